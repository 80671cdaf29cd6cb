"""A run as one object: what the command writes is what it saves, and a loaded folder has the same tables and files."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pandas
import pytest

import scenes
import validate
from pss import MissingLibraryError, RangeError
from render.store.folder import StoreError
from tests.helpers import drawn_sweep
from tests.helpers.closet import SCENE, SELECTION, SWEEP
from validate.plots import sweep as figures
from validate.plots.contact_sheet import captures_figure
from validate.run_sweep import main
from validate.runs.events import EVENTS
from validate.runs.tables import columns_of
from validate.sweeps.tables import TABLES

pytestmark = pytest.mark.slow

FILES = {"zooming.toml": SWEEP, "pairs.toml": SELECTION}
# What differs between two runs of one thing: seconds, and which of them rendered.
OF_THIS_RUN = ("timings.csv", "run.json", EVENTS)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two sweeps run by the command and by the library, views drawn, from one store."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "closet.toml").write_text(SCENE)
    for name, text in FILES.items():
        (folder / name).write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        whole = {name: getattr(figures, name) for name in ("draw_all", "all_drawn")}
        drawn_sweep.stand_in(patch.setattr, workers=False)
        for name, function in whole.items():
            patch.setattr(figures, name, function)
        patch.chdir(folder)
        assert main([*FILES, "--store", "store", "--out", "command", "--quiet"]) == 0
        result = validate.sweep(*FILES, store="store")
        result.save("library")
        plots = result.plot()
        by_object = validate.sweep("zooming.toml", store="store", scene=scenes.load("closet.toml"))
    return SimpleNamespace(
        folder=folder, result=result, by_object=by_object, plots=plots, loaded=validate.load(folder / "library")
    )


def files(folder):
    """The files of a folder by name, links by what they point to."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            found[path.relative_to(folder).as_posix()] = path.resolve()
        elif path.is_file():
            found[path.relative_to(folder).as_posix()] = path.read_bytes()
    return found


def test_the_command_and_the_library_leave_the_same_files(made):
    command, library = files(made.folder / "command"), files(made.folder / "library")
    assert command.keys() - {EVENTS} == library.keys()
    assert {"report.html", "scene.glb", "figures/zooming.png", "figures/pairs_captures.png"} < library.keys()
    assert sum(name.startswith("views/") for name in library) > 3
    assert [name for name in library if command[name] != library[name]] == ["run.json", "timings.csv"]
    one, other = (json.loads(content["run.json"]) for content in (command, library))
    assert {key for key in one if one[key] != other[key]} == {"options", "seconds", "rendered", "measured"}
    assert {key for key in one["options"] if one["options"][key] != other["options"][key]} == {"out", "quiet"}
    assert sum(one["seconds"].values()) == pytest.approx(2 * one["seconds"]["total"])


def test_a_loaded_folder_has_the_tables_of_the_result(made):
    """Every table but that of the steps' slopes has rows here, and each number is the same."""
    assert made.result.names == TABLES
    assert set(made.loaded.names) == set(TABLES)
    for name in TABLES:
        frame = made.result.table(name)
        pandas.testing.assert_frame_equal(frame, made.loaded.table(name))
        assert [dict(row) for row in made.loaded.written(name)] == made.result.written(name)
    steps = made.result.table("configurations")
    assert len(steps) == 2 * (3 + 3)
    assert steps["measured_pss_single_frame"].dtype == np.float64
    assert steps["points"].dtype == np.int64
    # Seven digits of what the result has in full.
    exact = [each.measured.errors.pss() for each in made.result.sweeps[0].assessments]
    assert steps["measured_pss_single_frame"][:3].to_numpy() == pytest.approx(exact, rel=1e-6)


def test_a_loaded_folder_is_saved_with_the_same_bytes(made, tmp_path):
    copy = made.loaded.save(tmp_path / "copy")
    assert files(copy) == files(made.folder / "library")
    with pytest.raises(StoreError, match="is the folder of the run; allowed is another folder"):
        made.loaded.save(made.folder / "library")


def test_a_report_from_memory_is_the_one_made_again_from_the_files(made, tmp_path, monkeypatch, capsys):
    """`report` reads the CSV files; the run wrote its own report from what it had computed."""
    copy = made.loaded.save(tmp_path / "copy")
    (copy / "report.html").unlink()
    monkeypatch.chdir(made.folder)
    given = [word for name in FILES for word in ("--file", name)]
    assert main(["report", str(copy), "--store", "store", *given, "--allow-outside"]) == 0
    assert (copy / "report.html").read_bytes() == (made.folder / "library" / "report.html").read_bytes()


