"""The pages of docs say what is so: names, tests, figures and columns; and their site builds without a warning."""

from __future__ import annotations

import ast
import contextlib
import csv
import dataclasses
import importlib
import io
import re
import runpy
import subprocess
import sys
import tomllib
import types
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import LogNorm

import pss
from render.light.lit_scene import GlowMeshes
from render.world.state import Room
from tests.helpers.closet import SCENE, SELECTION
from tests.helpers.documents import BLOCKS, DOCS, ROOT
from tests.helpers.made_up_run import made_up_run
from tests.helpers.processes import environment
from validate import run_sweep
from validate.prediction.frusta import room_corners
from validate.runs.csv_file import read_head

EQUATIONS_OF_THE_PAPER = 15
# Figures on docs/limits.md are those of these pages, which are generated or describe what was measured once.
WHERE_FIGURES_ARE_FROM = ("docs/findings.md", "CHANGELOG.md")


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


# ---- equations -------------------------------------------------------------------------------------------------------


def exists(name: str) -> bool:
    """Whether a dotted name is a module, what a module or class has, or a field of a dataclass."""
    parts = name.split(".")
    for split in range(len(parts), 0, -1):
        module = ".".join(parts[:split])
        try:
            here: object = importlib.import_module(module)
        except ModuleNotFoundError:
            continue
        for part in parts[split:]:
            if dataclasses.is_dataclass(here) and part in {field.name for field in dataclasses.fields(here)}:
                return part == parts[-1]
            if not hasattr(here, part):
                return False
            here = getattr(here, part)
        return True
    return False


def test_every_equation_has_its_row_once_and_in_order():
    numbers = re.findall(r"^\| (\d+) \|", page("equations.md"), re.MULTILINE)
    assert [int(number) for number in numbers] == list(range(1, EQUATIONS_OF_THE_PAPER + 1))


def test_the_names_beside_the_equations_exist():
    names = re.findall(r"`(pss(?:\.\w+)+)`", page("equations.md"))
    assert len(names) >= EQUATIONS_OF_THE_PAPER
    assert not [name for name in names if not exists(name)]
    assert not exists("pss.Evaluation.absent")
    assert not exists("pss.absent")


def test_the_tests_beside_the_equations_exist():
    rows = [line for line in page("equations.md").splitlines() if re.match(r"\| (\d|4\.)", line)]
    for row in rows:
        named = re.findall(r"`tests/([\w/]+\.py)(?:::(\w+))?`", row)
        assert named, row
        for file, name in named:
            module = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
            functions = {node.name for node in module.body if isinstance(node, ast.FunctionDef)}
            assert not name or name in functions, f"{file}::{name}"


# ---- figures and columns ---------------------------------------------------------------------------------------------


def test_the_figures_of_the_limits_are_those_that_were_found():
    """Numbers with an interval or a unit, whole."""
    figures = re.findall(r"\d[\d.]* \[[^\]]+\](?! ?\()|\d[\d.]* %|\d[\d.]*°", page("limits.md"))
    source = "\n".join((ROOT / name).read_text(encoding="utf-8") for name in WHERE_FIGURES_ARE_FROM)
    assert len(figures) >= 8
    assert not [figure for figure in figures if not re.search(rf"(?<![\d.]){re.escape(figure)}", source)]


def test_the_limits_of_detection_are_those_that_were_fitted():
    limits = tomllib.loads((ROOT / "results/reference/bank/calibrated.toml").read_text(encoding="utf-8"))["limits"]
    printed_text = " ".join(page("own-room.md").split())
    assert f"{limits['smallest_module_px']:g} pixels a module" in printed_text
    assert f"a blur below {limits['largest_blur_modules']:g} modules" in printed_text


def test_the_columns_that_the_first_run_names_are_there():
    for file in ("configurations", "correlation"):
        (row,) = (line for line in page("first-minutes.md").splitlines() if line.startswith(f"| `{file}.csv`"))
        with (DOCS / "examples" / "first-run" / f"{file}.csv").open(encoding="utf-8") as opened:
            columns = next(csv.reader(opened))
        named = set(re.findall(r"`(\w+)`", row.split("|")[2]))
        assert named
        assert named <= set(columns), named - set(columns)


def test_the_error_budget_of_the_room_is_that_of_its_sweeps():
    with (ROOT / "results/reference/configurations.csv").open(encoding="utf-8") as opened:
        rows = [row for row in csv.DictReader(opened) if row["noise_model"] == "physical"]
    printed_text = " ".join(page("report.md").split("<!-- figures: error budget of the room -->")[1].split())
    for name, words in (
        ("visibility", "visibility is"),
        ("noise_model", "the noise model"),
        ("detector", "the detector"),
    ):
        factors = [float(row[f"budget_{name}"]) for row in rows]
        assert f"{words} {min(factors):.2f} to {max(factors):.2f}" in printed_text
        in_brief = " ".join(page("results.md").split())
        assert f"{name.replace('_', ' ')} ({min(factors):.2f} to {max(factors):.2f})" in in_brief
    assert {f"{float(row['budget_geometry']):.3f}" for row in rows} == {"1.000"}
    assert "geometry 1.000" in printed_text


