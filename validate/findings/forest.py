"""Forest plots: a row for each contender, a panel for each place, a sign with its 95 % interval in each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator
from numpy.typing import ArrayLike, NDArray

from pss.hints import CsvRow
from validate.findings.contenders import Contender
from validate.plots.drawing import plt
from validate.runs.csv_file import bounds
from validate.runs.palette import DARK_INK, FINDINGS_BAND, FINDINGS_GRID, FRAME, REFERENCE, WELCOME_BAND

__all__ = ["INDENT", "Axis", "Mark", "Panel", "columns_for", "forest", "mark_of", "power_of_ten", "scale_axis", "style"]

WIDTH_IN = 11.0
ROW_IN, PANEL_IN, FIGURE_IN = 0.27, 0.75, 0.75
# Signs, of a row's height at most.
SIGN_PT, LINE_PT = 7.0, 1.8
FONT_PT = 11.0
# Where labels begin with it, those without are headings.
INDENT = "  "
# Half the distance of two marks in a row, in rows.
APART = 0.2
ALMOST_ONE = 1 - 1e-9


@dataclass(frozen=True)
class Mark:
    """A row's number with its interval; nan ends have no interval, a nan value is not drawn."""

    value: float
    low: float
    high: float
    colour: str
    sign: str
    filled: bool

    @property
    def text(self) -> str:
        """The numbers, as they enter the figure's digest."""
        return f"{self.value:.4g} {self.low:.4g} {self.high:.4g}"


@dataclass(frozen=True)
class Panel:
    """A place: its title, and a mark or None for each row.

    Attributes:
        second: marks below those, in the same rows; none for a row of one mark.
    """

    title: str
    marks: tuple[Mark | None, ...]
    second: tuple[Mark | None, ...] = ()


@dataclass(frozen=True)
class Axis:
    """The x axis that all panels share.

    Attributes:
        label: with the unit.
        low, high: marks beyond them become an arrow at the edge with their number.
        ticks: with what is written at them.
        scale: "linear", "log" or "fisher" (the inverse hyperbolic tangent, which opens up correlations near 1).
        band: from, to: a range that is right, shaded.
        line: a value with a line through all rows.
    """

    label: str
    low: float
    high: float
    ticks: tuple[float, ...]
    scale: str = "linear"
    band: tuple[float, float] | None = None
    line: float | None = None


def mark_of(row: CsvRow | None, column: str, contender: Contender, factor: float = 1.0) -> Mark | None:
    """A row's number in a column, times a factor, with its interval; None if it has none."""
    value, low, high = (factor * number for number in bounds(row, column))
    return None if math.isnan(value) else Mark(value, low, high, contender.colour, contender.sign, contender.filled)


@contextmanager
def style(scale: float) -> Iterator[None]:
    """Sizes of all text and lines, times `scale`; fonts that stay text in PDF, and SVG without names by chance."""
    font = FONT_PT * scale
    sizes = {
        "font.size": font,
        "axes.titlesize": 1.05 * font,
        "axes.labelsize": font,
        "xtick.labelsize": 0.92 * font,
        "ytick.labelsize": 0.95 * font,
        "legend.fontsize": 0.95 * font,
        "figure.titlesize": 1.2 * font,
        "axes.linewidth": 0.8 * scale,
        "xtick.major.size": 3.5 * scale,
        "xtick.major.width": 0.8 * scale,
        "ytick.major.size": 0.0,
        "ytick.major.pad": 9.0 * scale,
        "axes.edgecolor": FRAME,
        "text.color": DARK_INK,
        "axes.labelcolor": DARK_INK,
        "xtick.color": DARK_INK,
        "ytick.color": DARK_INK,
        "figure.facecolor": "white",
        "savefig.facecolor": "white",
        "pdf.fonttype": 42,
        "svg.hashsalt": "findings",
        "lines.linewidth": LINE_PT * scale,
        "figure.constrained_layout.w_pad": 0.06 * scale,
        "figure.constrained_layout.h_pad": 0.06 * scale,
    }
    with matplotlib.rc_context(sizes):
        yield


def columns_for(panels: int) -> int:
    """Columns of a grid of so many panels."""
    return panels if panels <= 3 else 2 if panels == 4 else 3


