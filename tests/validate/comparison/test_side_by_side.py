"""`run_sweep.py compare`: rows are matched by their keys, and intervals of differences cover the truth."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from render.store.folder import StoreError
from tests.helpers.few_rows import a_run
from validate.commands.compare import compared, summarised
from validate.comparison.matching import QUANTITIES, Quantity, matched_rows, separate
from validate.comparison.sides import settings_rows, sides_of
from validate.run_sweep import main

REFERENCE = Path(__file__).parents[3] / "results" / "reference"
PLAIN = Quantity("t", "v", "low", "high", ("sweep", "value"), True)
# 4000 draws: the share's own standard error is 0.0034; a coverage as of normal numbers is within this.
COVERAGE_WITHIN = 0.015


def row(sweep, value, v, low="", high=""):
    """A row as a CSV reader gives it."""
    return {"sweep": sweep, "value": value, "v": str(v), "low": str(low), "high": str(high)}


def test_rows_are_matched_by_key_and_not_by_place():
    """Rows in another order, and rows that only one side has."""
    first = [row("a", "1", 10), row("a", "2", 20), row("a", "3", 30)]
    second = [row("a", "3", 60), row("b", "1", 5), row("a", "1", 5)]
    found = matched_rows({"x": first, "y": second}, PLAIN)
    assert [(r["sweep"], r["value"], r["x"], r["y"]) for r in found] == [("a", "1", 10, 5), ("a", "3", 30, 60)]
    assert [r["y_ratio"] for r in found] == pytest.approx([0.5, 2.0], rel=1e-12)


def test_a_difference_of_three_sides_is_from_the_first():
    """Each of the others against the first; "apart" where the interval excludes equality."""
    tables = {name: [row("a", "1", v, v - 1, v + 1)] for name, v in (("x", 10.0), ("y", 11.0), ("z", 14.0))}
    (found,) = matched_rows(tables, Quantity("t", "v", "low", "high", ("sweep", "value"), False))
    assert (found["y_difference"], found["z_difference"]) == (1.0, 4.0)
    assert found["z_difference_ci_low"] == pytest.approx(4 - math.sqrt(2), rel=1e-12)
    assert (found["y_apart"], found["z_apart"]) == ("", "yes")


@pytest.mark.parametrize("as_ratio", [False, True])
def test_intervals_of_differences_cover_as_often_as_they_say(as_ratio):
    """Monte Carlo: two independent means, of logarithms for ratios, each with its own 95 % interval."""
    rng = np.random.default_rng(7)
    truth, spread = np.array([1.0, 1.4]), np.array([0.2, 0.1])
    drawn = rng.normal(truth, spread, size=(4000, 2))
    limits = np.stack([drawn, drawn - 1.959964 * spread, drawn + 1.959964 * spread], axis=-1)
    if as_ratio:
        limits = np.exp(limits)
    expected = truth[1] - truth[0]
    expected = math.exp(expected) if as_ratio else expected
    found = np.array([separate(tuple(a), tuple(b), as_ratio) for a, b in limits])
    covered = ((found[:, 1] <= expected) & (expected <= found[:, 2])).mean()
    assert covered == pytest.approx(0.95, abs=COVERAGE_WITHIN)


def test_missing_numbers_stay_missing():
    """No interval, no measured value, a ratio to nothing."""
    assert all(math.isnan(value) for value in separate((0.0, 0.0, 0.0), (1.0, 0.5, 2.0), True))
    value, low, high = separate((1.0, math.nan, math.nan), (3.0, 2.0, 4.0), False)
    assert value == 2.0
    assert math.isnan(low)
    assert math.isnan(high)


def test_two_sensors(tmp_path, capsys):
    """Two runs: what differs in their settings once, and measured PSS with ratios."""
    sides = [str(a_run(tmp_path / "dim")), str(a_run(tmp_path / "bright", 8.0, (150.0, 100.0)))]
    (only,) = settings_rows(sides_of(sides))
    assert only == {"key": "scene.sensor.exposure_ms", "dim": "4.0", "bright": "8.0"}
    assert main(["compare", *sides, "--table", "csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [(r["value"], float(r["bright_ratio"]), r["bright_apart"]) for r in rows] == [
        ("1", 1.5, "yes"),
        ("2", 0.5, "yes"),
    ]
    assert main(["compare", *sides]) == 0
    printed = capsys.readouterr().out
    assert "scene.sensor.exposure_ms" in printed
    assert "bright ÷ dim" in printed


def test_settings_of_a_camera_go_by_its_name(tmp_path):
    """As overrides address them."""
    sides = sides_of([str(a_run(tmp_path / "a")), str(a_run(tmp_path / "b", zoom=2.0))])
    assert settings_rows(sides) == [{"key": "scene.cameras.1.zoom", "a": "3.0", "b": "2.0"}]


def test_two_noise_models_of_one_run(tmp_path, capsys):
    """A selected column is no key."""
    folder = a_run(tmp_path / "run")
    sides = sides_of([f"{folder}@noise_model=as-printed", f"{folder}@noise_model=physical"])
    rows = [r for r in compared(sides, "predicted") if r["quantity"] == "pss_single_frame"]
    assert [r["value"] for r in rows] == ["1", "2"]
    assert [r["physical_ratio"] for r in rows] == pytest.approx([3.0, 3.0], rel=1e-6)
    assert main(["compare", f"{folder}@noise_model=as-printed", f"{folder}@noise_model=physical"]) == 0
    printed = capsys.readouterr().out
    assert "physical ÷ as-printed" in printed
    assert "measured" not in printed  # one run measured one thing


def test_two_metrics_of_the_reference():
    """Of the run that comes with the project: the difference of the two Spearman ρ that its table has."""
    of = [f"{REFERENCE}@metric={name},noise_model=physical" for name in ("visible-share", "pss-single-frame")]
    (found,) = [
        r
        for r in compared(sides_of(of), "correlation")
        if (r["sweep"], r["measure"], r["quantity"], r["level"])
        == ("zoom", "measured_pss_single_frame", "spearman", "configuration")
    ]
    with (REFERENCE / "correlation.csv").open() as file:
        own = {
            r["metric"]: float(r["spearman"])
            for r in csv.DictReader(file)
            if (r["sweep"], r["noise_model"], r["level"], r["measure"])
            == ("zoom", "physical", "configuration", "measured_pss_single_frame")
        }
    expected = own["pss-single-frame"] - own["visible-share"]
    name = next(key for key in found if key.endswith("_difference"))
    assert found[name] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("name", sorted(QUANTITIES))
def test_every_quantity_names_columns_that_runs_leave(name):
    """Of the tables of the project's own runs, so that columns cannot go stale."""
    for quantity in QUANTITIES[name]:
        tables = [*REFERENCE.glob(f"{quantity.table}.csv"), *REFERENCE.glob(f"*/{quantity.table}.csv")]
        assert tables, quantity.table
        for path in tables:
            with path.open() as file:
                head = set(next(csv.reader(file)))
            assert {quantity.value, quantity.low, quantity.high} - {""} <= head, (path, quantity.value)
            assert set(quantity.keys) & head


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (["{a}"], "two folders"),
        (["{a}", "{a}"], "twice"),
        (["{a}", "nowhere"], "nowhere is no folder"),
        (["{a}@physical", "{b}"], "COLUMN=VALUE"),
        (["{a}@noise_modell=physical", "{b}"], "noise_model"),
        (["{a}@noise_model=fysical", "{b}@noise_model=physical"], 'did you mean "physical"'),
        (["{a}", "{c}"], "alike"),
    ],
)
def test_mistakes_are_said(tmp_path, made, words):
    """Each in a line that says what is allowed."""
    places = {
        "a": a_run(tmp_path / "a"),
        "b": a_run(tmp_path / "b"),
        "c": a_run(tmp_path / "c", names=("zoom=7", "zoom=8")),
    }
    with pytest.raises(StoreError, match=words) as caught:
        compared(sides_of([each.format(**places) for each in made]), "predicted")
    assert "allowed" in str(caught.value)


