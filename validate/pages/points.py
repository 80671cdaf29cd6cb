"""A report's figure of single points: predicted against measured σ of each, by object, cameras or blur."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from validate.pages.curves import place
from validate.pages.data import KINDS, Kind, SweepTable
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.steps import Step
from validate.pages.style import LOG_AXIS, SCALE, layout, object_styles
from validate.runs.palette import GREY, INK, OTHER_POINTS

__all__ = ["point_columns", "points_figure"]

# Ends of a logarithmic axis about its data.
ROOM_FOR_AXIS = 1.25
VIEW_SYMBOLS = ("x", "cross", "triangle-up", "square", "pentagon", "hexagon", "star")


def points_figure(table: SweepTable) -> Figure:
    """Predicted against measured σ of each point at the slider's step, before those of all steps."""
    columns: Columns = {}
    for kind in KINDS:
        measured = table.measured_mm(kind)
        for model in table.models:
            _point_summary(columns, kind, model, table.predicted_mm(model, kind), measured)
    cloud = {
        "type": "scatter",
        "mode": "markers",
        "x": ref("cloud_x|{kind}|{model}"),
        "y": ref("cloud_y|{kind}|{model}"),
        "marker": {"color": OTHER_POINTS, "size": 4},
        "hoverinfo": "skip",
        "name": "all steps",
    }
    line = {"type": "scatter", "mode": "lines", "x": ref("line_x|{kind}|{model}"), "hoverinfo": "skip"}
    traces: list[dict[str, Any]] = [
        cloud,
        line | {"y": ref("line_x|{kind}|{model}"), "name": "as predicted", "line": {"color": INK, "width": 1.5}},
        line
        | {
            "y": ref("line_y|{kind}|{model}"),
            "name": ref("ratio_name|{kind}|{model}"),
            "line": {"color": GREY, "width": 1.5, "dash": "dash"},
        },
    ]
    point = {
        "type": "scatter",
        "mode": "markers",
        "x": ref("predicted|{kind}|{model}"),
        "y": ref("measured|{kind}"),
        "customdata": ref("about"),
        "text": ref("nees|{model}"),
        "showlegend": False,
        "hovertemplate": (
            "marker %{customdata[0]} on %{customdata[1]}<br>predicted %{x:.3g} mm, measured %{y:.3g} mm<br>"
            "%{customdata[2]} cameras should see it, found in %{customdata[3]:.0%} of the trials<br>"
            "blur %{customdata[4]:.2g} px in the mean, NEES/3 %{text:.2g}<extra></extra>"
        ),
    }
    edge = {"width": 0.5, "color": "white"}
    for name, (colour, symbol) in object_styles(table.objects).items():
        traces.append(
            {
                "when": {"colour": "object"},
                "type": "scatter",
                "mode": "markers",
                "x": [None],
                "y": [None],
                "name": name,
                "marker": {"color": colour, "symbol": symbol, "size": 9},
            }
        )
    bar = {"thickness": 12, "outlinewidth": 0}
    traces += [
        point
        | {
            "when": {"colour": "object"},
            "marker": {"color": ref("object_colours"), "symbol": ref("object_symbols"), "size": 9, "line": edge},
        },
        point
        | {
            "when": {"colour": "views"},
            "marker": {
                "color": ref("views"),
                "symbol": ref("view_symbols"),
                "size": 9,
                "line": edge,
                "colorscale": SCALE,
                "cmin": 2,
                "cmax": max(3, _most_views(table)),
                "colorbar": bar | {"title": {"text": "cameras"}, "dtick": 1},
            },
        },
        point
        | {
            "when": {"colour": "blur"},
            "marker": {
                "color": ref("blur"),
                "size": 9,
                "line": edge,
                "colorscale": SCALE,
                "cmin": 0,
                "cmax": ref("most_blur"),
                "colorbar": bar | {"title": {"text": "blur in px"}},
            },
        },
    ]
    return Figure(
        "points",
        "Point by point",
        "Each sign is a marker at the slider’s step, grey dots are those of all steps. On the solid line the error is "
        "as large as predicted; the dashed line is the median ratio of all steps. A scatter along a line shows that "
        "the metric predicts which points are hard; a line away from the solid one shows that it is wrong by a factor. "
        "Points that are not observable, or were never triangulated, have no place here: see the error budget.",
        "Scatter of predicted against measured σ of every marker, on logarithmic axes in millimetres.",
        traces,
        layout(
            LOG_AXIS | {"title": {"text": ref("x_title|{kind}")}, "range": ref("range_x|{kind}|{model}")},
            LOG_AXIS | {"title": {"text": ref("y_title|{kind}")}, "range": ref("range_y|{kind}|{model}")},
        ),
        (Choice("colour", "Colour and sign", (("object", "object"), ("views", "cameras"), ("blur", "blur"))),),
        columns
        | {f"x_title|{kind.name}": f"predicted {kind.symbol} in mm" for kind in KINDS}
        | {f"y_title|{kind.name}": "measured √λmax in mm" for kind in KINDS},
        height_px=440,
    )


