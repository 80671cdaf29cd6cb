"""Figure 4: two moments of strategy (1) in space above, and PSS against where the first person is below."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pss.hints import Row
from validate.plots.print_style import WIDTH_IN, for_print, print_colour_scale
from validate.plots.projected import Eye
from validate.plots.room3d import SIGNS, draw_configuration, shared_colours
from validate.plots.schedule import PANELS, draw_panel, key_lines
from validate.runs.palette import CATEGORIES
from validate.schedule.results import KINDS, ScheduleResult
from validate.schedule.runs import limit_name
from validate.stats.intervals import interval

__all__ = ["moments", "walk_figure", "walk_rows"]


HEIGHT_IN = 6.2
# The paper's moments: where the first person is, m along the hallway.
MOMENTS_Y_M = (-2.0, 2.0)
# The arrow of a person's heading: m, from half a metre over the head.
ARROW_M, OVER_HEAD_M, ABOVE_ARROW_M = 1.0, 0.35, 0.15
ELEVATION_DEG, AZIMUTH_DEG = 28.0, 25.0
# The paper's PSS is made of σ∞.
KIND = KINDS[0]


def moments(result: ScheduleResult) -> tuple[int, int]:
    """Numbers of the two steps at which the first person is nearest to the paper's places."""
    y = np.array([float(c.value) for c in result.configurations[: result.shape[1]]])
    first, second = (int(np.abs(y - place).argmin()) for place in MOMENTS_Y_M)
    return first, second


def walk_figure(result: ScheduleResult) -> Figure:
    """The paper's Figure 4 from a schedule's result of both people."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=[1.1, 1])
    runs, steps = result.held.design.runs, result.shape[1]
    run = next(n for n, each in enumerate(runs) if each.strategy in PANELS[0] and each.zoom_limit is None)
    shown = [run * steps + step for step in moments(result)]
    norm = shared_colours(result, shown)
    tops = []
    for column, number in enumerate(shown, start=1):
        axes = above.add_subplot(1, 2, column)
        followed = _followed(result, number)
        eye = draw_configuration(axes, result, number, norm, followed, ELEVATION_DEG, AZIMUTH_DEG)
        _arrows(axes, result, number, eye)
        where = f"{result.configurations[number].value:.1f} m".replace("-", "−")
        axes.set_title(f"strategy (1), y of {result.held.design.stage.names[0]} = {where}")
        for_print(axes)
        tops.append(axes)
    print_colour_scale(above, tops, norm, result.shown_model)
    panels = below.subplots(1, 2, sharey=True)
    for axes, strategies in zip(panels, PANELS, strict=True):
        draw_panel(axes, result, list(strategies), KIND)
        axes.set_xlabel(f"y of {result.held.design.stage.names[0]} in m")
        axes.legend()
        for_print(axes)
    panels[0].set_ylim(bottom=0)
    panels[0].set_ylabel("PSS in 1/mm, σ∞ and filter")
    below.legend(handles=key_lines(result), loc="outside lower center", ncols=3, frameon=False, fontsize=6.5)
    return figure


def _followed(result: ScheduleResult, number: int) -> dict[str, str]:
    """The colour of the person that each camera follows, by the camera's name."""
    run, step = divmod(number, result.shape[1])
    names = result.held.design.stage.names
    assigned = result.held.design.runs[run].steered.assignments[step]
    cameras = result.configurations[number].cameras
    return {
        camera.name: CATEGORIES[names.index(name)]
        for camera, name in zip(cameras, assigned, strict=True)
        if name in names
    }


def _arrows(axes: Axes, result: ScheduleResult, number: int, eye: Eye) -> None:
    """Where each person walks, over its head."""
    design = result.held.design
    step = number % result.shape[1]
    ahead = min(step, result.shape[1] - 2)
    for order, name in enumerate(design.stage.names):
        way = design.stage.walk.positions_m[name]
        walked = way[ahead + 1] - way[ahead]
        top = max(
            marker.centre_m[2]
            for marker in result.configurations[number].scene.state.markers
            if marker.object_name == name
        )
        start = np.array([*way[step][:2], top + OVER_HEAD_M])
        arrow = ARROW_M * walked / np.linalg.norm(walked)
        colour = CATEGORIES[order]
        tail, head = eye.flat(np.array([start, start + arrow]))
        line = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", head, tail, arrowprops=line, zorder=SIGNS)
        above = eye.flat(start + (0, 0, ABOVE_ARROW_M))
        axes.text(*above, name, color=colour, ha="center", zorder=SIGNS)


def walk_rows(result: ScheduleResult) -> list[Row]:
    """What the figure's curves show, of both kinds of PSS: a row for each run, step and kind, in 1/m."""
    rows: list[Row] = []
    runs, steps = result.held.design.runs, result.shape[1]
    papers = [name for panel in PANELS for name in panel]
    for kind in KINDS:
        measured = result.curves["", kind]
        low, high = interval(measured.samples)
        for number, run in enumerate(runs):
            if run.strategy not in papers:
                continue
            for step in range(steps):
                rows.append(
                    {
                        "figure": 4,
                        "strategy": run.strategy,
                        "zoom_limit": limit_name(run.zoom_limit),
                        "y_m": float(result.configurations[step].value),
                        "kind": kind,
                        "measured_pss": measured.values[number, step],
                        "measured_pss_ci_low": low[number, step],
                        "measured_pss_ci_high": high[number, step],
                        **{
                            f"pss_{model}": result.curves[model, kind].values[number, step]
                            for model in result.noise_models
                        },
                    }
                )
    return rows
