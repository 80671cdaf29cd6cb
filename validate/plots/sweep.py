"""A run's figures: curves in the manner of the paper's Figures 1 to 3, points, and contact sheets of the captures."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from pss.hints import Floats
from pss.json_text import json_text
from render.code_digest import code_of
from render.store.folder import Store, atomic_path
from validate.plots.contact_sheet import captures_figure, contact_sheet
from validate.plots.drawing import plt
from validate.plots.glyphs import settle_words
from validate.plots.names_beside import shortened, width_of
from validate.plots.room3d import colour_scale, draw_configuration, shared_colours
from validate.plots.single_step import measurement_figure
from validate.plots.style import TITLE_WIDTH, write_round_numbers
from validate.runs.axis_names import AXIS_NAMES
from validate.runs.file_names import FIGURES, figure_file
from validate.runs.numbers import written
from validate.runs.palette import CATEGORIES, MEASURED
from validate.stats.intervals import interval
from validate.stats.optimum import optimum
from validate.stats.stars import STEP, star_heights
from validate.sweeps.optima import Trend, trend
from validate.sweeps.single_step import is_measurement
from validate.sweeps.slopes import Slopes, slopes_of
from validate.sweeps.sweep import SweepResult

__all__ = [
    "all_drawn",
    "draw_all",
    "draw_curves",
    "figures_of",
    "points_figure",
    "shown_steps",
    "source_of",
    "sweep_figure",
    "write_round_numbers",
]


DPI = 130
# Characters of a title's line, of a label, and of all labels of an axis that stand level.
LONGEST_LABEL, LEVEL_WIDTH = 26, 50
# Room over the highest star.
ABOVE_OPTIMUM = 1.08
# Modules that figures use and that do not draw: what they give is in the tables, which count by themselves.
EXCLUDED = (
    "render.certificate",
    "render.renderer",
    "scenes.scene",
    "scenes.steps.sweep_file",
    "validate.acquire.acquire",
    "validate.acquire.request",
    "validate.markers.view_measurement",
    "render.store.folder",
    "render.store.views",
    "validate.sweeps.sweep",
)
# Tables that no figure shows and that differ from run to run.
NOT_SHOWN = ("timings.csv",)


def source_of(folder: Path, results: Sequence[SweepResult]) -> str:
    """Hash of all that the figures of a run show: its tables, its files, and the code that draws them."""
    digest = hashlib.sha256(code_of("validate.plots.sweep", excluded=EXCLUDED).digest.encode())
    for table in sorted(folder.glob("*.csv")):
        if table.name not in NOT_SHOWN:
            digest.update(table.read_bytes())
    for result in results:
        documents = [result.plan.sweep.resolved(), result.plan.scene.resolved()]
        digest.update(json_text(documents, sort_keys=True).encode())
    return digest.hexdigest()[:24]


def all_drawn(folder: Path, results: Sequence[SweepResult]) -> bool:
    """Whether every figure of a run is there."""
    names = [result.plan.sweep.name for result in results if result.assessments]
    return all((folder / "figures" / figure_file(name, suffix)).exists() for name in names for suffix in FIGURES)


def draw_all(folder: Path, results: Sequence[SweepResult], store: Store) -> list[Path]:
    """Draw every figure of a run into `folder`/figures and return their paths."""
    drawn = []
    for result in results:
        if not result.assessments:
            continue
        name = result.plan.sweep.name
        curves, points, captures = (folder / "figures" / figure_file(name, suffix) for suffix in FIGURES)
        for path, figure in zip((curves, points), _drawn(result), strict=True):
            with atomic_path(path) as temporary:
                figure.savefig(temporary, dpi=DPI, format="png")
            plt.close(figure)
            drawn.append(path)
        drawn.append(contact_sheet(captures, result, store))
    return drawn


def figures_of(result: SweepResult, store: Store) -> list[tuple[str, Figure]]:
    """The figures of a sweep as `draw_all` writes them, each with its file's name without `.png`.

    Raises:
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    names = (figure_file(result.plan.sweep.name, suffix).removesuffix(".png") for suffix in FIGURES)
    return list(zip(names, (*_drawn(result), captures_figure(result, store)), strict=True))


def _drawn(result: SweepResult) -> tuple[Figure, Figure]:
    """Curves, or what replaces them for one step, and points."""
    curves = measurement_figure(result) if is_measurement(result) else sweep_figure(result)
    points = points_figure(result)
    for figure in (curves, points):
        settle_words(figure)
    return curves, points


