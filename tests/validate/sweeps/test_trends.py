"""Where PSS is highest over a sweep, in words, tables, figures and report; the paper's claims on its sweeps alone."""

from __future__ import annotations

import csv
import dataclasses
import io
from pathlib import Path
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from rich.console import Console

import scenes
from scenes import load_sweep
from tests.helpers.closet import RISING, SCENE
from tests.helpers.made_up_run import made_up_run
from validate.pages.curves import curves_figure
from validate.pages.data import KINDS, read_sweeps
from validate.pages.sentences import in_words, verdicts
from validate.plots.sweep import draw_curves
from validate.stats.flatness import EXCHANGES
from validate.sweeps.claims import claim_rows
from validate.sweeps.correlation import correlation_rows
from validate.sweeps.optima import Trend
from validate.sweeps.summary import show

# The made-up detections know nothing of the exposure: measured PSS is flat, and so is that of the paper's R.
FLAT = """
scene = "closet.toml"
title = "Exposure"
trials = 6
seed = 3
active = ["west", "middle", "east"]

[vary]
parameter = "scene"
axis = "exposure_ms"
values = [2.0, 3.0, 4.0]

[vary.set]
"sensor.exposure_ms" = [2.0, 3.0, 4.0]
"""
SCENES = Path(__file__).parents[3] / "scenes"
LABELS = ("1.4", "2", "4", "16")


def curve(values, ordered=True, flat=False, least=0.0, side="measured"):
    """A curve without chance."""
    values = np.array(values, dtype=float)
    return Trend(side, "", True, LABELS[: len(values)], ordered, values, np.tile(values, (9, 1)), flat, least)


@pytest.mark.parametrize(
    ("made", "optimum", "place", "words"),
    [
        (curve([710, 300, 200, 100]), "1.4", "first", "falls 7.1-fold [7.1, 7.1] from 1.4 to 16"),
        (curve([100, 300, 400, 510]), "16", "last", "rises 5.1-fold [5.1, 5.1] from 1.4 to 16"),
        (curve([100, 50, 60, 200]), "16", "last", "highest at the last value 16, 4-fold [4, 4] the lowest, at 2"),
        (
            curve([100, 200, 190, 50], least=20),
            "2",
            "inside",
            "that of the first value, 4-fold [4, 4] that of the last value; not told apart from 2: 4",
        ),
        (
            curve([100, 103], flat=True),
            "flat",
            "",
            "flat within its interval, no optimum (highest / lowest 1.03 [1.03,",
        ),
        (curve([100, 100], flat=True, side="predicted"), "flat", "", "the same at every step"),
        (curve([0, 0, 0], flat=True), "none", "", "0 at every step: no optimum"),
        (curve([100, 300, 200], ordered=False), "2", "", "highest with 2, 3-fold [3, 3] the lowest, 1.4"),
        (curve([100, 0, 0]), "1.4", "first", "many times (0)"),
        (curve([100, 300, 200], least=250), "2", "inside", "shown for these markers alone"),
    ],
)
def test_a_curve_in_words(made, optimum, place, words):
    """Each kind of curve."""
    assert (made.optimum, made.place) == (optimum, place)
    assert words in made.finding


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A flat sweep, and one that has an optimum."""
    folder = tmp_path_factory.mktemp("trends")
    results, acquired, _ = made_up_run(folder, SCENE, {"flat": FLAT, "mine": RISING})
    text = io.StringIO()
    show(results, acquired, Console(file=text, width=300))
    return SimpleNamespace(folder=folder / "run", results=results, acquired=acquired, shown=text.getvalue())


def test_a_flat_curve_has_no_optimum_and_no_rank(made):
    """In what is printed, in correlation.csv and in optima.csv."""
    lines = [[cell.strip() for cell in line.split("│")] for line in made.shown.splitlines() if "│ flat " in line]
    (ranks,) = [cells for cells in lines if cells[2:4] == ["corrected", "single frame"]]
    assert ranks[4:7] == ["undefined", "flat", "flat"]
    (row,) = [
        row
        for row in correlation_rows(made.results[0])
        if (row["metric"], row["measure"], row["noise_model"], row["level"])
        == ("pss-single-frame", "measured_pss_single_frame", "corrected", "configuration")
    ]
    assert np.isnan([row[name] for name in ("spearman", "spearman_ci_low", "kendall", "pearson_log")]).all()
    assert row["measured_flat"] == "yes"
    with (made.folder / "optima.csv").open() as file:
        (row,) = [r for r in csv.DictReader(file) if r["sweep"] == "flat" and (r["side"], r["kind"]) == KEY]
    assert (row["flat"], row["optimum"], row["optimum_position"]) == ("yes", "", "")


KEY = ("measured", "single frame")


def test_a_flat_prediction_ranks_nothing(made):
    """The paper's R knows no exposure: its rounding errors have no order, whatever is measured; nor a regret."""
    result = made.results[0]
    result = dataclasses.replace(result)
    result.__dict__["exchanged_ranges"] = np.zeros(EXCHANGES)  # what is measured counts as no chance
    rows = {
        row["metric"]: row
        for row in correlation_rows(result)
        if (row["measure"], row["noise_model"], row["level"])
        == ("measured_pss_single_frame", "corrected", "configuration")
    }
    assert rows["pss-single-frame"]["measured_flat"] == "no"
    assert np.isnan([rows["pss-single-frame"][name] for name in ("spearman", "kendall", "regret")]).all()