def forest(
    title: str, labels: Sequence[str], groups: Sequence[str], panels: Sequence[Panel], axis: Axis, scale: float = 1.0
) -> Figure:
    """Draw the panels in a grid.

    Args:
        labels: of the rows, from the top.
        groups: of each row; every other group is shaded.
        scale: of the whole figure; its words are `scale` times 11 pt.
    """
    columns = columns_for(len(panels))
    lines = math.ceil(len(panels) / columns)
    height = lines * (ROW_IN * len(labels) + PANEL_IN) + FIGURE_IN
    with style(scale):
        figure, grid = plt.subplots(
            lines,
            columns,
            figsize=(WIDTH_IN * scale, height * scale),
            sharex=True,
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        figure.suptitle(title, x=0.01, ha="left", weight="bold")
        places = grid.ravel().tolist()
        for axes, panel in zip(places, panels, strict=False):
            _panel(axes, panel, labels, groups, axis, scale)
        for axes in places[len(panels) :]:
            axes.set_visible(False)
        for axes in places[: len(panels)]:
            axes.tick_params(axis="x", labelbottom=True)
        figure.supxlabel(axis.label, fontsize=FONT_PT * scale)
    return figure


def _panel(axes: Axes, panel: Panel, labels: Sequence[str], groups: Sequence[str], axis: Axis, scale: float) -> None:
    axes.set_title(panel.title, loc="left", weight="bold")
    scale_axis(axes.set_xscale, axis.scale)
    axes.set_xlim(axis.low, axis.high)
    axes.xaxis.set_major_locator(FixedLocator(list(axis.ticks)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.set_yticks(range(len(labels)), labels)
    for row, text in enumerate(axes.get_yticklabels()):
        if not labels[row].startswith(INDENT) and any(label.startswith(INDENT) for label in labels):
            text.set_weight("bold")
    _shade(axes, groups)
    axes.grid(axis="x", color=FINDINGS_GRID, lw=0.8 * scale, zorder=0)
    axes.set_axisbelow(True)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    if axis.band:
        axes.axvspan(*axis.band, color=WELCOME_BAND, alpha=0.7, lw=0, zorder=1)
    if axis.line is not None:
        axes.axvline(axis.line, color=REFERENCE, lw=1.2 * scale, ls=(0, (4, 2)), zorder=1)
    apart = APART if panel.second else 0.0
    for marks, offset in ((panel.marks, -apart), (panel.second, apart)):
        for row, mark in enumerate(marks):
            if mark is not None and not math.isnan(mark.value):
                _mark(axes, row + offset, mark, axis, scale)


def scale_axis(set_scale: Callable[..., None], kind: str) -> None:
    """Set "linear", "log" or "fisher" by an axis's `set_xscale` or `set_yscale`."""
    if kind == "fisher":
        set_scale("function", functions=(_fisher, np.tanh))
    else:
        set_scale(kind)


def _fisher(rho: ArrayLike) -> NDArray[np.float64]:
    """Fisher's z, finite at -1 and 1, where Matplotlib tries it."""
    return np.arctanh(np.clip(np.asarray(rho, dtype=float), -ALMOST_ONE, ALMOST_ONE))


def _shade(axes: Axes, groups: Sequence[str]) -> None:
    starts = [0, *(row for row, (a, b) in enumerate(pairwise(groups), 1) if a != b), len(groups)]
    for number, (first, last) in enumerate(pairwise(starts)):
        if number % 2 == 0:
            axes.axhspan(first - 0.5, last - 0.5, color=FINDINGS_BAND, lw=0, zorder=0)


def _mark(axes: Axes, row: float, mark: Mark, axis: Axis, scale: float) -> None:
    face = mark.colour if mark.filled else "white"
    sizes = {"ms": SIGN_PT * scale, "mew": 1.5 * scale, "color": mark.colour, "mfc": face, "clip_on": False}
    if axis.low <= mark.value <= axis.high:
        if not (math.isnan(mark.low) or math.isnan(mark.high)):
            ends = (max(mark.low, axis.low), min(mark.high, axis.high))
            axes.plot(ends, (row, row), color=mark.colour, lw=LINE_PT * scale, solid_capstyle="round", zorder=3)
            for beyond, end, sign in ((mark.low < axis.low, axis.low, "<"), (mark.high > axis.high, axis.high, ">")):
                if beyond:
                    axes.plot([end], [row], sign, zorder=3, **(sizes | {"ms": 0.6 * SIGN_PT * scale, "mew": 0.0,
                                                                        "mfc": mark.colour}))  # fmt: skip
        axes.plot([mark.value], [row], mark.sign, zorder=4, **sizes)
        return
    # Beyond the axis: an arrow at its edge, with the number.
    left = mark.value < axis.low
    edge = axis.low if left else axis.high
    axes.plot([edge], [row], "<" if left else ">", zorder=4, **(sizes | {"mfc": mark.colour}))
    axes.annotate(
        _few(mark.value),
        (edge, row),
        xytext=((9 if left else -9) * scale, 0),
        textcoords="offset points",
        ha="left" if left else "right",
        va="center_baseline",
        fontsize=0.85 * FONT_PT * scale,
        color=mark.colour,
    )


def _few(value: float) -> str:
    """One digit: 0.2, or 3·10⁻⁵ of what is smaller than a thousandth."""
    if value == 0 or abs(value) >= 1e-3:
        return f"{value:.1g}"
    digit, power = f"{value:.0e}".split("e")
    return f"{digit}·{power_of_ten(int(power))}"


def power_of_ten(power: int) -> str:
    """10⁻⁵ without markup."""
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
