"""ρ of σ∞, and of counts of points, over the ratio of process noise to measurement noise."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from pss.hints import CsvRow
from validate.findings.contenders import contenders_in
from validate.findings.curves import Curve, draw_curves, label_below, legend_below, panels_of
from validate.findings.forest import FONT_PT, power_of_ten, scale_axis, style
from validate.findings.places import COUNT, Place
from validate.findings.process import MOTIONS
from validate.runs.csv_file import all_of, bounds, first_of, value_of
from validate.runs.palette import DARK_INK, REFERENCE

__all__ = ["SHARE", "headline_levels", "process_curves", "process_figure"]

# Scaled ones and variants of visibility crowd the panels; the table has them all.
SHOWN = ("as-printed", "as-printed, scaled", "identity", "physical", "calibrated")
# The share of points that two cameras see, or by `calibrated` are expected to find.
SHARE = "visible-share"
COUNTS = {COUNT: ("count of points", "X"), SHARE: ("share that two cameras find", "P")}
# Whose counts: those of the best contender there is.
COUNTED_BY = ("calibrated", "calibrated, limits", "physical")
PANEL_IN = 2.9
SHADED = ("calibrated", COUNTS[SHARE][0])
TICKS = (-0.5, 0.0, 0.5, 0.8, 0.95, 0.99, 0.998)
HIGHEST = 0.999


def process_curves(places: Sequence[Place]) -> list[Curve]:
    """A panel for each kind of motion and each room in its own light; the table has the others too."""
    found = []
    for panel, rows in _panels(places):
        for model in contenders_in(SHOWN):
            of_model = all_of(rows, metric="pss", noise_model=model.name)
            found.append(_curve(panel, model.name, model.colour, model.sign, model.filled, of_model))
        for metric, (name, sign) in COUNTS.items():
            counts = (all_of(rows, metric=metric, noise_model=by) for by in COUNTED_BY)
            found.append(_curve(panel, name, DARK_INK, sign, False, next(filter(None, counts), [])))
    return [curve for curve in found if curve.x]


def headline_levels(places: Sequence[Place]) -> dict[str, float]:
    """The q/c of the level that is judged, by panel."""
    rows = {panel: first_of(of_panel, headline="yes") for panel, of_panel in _panels(places)}
    return {panel: value_of(row, "q_over_c") for panel, row in rows.items() if row is not None}


def process_figure(curves: Sequence[Curve], judged: Mapping[str, float], scale: float) -> Figure:
    """Draw the panels at a scale.

    Args:
        judged: the level that is judged, by panel.
    """
    shown = [value for curve in curves for value in (curve.low if curve.name in SHADED else curve.y)]
    powers = [round(math.log10(value)) for curve in curves for value in curve.x]
    ticks = range(2 * (min(powers) // 2), max(powers) + 1, 2)
    with style(scale):
        figure, panels = panels_of(curves, "σ∞ by process noise: precision or a count?", PANEL_IN, scale)
        for title, axes in panels:
            draw_curves(axes, [curve for curve in curves if curve.panel == title], scale, shaded=SHADED)
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(FixedLocator([10.0**power for power in ticks]))
            axes.xaxis.set_major_formatter(lambda value, _: power_of_ten(round(math.log10(value))))
            axes.xaxis.set_minor_locator(NullLocator())
            scale_axis(axes.set_yscale, "fisher")
            axes.yaxis.set_major_locator(FixedLocator(list(TICKS)))
            axes.yaxis.set_major_formatter("{x:g}")
            axes.set_ylim(min(value for value in shown if not math.isnan(value)) - 0.02, HIGHEST)
            if title in judged:
                axes.axvline(judged[title], color=REFERENCE, lw=1.2 * scale, ls=(0, (4, 2)), zorder=1)
        label_below(panels, "q / c (dashed: judged level)")
        figure.supylabel("Spearman's ρ with the filter's measured PSS", fontsize=FONT_PT * scale)
        legend_below(figure, panels, scale)
    return figure


def _panels(places: Sequence[Place]) -> Iterator[tuple[str, list[CsvRow]]]:
    for motion, words in MOTIONS.items():
        for place in (place for place in places if place.own_light):
            yield f"{place.title}, {words}", all_of(place.rows("process"), process=motion)


def _curve(panel: str, name: str, colour: str, sign: str, filled: bool, rows: Sequence[CsvRow]) -> Curve:
    known = sorted((row for row in rows if row.get("spearman")), key=lambda row: value_of(row, "q_over_c"))
    columns = [tuple(value_of(row, "q_over_c") for row in known)]
    columns += [tuple(bounds(row, "spearman")[end] for row in known) for end in range(3)]
    return Curve(panel, name, colour, sign, filled, *columns)
