"""The pixel noise table as a figure: spread and bias against each factor, detection below, exponents beside."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, ScalarFormatter

from pss.hints import Floats
from render.store.folder import atomic_path
from validate.pixel_noise.design import COMBINATIONS
from validate.plots.drawing import plt
from validate.runs.palette import BLUE, MEASURED, MIDDLE_GREY, PURPLE, VERMILION

__all__ = ["draw", "noise_figure"]

Rows = Sequence[dict[str, object]]

SPREAD, BIAS, PAPER, BOUND, PHYSICAL = BLUE, VERMILION, PURPLE, MEASURED, MIDDLE_GREY
DPI = 150
LOGARITHMIC = ("module_px", "white_e")
# (series, column along x, title, label of x)
PANELS = (
    ("module", "module_px", "size", "module in px"),
    ("cc-10px", "cc_px", "defocus, module 10 px", "circle of confusion in px"),
    ("cc-25px", "cc_px", "defocus, module 25 px", "circle of confusion in px"),
    ("incidence", "incidence_deg", "incidence", "incidence in degrees"),
    ("white", "white_e", "signal", "white in electrons"),
)
FACTOR_NAMES = {
    "module_px": "module",
    "cc_px": "cc ≥ 1 px",
    "blur_px": "blur",
    "cos_incidence": "cos α",
    "white_e": "white",
    "edge_cnr": "edge CNR",
}
PLACES = {"cc-10px": ", module 10 px", "cc-25px": ", module 25 px", COMBINATIONS: ", all together"}
LEGEND = ("σ", "bias", "Cramér–Rao bound", "model “physical”", "σ ∝ cc (Eq. 15)")
# Where the names of the exponents begin, on their own axis.
NAMES_AT = -2.8


def draw(path: Path, levels: Rows, exponents: Rows) -> None:
    """Write the figure of the table's rows and those of the exponents."""
    figure = noise_figure(levels, exponents)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=DPI, format="png")
    plt.close(figure)


def noise_figure(levels: Rows, exponents: Rows) -> Figure:
    """A panel for each series, and one for the exponents."""
    figure = plt.figure(figsize=(15, 9.4), layout="constrained")
    figure.suptitle("Localisation of an ArUco marker's centre (4 × 4 bits): σ and bias of one axis", fontsize=16)
    grid = figure.add_gridspec(4, 3, height_ratios=[1, 0.2, 1, 0.2])
    first = None
    for number, (series, column, title, label) in enumerate(PANELS):
        row, place = divmod(number, 3)
        rows = [each for each in levels if each["series"] == series]
        axes = figure.add_subplot(grid[2 * row, place], sharey=first)
        first = first or axes
        below = figure.add_subplot(grid[2 * row + 1, place], sharex=axes)
        _noise(axes, rows, column)
        _detection(below, rows, column)
        axes.set_title(title, fontsize=13)
        below.set_xlabel(label, fontsize=11)
        axes.tick_params(labelbottom=False)
        if place == 0:
            axes.set_ylabel("px", fontsize=12)
            below.set_ylabel("found", fontsize=11)
    _exponents(figure.add_subplot(grid[2:, 2]), exponents)
    handles, labels = figure.axes[2].get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda number: LEGEND.index(labels[number]))
    figure.legend(
        [handles[number] for number in order],
        [labels[number] for number in order],
        loc="outside lower center",
        ncols=len(labels),
        fontsize=11,
        frameon=False,
    )
    return figure


def _column(rows: Rows, name: str) -> Floats:
    return np.array([row[name] for row in rows], dtype=float)