def test_a_curve_with_an_optimum_keeps_its_rank(made):
    """The sweep of zoom: made-up errors in pixels are smaller in space where the field of view is."""
    with (made.folder / "optima.csv").open() as file:
        (row,) = [r for r in csv.DictReader(file) if r["sweep"] == "mine" and (r["side"], r["kind"]) == KEY]
    assert (row["flat"], row["optimum"], row["optimum_position"]) == ("no", "2", "last")
    assert row["finding"].startswith("rises ")
    assert row["finding"] in made.shown


def test_a_flat_curve_has_no_star(made):
    """Neither in the picture nor on the page; its prediction, which is the same at every step, has none either."""
    for result, stars in ((made.results[0], 0), (made.results[1], 3)):
        axes = plt.figure().add_subplot()
        draw_curves(axes, result, single_frame=True)
        assert sum(line.get_marker() == "*" for line in axes.lines) == stars
        plt.close("all")
    table = read_sweeps(made.folder)[0]
    assert curves_figure(table).columns[f"optima|{KINDS[0].name}"] == [None, None, None]


def test_the_report_says_flat(made):
    """In its table, in its sentence, and in the section."""
    flat, mine = read_sweeps(made.folder)[:2]
    assert {(v.measured_optimum, v.standing) for v in verdicts(flat) if v.kind is KINDS[0]} == {
        ("flat", "has nothing to follow")
    }
    assert "flat within its interval" in in_words(flat)
    assert "Spearman" in in_words(mine)
    text = (made.folder / "report.html").read_text()
    assert text.count("Where PSS is highest</summary>") == 2
    assert text.count("The paper’s claims on this sweep") == 0


def test_claims_are_asked_of_the_papers_scene_alone(made, monkeypatch):
    """The same sweep of zoom, as one of a room of one's own and as one of the paper's."""
    assert "The paper's claims" not in made.shown
    assert not any(claim_rows(result) for result in made.results)
    monkeypatch.setattr("scenes.steps.sweep_file.PAPER_SCENE", made.results[1].plan.scene.path)
    anew = [dataclasses.replace(result) for result in made.results]  # nothing is derived from these yet
    assert [bool(claim_rows(result)) for result in anew] == [False, True]
    text = io.StringIO()
    show(anew, made.acquired, Console(file=text, width=300))
    claims, optima = (
        text.getvalue().split(title)[1].split("└")[0] for title in ("The paper's claims", "it is highest")
    )
    assert "│ mine " in claims
    assert "│ flat " not in claims
    assert "│ flat " in optima
    assert "│ mine " not in optima


@pytest.mark.parametrize(
    ("name", "figure"),
    [("zoom", 1), ("focus", 2), ("selection", 3), ("zoom-of-three", 1), ("workshop", None), ("aperture", None)],
)
def test_the_papers_figures_are_sweeps_of_its_scene(name, figure):
    """Of the project's own sweeps; another scene makes it another sweep."""
    sweep = load_sweep(name)
    assert sweep.paper_figure(scenes.load(sweep.scene_path)) == figure
    assert sweep.paper_figure(scenes.load(SCENES / "workshop.toml")) is None


@pytest.mark.parametrize("override", ["vary.parameter=f_number", "vary.parameter=pan_deg"])
def test_other_settings_are_none_of_the_papers_figures(override):
    """In the paper's scene too."""
    sweep = load_sweep("zoom", [f"sweep.{override}"])
    assert sweep.paper_figure(scenes.load(sweep.scene_path)) is None


def test_larger_selections_are_none_of_the_papers_figures():
    """Figure 3 is of pairs."""
    sweep = load_sweep("selection", ['sweep.vary.values=["2", ["3", "4"]]'])
    assert sweep.paper_figure(scenes.load(sweep.scene_path)) is None