def sweep_figure(result: SweepResult) -> Figure:
    """The best and the worst configuration in space above, predicted and measured PSS over the steps below."""
    figure = plt.figure(figsize=(12, 10), layout="constrained")
    figure.suptitle(fill(result.plan.sweep.title, TITLE_WIDTH), fontsize=15)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.05, 1])
    shown = shown_steps(result)
    norm = shared_colours(result, list(shown))
    tops = []
    for column, (step, words) in enumerate(shown.items()):
        axes = figure.add_subplot(grid[0, column] if len(shown) > 1 else grid[0, :])
        draw_configuration(axes, result, step, norm)
        axes.set_title(f"{words}: {_title(result, step)}", fontsize=11)
        tops.append(axes)
    bar = colour_scale(figure, tops, norm, shrink=0.7, pad=0.02, aspect=30)
    bar.set_label(f"predicted √λmax of C in mm ({result.shown_model}); grey: unobservable")
    draw_curves(figure.add_subplot(grid[1, 0]), result, single_frame=True)
    found = slopes_of(result) if result.plan.sweep.varies_scene else None
    if found is not None and found.points:
        _slopes(figure.add_subplot(grid[1, 1]), result, found)
    else:
        draw_curves(figure.add_subplot(grid[1, 1]), result, single_frame=False)
    return figure


def shown_steps(result: SweepResult) -> dict[int, str]:
    """The steps that are drawn in space, in the sweep's order, and what they are: the best and the worst as measured.

    Of a flat curve they are the highest and the lowest, and no better or worse. Where nothing was measured, by the
    prediction of the leading noise model; where that has no best either, the first and the last.
    """
    if len(result.configurations) == 1:
        return {0: "the only step"}
    for curve in (trend(result, True), trend(result, True, result.shown_model)):
        best = optimum(curve.values)
        if best is not None:
            highest, lowest = ("highest", "lowest") if curve.flat else ("best", "worst")
            words = {int(np.nanargmin(curve.values)): f"{lowest} {curve.side}", best: f"{highest} {curve.side}"}
            return dict(sorted(words.items()))
    return {0: "first step", len(result.configurations) - 1: "last step"}


def _title(result: SweepResult, step: int) -> str:
    measured = result.measured_pss(True)[step]
    predicted = result.predicted_pss(result.shown_model, True)[step]
    label = shortened(result.configurations[step].label, 2 * LONGEST_LABEL)
    return f"{label}\nPSS of C: measured {written(measured, 3)} /m, predicted {written(predicted, 3)} /m"


def draw_curves(axes: Axes, result: SweepResult, single_frame: bool) -> None:
    """PSS over the steps, each curve relative to its own maximum, which the legend gives."""
    selection = result.configurations[0].parameter == "selection"
    labels = [str(configuration.value) for configuration in result.configurations]
    x = np.arange(float(len(labels))) if selection else np.array([float(c.value) for c in result.configurations])
    measured = trend(result, single_frame)
    best = measured.values.max() or 1.0
    if single_frame:
        low, high = interval(next(iter(result.replicates.values())).measured_pss)
        if np.isfinite(low).all():
            axes.fill_between(x, low / best, high / best, color=MEASURED, alpha=0.15, lw=0, label="95 % interval")
    colours, places = [MEASURED], [_curve(axes, x, measured, MEASURED, "o-", "measured")]
    for number, model in enumerate(result.noise_models):
        colours.append(CATEGORIES[number % len(CATEGORIES)])
        predicted = trend(result, single_frame, model)
        places.append(_curve(axes, x, predicted, colours[-1], "s--", f"predicted, {model}"))
    heights = star_heights(places, float(x[-1] - x[0]))
    for place, height, colour in zip(places, heights, colours, strict=True):
        if place is not None and height is not None:
            # A legend finds its place by vertices alone: those above and below keep it off the star.
            around = [height - STEP, height, height + STEP]
            axes.plot([place] * 3, around, "*", markevery=[1], color=colour, ms=14, mec="white", zorder=5)
    axes.set_xlabel(AXIS_NAMES.get(result.configurations[0].parameter, result.configurations[0].parameter))
    axes.set_ylabel("PSS relative to its maximum")
    kind = "single frame: C against triangulation" if single_frame else "filter: P∞ against tracking"
    axes.set_title(f"{kind} (★ optimum)", fontsize=11)
    if selection:
        turned = sum(width_of(label) for label in labels) > LEVEL_WIDTH
        style = {"rotation": 25, "ha": "right", "rotation_mode": "anchor"} if turned else {}
        axes.set_xticks(x, [shortened(label, LONGEST_LABEL) for label in labels], **style)
    top = max((height for height in heights if height is not None), default=1.0)
    axes.set_ylim(bottom=0, top=max(top * ABOVE_OPTIMUM, axes.get_ylim()[1]))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


