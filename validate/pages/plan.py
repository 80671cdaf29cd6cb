"""A report's plan of the markers of a scene that is measured as it is: each marker's error in mm, seen from above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pss.hints import Floats
from validate.pages.data import MM, SweepTable
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.steps import Step
from validate.pages.style import SCALE, layout
from validate.prediction.frusta import room_corners
from validate.runs.palette import GREY, INK, OUTLINE, PURPLE_ORANGE
from validate.stats.log_ticks import round_numbers

__all__ = ["plan_figure"]


# Which of x, y, z points right and up.
SEEN = {"above": (0, 1), "y": (0, 2), "x": (1, 2)}
QUANTITIES = (("measured", "measured RMS"), ("predicted", "predicted √tr C"), ("ratio", "measured / predicted"))
# Ratios of 1/4 and 4 are the ends of their colours.
MOST_RATIO = 4.0
# Beyond the smallest and the largest error, so that equal ones have a scale.
ROOM = 1.1


def plan_figure(table: SweepTable, steps: Sequence[Step]) -> Figure:
    """The markers of the first step, coloured by what is chosen; those without a number are open."""
    (step, *_), columns = steps, dict[str, Any]()
    points = table.points[table.models[0]]
    measured = points["measured_rms_m"][0] * MM
    for model in table.models:
        predicted = table.points[model]["single_frame_rms_m"][0] * MM
        with np.errstate(divide="ignore", invalid="ignore"):
            of = {"measured": measured, "predicted": predicted, "ratio": measured / predicted}
        for name, values in of.items():
            columns |= _coloured(table, f"{name}|{model}", values, of, name == "ratio")
    places = np.column_stack([points[f"{axis}_m"][0] for axis in "xyz"])
    cameras = np.array([camera.position_m for camera in step.cameras])
    low, high = room_corners(step.state.room)
    for name, (right, up) in SEEN.items():
        corners = np.array([low, high])[[[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], [right, up]]
        for what, where in (("plan", places[:, [right, up]]), ("room", corners), ("cameras", cameras[:, [right, up]])):
            columns |= {f"{what}_{axis}|{name}": plain(where[:, n]) for n, axis in enumerate("xy")}
        columns |= {f"plan_{side}_title|{name}": f"{'xyz'[axis]} in m" for side, axis in (("x", right), ("y", up))}
    traces: list[dict[str, Any]] = [
        {
            "type": "scatter",
            "mode": "lines",
            "x": ref("room_x|{seen}"),
            "y": ref("room_y|{seen}"),
            "line": {"color": GREY, "width": 1.5},
            "hoverinfo": "skip",
            "showlegend": False,
        },
        {
            "type": "scatter",
            "mode": "markers+text",
            "x": ref("cameras_x|{seen}"),
            "y": ref("cameras_y|{seen}"),
            "text": [camera.name for camera in step.cameras],
            "textposition": "top center",
            "marker": {"symbol": "triangle-down", "size": 11, "color": INK},
            "name": "cameras",
            "hovertemplate": "camera %{text}<extra></extra>",
        },
        {
            "type": "scatter",
            "mode": "markers",
            "x": ref("plan_x|{seen}"),
            "y": ref("plan_y|{seen}"),
            "text": ref("plan_words|{quantity}|{model}"),
            "hovertemplate": "%{text}<extra></extra>",
            "showlegend": False,
            "marker": {
                "size": 11,
                "symbol": ref("plan_signs|{quantity}|{model}"),
                "color": ref("plan_colours|{quantity}|{model}"),
                "cmin": ref("plan_low|{quantity}|{model}"),
                "cmax": ref("plan_high|{quantity}|{model}"),
                "colorscale": ref("plan_scale|{quantity}|{model}"),
                "reversescale": ref("plan_reversed|{quantity}"),
                "line": {"width": 1, "color": OUTLINE},
                "colorbar": {
                    "title": {"text": ref("plan_title|{quantity}"), "side": "right"},
                    "tickvals": ref("plan_ticks|{quantity}|{model}"),
                    "ticktext": ref("plan_tick_words|{quantity}|{model}"),
                    "thickness": 12,
                    "outlinewidth": 0,
                },
            },
        },
    ]
    titles = {"measured": "mm", "predicted": "mm", "ratio": "measured / predicted"}
    return Figure(
        "plan",
        "Where the error is large",
        "The room from above, or along y or x: each sign is a marker with its single-frame error in mm, bright where "
        "it is small; triangles are cameras. Open circles have no number: never triangulated, or not observable by the "
        "prediction. Markers on a wall lie over each other from above.",
        "The markers in the room, coloured by error; the table of markers below gives the same in numbers.",
        traces,
        layout(
            {"title": {"text": ref("plan_x_title|{seen}")}, "constrain": "domain"},
            {"title": {"text": ref("plan_y_title|{seen}")}, "scaleanchor": "x", "constrain": "domain"},
            hovermode="closest",
        ),
        (
            Choice("quantity", "Colour", QUANTITIES),
            Choice("seen", "Seen", (("above", "from above"), ("y", "along y"), ("x", "along x"))),
        ),
        columns
        | {f"plan_title|{name}": words for name, words in titles.items()}
        | {f"plan_reversed|{name}": name != "ratio" for name in titles},
        height_px=440,
    )


def _coloured(table: SweepTable, name: str, values: Floats, of: dict[str, Floats], is_ratio: bool) -> Columns:
    """Colours, scale and words of one quantity."""
    known = np.isfinite(values) & (values > 0)
    chosen = values[known]
    low, high = (float(chosen.min()) / ROOM, float(chosen.max()) * ROOM) if len(chosen) else (0.5, 2.0)
    if is_ratio:
        low, high = 1 / MOST_RATIO, MOST_RATIO
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.where(known, np.log10(values), np.nan)
    ticks = [0.25, 0.5, 1, 2, 4] if is_ratio else round_numbers(low, high)
    words = [
        f"marker {point} on {where}: " + ", ".join(f"{what} {_text(numbers[n])}" for what, numbers in of.items())
        for n, (point, where) in enumerate(zip(table.point_ids, table.objects, strict=True))
    ]
    return {
        f"plan_colours|{name}": plain(np.where(known, logs, np.log10(low))),
        f"plan_signs|{name}": ["circle" if there else "circle-open" for there in known],
        f"plan_low|{name}": float(np.log10(low)),
        f"plan_high|{name}": float(np.log10(high)),
        f"plan_scale|{name}": PURPLE_ORANGE if is_ratio else SCALE,
        f"plan_ticks|{name}": plain(np.log10(np.array(ticks, dtype=float))),
        f"plan_tick_words|{name}": [f"{tick:g}" for tick in ticks],
        f"plan_words|{name}": words,
    }


def _text(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "none"
