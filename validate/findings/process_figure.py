"""ρ of σ∞, and of the count of visible points, over the ratio of process noise to measurement noise."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from validate.findings.contenders import contenders_in
from validate.findings.curves import Curve, draw_curves, legend_below, panels_of
from validate.findings.forest import FONT_PT, style
from validate.findings.places import COUNT, Place
from validate.findings.process import MOTIONS
from validate.findings.tables import Row, all_of, bounds, value_of

__all__ = ["process_curves", "process_figure"]

# Scaled ones and variants of visibility crowd the panels; the table has them all.
SHOWN = ("as-printed", "as-printed, scaled", "identity", "physical", "calibrated")
COUNTED = "counting visible points"
INK = "#222222"
PANEL_IN = 2.9
SHADED = ("calibrated", COUNTED)


def process_curves(places: Sequence[Place]) -> list[Curve]:
    """A panel for each kind of motion and each room in its own light; the table has the others too."""
    found = []
    for motion, words in MOTIONS.items():
        for place in (place for place in places if place.own_light):
            rows = all_of(place.rows("process"), process=motion)
            panel = f"{place.title}, {words}"
            for model in contenders_in(SHOWN):
                of_model = all_of(rows, metric="pss", noise_model=model.name)
                found.append(_curve(panel, model.name, model.colour, model.sign, model.filled, of_model))
            count = all_of(rows, metric=COUNT, noise_model="physical")
            found.append(_curve(panel, COUNTED, INK, "X", True, count))
    return [curve for curve in found if curve.x]


def process_figure(curves: Sequence[Curve], scale: float) -> Figure:
    """Draw the panels at a scale."""
    with style(scale):
        figure, panels = panels_of(curves, "σ∞ by process noise: precision or count?", PANEL_IN, scale)
        lowest = math.floor(10 * min(min(curve.y) for curve in curves)) / 10 - 0.05
        for title, axes in panels:
            here = [curve for curve in curves if curve.panel == title]
            draw_curves(axes, here, scale, shaded=SHADED)
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
            axes.set_ylim(lowest, 1.02)
            axes.axvline(1.0, color="#555555", lw=1.2 * scale, ls=(0, (4, 2)), zorder=1)
            if axes.xaxis.get_tick_params()["labelbottom"]:
                axes.set_xlabel("q / c (dashed: 1)")
        figure.supylabel("Spearman's ρ with the filter's measured PSS", fontsize=FONT_PT * scale)
        legend_below(figure, panels, scale, columns=6)
    return figure


def _curve(panel: str, name: str, colour: str, sign: str, filled: bool, rows: Sequence[Row]) -> Curve:
    known = sorted((row for row in rows if row.get("spearman")), key=lambda row: value_of(row, "q_over_c"))
    columns = [tuple(value_of(row, "q_over_c") for row in known)]
    columns += [tuple(bounds(row, "spearman")[end] for row in known) for end in range(3)]
    return Curve(panel, name, colour, sign, filled, *columns)
