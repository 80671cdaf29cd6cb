"""What figures of curves share: a panel for each title, lines with a shaded range, a legend beside the panels."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validate.findings.forest import FONT_PT, LINE_PT, SIGN_PT, WIDTH_IN, columns_for
from validate.plots.drawing import plt
from validate.runs.palette import FINDINGS_GRID

__all__ = ["Curve", "draw_curves", "label_below", "legend_below", "panels_of"]


@dataclass(frozen=True)
class Curve:
    """A line in a panel: values y over x with the range low to high.

    Attributes:
        panel: its title.
        name: in the legend.
    """

    panel: str
    name: str
    colour: str
    sign: str
    filled: bool
    x: tuple[float, ...]
    y: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    def __str__(self) -> str:
        """The numbers, as they enter the figure's digest."""
        columns = (" ".join(f"{value:.4g}" for value in each) for each in (self.x, self.y, self.low, self.high))
        return f"{self.panel}, {self.name}: " + "; ".join(columns)


def panels_of(
    curves: Sequence[Curve], title: str, panel_height_in: float, scale: float
) -> tuple[Figure, list[tuple[str, Axes]]]:
    """A grid of empty panels for the curves, to be drawn in a `style`."""
    titles = list(dict.fromkeys(curve.panel for curve in curves))
    columns = columns_for(len(titles))
    lines = math.ceil(len(titles) / columns)
    figure, grid = plt.subplots(
        lines,
        columns,
        figsize=(WIDTH_IN * scale, (lines * panel_height_in + 1.2) * scale),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    figure.suptitle(title, x=0.01, ha="left", weight="bold")
    found = []
    for number, axes in enumerate(grid.ravel().tolist()):
        if number >= len(titles):
            axes.set_visible(False)
            continue
        axes.set_title(titles[number], loc="left", weight="bold")
        axes.grid(color=FINDINGS_GRID, lw=0.8 * scale)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        axes.tick_params(axis="x", labelbottom=True)
        found.append((titles[number], axes))
    return figure, found


def draw_curves(axes: Axes, curves: Sequence[Curve], scale: float, shaded: Collection[str]) -> None:
    """Lines, those of the names in `shaded` with their ranges."""
    for curve in (curve for curve in curves if curve.name in shaded):
        axes.fill_between(curve.x, curve.low, curve.high, color=curve.colour, alpha=0.2, lw=0)
    for curve in curves:
        axes.plot(
            curve.x,
            curve.y,
            color=curve.colour,
            marker=curve.sign,
            mfc=curve.colour if curve.filled else "white",
            ms=0.75 * SIGN_PT * scale,
            mew=1.3 * scale,
            lw=0.9 * LINE_PT * scale,
            ls="-" if curve.filled else (0, (4, 1.5)),
            label=curve.name,
        )


def label_below(panels: Sequence[tuple[str, Axes]], label: str) -> None:
    """Name the x axis below the lowest panel of each column, with room for a legend."""
    for _, axes in panels[-columns_for(len(panels)) :]:
        axes.set_xlabel(label)


def legend_below(figure: Figure, panels: Sequence[tuple[str, Axes]], scale: float, columns: int = 4) -> None:
    """One legend for all panels, outside of them."""
    handles = {}
    for _, axes in panels:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(name, handle)
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower center",
        ncols=min(columns, len(handles)),
        frameon=False,
        fontsize=0.95 * FONT_PT * scale,
        handlelength=2.4,
    )
