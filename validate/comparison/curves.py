"""A comparison's figures of steps: curves of all sides over their ratios, and predicted against measured ratio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pss.hints import Floats
from validate.comparison.axes import ratio_ticks, side_style
from validate.comparison.series import OWN, Group, Series, leading
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.style import GREY, INK, layout
from validate.runs.axis_names import AXIS_NAMES

__all__ = ["curves_figure", "moved_figure", "pair_choice"]


# Beyond the data of a logarithmic axis.
ROOM_FOR_AXIS = 1.15
# Of the axis of steps: so far apart are the sides at one step, so that no interval hides another.
APART_SHARE = 0.012
# Halves of the figure: curves above, ratios below.
UPPER, LOWER = (0.47, 1.0), (0.0, 0.38)


def pair_choice(group: Group) -> tuple[Choice, Choice]:
    """Of quantity and noise model, for all figures of a group."""
    models = tuple(group.models) or ("",)
    return (
        Choice("pair", "Quantity", tuple((s.pair.name, s.pair.words) for s in group.series), group.series[0].pair.name),
        Choice("model", "Noise model", tuple((m, m or "none") for m in models), leading(models)),
    )


def curves_figure(group: Group, names: Sequence[str]) -> Figure:
    """Measured and predicted over the steps, of all sides; below it their ratios to the first side."""
    x = group.numbers or [float(n) for n in range(len(group.steps))]
    shift = APART_SHARE * (max(x) - min(x) or 1.0)
    columns: Columns = {}
    for series in group.series:
        _fill(columns, series, group)
    traces: list[dict[str, Any]] = []
    one = all(bool(np.isnan(series.measured_ratio).all()) for series in group.series)
    for number, name in enumerate(names):
        colour, symbol, dash = side_style(number)
        at = [value + shift * (number - (len(names) - 1) / 2) for value in x]
        base = {
            "type": "scatter",
            "mode": "lines+markers",
            "x": at,
            "text": list(group.steps),
            "legendgroup": str(number),
        }
        solid = base | {
            "name": "measured" if one else f"{name}, measured",
            "line": {"color": colour, "width": 2.2, "dash": "solid"},
            "marker": {"color": colour, "symbol": symbol, "size": 8},
        }
        dashed = base | {
            "name": f"{name}, predicted",
            "line": {"color": colour, "width": 1.6, "dash": "dot" if number == 0 else dash},
            "marker": {"color": "white", "symbol": symbol, "size": 8, "line": {"color": colour, "width": 1.6}},
        }
        traces += [_drawn(solid, number, "measured", "{pair}"), _drawn(dashed, number, "predicted", "{pair}|{model}")]
        if number:
            below = {"xaxis": "x", "yaxis": "y2", "showlegend": False}
            hover = "%{text}: %{y:.3g} times"
            more = solid | below | {"y": ref(f"ratio{number}|measured|{{pair}}"), "hovertemplate": hover}
            traces.append(more | {"error_y": _error(f"ratio{number}|measured", "{pair}", colour)})
            traces.append(
                dashed | below | {"y": ref(f"ratio{number}|predicted|{{pair}}|{{model}}"), "hovertemplate": hover}
            )
    axis: dict[str, Any] = {"title": {"text": AXIS_NAMES.get(group.parameter, group.parameter)}, "anchor": "y2"}
    if group.numbers is None:
        axis |= {"tickvals": x, "ticktext": list(group.steps)}
    plot = layout(
        axis,
        {
            "title": {"text": "÷ its largest" if one else f"÷ largest of {names[0]}"},
            "domain": list(UPPER),
            "rangemode": "tozero",
        },
        hovermode="closest",
    )
    plot["yaxis2"] = plot["yaxis"] | {
        "domain": list(LOWER),
        "type": "log",
        "rangemode": "normal",
        "tickvals": ref("ticks|{pair}|{model}"),
        "ticktext": ref("tick_words|{pair}|{model}"),
        "title": {"text": f"÷ {names[0]}", "font": {"size": 13}},
    }
    plot["shapes"] = [{"type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": "y2", "y0": 1, "y1": 1} | _LINE]
    return Figure(
        "curves",
        "What was measured and predicted, and how it changed",
        _words(names, one, _own_models(group)),
        "Curves over the steps, of each side measured and predicted, and below them the ratios to "
        f"{names[0]}. The tables below give the same in numbers.",
        traces,
        plot,
        (),
        columns,
        wide=one,
        height_px=600,
    )


def _words(names: Sequence[str], one: bool, own: bool) -> str:
    """The caption: of sides that are `one` measurement, or have their `own` noise models, otherwise."""
    if one:
        return (
            "Above: the solid line with 95 % intervals is what was measured, once for all sides; broken lines with "
            "open signs are predicted. Each is divided by its own largest value: shapes and optima can be compared, "
            f"sizes cannot. Below: each prediction over that of {names[0]}. Where this line is level, the two differ "
            "by a factor alone, and choose the same step; where it is not, they rank differently."
        )
    scale = "the largest of their own" if own else f"the largest predicted of {names[0]}"
    return (
        "Above: solid lines with 95 % intervals are measured, broken ones with open signs predicted. Measured curves "
        f"are divided by the largest measured of {names[0]}, predicted ones by {scale}. Below: each step’s ratio to "
        f"{names[0]}; on the grey line nothing changed. Where an interval crosses that line, this step alone does not "
        "show a change. Where the broken line runs within the intervals, the prediction saw the change coming. The "
        "filter’s measured PSS has no interval in the tables."
    )


_LINE = {"line": {"color": GREY, "width": 1.5}, "layer": "below"}


def _own_models(group: Group) -> bool:
    return OWN in group.models


def _drawn(base: dict[str, Any], number: int, what: str, stem: str) -> dict[str, Any]:
    made = base | {
        "y": ref(f"curve{number}|{what}|{stem}"),
        "customdata": ref(f"value{number}|{what}|{stem}"),
        "hovertemplate": "%{text}: %{customdata:,.4r} %{meta}",
        "meta": ref("unit|{pair}"),
        "showlegend": ref(f"shown{number}|{what}|{stem}"),
    }
    if what == "measured":
        made["error_y"] = _error(f"curve{number}|measured", stem, base["line"]["color"])
    return made


def _error(name: str, stem: str, colour: str) -> dict[str, Any]:
    return {
        "type": "data",
        "symmetric": False,
        "array": ref(f"{name}_above|{stem}"),
        "arrayminus": ref(f"{name}_below|{stem}"),
        "color": colour,
        "thickness": 1.4,
        "width": 3,
    }


def _fill(columns: Columns, series: Series, group: Group) -> None:
    """Columns of one pair: curves, what they are in units, ratios, and how far intervals reach."""
    name = series.pair.name
    columns[f"unit|{name}"] = "m" if series.pair.name == "rms" else "/m"
    scale = _largest(series.measured[0, :, 0])
    for number, values in enumerate(series.measured):
        stem = f"measured|{name}"
        hidden = number > 0 and bool(np.isnan(series.measured_ratio[number - 1]).all())  # the first's measurement again
        shown = np.full_like(values, np.nan) if hidden else values
        columns[f"shown{number}|{stem}"] = bool(np.isfinite(shown[:, 0]).any())
        columns[f"value{number}|{stem}"] = plain(shown[:, 0])
        _limited(columns, f"curve{number}|measured", name, shown / scale)
    for number, ratio in enumerate(series.measured_ratio, start=1):
        _limited(columns, f"ratio{number}|measured", name, ratio)
    for model in group.models or ("",):
        predicted = series.predicted.get(model, np.full(series.measured.shape[:2], np.nan))
        ratios = series.predicted_ratio.get(model, np.full(series.measured_ratio.shape[:2], np.nan))
        stem = f"predicted|{name}|{model}"
        for number, values in enumerate(predicted):
            columns[f"shown{number}|{stem}"] = bool(np.isfinite(values).any())
            columns[f"value{number}|{stem}"] = plain(values)
            columns[f"curve{number}|{stem}"] = plain(values / _largest(values if model == OWN else predicted[0]))
        for number, values in enumerate(ratios, start=1):
            columns[f"ratio{number}|{stem}"] = plain(values)
        seen = np.concatenate([ratios.ravel(), series.measured_ratio.ravel(), [1.0]])
        columns |= _ticks(f"{name}|{model}", seen)


def _ticks(stem: str, ratios: Floats) -> Columns:
    ticks = ratio_ticks(ratios)
    return {f"ticks|{stem}": ticks, f"tick_words|{stem}": [f"{tick:g}" for tick in ticks]}


def _limited(columns: Columns, name: str, stem: str, values: Floats) -> None:
    columns[f"{name}|{stem}"] = plain(values[:, 0])
    columns[f"{name}_above|{stem}"] = plain(values[:, 2] - values[:, 0])
    columns[f"{name}_below|{stem}"] = plain(values[:, 0] - values[:, 1])


def _largest(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.max(initial=0.0)) or 1.0


def moved_figure(group: Group, names: Sequence[str]) -> Figure | None:
    """Predicted ratio to the first side against the measured one, step by step; None where no step has both."""
    columns: Columns = {}
    drawable = False
    for series in group.series:
        for model in group.models:
            predicted = series.predicted_ratio.get(model, np.full(series.measured_ratio.shape[:2], np.nan))
            stem = f"{series.pair.name}|{model}"
            both = np.concatenate([predicted.ravel(), series.measured_ratio.ravel()])
            known = both[np.isfinite(both) & (both > 0)]
            pairs = np.isfinite(predicted) & np.isfinite(series.measured_ratio[..., 0])
            drawable |= bool(pairs.any())
            low, high = (min(known.min(), 1.0), max(known.max(), 1.0)) if len(known) else (0.5, 2.0)
            ends = [float(low) / ROOM_FOR_AXIS, float(high) * ROOM_FOR_AXIS]
            columns[f"ends|{stem}"] = plain(ends)
            columns[f"range|{stem}"] = plain(np.log10(ends))
            columns |= _ticks(stem, np.array(ends))
            for number, values in enumerate(predicted, start=1):
                columns[f"moved{number}|{stem}"] = plain(values)
                _limited(columns, f"measured{number}", stem, series.measured_ratio[number - 1])
    if not drawable:
        return None
    traces: list[dict[str, Any]] = [
        {
            "type": "scatter",
            "mode": "lines",
            "x": ref("ends|{pair}|{model}"),
            "y": ref("ends|{pair}|{model}"),
            "name": "as predicted",
            "line": {"color": INK, "width": 1.5},
            "hoverinfo": "skip",
        }
    ]
    for number, name in enumerate(names[1:], start=1):
        colour, symbol, _ = side_style(number)
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": f"{name} ÷ {names[0]}",
                "x": ref(f"moved{number}|{{pair}}|{{model}}"),
                "y": ref(f"measured{number}|{{pair}}|{{model}}"),
                "error_y": _error(f"measured{number}", "{pair}|{model}", colour),
                "marker": {"color": colour, "symbol": symbol, "size": 10, "line": {"color": "white", "width": 0.6}},
                "text": list(group.steps),
                "hovertemplate": "%{text}: predicted ×%{x:.3g}, measured ×%{y:.3g}",
            }
        )
    even = [
        {"type": "line", "xref": "x", "yref": "paper", "x0": 1, "x1": 1, "y0": 0, "y1": 1} | _LINE,
        {"type": "line", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": 1, "y1": 1} | _LINE,
    ]
    both_axes: dict[str, Any] = {"type": "log", "range": ref("range|{pair}|{model}")}
    both_axes |= {"tickvals": ref("ticks|{pair}|{model}"), "ticktext": ref("tick_words|{pair}|{model}")}
    return Figure(
        "moved",
        "Does the metric foresee the change?",
        f"Each sign is a step: to the right, how many times as large as {names[0]}’s the prediction is; upwards, how "
        "many times what was measured is, with its 95 % interval. On the black line the metric foresees exactly what "
        "changing the settings does. Signs stacked above one another are changes that the metric does not know of; on "
        "the grey lines nothing changed. In the upper right and lower left quarters the direction is right.",
        "Scatter of predicted against measured ratios to "
        f"{names[0]}, one sign a step, on logarithmic axes with the line of equality.",
        traces,
        layout(
            both_axes | {"title": {"text": f"predicted ÷ that of {names[0]}"}},
            both_axes | {"title": {"text": f"measured ÷ that of {names[0]}"}},
            shapes=even,
            hovermode="closest",
        ),
        (),
        columns,
        height_px=600,
    )