def _slopes(axes: Axes, result: SweepResult, found: Slopes) -> None:
    """RMS over the steps of a sweep of one factor, each curve relative to its first step, with its slope."""
    x = np.array([float(c.value) for c in result.configurations])
    label = f"measured: slope {found.measured:+.2f}"
    label += f" [{found.low:+.2f}, {found.high:+.2f}]" if np.isfinite(found.low) else ""
    axes.plot(x, found.measured_rms_m / found.measured_rms_m[0], "o-", color=MEASURED, ms=4, lw=1.5, label=label)
    for number, (model, rms) in enumerate(found.predicted_rms_m.items()):
        colour, label = CATEGORIES[number % len(CATEGORIES)], f"{model}: {found.predicted[model]:+.2f}"
        axes.plot(x, rms / rms[0], "s--", color=colour, ms=4, lw=1.5, label=label)
    axes.set(xscale="log", yscale="log", ylabel="RMS relative to the first step")
    axes.set_xlabel(AXIS_NAMES.get(result.configurations[0].parameter, result.configurations[0].parameter))
    axes.set_title(f"single-frame RMS, {found.points} points common to all steps", fontsize=11)
    axes.set_xticks(x, [f"{value:g}" for value in x])
    axes.xaxis.set_minor_formatter(NullFormatter())
    write_round_numbers(axes.yaxis, np.array(axes.get_ylim()))
    axes.grid(alpha=0.3, which="both", lw=0.4)
    axes.legend(fontsize=8)


def _curve(axes: Axes, x: Floats, curve: Trend, colour: str, style: str, name: str) -> float | None:
    """Draw a curve relative to its maximum; where its optimum is, if it has one."""
    pss, highest = curve.values, optimum(curve.values)
    if highest is None:
        axes.plot(x, pss, style, color=colour, ms=4, lw=1.5, label=f"{name} (0 at every step)")
        return None
    scale = pss[highest]
    words = f"{name} ({'flat, ' if curve.flat else ''}max {written(scale, 3)} /m)"
    axes.plot(x, pss / scale, style, color=colour, ms=4, lw=1.5, label=words)
    return None if curve.best is None else float(x[curve.best])


def points_figure(result: SweepResult) -> Figure:
    """Predicted against measured RMS of every point of every configuration, a panel for each noise model."""
    models = result.noise_models
    figure, panels = plt.subplots(1, len(models), figsize=(5.6 * len(models), 5.2), layout="constrained", squeeze=False)
    title = f"{result.plan.sweep.title}: single-frame error of each point"
    figure.suptitle(fill(title, int(TITLE_WIDTH * len(models) / 3)), fontsize=13)
    views = np.concatenate([next(iter(a.predicted.values())).visible.sum(axis=0) for a in result.assessments])
    measured = np.concatenate([a.measured.errors.rms_m for a in result.assessments]) * 1000
    most = int(views.max(initial=2))
    counts = BoundaryNorm(np.arange(1.5, most + 1), 256) if most > 2 else None
    for axes, model in zip(panels[0], models, strict=True):
        predicted = np.concatenate([a.predicted[model].single_frame_rms_m for a in result.assessments]) * 1000
        known = np.isfinite(predicted) & np.isfinite(measured)
        axes.set(xlabel="predicted √tr C in mm", ylabel="measured RMS in mm", title=model)
        if not known.any():  # a configuration of one camera: a logarithmic axis of nothing has no ticks
            axes.text(0.5, 0.5, "no point is observable and measured", ha="center", transform=axes.transAxes)
            continue
        dots = axes.scatter(
            predicted[known], measured[known], c=views[known], s=9, alpha=0.6, cmap="viridis", norm=counts, lw=0
        )
        axes.set(xscale="log", yscale="log")
        axes.grid(alpha=0.3, which="both", lw=0.4)
        for axis, values in ((axes.xaxis, predicted[known]), (axes.yaxis, measured[known])):
            write_round_numbers(axis, values)
        ends = np.array([predicted[known].min(), predicted[known].max()])
        ratio = np.median(measured[known] / predicted[known])
        axes.plot(ends, ends * ratio, color="0.4", lw=1, label=f"measured = {ratio:.3g} × predicted (median)")
        axes.legend(fontsize=8, loc="upper left")
        if counts is not None:
            bar = figure.colorbar(dots, ax=axes, label="views that should see the point", ticks=range(2, most + 1))
            bar.minorticks_off()
    return figure
