"""Names of stored results hold the code that made them: all of it, and no more."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from render import backend
from render.code_digest import PACKAGES, ROOT, code_of, installed_version
from render.files.exr import read_view, write_view
from render.keys import EXCLUDED as VIEW_EXCLUDED
from render.keys import light_code, view_code
from render.lens.sampling import Sampling
from render.random_streams import random_stream
from render.renderer import Renderer
from render.sensor import capture
from tests.helpers.processes import environment
from validate.markers.detector import Targets
from validate.markers.view_measurement import EXCLUDED as MEASURE_EXCLUDED
from validate.markers.view_measurement import MeasureTask, _words_of, measure_capture, measure_code
from validate.pixel_noise.laboratory import DICTIONARY, Factors, Pose, Setup
from validate.pixel_noise.measure import pixel_noise_code
from validate.plots.sweep import EXCLUDED as FIGURES_EXCLUDED

CODES = {"view": view_code, "light": light_code, "measurement": measure_code, "pixel noise": pixel_noise_code}
# Modules that run while a view is rendered and measured, and that no digest holds, with the reason.
NOT_COUNTED = {
    "render.code_digest": "makes names; what it finds is the name",
}


def of_measurements(root: Path) -> str:
    return code_of("validate.markers.view_measurement", excluded=tuple(MEASURE_EXCLUDED), root=root).digest


def of_views(root: Path) -> str:
    return code_of("render.renderer", "render.files.exr", excluded=tuple(VIEW_EXCLUDED), root=root).digest


def changed(folder: Path, file: str, change) -> Path:
    """The project in `folder` (its packages, of links) with one file changed."""
    skipped = shutil.ignore_patterns("__pycache__", "*.toml")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=skipped, copy_function=os.symlink)
    path = folder / file
    text = path.read_text(encoding="utf-8")
    new = change(text)
    assert new != text
    path.unlink()
    path.write_text(new, encoding="utf-8")
    return folder


# ---- what changes a digest -------------------------------------------------------------------------------------------


def test_shifted_detections_are_other_measurements(tmp_path):
    """25 px in `localise.py`: measured again; the views stay."""

    def shift(text: str) -> str:
        return re.sub(r"( +)return Localised\(", r"\1fit = fit + 25.0\n\1return Localised(", text, count=1)

    root = changed(tmp_path, "validate/markers/localise.py", shift)
    assert of_measurements(root) != of_measurements(ROOT)
    assert of_views(root) == of_views(ROOT)


@pytest.mark.parametrize(
    ("file", "measured", "rendered"),
    [
        ("validate/markers/detect.py", True, False),
        ("validate/markers/marker_image.py", True, False),
        ("validate/markers/coarse_fit.py", True, False),
        ("validate/markers/registration.py", True, False),
        ("render/sensor.py", True, True),
        ("pss/cameras/sensor.py", True, True),
        ("render/lens/thin_lens.py", False, True),
        ("render/world/traced_meshes.py", False, True),
        ("pss/cameras/camera.py", True, True),
        # What shows results, or only predicts, invalidates nothing.
        ("validate/sweeps/rows.py", False, False),
        ("validate/pages/section.py", False, False),
        ("render/store/folder.py", False, False),
        ("validate/acquire/pool.py", False, False),
        ("pss/riccati/solve.py", False, False),
        ("pss/__init__.py", False, False),
        ("scenes/markers/layout.py", False, False),
    ],
)
def test_code_counts_where_it_has_a_share_in_the_result(tmp_path, file, measured, rendered):
    """One statement more in a file, and which names change."""
    root = changed(tmp_path, file, lambda text: text + "\nprint(0)\n" * (not file.endswith("__init__.py")) + " ")
    assert (of_measurements(root) != of_measurements(ROOT), of_views(root) != of_views(ROOT)) == (measured, rendered)


def test_a_package_that_does_more_than_pass_names_on_counts(tmp_path):
    """What it does when it is imported may change what its modules do."""
    root = changed(tmp_path, "pss/__init__.py", lambda text: text + "\nprint(0)\n")
    assert of_views(root) != of_views(ROOT)


def test_a_package_that_passes_names_on_at_their_first_use_does_not_count(tmp_path):
    """`render` and `validate` do; what it passes on counts where it is used."""

    def imported(text: str) -> str:
        return text.replace("def localise(", "def _late():\n    from render import view\n\n\ndef localise(")

    modules = code_of(
        "validate.markers.localise",
        excluded=tuple(MEASURE_EXCLUDED),
        root=changed(tmp_path, "validate/markers/localise.py", imported),
    ).modules
    assert "render" not in modules
    assert "render.viewing" in modules
    assert "render" not in view_code().modules
    assert "render.viewing" not in view_code().modules


def test_a_new_helper_module_counts(tmp_path):
    """Wherever it is imported, and what is changed in it later."""
    digests = set()
    for number, value in enumerate((1, 2)):
        root = changed(
            tmp_path / str(number),
            "validate/markers/localise.py",
            lambda text: text.replace("def localise(", "def _late():\n    import validate.helper\n\n\ndef localise("),
        )
        (root / "validate" / "helper.py").write_text(f"X = {value}\n")
        digests.add(of_measurements(root))
    assert len(digests | {of_measurements(ROOT)}) == 3


def test_comments_docstrings_and_layout_count_for_nothing(tmp_path):
    """A comment, another docstring, a wrapped line, and quotes of the other kind."""

    def reword(text: str) -> str:
        for old, new in (
            ('"""Register one decoded marker; None', '"""In other words: None'),
            (
                "= len(pattern(dictionary, marker_id)) / 2",
                "= (\n        len(pattern(dictionary, marker_id))\n    ) / 2",
            ),
            ('"the image ends on it"', "'the image ends on it'"),
        ):
            assert old in text
            text = text.replace(old, new)
        return text + "# the end\n"

    assert of_measurements(changed(tmp_path, "validate/markers/localise.py", reword)) == of_measurements(ROOT)


def test_what_is_imported_for_type_checking_is_not_reached(tmp_path):
    """It does not run."""
    root = changed(
        tmp_path,
        "validate/markers/localise.py",
        lambda text: text + "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import validate.sweeps.rows\n",
    )
    modules = code_of("validate.markers.view_measurement", excluded=tuple(MEASURE_EXCLUDED), root=root).modules
    assert modules == measure_code().modules


@pytest.mark.parametrize("library", sorted({"cv2", "numpy", *dict(measure_code().libraries)}))
def test_versions_of_libraries_change_the_names_of_measurements(monkeypatch, library):
    """An update of OpenCV finds other markers, one of NumPy draws other noise."""
    task = MeasureTask(Path("store"), "a" * 24, "DICT_4X4_100", (1, 2), 0, 3)
    monkeypatch.setattr(
        "render.code_digest.installed_version", lambda name: "0" if name == library else installed_version(name)
    )
    other = MeasureTask(Path("store"), "a" * 24, "DICT_4X4_100", (1, 2), 0, 3)
    assert other.path != task.path


@pytest.mark.parametrize("library", sorted({"mitsuba", "drjit", "numpy", *dict(view_code().libraries)}))
def test_versions_of_libraries_change_the_names_of_views(monkeypatch, library):
    """Those that render, and that write the image."""
    before = view_code().digest
    monkeypatch.setattr(
        "render.code_digest.installed_version", lambda name: "0" if name == library else installed_version(name)
    )
    assert view_code().digest != before


def test_other_markers_of_a_dictionary_are_other_measurements(monkeypatch):
    """Its words decide which errors are mended."""
    task = MeasureTask(Path("store"), "a" * 24, "DICT_4X4_100", (1, 2), 0, 3)
    before = task.path
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    _words_of.cache_clear()
    monkeypatch.setattr("validate.markers.view_measurement.predefined_dictionary", lambda name: words)
    assert task.path != before
    _words_of.cache_clear()


@pytest.mark.parametrize("library", sorted({name for code in CODES.values() for name, _ in code().libraries}))
def test_every_library_that_counts_has_a_version(library):
    """One without would count for nothing."""
    assert re.match(r"\d", installed_version(library))


# ---- the same everywhere ---------------------------------------------------------------------------------------------

PRINT_DIGESTS = """
import render.code_digest as digests
digests.installed_version = lambda name: "1"
print([digests.code_of(entry).digest for entry in ("render.renderer", "validate.markers.view_measurement",
"validate.acquire.job")])
"""


@pytest.mark.parametrize("python", ["python3.11", "python3.12", "python3.13", "python3.14"])
def test_digests_are_the_same_for_all_versions_of_python(python):
    """Their syntax trees differ in fields that say nothing here."""

    def printed(program: str) -> str:
        done = subprocess.run(
            [program, "-c", PRINT_DIGESTS],
            capture_output=True,
            text=True,
            check=False,
            env=environment(PYTHONHASHSEED=python[-1]),
            timeout=120,
        )
        return done.stdout if done.returncode == 0 else ""

    if not (theirs := printed(python) if shutil.which(python) else ""):
        pytest.skip(f"no {python} here")
    assert theirs == printed(sys.executable) != ""


# ---- as much as is needed, and no more -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["view", "light"])
def test_renders_hang_on_nothing_that_validates_or_reads_scenes(kind):
    """A change of a report, a table or a file's reader renders nothing again."""
    packages = {module.partition(".")[0] for module in CODES[kind]().modules}
    assert packages == {"pss", "render"}


