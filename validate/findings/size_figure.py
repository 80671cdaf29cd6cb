"""Measured over predicted error of points, in bins of the predicted one, from size.csv."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from validate.findings.contenders import contenders_in
from validate.findings.curves import Curve, draw_curves, label_below, legend_below, panels_of
from validate.findings.forest import FONT_PT, style
from validate.findings.places import Place
from validate.runs.csv_file import all_of, value_of
from validate.runs.palette import REFERENCE

__all__ = ["size_curves", "size_figure"]

MM = 1e3
PANEL_IN = 2.9
SHADED = ("calibrated",)
# Measured over predicted, as far as it is drawn; contenders whose median is outside are named with it.
RANGE = (0.5, 2.0)
TICKS_MM = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
TICKS = (0.5, 0.7, 1.0, 1.4, 2.0)


def size_curves(places: Sequence[Place]) -> list[Curve]:
    """A panel for each place, a line for each contender: measured over predicted RMS by predicted RMS in mm."""
    found = []
    for place in places:
        table = place.rows("size")
        for model in contenders_in(row["noise_model"] for row in table):
            rows = sorted(all_of(table, noise_model=model.name), key=lambda row: value_of(row, "predicted_rms_m"))
            predicted = tuple(value_of(row, "predicted_rms_m") for row in rows)
            columns = [
                tuple(value_of(row, name) / base for row, base in zip(rows, predicted, strict=True))
                for name in ("measured_rms_m", "measured_q25_m", "measured_q75_m")
            ]
            millimetres = tuple(MM * each for each in predicted)
            found.append(Curve(place.title, model.name, model.colour, model.sign, model.filled, millimetres, *columns))
    return [curve for curve in found if curve.x]


def size_figure(curves: Sequence[Curve], scale: float) -> Figure:
    """Draw the panels at a scale; what is off by more than `RANGE` is named in its panel."""
    near = [curve for curve in curves if RANGE[0] < _times(curve) < RANGE[1]] or list(curves)
    values = np.array([value for curve in near for value in curve.x])
    low, high = 0.9 * float(values.min()), 1.1 * float(values.max())
    with style(scale):
        figure, panels = panels_of(curves, "Is the error of each point as large as predicted?", PANEL_IN, scale)
        for title, axes in panels:
            here = [curve for curve in curves if curve.panel == title]
            axes.axhline(1.0, color=REFERENCE, lw=1.2 * scale, ls=(0, (4, 2)), zorder=1)
            draw_curves(axes, [curve for curve in here if curve in near], scale, SHADED)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlim(low, high)
            axes.set_ylim(*RANGE)
            ticks = [tick for tick in TICKS_MM if low <= tick <= high]
            for axis, shown in ((axes.xaxis, ticks), (axes.yaxis, TICKS)):
                axis.set_major_locator(FixedLocator(list(shown)))
                axis.set_major_formatter("{x:g}")
                axis.set_minor_locator(NullLocator())
            far = [f"{curve.name}: {_times(curve):.1g}" for curve in here if curve not in near]
            if far:
                axes.text(
                    0.98, 0.97, "below the axis:\n" + "\n".join(far), transform=axes.transAxes, ha="right", va="top",
                    fontsize=0.85 * FONT_PT * scale, linespacing=1.1,
                )  # fmt: skip
        label_below(panels, "predicted RMS, mm")
        figure.supylabel("measured over predicted RMS (dashed: as predicted)", fontsize=FONT_PT * scale)
        legend_below(figure, panels, scale)
    return figure


def _times(curve: Curve) -> float:
    """Measured over predicted, in the median of the bins."""
    return float(np.median(curve.y))
