"""A report's figures of a sweep's steps and points: PSS over the steps, and predicted against measured per point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from validate.figures import AXIS_NAMES
from validate.report.data import KINDS, MM, Kind, SweepTable
from validate.report.steps import Step
from validate.report.style import GREY, INK, SCALE, layout, model_style, object_styles
from validate.report.traces import Choice, Columns, Figure, plain, ref

__all__ = ["curves_figure", "place", "point_columns", "points_figure", "step_axis"]

# Ends of a logarithmic axis about its data.
ROOM_FOR_AXIS = 1.25
VIEW_SYMBOLS = ("x", "cross", "triangle-up", "square", "pentagon", "hexagon", "star")


def place(table: SweepTable) -> list[float]:
    """Where the steps lie on an axis: at their value, or one after the other."""
    return [float(v) for v in table.values] if table.numeric else [float(n) for n in range(len(table.values))]


def step_axis(table: SweepTable) -> dict[str, Any]:
    """The axis of the steps."""
    axis: dict[str, Any] = {"title": {"text": AXIS_NAMES.get(table.parameter, table.parameter)}}
    if not table.numeric:
        axis |= {"tickvals": place(table), "ticktext": list(table.values)}
    return axis


def curves_figure(table: SweepTable) -> Figure:
    """Predicted and measured PSS over the steps, each curve relative to its maximum; or the RMS error in mm."""
    x, columns = place(table), _curve_columns(table)
    pss, rms = {"quantity": "pss"}, {"quantity": "rms"}
    traces: list[dict[str, Any]] = [
        {"when": pss, "type": "scatter", "x": ref("band_x|{kind}"), "y": ref("band_y|{kind}"), "fill": "toself",
         "fillcolor": "rgba(26,26,26,0.14)", "line": {"width": 0}, "mode": "lines", "hoverinfo": "skip",
         "name": "95 % interval, measured"},
    ]  # fmt: skip
    for number, model in enumerate(table.models):
        colour, symbol, dash = model_style(number)
        style = {"type": "scatter", "mode": "lines+markers", "x": x, "name": f"predicted, {model}",
                 "line": {"color": colour, "dash": dash, "width": 2},
                 "marker": {"color": colour, "symbol": symbol, "size": 8}}  # fmt: skip
        traces.append(
            style | {"when": pss, "y": ref("curve|{kind}|" + model), "customdata": ref("pss|{kind}|" + model),
                     "hovertemplate": "%{customdata:.4g} /m, %{y:.2f} of its maximum"}
        )  # fmt: skip
        traces.append(style | {"when": rms, "y": ref("rms|" + model), "hovertemplate": "%{y:.3g} mm"})
    measured = {"type": "scatter", "mode": "lines+markers", "x": x, "name": "measured",
                "line": {"color": INK, "width": 2.5}, "marker": {"color": INK, "symbol": "circle", "size": 8}}  # fmt: skip
    traces.append(
        measured | {"when": pss, "y": ref("curve|{kind}|measured"), "customdata": ref("pss|{kind}|measured"),
                    "hovertemplate": "%{customdata:.4g} /m, %{y:.2f} of its maximum"}
    )  # fmt: skip
    traces.append(measured | {"when": rms, "y": ref("rms|measured"), "hovertemplate": "%{y:.3g} mm"})
    traces.append(
        {"when": pss, "type": "scatter", "mode": "markers", "x": ref("optima|{kind}"),
         "y": [1.0] * (len(table.models) + 1), "name": "optimum of each", "hoverinfo": "skip",
         "marker": {"symbol": "star", "size": 15, "color": "white", "line": {"color": INK, "width": 1.3}}}
    )  # fmt: skip
    now = {"type": "line", "xref": "x", "yref": "paper", "x0": ref("now"), "x1": ref("now"), "y0": 0, "y1": 1,
           "line": {"color": GREY, "width": 1.5, "dash": "dot"}}  # fmt: skip
    return Figure(
        "curves",
        "What was predicted, and what was measured",
        "Each curve is divided by its own maximum (hover for 1/m), because the paper’s R adds m² to px²: shapes and "
        "optima can be compared, sizes cannot. Stars mark optima, the dotted line the step that the slider shows. The "
        "prediction is computed, not drawn by lot, and has no interval; the measured filter curve has none in the tables. "
        "Where the curves rise and fall together, the metric ranks the steps as the measurement does. “RMS error” "
        f"takes the {int(table.steps[table.models[0]]['common_points'][0])} points that every step measured, in mm.",
        "Curves over the steps of the sweep: predicted by each noise model, and measured with its 95 % interval. The "
        "verdict above and the table of steps below give the same in words and numbers.",
        traces,
        layout(
            step_axis(table),
            {"title": {"text": ref("y_title|{quantity}")}, "type": ref("y_type|{quantity}"),
             "rangemode": "tozero"},
            shapes=[now],
            hovermode="x unified",
        ),
        (Choice("quantity", "Quantity", (("pss", "PSS"), ("rms", "RMS error"))),),
        columns,
    )  # fmt: skip


def _curve_columns(table: SweepTable) -> Columns:
    columns: Columns = {
        "y_title|pss": "PSS relative to its maximum",
        "y_title|rms": "single-frame RMS error in mm",
        "y_type|pss": "linear",
        "y_type|rms": "log",
        "rms|measured": plain(table.steps[table.models[0]]["measured_rms_common_m"] * MM),
    }
    x = place(table)
    for kind in KINDS:
        measured = table.measured_pss(kind)
        scale = _largest(measured.values)
        best = [x[measured.best]]
        columns[f"curve|{kind.name}|measured"] = plain(measured.values / scale)
        columns[f"pss|{kind.name}|measured"] = plain(measured.values)
        known = bool(np.isfinite(measured.low).all())
        columns[f"band_x|{kind.name}"] = [*x, *reversed(x)] if known else []
        columns[f"band_y|{kind.name}"] = (
            plain(np.concatenate([measured.high, measured.low[::-1]]) / scale) if known else []
        )
        for model in table.models:
            predicted = table.predicted_pss(model, kind)
            columns[f"curve|{kind.name}|{model}"] = plain(predicted.values / _largest(predicted.values))
            columns[f"pss|{kind.name}|{model}"] = plain(predicted.values)
            best.append(x[predicted.best])
        columns[f"optima|{kind.name}"] = best
    for model in table.models:
        columns[f"rms|{model}"] = plain(table.steps[model]["predicted_rms_common_m"] * MM)
    return columns


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(values)) or 1.0


def points_figure(table: SweepTable) -> Figure:
    """Predicted against measured σ of each point at the slider's step, before those of all steps."""
    columns: Columns = {}
    for kind in KINDS:
        measured = table.measured_mm(kind)
        for model in table.models:
            _point_summary(columns, kind, model, table.predicted_mm(model, kind), measured)
    cloud = {"type": "scatter", "mode": "markers", "x": ref("cloud_x|{kind}|{model}"), "y": ref("cloud_y|{kind}|{model}"),
             "marker": {"color": "#c9c9c9", "size": 4}, "hoverinfo": "skip", "name": "all steps"}  # fmt: skip
    line = {"type": "scatter", "mode": "lines", "x": ref("line_x|{kind}|{model}"), "hoverinfo": "skip"}
    traces: list[dict[str, Any]] = [
        cloud,
        line | {"y": ref("line_x|{kind}|{model}"), "name": "as predicted", "line": {"color": INK, "width": 1.5}},
        line | {"y": ref("line_y|{kind}|{model}"), "name": ref("ratio_name|{kind}|{model}"),
                "line": {"color": GREY, "width": 1.5, "dash": "dash"}},
    ]  # fmt: skip
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
            {"when": {"colour": "object"}, "type": "scatter", "mode": "markers", "x": [None], "y": [None], "name": name,
             "marker": {"color": colour, "symbol": symbol, "size": 9}}
        )  # fmt: skip
    bar = {"thickness": 12, "outlinewidth": 0}
    traces += [
        point | {"when": {"colour": "object"}, "marker": {
            "color": ref("object_colours"), "symbol": ref("object_symbols"), "size": 9, "line": edge}},
        point | {"when": {"colour": "views"}, "marker": {
            "color": ref("views"), "symbol": ref("view_symbols"), "size": 9, "line": edge, "colorscale": SCALE,
            "cmin": 2, "cmax": max(3, _most_views(table)), "colorbar": bar | {"title": {"text": "cameras"}, "dtick": 1}}},
        point | {"when": {"colour": "blur"}, "marker": {
            "color": ref("blur"), "size": 9, "line": edge, "colorscale": SCALE, "cmin": 0, "cmax": ref("most_blur"),
            "colorbar": bar | {"title": {"text": "blur in px"}}}},
    ]  # fmt: skip
    return Figure(
        "points",
        "Point by point",
        "Each sign is a marker at the slider’s step, grey dots are those of all steps. On the solid line the error is as "
        "large as predicted; the dashed line is the median ratio of all steps. A scatter along a line says that the metric "
        "knows which points are hard; a line away from the solid one says that it is wrong by a factor. Points that are "
        "not observable, or were never triangulated, have no place here: see the error budget.",
        "Scatter of predicted against measured σ of every marker, on logarithmic axes in millimetres.",
        traces,
        layout(
            {"type": "log", "title": {"text": ref("x_title|{kind}")}, "range": ref("range_x|{kind}|{model}")},
            {"type": "log", "title": {"text": ref("y_title|{kind}")}, "range": ref("range_y|{kind}|{model}")},
        ),
        (Choice("colour", "Colour and sign", (("object", "object"), ("views", "cameras"), ("blur", "blur"))),),
        columns | {f"x_title|{kind.name}": f"predicted {kind.symbol} in mm" for kind in KINDS}
        | {f"y_title|{kind.name}": "measured √λmax in mm" for kind in KINDS},
        height_px=440,
    )  # fmt: skip


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
    columns[f"ratio_name|{name}"] = f"measured = {ratio:.3g} × predicted (median)"
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