def test_measurements_hang_on_nothing_that_shows_or_keeps_them():
    """Of `validate`, only the search and the localisation."""
    own = {module for module in measure_code().modules if module.startswith("validate.")}
    assert {
        "validate.markers.detect",
        "validate.markers.localise",
        "validate.markers.marker_image",
        "validate.markers.view_measurement",
    } <= own
    assert not set(measure_code().modules) & {
        "render.store.folder",
        "validate.sweeps.rows",
        "validate.commands.run_and_save",
        "validate.runs.progress",
    }


def test_figures_and_reports_hang_on_all_that_draws_them():
    """Helpers of other folders too; not on what renders, measures or keeps views."""
    figures = code_of("validate.plots.sweep", excluded=FIGURES_EXCLUDED)
    report = code_of("validate.pages.section", excluded=FIGURES_EXCLUDED)
    assert {
        "validate.plots.room3d",
        "validate.runs.palette",
        "validate.sweeps.slopes",
        "validate.stats.stars",
    } <= set(figures.modules)
    assert {"validate.pages.curves", "validate.runs.csv_file"} <= set(report.modules)
    assert {"matplotlib", "numpy"} <= {name for name, _ in figures.libraries}
    assert {"plotly", "jinja2"} <= {name for name, _ in report.libraries}
    for code in (figures, report):
        assert not {
            "render.store.folder",
            "validate.markers.localise",
            "validate.acquire.acquire",
            "render.lens.sampling",
        } & set(code.modules)