def _noise(axes: Axes, rows: Rows, column: str) -> None:
    x = _column(rows, column)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    if column in LOGARITHMIC:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
    bound, physical = (_column(rows, name) for name in ("bound_sigma_px", "physical_sigma_px"))
    axes.plot(x, bound, color=BOUND, lw=1.8, label="Cramér–Rao bound")
    axes.plot(x, physical, "--", color=PHYSICAL, lw=1.5, label="model “physical”")
    sigma = _column(rows, "sigma_px")
    if column == "cc_px" and np.isfinite(sigma[x > 0]).any():
        # Through the measured σ at the largest blur, where nothing but the blur should count.
        last = np.flatnonzero((x > 0) & np.isfinite(sigma))[-1]
        drawn = np.linspace(0.3, x[last], 50)
        axes.plot(drawn, sigma[last] * drawn / x[last], ":", color=PAPER, lw=2, label="σ ∝ cc (Eq. 15)")
    for name, colour, style, symbol in (("bias", BIAS, "D", "bias"), ("sigma", SPREAD, "o", "σ")):
        value, low, high = (_column(rows, f"{name}{end}_px") for end in ("", "_low", "_high"))
        # A bias of which noise explains all has no place on a logarithmic axis but for its upper end.
        shown = np.where(value > 0, value, np.nan)
        ends = np.array([shown - np.maximum(low, 1e-6), high - shown])
        axes.errorbar(
            x, shown, yerr=np.nan_to_num(ends), fmt=style, color=colour, ms=6, capsize=3, lw=1.5, label=symbol
        )
        none = (value == 0) & (high > 0)
        axes.plot(x[none], high[none], "v", color=colour, mfc="none", ms=7)
    axes.set_ylim(4e-4, 0.04)
    axes.grid(alpha=0.3, which="both", lw=0.5)


def _detection(axes: Axes, rows: Rows, column: str) -> None:
    x = _column(rows, column)
    rate, low, high = (_column(rows, f"detection_rate{end}") for end in ("", "_low", "_high"))
    axes.fill_between(x, low, high, color=SPREAD, alpha=0.2, lw=0)
    axes.plot(x, rate, "o-", color=SPREAD, ms=4, lw=1.5)
    axes.set_ylim(-0.05, 1.08)
    axes.set_yticks([0, 0.5, 1], ["0", "½", "1"])
    axes.grid(alpha=0.3)
    if column in LOGARITHMIC:
        ticks = (3, 5, 10, 25) if column == "module_px" else (60, 250, 1000, 8000)
        axes.xaxis.set_major_locator(FixedLocator(ticks))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(ScalarFormatter())


def _exponents(axes: Axes, rows: Rows) -> None:
    """Exponents with their intervals, beside those of the bound and of the paper's R; names are inside, at the left."""
    place = np.arange(len(rows))[::-1]
    value, low, high = (_column(rows, f"exponent{end}") for end in ("", "_low", "_high"))
    axes.axvline(0, color="0.6", lw=1)
    ends = [value - low, high - value]
    axes.errorbar(value, place, xerr=ends, fmt="o", color=SPREAD, ms=6, capsize=3, lw=1.5, label="measured")
    axes.plot(_column(rows, "bound_exponent"), place, "|", color=BOUND, ms=16, mew=2.2, label="bound")
    axes.plot(_column(rows, "paper_exponent"), place, "*", color=PAPER, ms=14, mec="white", label="the paper's R alone")
    for row, at in zip(rows, place, strict=True):
        name, where = FACTOR_NAMES[str(row["factor"])], PLACES.get(str(row["set"]), "")
        axes.text(NAMES_AT, at, f"{name}{where}", va="center", fontsize=10)
    axes.set_xlim(NAMES_AT - 0.05, 1.25)
    axes.set_xticks(np.arange(-1, 1.1, 0.5))
    axes.set_yticks([])
    axes.set_ylim(-0.7, len(rows) + 0.7)
    axes.set_title("exponents of σ", fontsize=13)
    axes.set_xlabel("σ ∝ factor to the power of …", fontsize=11)
    axes.grid(alpha=0.3, axis="x")
    axes.legend(fontsize=9, loc="upper center", ncols=3, frameon=False, columnspacing=1.0, handletextpad=0.3)