# ---- nothing alike ---------------------------------------------------------------------------------------------------


def renamed(folder, sweep, scene=None):
    """The folder's run, as one of a sweep of another name."""
    for path in folder.glob("*.csv"):
        text = path.read_text()
        path.write_text("\n".join(re.sub(r"^zoom,", f"{sweep},", line) for line in text.splitlines()) + "\n")
    record = json.loads((folder / "run.json").read_text())
    scenes = {sweep: scene or record["scenes"]["zoom"]}
    (folder / "run.json").write_text(json.dumps(record | {"scenes": scenes, "sweeps": {sweep: {"seed": 1}}}))
    return folder


@pytest.mark.parametrize("rows", ["measured", "predicted"])
def test_rows_that_match_nothing_are_one_line_and_no_success(tmp_path, capsys, rows):
    """Of sweeps of different names; chosen as one column, they match by their values."""
    one, other = a_run(tmp_path / "one"), renamed(a_run(tmp_path / "other", pss=(50.0, 400.0)), "mine")
    assert main(["compare", str(one), str(other), "--rows", rows]) == 2
    shown = capsys.readouterr()
    (line,) = shown.err.strip().splitlines()
    for words in ("one has zoom; other has mine", "allowed", "RUN@sweep=NAME"):
        assert words in line
    assert not shown.out.strip()
    assert main(["compare", f"{one}@sweep=zoom", f"{other}@sweep=mine", "--rows", rows]) == 0
    assert "mine ÷ zoom" in capsys.readouterr().out