@pytest.mark.parametrize("apart", [VIEW_EXCLUDED, MEASURE_EXCLUDED], ids=["view", "measurement"])
def test_what_does_not_count_is_there_and_has_a_reason(apart):
    for name, reason in apart.items():
        assert len(reason) > 20
        assert name.partition(".")[0] not in PACKAGES or (ROOT / f"{name.replace('.', '/')}.py").is_file()


def executed_while(act) -> set[str]:
    """The project's modules of which a function runs while `act` does, in any thread."""
    files: set[str] = set()

    def note(frame, event, _argument) -> None:
        if event == "call":
            files.add(frame.f_code.co_filename)

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        act()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    inside = [
        Path(file).relative_to(ROOT) for file in files if file.startswith(tuple(f"{ROOT / p}/" for p in PACKAGES))
    ]
    return {".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in inside}


@pytest.mark.render
def test_all_code_that_runs_while_a_view_is_made_and_measured_counts(tmp_path):
    """Found by running it: one marker before a camera, lit, rendered, written, read, captured, found and localised."""
    setup, chosen = Setup(Factors(), Pose(1, 20.0, 10.0, (0.1, 0.2))), backend.choose()
    made = {}

    def make() -> None:
        renderer = Renderer(setup.state, setup.baked(), chosen)
        request = renderer.request(setup.camera, setup.sensor, Sampling())
        write_view(tmp_path / "view.exr", renderer.render(request), request)

    def measure() -> None:
        view = read_view(tmp_path / "view.exr")
        numbers = capture(view.expected_electrons(), view.sensor, random_stream(0, "a", "b"))
        made["found"], _, _ = measure_capture(numbers, Targets(DICTIONARY, (1,)), view.sensor)

    rendering = executed_while(make) - {"validate.pixel_noise.laboratory"}
    assert {"render.renderer", "render.lens.sampling", "render.light.radiosity", "pss.cameras.camera"} <= rendering
    assert rendering <= {*view_code().modules, *NOT_COUNTED}
    measuring = executed_while(measure)
    assert np.isfinite(made["found"]).all()
    assert {"validate.markers.localise", "validate.markers.detect", "render.sensor"} <= measuring
    # What reads the view is of the view's own name.
    assert measuring <= {*measure_code().modules, *view_code().modules, *NOT_COUNTED}