def test_the_tables_that_the_report_names_have_those_columns(tmp_path):
    named = dict(re.findall(r"`(\w+)\.csv`: ((?:`\w+`[^`|]*)+)", page("report.md")))
    assert set(named) == {"points", "configurations"}
    head = (ROOT / "results/reference/configurations.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert set(re.findall(r"`(\w+)`", named["configurations"])) <= set(head)
    made_up_run(tmp_path, SCENE, {"pairs": SELECTION})  # no table of points is kept
    assert set(re.findall(r"`(\w+)`", named["points"])) <= set(read_head(tmp_path / "run" / "points.csv"))


# What the screen calls the two kinds, and what correlation.csv has them under.
KINDS = {"single frame": ("pss-single-frame", "measured_pss_single_frame"), "filter": ("pss", "measured_pss_filter")}


def first_lines(rows: list[dict[str, str]]) -> set[tuple[str, str, str]]:
    """Noise model, kind and Spearman's ρ, as the screen has them, from a run's correlation.csv."""
    lines = set()
    for kind, (metric, measured) in KINDS.items():
        for row in rows:
            if (row["metric"], row["level"], row["measure"]) == (metric, "configuration", measured):
                value, low, high = (f"{float(row[f'spearman{end}']):+.2f}" for end in ("", "_ci_low", "_ci_high"))
                lines.add((row["noise_model"], kind, f"{value} [{low}, {high}]"))
    return lines


def test_the_first_lines_of_the_first_run_are_its_tables():
    """All rows, the filter's too, one of which runs against the measurement."""
    (block,) = (block for block in BLOCKS if block.treatment == "first lines of a run")
    folder = DOCS / "examples" / "first-run"
    with (folder / "correlation.csv").open(encoding="utf-8") as opened:
        expected = first_lines(list(csv.DictReader(opened)))
    shown = [[cell.strip() for cell in line.split("│")] for line in block.text.splitlines()[1:]]
    assert {(cells[2], cells[3], cells[4]) for cells in shown} == expected
    assert len(shown) == len(expected) == 8
    with (folder / "configurations.csv").open(encoding="utf-8") as opened:
        rows = list(csv.DictReader(opened))
    columns = {
        "single frame": ("pss_single_frame", "measured_pss_single_frame"),
        "filter": ("pss", "measured_pss_filter"),
    }
    for cells in shown:
        steps = [row for row in rows if row["noise_model"] == cells[2]]
        best = [float(max(steps, key=lambda row: float(row[name]))["value"]) for name in columns[cells[3]]]
        assert [float(cells[5]), float(cells[6])] == best, cells
    counts = {row["value"]: (row["observable"], row["detected"]) for row in rows if row["noise_model"] == "physical"}
    printed_text = " ".join(page("first-minutes.md").split())
    (at_one, found_at_one), (at_three, found_at_three) = counts["1"], counts["3"]
    assert f"the prediction counts {at_one} at ×1, of which no more than {found_at_one}" in printed_text
    assert f"and {at_three} at ×3, where {found_at_three} are" in printed_text


def test_the_lines_that_the_readme_shows_are_of_the_same_run():
    """README's lines of output are lines of docs/first-minutes.md, and both pages have the same command."""
    (few,) = (block for block in BLOCKS if block.treatment == "some lines of a run")
    (whole,) = (block for block in BLOCKS if block.treatment == "first lines of a run")
    assert set(few.text.splitlines()) <= set(whole.text.splitlines())
    assert len(few.text.splitlines()) == 4
    run = {block.text for block in BLOCKS if block.language == "sh" and "--out results/first" in block.text}
    assert len(run) == 1


def test_the_example_sensor_of_python_is_that_of_toml():
    (part,) = (block for block in BLOCKS if block.page == "docs/own-sensor.md" and block.language == "toml")
    (code,) = (block for block in BLOCKS if block.page == "docs/own-sensor.md" and block.language == "python")
    names: dict[str, object] = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(compile(code.text, str(code), "exec"), names)
    table = tomllib.loads(part.text)["sensor"]
    of_cameras = {"resolution_px", "pixel_pitch_um"}
    assert dataclasses.asdict(names["sensor"]) == {key: value for key, value in table.items() if key not in of_cameras}
    rows = re.findall(r"^\| .* \| .* \| `(\w+)` \|", page("own-sensor.md"), re.MULTILINE)
    assert sorted(rows) == sorted(table)


# ---- the site --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The pages of the site by name, built as `make docs` does; every warning is an error."""
    folder = tmp_path_factory.mktemp("site")
    options = ["-q", "-W", "--keep-going", "-n", "-d", str(folder / "doctrees")]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, str(DOCS), str(folder / "html")],
        capture_output=True,
        text=True,
        timeout=900,
        env=environment(),
    )
    assert done.returncode == 0, done.stderr
    return {path.stem: path.read_text(encoding="utf-8") for path in (folder / "html").glob("*.html")}