def test_plots_are_the_commands_figures(made, tmp_path):
    written = sorted(path.stem for path in (made.folder / "command" / "figures").iterdir())
    assert sorted(made.plots) == written
    for name in ("zooming", "pairs_points"):
        made.plots[name].savefig(tmp_path / "a.png", dpi=figures.DPI)
        picture, again = (
            cv2.imread(str(path)) for path in (made.folder / f"command/figures/{name}.png", tmp_path / "a.png")
        )
        assert np.array_equal(picture, again)
    (shown,) = made.plots["pairs_captures"].axes[0].images
    captures = cv2.imread(str(made.folder / "command" / "figures" / "pairs_captures.png"))
    assert np.array_equal(shown.get_array()[..., ::-1], captures)


def test_what_is_derived_is_what_the_tables_have(made):
    """The error budget and NEES, by sweep and noise model."""
    table = made.result.table("configurations")
    of = table[(table["sweep"] == "zooming") & (table["noise_model"] == "corrected")]
    budgets = made.result.error_budget["zooming", "corrected"]
    assert of["budget_geometry"].to_numpy() == pytest.approx([each.geometry for each in budgets], rel=1e-6, nan_ok=True)
    points = made.result.table("points")
    of = points[(points["sweep"] == "zooming") & (points["noise_model"] == "corrected")]
    assert of["nees"].to_numpy() == pytest.approx(
        made.result.nees["zooming", "corrected"].ravel(), rel=1e-6, nan_ok=True
    )
    assert set(made.result.slopes) == set(made.result.claims) == {"zooming", "pairs"}
    assert repr(made.result) == "RunResult(zooming: 3 configurations, pairs: 3 configurations)"


def test_column_names_of_older_versions_are_read_as_todays(made, tmp_path):
    copy = made.loaded.save(tmp_path / "copy")
    table = copy / "correlation.csv"
    table.write_text(table.read_text().replace("measure,", "yardstick,", 1))
    assert "yardstick" in table.read_text()
    pandas.testing.assert_frame_equal(validate.load(copy).table("correlation"), made.result.table("correlation"))


def test_a_scene_object_stands_for_its_file(made):
    steps = made.result.table("configurations")
    of_zoom = steps[steps["sweep"] == "zooming"]
    found = made.by_object.table("configurations")
    assert found["value"].tolist() == [1.5, 2.0, 3.0] * 2  # text beside the names of selected cameras
    pandas.testing.assert_frame_equal(of_zoom.drop(columns="value"), found.drop(columns="value"))
    assert made.by_object.acquired.rendered == 0
    scene = made.by_object.sweeps[0].plan.scene
    with pytest.raises(RangeError, match=r"override 'lens.f_number=2'; allowed with a scene object: sweep\.KEY=VALUE"):
        validate.sweep("zoom", scene=scene, overrides=["lens.f_number=2"])


def test_columns_of_names_stay_text():
    """A camera may be called "2", and a view's hash may look like a number."""
    rows = [{"camera": "2", "view": "1e5", "zoom": "1.5", "markers_visible": "3"}]
    columns = columns_of([*rows, {"camera": "3", "view": "22", "zoom": "", "markers_visible": "4"}])
    assert list(columns["camera"]) == ["2", "3"]
    assert list(columns["view"]) == ["1e5", "22"]
    assert columns["zoom"].tolist() == pytest.approx([1.5, np.nan], nan_ok=True)
    assert columns["markers_visible"].tolist() == [3, 4]
    assert columns["markers_visible"].dtype == np.int64


def test_what_is_not_there_is_named(made, tmp_path, monkeypatch):
    for run in (made.result, made.loaded):
        with pytest.raises(RangeError, match=r"table 'steps'; allowed: .*configurations"):
            run.table("steps")
    with pytest.raises(StoreError, match="nowhere is no folder; allowed"):
        validate.load(tmp_path / "nowhere")
    with pytest.raises(StoreError, match=r"has no table \(\.csv\); allowed"):
        validate.load(tmp_path)
    with pytest.raises(RangeError, match="--trials 1; allowed"):
        validate.sweep("zoom", trials=1)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        MissingLibraryError, match=r"table\('points'\) needs pandas: pip install 'pss-testbed\[pandas\]'"
    ):
        made.result.table("points")
    assert len(made.result.columns("points")["x_m"]) == len(made.result.written("points"))


def test_a_store_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "store").write_text("")
    with pytest.raises(StoreError, match="is a file; allowed is a folder"):
        validate.sweep("zoom", store=tmp_path / "store")
    assert Path(tmp_path / "store").read_text() == ""


def test_captures_keep_their_colours_in_a_figure(monkeypatch):
    """OpenCV's first channel is blue, Matplotlib's is red."""
    sheet = np.zeros((4, 5, 3), dtype=np.uint8)
    sheet[..., 0] = 255
    monkeypatch.setattr("validate.plots.contact_sheet.captures", lambda result, store: sheet)
    (shown,) = captures_figure(None, None).axes[0].images
    assert shown.get_array()[0, 0].tolist() == [0, 0, 255]