def _most_views(table: SweepTable) -> int:
    return int(np.nanmax(table.points[table.models[0]]["views"]))


def _point_summary(columns: Columns, kind: Kind, model: str, predicted: np.ndarray, measured: np.ndarray) -> None:
    """Cloud, lines and ranges of one kind and noise model."""
    name = f"{kind.name}|{model}"
    known = np.isfinite(predicted) & np.isfinite(measured) & (measured > 0)
    x, y = predicted[known], measured[known]
    columns[f"cloud_x|{name}"], columns[f"cloud_y|{name}"] = plain(x, 3), plain(y, 3)
    if not len(x):
        columns |= {f"line_x|{name}": [], f"line_y|{name}": [], f"ratio_name|{name}": "no point has both"}
        columns |= {f"range_x|{name}": [-1, 1], f"range_y|{name}": [-1, 1]}
        return
    ratio, ends = float(np.median(y / x)), np.array([x.min(), x.max()])
    columns[f"line_x|{name}"], columns[f"line_y|{name}"] = plain(ends), plain(ends * ratio)
    columns[f"ratio_name|{name}"] = f"median ratio {ratio:.3g}"
    for axis, values in (("x", x), ("y", y)):
        columns[f"range_{axis}|{name}"] = plain(np.log10([values.min() / ROOM_FOR_AXIS, values.max() * ROOM_FOR_AXIS]))


def point_columns(table: SweepTable, steps: Sequence[Step]) -> list[Columns]:
    """What each step's points are: predictions, measurements, and what they may be coloured by."""
    styles = object_styles(table.objects)
    x = place(table)
    most = max((float(np.nanmax(step.blur_px, initial=0)) for step in steps), default=0.0)
    filled = []
    for number, step in enumerate(steps):
        views = table.points[table.models[0]]["views"][number].astype(int)
        rate = table.points[table.models[0]]["detection_rate"][number]
        blur = plain(step.blur_px, 3)
        about = zip(table.point_ids, table.objects, views.tolist(), plain(rate), blur, strict=True)
        columns: Columns = {
            "now": x[number],
            "about": [list(row) for row in about],
            "object_colours": [styles[name][0] for name in table.objects],
            "object_symbols": [styles[name][1] for name in table.objects],
            "views": views.tolist(),
            "view_symbols": [VIEW_SYMBOLS[min(count, len(VIEW_SYMBOLS)) - 1] for count in views],
            "blur": blur,
            "most_blur": round(most, 1),
        }
        for kind in KINDS:
            columns[f"measured|{kind.name}"] = plain(table.measured_mm(kind)[number])
            for model in table.models:
                columns[f"predicted|{kind.name}|{model}"] = plain(table.predicted_mm(model, kind)[number])
        for model in table.models:
            columns[f"nees|{model}"] = plain(table.nees_share(model)[number], 3)
        filled.append(columns)
    return filled
