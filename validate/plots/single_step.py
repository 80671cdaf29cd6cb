"""The figure of a scene measured as it is: the scene in space, its markers from above, and the error of each in mm."""

from __future__ import annotations

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from validate.plots.drawing import plt
from validate.plots.room3d import COLOUR_MAP, colour_scale, draw_configuration, shared_colours
from validate.plots.style import TITLE_WIDTH, write_round_numbers
from validate.runs.palette import CATEGORIES, MEASURED
from validate.sweeps.sweep import SweepResult

__all__ = ["draw_errors", "measurement_figure"]


MM = 1000.0
# Numbers of markers that have room below an axis.
MOST_NUMBERS = 30


def measurement_figure(result: SweepResult) -> Figure:
    """Predicted σ in space and measured errors from above; below, the error of each marker beside its predictions."""
    figure = plt.figure(figsize=(12, 10), layout="constrained")
    figure.suptitle(fill(result.plan.sweep.title, TITLE_WIDTH), fontsize=15)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.05, 1])
    norm = shared_colours(result, [0])
    space = figure.add_subplot(grid[0, 0])
    draw_configuration(space, result, 0, norm)
    space.set_title("predicted √λmax of C", fontsize=11)
    colour_scale(figure, [space], norm, shrink=0.7, pad=0.02, aspect=30).set_label(f"mm ({result.shown_model})")
    draw_plan(figure.add_subplot(grid[0, 1]), result)
    draw_errors(figure.add_subplot(grid[1, :]), result)
    return figure


def draw_plan(axes: Axes, result: SweepResult) -> None:
    """The room from above: markers by measured RMS, open where they were never triangulated, and the cameras."""
    (configuration,), errors = result.configurations, result.assessments[0].measured.errors
    state = configuration.scene.state
    places, rms = np.array([marker.centre_m for marker in state.markers]), errors.rms_m * MM
    known = np.isfinite(rms)
    axes.scatter(*places[~known, :2].T, s=26, facecolors="none", edgecolors="0.4", label="not triangulated")
    if known.any():
        norm = LogNorm(rms[known].min() / 1.01, rms[known].max() * 1.01)
        dots = axes.scatter(*places[known, :2].T, c=rms[known], s=26, cmap=COLOUR_MAP, norm=norm, ec="0.3", lw=0.3)
        bar = axes.figure.colorbar(dots, ax=axes, shrink=0.7, pad=0.02, aspect=30, label="mm")
        write_round_numbers(bar.ax.yaxis, rms[known])
    for camera in configuration.cameras:
        x, y, _ = camera.position_m
        axes.plot(x, y, "v", color=CATEGORIES[0], ms=7)
        axes.annotate(camera.name, (x, y), (0, 5), textcoords="offset points", ha="center", fontsize=9)
    half = state.room.width_m / 2, state.room.length_m / 2
    axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal", xlabel="x in m", ylabel="y in m")
    axes.set_title("measured RMS, from above", fontsize=11)
    if not known.all():
        axes.legend(fontsize=8)


def draw_errors(axes: Axes, result: SweepResult) -> None:
    """The error in mm of each marker, measured and predicted, by object; markers that were not found have none."""
    (assessment,), markers = result.assessments, result.configurations[0].scene.state.markers
    order = sorted(range(len(markers)), key=lambda n: (markers[n].object_name, markers[n].id))
    x, drawn = np.arange(len(markers)), []
    for number, model in enumerate(result.noise_models):
        drawn.append(assessment.predicted[model].single_frame_rms_m[order] * MM)
        colour = CATEGORIES[number % len(CATEGORIES)]
        axes.plot(x, drawn[-1], "s", label=f"predicted √tr C, {model}", color=colour, ms=4, mfc="none")
    drawn.append(assessment.measured.errors.rms_m[order] * MM)
    axes.plot(x, drawn[-1], "o", color=MEASURED, ms=4, label="measured RMS")
    names = [markers[n].object_name for n in order]
    for name in dict.fromkeys(names):
        first, count = names.index(name), names.count(name)
        axes.axvline(first - 0.5, color="0.7", lw=0.8)
        axes.text(first + count / 2 - 0.5, 1.01, name, transform=axes.get_xaxis_transform(), ha="center", fontsize=9)
    step = -(-len(markers) // MOST_NUMBERS)
    axes.set_xticks(x[::step], [str(markers[n].id) for n in order[::step]], fontsize=8)
    axes.set(xlabel="marker", ylabel="single-frame error in mm")
    values = np.concatenate(drawn)
    values = values[np.isfinite(values) & (values > 0)]
    if len(values):
        axes.set_yscale("log")
        write_round_numbers(axes.yaxis, values)
    axes.grid(alpha=0.3, axis="y")
    axes.legend(fontsize=8)
