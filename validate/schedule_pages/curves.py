"""A schedule report's figure of PSS along the walk: predicted and measured, one strategy or all."""

from __future__ import annotations

from typing import Any

import numpy as np

from pss.hints import Floats
from validate.pages.data import KINDS, Kind
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.style import layout, line_at, model_style
from validate.runs.palette import BLUE, INK
from validate.schedule_pages.tables import ScheduleTable

__all__ = ["walk_columns", "walk_figure"]


AXES = (("y", "where the first avatar is"), ("time", "time"))
SCALES = (("shape", "share of the highest of all runs"), ("size", "1/m"))
SHOWN = (
    ("chosen", "the chosen strategy, predicted and measured"),
    ("measured", "all strategies, measured"),
    ("predicted", "all strategies, predicted"),
)


def walk_figure(table: ScheduleTable, first_avatar: str, second_avatar: str) -> Figure:
    """PSS over the steps of the walk for the chosen strategy, or for all of them."""
    chosen = {"shown": "chosen"}
    x = ref("x|{axis}")
    hover = "%{customdata:,.4r} /m<extra>%{fullData.name}</extra>"
    traces: list[dict[str, Any]] = [
        {
            "when": chosen,
            "type": "scatter",
            "x": ref("band_x|{axis}|{kind}"),
            "y": ref("band|{scale}|{kind}|{strategy}|{zoom_limit}"),
            "fill": "toself",
            "fillcolor": "rgba(26,26,26,0.14)",
            "line": {"width": 0},
            "mode": "lines",
            "hoverinfo": "skip",
            "name": "95 % interval, measured",
        },
        {
            "when": chosen,
            "type": "scatter",
            "mode": "lines+markers",
            "x": x,
            "y": ref("curve|{scale}|{kind}|{model}|{strategy}|{zoom_limit}"),
            "customdata": ref("curve|size|{kind}|{model}|{strategy}|{zoom_limit}"),
            "hovertemplate": hover,
            "name": "predicted",
            "line": {"color": BLUE, "dash": "dash", "width": 2},
            "marker": {"color": BLUE, "symbol": "square", "size": 8},
        },
        {
            "when": chosen,
            "type": "scatter",
            "mode": "lines+markers",
            "x": x,
            "y": ref("curve|{scale}|{kind}|measured|{strategy}|{zoom_limit}"),
            "customdata": ref("curve|size|{kind}|measured|{strategy}|{zoom_limit}"),
            "hovertemplate": hover,
            "name": "measured",
            "line": {"color": INK, "width": 2.5},
            "marker": {"color": INK, "symbol": "circle", "size": 8},
        },
    ]
    for number, strategy in enumerate(table.strategy_names):
        colour, symbol, dash = model_style(number)
        for shown, whose in (("measured", "measured"), ("predicted", "{model}")):
            traces.append(
                {
                    "when": {"shown": shown},
                    "type": "scatter",
                    "mode": "lines+markers",
                    "x": x,
                    "y": ref(f"curve|{{scale}}|{{kind}}|{whose}|{strategy}|{{zoom_limit}}"),
                    "customdata": ref(f"curve|size|{{kind}}|{whose}|{strategy}|{{zoom_limit}}"),
                    "hovertemplate": hover,
                    "name": strategy,
                    "line": {"color": colour, "dash": dash if number else "solid", "width": 1.8},
                    "marker": {"color": colour, "symbol": symbol, "size": 7},
                }
            )
    return Figure(
        "walk",
        "PSS along the walk",
        f"{first_avatar} walks towards greater y, {second_avatar} the other way; they pass each other at y = 0. PSS is "
        "of the markers of both. As a share, predicted and measured are each divided by their highest value of all "
        "runs, so that strategies can be compared and shapes too; in 1/m sizes are as they are (with the paper’s two "
        "readings of R they have no meaning, since that R mixes units). The band is the 95 % interval of what was "
        "measured, of resampled trials and markers; the prediction is computed, not drawn by lot. The dotted line is "
        "the step that the slider shows.",
        "Curves of PSS over the steps of the walk. The verdict above and the tables below give the same in words and "
        "numbers.",
        traces,
        layout(
            {"title": {"text": ref("x_title|{axis}")}},
            {"title": {"text": ref("y_title|{scale}|{kind}")}, "rangemode": "tozero"},
            shapes=[line_at(ref("now|{axis}"))],
            hovermode="x unified",
        ),
        (
            Choice("shown", "Show", SHOWN),
            Choice("axis", "Along", (("y", f"where {first_avatar} is"), AXES[1])),
            Choice("scale", "Scale", SCALES),
        ),
        _columns(table, first_avatar),
        wide=True,
    )


def walk_columns(table: ScheduleTable, step_of_walk: int) -> Columns:
    """Where a step is on the figure's axis."""
    now = {"y": table.y_m[step_of_walk], "time": table.time_s[step_of_walk]}
    return {f"now|{axis}": float(f"{value:.4g}") for axis, value in now.items()}


def _columns(table: ScheduleTable, first_avatar: str) -> Columns:
    x = {"y": table.y_m, "time": table.time_s}
    columns: Columns = {"x_title|y": f"y of {first_avatar} in m", "x_title|time": "time in s"}
    for axis, values in x.items():
        columns[f"x|{axis}"] = plain(np.round(values, 6))
    for kind in KINDS:
        measured, low, high = table.measured(kind)
        of_kind = "σ∞ and filter" if kind.name == "filter" else "single frame"
        columns[f"y_title|shape|{kind.name}"] = f"PSS, share of the highest, {of_kind}"
        columns[f"y_title|size|{kind.name}"] = f"PSS in 1/m, {of_kind}"
        known = bool(np.isfinite(low).all())
        for axis, values in x.items():
            columns[f"band_x|{axis}|{kind.name}"] = plain(np.concatenate([values, values[::-1]])) if known else []
        _add(columns, table, kind, "measured", measured)
        for scale, over in (("shape", _highest(measured)), ("size", 1.0)):
            for number, (strategy, limit) in enumerate(table.runs):
                band = np.concatenate([high[number], low[number, ::-1]]) / over if known else np.zeros(0)
                columns[f"band|{scale}|{kind.name}|{strategy}|{limit}"] = plain(band)
        for model in table.every.models:
            _add(columns, table, kind, model, table.predicted(model, kind))
    return columns


def _add(columns: Columns, table: ScheduleTable, kind: Kind, whose: str, values: Floats) -> None:
    for scale, over in (("shape", _highest(values)), ("size", 1.0)):
        for number, (strategy, limit) in enumerate(table.runs):
            columns[f"curve|{scale}|{kind.name}|{whose}|{strategy}|{limit}"] = plain(values[number] / over)


def _highest(values: Floats) -> float:
    return float(np.nanmax(values)) or 1.0
