"""The figure of a schedule in the manner of the paper's Figure 4: PSS against where H1 is, predicted and measured."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from validate.plots.drawing import plt
from validate.runs.palette import CATEGORIES, OUTLINE, ZERO_LINE
from validate.schedule.held import FULL_MODEL
from validate.schedule.results import KINDS, ScheduleResult
from validate.schedule.runs import limit_name
from validate.stats.intervals import interval

__all__ = ["draw_panel", "key_lines", "schedule_figure"]


PAPERS = {
    "follow": "(1) follow",
    "swap-to-farther": "(2a) swap to the farther",
    "swap-to-closer": "(2b) swap to the closer",
}
# Strategies that share a panel: the paper's left plot, its right one, and all others.
PANELS = (("follow",), ("swap-to-farther", "swap-to-closer"))
LINES = ("-", "--", ":", "-.")
SHOWN_BESIDE = "corrected"
PER_MM = 1e-3


def schedule_figure(result: ScheduleResult) -> Figure:
    """PSS of both avatars: a row for each kind, a column for strategy (1), (2) and the others."""
    runs = result.held.design.runs
    named = [[run.strategy for run in runs if run.strategy in panel] for panel in PANELS]
    others = [run.strategy for run in runs if not any(run.strategy in panel for panel in PANELS)]
    columns = [list(dict.fromkeys(names)) for names in (*named, others) if names]
    figure, grid = plt.subplots(
        len(KINDS), len(columns), figsize=(5.2 * len(columns), 4.2 * len(KINDS)), sharex=True, sharey="row",
        squeeze=False, layout="constrained",
    )  # fmt: skip
    figure.suptitle(result.held.design.schedule.spec.title, fontsize=15)
    for row, kind in zip(grid, KINDS, strict=True):
        for axes, strategies in zip(row, columns, strict=True):
            draw_panel(axes, result, strategies, kind)
        # When all of the row is drawn: a limit that is set ends the search for others.
        row[0].set_ylim(bottom=0)
        row[0].set_ylabel(f"PSS in 1/mm, {kind.replace('filter', 'σ∞ and filter')}")
    for axes in grid[-1]:
        axes.set_xlabel(f"y of {result.held.design.stage.names[0]} in m")
    for axes in grid[0]:
        axes.legend(fontsize=8, frameon=False, loc="upper left")
    figure.legend(handles=key_lines(result), loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def draw_panel(axes: Axes, result: ScheduleResult, strategies: list[str], kind: str) -> None:
    runs, steps = result.held.design.runs, result.shape[1]
    y = np.array([float(c.value) for c in result.configurations[:steps]])
    limits = list(dict.fromkeys(run.zoom_limit for run in runs))
    predicted, measured = result.curves[FULL_MODEL, kind], result.curves["", kind]
    beside = result.curves[SHOWN_BESIDE, kind]
    low, high = interval(measured.samples)
    for number, run in enumerate(runs):
        if run.strategy not in strategies:
            continue
        colour = CATEGORIES[list(dict.fromkeys(r.strategy for r in runs)).index(run.strategy) % len(CATEGORIES)]
        style = LINES[limits.index(run.zoom_limit) % len(LINES)]
        label = PAPERS.get(run.strategy, run.strategy) if run.zoom_limit == limits[0] else None
        axes.plot(y, PER_MM * predicted.values[number], style, color=colour, label=label, linewidth=1.6)
        if run.zoom_limit != limits[0]:
            # Where the limit does not bind, the views are those of the run without it.
            free = next(n for n, r in enumerate(runs) if (r.strategy, r.zoom_limit) == (run.strategy, limits[0]))
            bound = measured.values[number] != measured.values[free]
            held_back = PER_MM * measured.values[number][bound]
            axes.plot(y[bound], held_back, "s", color=colour, markerfacecolor="white", markersize=4, linewidth=0)
            continue
        bars = PER_MM * np.abs(np.array([low[number], high[number]]) - measured.values[number])
        axes.errorbar(
            y, PER_MM * measured.values[number], bars, fmt="o", color=colour, markersize=3.5, linewidth=0.8, capsize=2
        )
        # In its own unit a shape, not a size: drawn at the measured mean.
        scale = measured.values[number].mean() / beside.values[number].mean()
        axes.plot(y, PER_MM * scale * beside.values[number], color=colour, linewidth=0.7, alpha=0.55)
    axes.axvline(0, color=ZERO_LINE, linewidth=0.8, zorder=0)


def key_lines(result: ScheduleResult) -> list[Line2D]:
    limits = list(dict.fromkeys(run.zoom_limit for run in result.held.design.runs))
    grey = OUTLINE
    found = []
    for style, limit in zip(LINES, limits, strict=False):
        name = "no zoom limit" if limit is None else f"zoom limit ×{limit_name(limit).removeprefix('x')}"
        found.append(Line2D([], [], color=grey, linestyle=style, label=f"predicted, calibrated R, {name}"))
    found.append(Line2D([], [], color=grey, marker="o", linestyle="", markersize=4, label="measured, 95 %"))
    if len(limits) > 1:
        square = {"marker": "s", "markerfacecolor": "white", "linestyle": "", "markersize": 4}
        found.append(Line2D([], [], color=grey, label="measured where a limit binds", **square))
    found.append(
        Line2D([], [], color=grey, linewidth=0.7, alpha=0.6, label=f"predicted, {SHOWN_BESIDE} R, scaled to the mean")
    )
    return found
