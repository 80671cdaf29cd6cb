"""A report's figure of a sweep's steps: predicted and measured PSS over them, or the RMS error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from validate.pages.data import KINDS, MM, Curve, SweepTable
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.style import INK, LOG_AXIS, NUMBERS, layout, line_at, model_style
from validate.runs.axis_names import AXIS_NAMES
from validate.stats.stars import star_heights

__all__ = ["curves_figure", "place", "step_axis"]


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
        {
            "when": pss,
            "type": "scatter",
            "x": ref("band_x|{kind}"),
            "y": ref("band_y|{kind}"),
            "fill": "toself",
            "fillcolor": "rgba(26,26,26,0.14)",
            "line": {"width": 0},
            "mode": "lines",
            "hoverinfo": "skip",
            "name": "95 % interval, measured",
        },
    ]
    for number, model in enumerate(table.models):
        colour, symbol, dash = model_style(number)
        style = {
            "type": "scatter",
            "mode": "lines+markers",
            "x": x,
            "name": f"predicted, {model}",
            "line": {"color": colour, "dash": dash, "width": 2},
            "marker": {"color": colour, "symbol": symbol, "size": 8},
        }
        traces.append(
            style
            | {
                "when": pss,
                "y": ref("curve|{kind}|" + model),
                "customdata": ref("pss|{kind}|" + model),
                "hovertemplate": "%{customdata:,.4r} /m, %{y:.2f} of its maximum",
            }
        )
        traces.append(style | {"when": rms, "y": ref("rms|" + model), "hovertemplate": "%{y:.3g} mm"})
    measured = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": x,
        "name": "measured",
        "line": {"color": INK, "width": 2.5},
        "marker": {"color": INK, "symbol": "circle", "size": 8},
    }
    traces.append(
        measured
        | {
            "when": pss,
            "y": ref("curve|{kind}|measured"),
            "customdata": ref("pss|{kind}|measured"),
            "hovertemplate": "%{customdata:,.4r} /m, %{y:.2f} of its maximum",
        }
    )
    traces.append(measured | {"when": rms, "y": ref("rms|measured"), "hovertemplate": "%{y:.3g} mm"})
    traces.append(
        {
            "when": pss,
            "type": "scatter",
            "mode": "markers",
            "x": ref("optima|{kind}"),
            "y": ref("stars|{kind}"),
            "name": "optimum of each",
            "hoverinfo": "skip",
            "marker": {
                "symbol": "star",
                "size": 14,
                "color": [INK, *(model_style(number)[0] for number in range(len(table.models)))],
                "line": {"color": "white", "width": 1},
            },
        }
    )
    return Figure(
        "curves",
        "What was predicted, and what was measured",
        "Each curve is divided by its own maximum (hover for 1/m), because the paper’s R adds m² to px²: shapes and "
        "optima can be compared, sizes cannot. Stars mark optima, one above the other where curves share one, the "
        "dotted line the step that the slider shows. The prediction is computed, not drawn by lot, and has no "
        "interval; the measured filter curve has none in the tables. Where the curves rise and fall together, the "
        "metric ranks the steps as the measurement does. “RMS "
        f"error” takes the {int(table.steps[table.models[0]]['common_points'][0])} points that every step measured, in "
        "mm.",
        "Curves over the steps of the sweep: predicted by each noise model, and measured with its 95 % interval. The "
        "verdict above and the table of steps below give the same in words and numbers.",
        traces,
        layout(
            step_axis(table),
            {"title": {"text": ref("y_title|{quantity}")}, "type": ref("y_type|{quantity}"), "rangemode": "tozero"}
            | {"tickformat": NUMBERS, "nticks": ref("y_ticks|{quantity}")},
            shapes=[line_at(ref("now"))],
            hovermode="x unified",
        ),
        (Choice("quantity", "Quantity", (("pss", "PSS"), ("rms", "RMS error"))),),
        columns,
    )


def _curve_columns(table: SweepTable) -> Columns:
    columns: Columns = {
        "y_title|pss": "PSS relative to its maximum",
        "y_title|rms": "single-frame RMS error in mm",
        "y_type|pss": "linear",
        "y_type|rms": "log",
        "y_ticks|pss": 8,
        "y_ticks|rms": LOG_AXIS["nticks"],
        "rms|measured": plain(table.steps[table.models[0]]["measured_rms_common_m"] * MM),
    }
    x = place(table)
    for kind in KINDS:
        measured = table.measured_pss(kind)
        scale = _largest(measured.values)
        best = [_place_of(measured, x)]
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
            best.append(_place_of(predicted, x))
        columns[f"optima|{kind.name}"] = best
        columns[f"stars|{kind.name}"] = star_heights(best, x[-1] - x[0])
    for model in table.models:
        columns[f"rms|{model}"] = plain(table.steps[model]["predicted_rms_common_m"] * MM)
    return columns


def _place_of(curve: Curve, x: Sequence[float]) -> float | None:
    """Where a curve's star stands on the axis; None without an optimum."""
    return None if curve.best is None else x[curve.best]


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(values)) or 1.0
