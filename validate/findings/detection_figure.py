"""The share of markers found over the probability that was predicted, from reliability.csv."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from validate.findings.contenders import CONTENDERS
from validate.findings.curves import Curve, draw_curves, label_below, panels_of
from validate.findings.forest import FONT_PT, style
from validate.findings.places import Place
from validate.findings.size_tables import share_found
from validate.runs.csv_file import value_of
from validate.runs.palette import REFERENCE

__all__ = ["detection_curves", "detection_figure"]

PANEL_IN = 2.9
NAME = "calibrated"
TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)


def detection_curves(places: Sequence[Place]) -> list[Curve]:
    """A panel for each place: the bins of predicted probability in which there are markers."""
    shown = next(contender for contender in CONTENDERS if contender.name == NAME)
    found = []
    for place in places:
        rows = [row for row in place.rows("reliability") if row.get("predicted") and row.get("found")]
        columns = [tuple(value_of(row, "predicted") for row in rows)]
        columns += [tuple(share_found(row)[end] for row in rows) for end in range(3)]
        found.append(Curve(place.title, NAME, shown.colour, shown.sign, shown.filled, *columns))
    return [curve for curve in found if curve.x]


def detection_figure(curves: Sequence[Curve], scale: float) -> Figure:
    """Draw the panels at a scale."""
    with style(scale):
        figure, panels = panels_of(curves, "Are markers found as often as predicted?", PANEL_IN, scale)
        for title, axes in panels:
            axes.plot((0, 1), (0, 1), color=REFERENCE, lw=1.2 * scale, ls=(0, (4, 2)), zorder=1)
            draw_curves(axes, [curve for curve in curves if curve.panel == title], scale, shaded=(NAME,))
            axes.set_xlim(-0.02, 1.02)
            axes.set_ylim(-0.02, 1.02)
            axes.set_xticks(TICKS)
            axes.set_yticks(TICKS)
            axes.xaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_major_formatter("{x:g}")
        label_below(panels, "predicted probability")
        figure.supylabel("share found (dashed: as predicted)", fontsize=FONT_PT * scale)
    return figure
