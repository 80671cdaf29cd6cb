"""`run_sweep.py figures`: what is illustrated, what the tables say, and files that are the same each time."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

import scenes
from pss import RangeError
from scenes import load_sweep
from tests.helpers.predicted_result import predicted_result
from validate.commands.figures import execute
from validate.commands.subcommands import Figures
from validate.plots.paper_sweeps import ILLUSTRATED, SWEEPS, shown_steps, static_figure, static_rows
from validate.plots.print_style import print_style, save

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def result():
    """The selection sweep with its predictions, and measured numbers that are made up."""
    return predicted_result("selection")


@pytest.mark.parametrize("number", sorted(SWEEPS))
def test_the_sweeps_have_the_steps_that_the_paper_illustrates(number):
    """Zoom ×4 and ×7, focus at 2 and 5 m, cameras 1+3 and 1+6; a sweep without them shows an early and the last."""
    sweep = load_sweep(SWEEPS[number])
    labels = [step.label for step in sweep.configurations(scenes.load(sweep.scene_path))]
    assert tuple(labels[step] for step in shown_steps(number, labels)) == ILLUSTRATED[number]
    assert shown_steps(number, ["a", "b", "c", "d", "e"]) == (1, 4)


def test_the_table_has_what_the_curves_show(result):
    """A row for each step and kind; intervals for the kind that has them."""
    rows = static_rows(3, result)
    assert [row["selection"] for row in rows[:6]] == ["1+2", "1+3", "1+4", "1+5", "1+6", "1+7"]
    assert [row["kind"] for row in rows] == ["single frame"] * 6 + ["filter"] * 6
    assert rows[5]["measured_pss"] == 2.0
    assert 1.8 <= rows[5]["measured_pss_ci_low"] < 2.0 < rows[5]["measured_pss_ci_high"] <= 2.2
    assert np.isnan(rows[11]["measured_pss_ci_low"])
    assert rows[11]["measured_pss"] == 6.0
    for row, assessment in zip(rows, result.assessments, strict=False):
        assert row["pss_physical"] == assessment.predicted["physical"].pss_single_frame


def test_a_figure_has_its_illustrations_and_curves(result):
    """Two views in space with cameras' numbers, two plots, one scale of colours."""
    with print_style():
        figure = static_figure(3, result)
    spaces = figure.axes[:2]
    assert [axes.get_title().partition(",")[0] for axes in spaces] == ["cameras 1+3", "cameras 1+6"]
    assert {text.get_text().strip() for text in spaces[0].texts} == set("1234567")
    assert len(figure.axes) == 5


def test_files_are_vectors_and_the_same_each_time(tmp_path):
    """PDF and SVG without dates or random names."""
    contents = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        with print_style():
            figure = Figure(figsize=(2, 2))
            axes = figure.add_subplot()
            axes.plot([0, 1], [0, 1], label="line")
            axes.fill_between([0, 1], [0, 1], [1, 2], alpha=0.2)
            axes.legend()
            paths = save(figure, folder, "figure")
        contents.append([path.read_bytes() for path in paths])
    assert contents[0] == contents[1]
    assert contents[0][0].startswith(b"%PDF")
    assert ElementTree.fromstring(contents[0][1]).tag.endswith("svg")


def test_a_figure_that_the_paper_has_not():
    """Named, with those that it has, before anything is loaded."""
    with pytest.raises(RangeError, match=r"figure 5; allowed: 1, 2, 3, 4"):
        execute(Figures((1, 5)))
