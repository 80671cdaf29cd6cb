"""Calibration plots: the measured error of points in bins of the predicted one, from size.csv."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from validate.findings.contenders import contenders_in
from validate.findings.curves import Curve, draw_curves, legend_below, panels_of
from validate.findings.forest import FONT_PT, style
from validate.findings.places import Place
from validate.findings.tables import all_of, value_of

__all__ = ["size_curves", "size_figure"]

MM = 1e3
PANEL_IN = 3.3
SHADED = ("calibrated",)
# Predictions this many times off in the median have no place on axes that show the others.
FAR = 10.0
TICKS_MM = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


def size_curves(places: Sequence[Place]) -> list[Curve]:
    """A panel for each place, a line for each contender, in mm."""
    found = []
    for place in places:
        table = place.rows("size")
        for model in contenders_in(row["noise_model"] for row in table):
            rows = sorted(all_of(table, noise_model=model.name), key=lambda row: value_of(row, "predicted_rms_m"))
            columns = [
                tuple(MM * value_of(row, name) for row in rows)
                for name in ("predicted_rms_m", "measured_rms_m", "measured_q25_m", "measured_q75_m")
            ]
            found.append(Curve(place.title, model.name, model.colour, model.sign, model.filled, *columns))
    return [curve for curve in found if curve.x]


def size_figure(curves: Sequence[Curve], scale: float) -> Figure:
    """Draw the panels at a scale; what is off by more than tenfold is named in its panel."""
    near = [curve for curve in curves if 1 / FAR < _times(curve) < FAR] or list(curves)
    values = np.array([value for curve in near for value in (*curve.x, *curve.y)])
    low, high = 0.7 * float(values.min()), 1.4 * float(values.max())
    with style(scale):
        figure, panels = panels_of(curves, "Is the error as large as predicted? Points by predicted error", PANEL_IN,
                                   scale)  # fmt: skip
        for title, axes in panels:
            here = [curve for curve in curves if curve.panel == title]
            axes.plot((low, high), (low, high), color="#555555", lw=1.2 * scale, ls=(0, (4, 2)), zorder=1)
            draw_curves(axes, [curve for curve in here if curve in near], scale, SHADED)
            _axes(axes, low, high)
            if axes.xaxis.get_tick_params()["labelbottom"]:
                axes.set_xlabel("predicted RMS, mm")
            far = [f"{curve.name} × {_times(curve):,.0f}" for curve in here if curve not in near]
            if far:
                axes.text(
                    0.98, 0.03, "off the axis:\n" + "\n".join(far), transform=axes.transAxes, ha="right", va="bottom",
                    fontsize=0.85 * FONT_PT * scale,
                )  # fmt: skip
        figure.supylabel("measured RMS, mm (dashed: as predicted)", fontsize=FONT_PT * scale)
        legend_below(figure, panels, scale)
    return figure


def _times(curve: Curve) -> float:
    """Predicted over measured, in the median of the bins."""
    return float(np.median(np.array(curve.x) / np.array(curve.y)))


def _axes(axes: Axes, low: float, high: float) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(FixedLocator([tick for tick in TICKS_MM if low <= tick <= high]))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(NullLocator())
