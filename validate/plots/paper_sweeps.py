"""Figures 1 to 3: two steps of a sweep in space above, with one colour scale, and PSS over all its steps below."""

from __future__ import annotations

from matplotlib.figure import Figure

from pss.hints import Row
from validate.plots.print_style import WIDTH_IN, for_print, print_colour_scale
from validate.plots.room3d import draw_configuration, shared_colours
from validate.plots.sweep import draw_curves
from validate.stats.intervals import interval
from validate.sweeps.sweep import SweepResult

__all__ = ["SWEEPS", "shown_steps", "static_figure", "static_rows"]


SWEEPS = {1: "zoom", 2: "focus", 3: "selection"}
"""The sweep of each of the paper's figures of static scenes."""
# The steps that the paper illustrates, by label.
ILLUSTRATED = {
    1: ("zoom=4", "zoom=7"),
    2: ("focus_distance_m=2", "focus_distance_m=5"),
    3: ("1+3", "1+6"),
}
TITLES = {"zoom=": "zoom ×", "focus_distance_m=": "focus at "}
HEIGHT_IN = 5.2


def shown_steps(number: int, labels: list[str]) -> tuple[int, int]:
    """The two steps that are illustrated: the paper's if the sweep has them, else one early and the last."""
    if all(label in labels for label in ILLUSTRATED[number]):
        first, second = (labels.index(label) for label in ILLUSTRATED[number])
        return first, second
    return len(labels) // 4, len(labels) - 1


def static_figure(number: int, result: SweepResult) -> Figure:
    """One of Figures 1 to 3 of the paper from a sweep's result."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=[1.25, 1])
    shown = shown_steps(number, [configuration.label for configuration in result.configurations])
    norm = shared_colours(result, shown)
    tops = []
    for column, step in enumerate(shown):
        axes = figure.add_subplot(grid[0, column])
        draw_configuration(axes, result, step, norm)
        axes.set_title(_title(result, step), pad=0)
        for_print(axes)
        tops.append(axes)
    print_colour_scale(figure, tops, norm, result.shown_model)
    for column, single_frame in enumerate((True, False)):
        axes = figure.add_subplot(grid[1, column])
        draw_curves(axes, result, single_frame)
        for_print(axes)
    return figure


def _title(result: SweepResult, step: int) -> str:
    label = result.configurations[step].label
    for before, after in TITLES.items():
        if label.startswith(before):
            label = label.replace(before, after) + (" m" if "focus" in before else "")
    if result.configurations[step].parameter == "selection":
        label = f"cameras {label}"
    pss = result.assessments[step].predicted[result.shown_model].pss_single_frame
    return f"{label}, PSS of C {pss:,.0f} /m"


def static_rows(number: int, result: SweepResult) -> list[Row]:
    """What the figure's curves show: a row for each step and kind of PSS, in 1/m."""
    low, high = interval(next(iter(result.replicates.values())).measured_pss)
    rows: list[Row] = []
    for single_frame in (True, False):
        measured = result.measured_pss(single_frame)
        predicted = {model: result.predicted_pss(model, single_frame) for model in result.noise_models}
        for step, configuration in enumerate(result.configurations):
            rows.append(
                {
                    "figure": number,
                    configuration.parameter: configuration.value,
                    "kind": "single frame" if single_frame else "filter",
                    "measured_pss": measured[step],
                    "measured_pss_ci_low": low[step] if single_frame else float("nan"),
                    "measured_pss_ci_high": high[step] if single_frame else float("nan"),
                    **{f"pss_{model}": float(values[step]) for model, values in predicted.items()},
                }
            )
    return rows
