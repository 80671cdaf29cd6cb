"""What the findings' figures show: both counts, the level that is judged, and what goes on beyond an axis."""

from __future__ import annotations

import pytest

from tests.helpers.made_up_reference import write_reference
from validate.findings.figures import drawings_of
from validate.findings.forest import Axis, Mark, Panel, forest, power_of_ten
from validate.findings.places import Place, places_of_reference
from validate.findings.process_figure import headline_levels, process_curves, process_figure
from validate.findings.sigma_figure import sigma_rows
from validate.findings.size_figure import size_curves
from validate.plots.drawing import plt


@pytest.fixture(scope="module")
def places(tmp_path_factory) -> list[Place]:
    return places_of_reference(write_reference(tmp_path_factory.mktemp("reference")))


@pytest.fixture
def drawn():
    yield lambda *args: forest("title", ["a", "b"], ["1", "2"], *args)
    plt.close("all")


def test_every_panel_has_the_numbers_of_its_axis(drawn):
    """Five panels leave a gap in the last line, under which the axis of the line above was bare."""
    panels = [Panel(str(number), (Mark(0.5, 0.4, 0.6, "k", "o", True), None)) for number in range(5)]
    figure = drawn(panels, Axis("x", 0.0, 1.0, (0.0, 1.0)))
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert len(shown) == 5
    assert all(axes.xaxis.get_tick_params()["labelbottom"] for axes in shown)


def test_an_interval_that_goes_on_ends_in_an_arrow(drawn):
    """And only on the side where it does."""
    figure = drawn([Panel("room", (Mark(0.5, 0.4, 1.6, "k", "o", True), None))], Axis("x", 0.0, 1.0, (0.0, 1.0)))
    ends = [(line.get_marker(), line.get_xdata()[0]) for line in figure.axes[0].lines if line.get_marker() in "<>"]
    assert ends == [(">", 1.0)]


def test_powers_of_ten_are_written_without_markup():
    assert [power_of_ten(power) for power in (-5, 0, 12)] == ["10⁻⁵", "10⁰", "10¹²"]


def test_sigma_stands_beside_both_counts(places):
    """The second mark of a row is the difference to the share that two cameras see."""
    rows = [
        {
            **row,
            "minus_visible_share": "0.123",
            "minus_visible_share_ci_low": "0.1",
            "minus_visible_share_ci_high": "0.2",
        }
        for row in places[0].rows("process")
    ]
    labels, _, (panel,) = sigma_rows([Place("room", "", {"process": rows})])
    assert len(labels) == len(panel.marks) == len(panel.second)
    first, second = (marks[labels.index("  calibrated")] for marks in (panel.marks, panel.second))
    assert (second.value, second.low, second.high) == (0.123, 0.1, 0.2)
    assert first.value != second.value
    assert first.filled > second.filled


def test_the_level_that_is_judged_is_marked(places):
    """A line in each panel of the curves, at the q/c of the headline."""
    curves, judged = process_curves(places), headline_levels(places)
    assert set(judged) == {curve.panel for curve in curves}
    assert {f"{level:.3g}" for level in judged.values()} == {
        f"{float(row['q_over_c']):.3g}" for row in places[0].rows("process") if row["headline"] == "yes"
    }
    figure = process_figure(curves, judged, 1.0)
    for axes in figure.axes:
        vertical = [line for line in axes.lines if len(set(line.get_xdata())) == 1]
        assert judged[axes.get_title(loc="left")] in [line.get_xdata()[0] for line in vertical]
    plt.close(figure)
    (drawing,) = (each for each in drawings_of(places) if each.name == "findings-process")
    assert all(f"{panel}: {level:.4g}" in drawing.data for panel, level in judged.items())


def test_curves_of_counts_are_those_that_the_calibrated_expects(places):
    rows = [
        {**row, "spearman": "0.77" if row["noise_model"] == "calibrated" else "0.11"}
        for row in places[0].rows("process")
    ]
    curves = process_curves([Place("room", "", {"process": rows})])
    counted = [curve for curve in curves if curve.name in ("count of points", "share that two cameras find")]
    assert len(counted) == 4
    assert {value for curve in counted for value in curve.y} == {0.77}


def test_sizes_are_measured_over_predicted(places):
    curve = size_curves(places[:1])[0]
    rows = [row for row in places[0].rows("size") if row["noise_model"] == curve.name]
    expected = sorted(float(row["measured_rms_m"]) / float(row["predicted_rms_m"]) for row in rows)
    assert sorted(curve.y) == pytest.approx(expected)