@pytest.mark.slow
def test_every_page_is_on_the_site_and_in_its_contents(site):
    pages = {path.stem for path in (*DOCS.glob("*.md"), *DOCS.glob("*.ipynb"))}
    assert pages <= site.keys()
    for name in pages - {"index"}:
        assert f'href="{name}.html"' in site["index"], name


@pytest.mark.slow
def test_every_public_name_and_every_metric_is_described(site):
    described = set(re.findall(r'id="pss\.(\w+)"', site["api"]))
    instances = {name for name in pss.__all__ if not callable(getattr(pss, name))}
    assert set(pss.__all__) - described <= instances
    assert instances == {"METRICS", "NOISE_MODELS"}
    for name in (*pss.METRICS, *pss.NOISE_MODELS):
        assert re.search(rf">{re.escape(name)}<", site["api"]), name


def test_make_docs_builds_as_the_test_does():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "-m sphinx -q -W --keep-going -n -d docs/_build/doctrees docs docs/_build/html" in makefile


# ---- the first picture ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def first_screen():
    """The names of docs/draw_first_screen.py."""
    return runpy.run_path(str(DOCS / "draw_first_screen.py"))


def test_the_first_picture_looks_into_the_room_through_what_is_taken_away(first_screen):
    """Of the six sides of a room the two before the eye and the ceiling with its lamps go; the rest stays as it was."""
    room = Room(6.0, 4.0, 3.0, 0.5, 0.5, 0.5)
    low, high = room_corners(room)
    sides = []
    for axis in range(3):
        for level in (low[axis], high[axis], 0.98 * high[axis]):
            sides.append(np.array([[level if a == axis else c[a] for a in range(3)] for c in (low, high, (0, 0, 1.5))]))
    vertices = np.concatenate(sides)
    none = np.zeros(0)
    meshes = GlowMeshes(vertices, np.arange(27).reshape(9, 3), none, none, none, none, none, none)
    kept = first_screen["opened"](meshes, room)
    # Of x, y and z: the lower side, the upper one, and a plane just within the upper one (a lamp, for z).
    assert kept.faces[:, 0].tolist() == [0, 6, 9, 15, 18]
    assert (np.array(first_screen["EYE_M"]) > high).all()


def test_the_first_picture_gives_markers_the_colour_of_their_error(first_screen):
    marker_id = np.array([[-1, 3, 3, 4, 4, -1]])
    view = types.SimpleNamespace(
        marker_id=marker_id,
        depth_m=np.array([[1, 1, 1, 1, 1, np.inf]]),
        radiance=np.array([[0.5, 1, 0.0, 1, 0.0, 0.0]]),
    )
    picture = first_screen["coloured"](view, np.array([3, 4, 5]), np.array([0.1, np.nan, 0.1]), LogNorm(0.01, 0.1))[0]
    dark = matplotlib.colormaps[first_screen["COLOUR_MAP"]](1.0)[:3]
    # The 95th percentile of two pixels is just below the brighter one.
    assert picture[1] == pytest.approx(dark)
    assert picture[2] == pytest.approx(np.multiply(first_screen["DARKEST"], dark))
    assert picture[3] == pytest.approx(first_screen["UNOBSERVABLE"])
    assert picture[0] == pytest.approx(np.full(3, (0.5 / 1.0) ** (1 / first_screen["GAMMA"])))
    assert picture[5] == pytest.approx(np.ones(3))


# ---- longer ----------------------------------------------------------------------------------------------------------


RUNS = {
    "first": (["zoom", "--trials", "5", "--set", "sweep.vary.values=[1, 3, 6]"], "first-run"),
    "lab": ([str(DOCS / "examples" / "lab-zoom.toml")], "lab-run"),
}


@pytest.mark.acceptance
@pytest.mark.render
@pytest.mark.parametrize("name", RUNS)
def test_the_runs_of_the_pages_leave_what_the_pages_show(name, tmp_path, monkeypatch):
    """Rendered anew: files by name, the best step predicted and measured, and PSS within what other noise explains."""
    monkeypatch.chdir(tmp_path)
    arguments, stored = RUNS[name]
    if name == "first":
        arguments = [*arguments, "--set", "sensor.resolution_px=[640, 480]"]
    assert run_sweep.main([*arguments, "--out", "results/run", "--store", "store"]) == 0
    files = set(re.findall(r"^\| `([\w.]+)` \|", page("first-minutes.md"), re.MULTILINE))
    assert {path.name for path in Path("results/run").iterdir()} == files
    rows = {}
    for kind, folder in (("again", Path("results/run")), ("stored", DOCS / "examples" / stored)):
        with (folder / "configurations.csv").open(encoding="utf-8") as opened:
            rows[kind] = [row for row in csv.DictReader(opened) if row["noise_model"] == "physical"]
    for again, before in zip(rows["again"], rows["stored"], strict=True):
        assert again["value"] == before["value"]
        # No noise enters the prediction, but light is solved on another machine.
        assert float(again["pss_single_frame"]) == pytest.approx(float(before["pss_single_frame"]), rel=1e-3)
        low, high = (float(before[f"measured_pss_ci_{end}"]) for end in ("low", "high"))
        assert low <= float(again["measured_pss_single_frame"]) <= high