def test_rows_of_a_table_that_is_missing_or_empty_are_one_line(tmp_path, capsys):
    """Which side lacks it is in the line."""
    one, other = a_run(tmp_path / "one"), a_run(tmp_path / "other")
    assert main(["compare", str(one), str(other), "--rows", "slopes"]) == 2
    assert "one and other has no such table" in capsys.readouterr().err
    (one / "slopes.csv").write_text("")
    (other / "slopes.csv").write_text("")
    assert main(["compare", str(one), str(other), "--rows", "slopes"]) == 2
    assert "one and other has an empty one" in capsys.readouterr().err


def test_a_comparison_of_nothing_alike_says_so_and_shows_the_settings(tmp_path, capsys):
    """Without --rows the settings are a result; one line says that they are all."""
    one, other = a_run(tmp_path / "one"), renamed(a_run(tmp_path / "other", 8.0), "mine")
    assert main(["compare", str(one), str(other), "--out", str(tmp_path / "page.html")]) == 0
    printed = capsys.readouterr().out
    assert "scene.sensor.exposure_ms" in printed
    assert "they share no sweep" in printed
    assert (tmp_path / "page.html").exists()


@pytest.mark.parametrize("slopes", ["", "sweep,parameter,noise_model,measured_slope\n", "sweep,noise_model\nx,other\n"])
def test_a_table_without_the_chosen_rows_costs_no_page(tmp_path, slopes):
    """A selection has no slopes; the page is made, and states which table it is without."""
    folder = a_run(tmp_path / "run")
    (folder / "slopes.csv").write_text(slopes)
    sides = [f"{folder}@noise_model=as-printed", f"{folder}@noise_model=physical"]
    assert main(["compare", *sides, "--out", str(tmp_path / "page.html")]) == 0
    assert "slopes.csv has no rows for as-printed and physical" in (tmp_path / "page.html").read_text()


def long_scene(**changed):
    """A scene of many keys."""
    cameras = [{"name": str(n), "zoom": 3.0, "focus_distance_m": 4.0} | changed for n in range(20)]
    return {"sensor": {"exposure_ms": 4.0}, "cameras": cameras}


def test_one_scene_in_two_sweeps_of_different_names_has_no_differences(tmp_path):
    """Each key of the scene was listed twice, as missing from the other: 293 of the room's."""
    one, other = (renamed(a_run(tmp_path / name), name, long_scene()) for name in ("first", "second"))
    assert settings_rows(sides_of([str(one), str(other)])) == [{"key": "sweeps", "first": "first", "second": "second"}]
    third = renamed(a_run(tmp_path / "third"), "third", long_scene(zoom=2.0))
    rows = settings_rows(sides_of([str(one), str(third)]))
    assert {row["key"] for row in rows} == {"sweeps", *(f"scene.cameras.{n}.zoom" for n in range(20))}
    assert {(row["first"], row["third"]) for row in rows if row["key"] != "sweeps"} == {("3.0", "2.0")}


def test_many_differences_are_counted_by_table(tmp_path, capsys):
    """Not page after page; --rows settings has all of them."""
    one = renamed(a_run(tmp_path / "one"), "mine", long_scene())
    other = renamed(a_run(tmp_path / "other"), "mine", long_scene(zoom=2.0) | {"sensor": {"exposure_ms": 8.0}})
    rows = settings_rows(sides_of([str(one), str(other)]))
    assert len(rows) == 21
    assert [row["key"] for row in summarised(rows)] == [
        "scene.sensor.exposure_ms",
        "scene.cameras: 20 keys, such as 0.zoom",
    ]
    assert main(["compare", str(one), str(other), "--no-report"]) == 0
    assert "--rows settings" in capsys.readouterr().out
    assert main(["compare", str(one), str(other), "--rows", "settings"]) == 0
    assert capsys.readouterr().out.count("scene.cameras.") == 20
