"""A comparison's figure of dots with intervals: a number of each side in rows, and differences from the first side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from pss.hints import ReadOnlyRow
from validate.comparison.axes import side_style
from validate.pages.empty_rows import NO_ORDER, Sign, empty_row_words
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.quality import MEASURE_NAMES, METRIC_NAMES
from validate.pages.style import GREY, LOG_AXIS, layout

__all__ = ["Dots", "dots_figure"]


# Rows of a figure lie one apart; the sides share this much of it.
ROW_SHARE = 0.5
# px, of a row and of axis, title and legend together.
ROW_PX, REST_PX = 26, 150
# Rows of more than this many configurations are in the order of the first side's number, as a leaderboard is.
SORTED_FROM = 8
# What is shown first, where it is there.
FIRST = ("measured_pss_single_frame", "physical", "both", "none", "measured PSS, filter", "single frame")
COLUMN_NAMES = {
    "sweep": "Sweep",
    "cameras": "Cameras",
    "measure": "Measure",
    "noise_model": "Noise model",
    "kind": "Kind",
    "avatar": "Person",
    "zoom_limit": "Zoom limit",
    "statistic": "Quantity",
    "metric": "Metric",
    "strategy": "Strategy",
}


@dataclass(frozen=True)
class Dots:
    """What such a figure shows.

    Attributes:
        id, title, caption: as of a `Figure`.
        axis: what the numbers are.
        rows: matched rows (`matched_rows`) of one quantity.
        down: the column whose values are rows of the figure.
        as_ratio: whether the right half has ratios, not differences.
    """

    id: str
    title: str
    caption: str
    axis: str
    rows: Sequence[ReadOnlyRow]
    down: str
    as_ratio: bool


def dots_figure(dots: Dots, labels: Sequence[str], names: Sequence[str]) -> Figure | None:
    """The figure with a choice for every other column; None if no row has a number.

    Args:
        labels: of the sides, as the rows have them.
        names: of the sides, as the reader sees them.
    """
    rows = [row for row in dots.rows if any(not math.isnan(_number(row, label)) for label in labels)]
    if not rows:
        return None
    keys = [key for key in list(rows[0])[: list(rows[0]).index("quantity")] if key != dots.down]
    keys = [key for number, key in enumerate(keys) if not _follows(key, keys[:number], rows)]
    choices = [_choice(key, rows) for key in keys]
    choices = [choice for choice in choices if len(choice.options) > 1]
    stem = "|".join(f"{{{choice.name}}}" for choice in choices)
    columns: Columns = {}
    for values in product(*([value for value, _ in choice.options] for choice in choices)):
        chosen = dict(zip((choice.name for choice in choices), values, strict=True))
        own = [row for row in rows if all(_fits(row, key, value) for key, value in chosen.items())]
        columns |= _columns("|".join(values), own, dots, labels, names)
    right = "ratio" if dots.as_ratio else "difference"
    traces: list[dict[str, Any]] = []
    for number, name in enumerate(names):
        traces.append(_trace(number, name, f"value{number}|{stem}", "", "%{y}: %{x:.3g}"))
        if number:
            more = _trace(number, name, f"{right}{number}|{stem}", "2", f"%{{y}}: {right} %{{x:.3g}}")
            traces.append(more | {"showlegend": False})
    sign = "÷" if dots.as_ratio else "−"
    other = names[1] if len(names) == 2 else "others"
    down = {
        "tickvals": ref(f"rows|{stem}"),
        "ticktext": ref(f"names|{stem}"),
        "range": ref(f"range|{stem}"),
        "showgrid": True,
        "zeroline": False,
    }
    plot = layout(
        {"title": {"text": dots.axis}, "domain": [0, 0.6], "anchor": "y", "zerolinecolor": GREY},
        down | {"domain": [0, 1], "anchor": "x"},
        height=ref(f"height|{stem}"),
        hovermode="closest",
    )
    line = {"type": "line", "xref": "x2", "yref": "y2 domain", "y0": 0, "y1": 1, "line": {"color": GREY, "width": 1.5}}
    even = 1 if dots.as_ratio else 0
    plot["xaxis2"] = plot["xaxis"] | {
        "domain": [0.64, 1],
        "anchor": "y2",
        "title": {"text": f"{other} {sign} {names[0]}", "font": {"size": 13}},
        "nticks": 5,
    }
    if dots.as_ratio:
        plot["xaxis2"] |= LOG_AXIS
    plot["yaxis2"] = plot["yaxis"] | {"anchor": "x2", "showticklabels": False}
    plot["annotations"] = ref(f"words|{stem}")
    plot["shapes"] = [line | {"x0": even, "x1": even}]
    alt = (
        f"Dots with intervals: {dots.axis} of each side, by {COLUMN_NAMES.get(dots.down, dots.down).lower()}; beside "
        f"it the {right}s to {names[0]}. The folded tables have the same numbers."
    )
    return Figure(dots.id, dots.title, dots.caption, alt, traces, plot, tuple(choices), columns, wide=True)


def _trace(number: int, name: str, column: str, axis: str, hover: str) -> dict[str, Any]:
    colour, symbol, _ = side_style(number)
    before, _, rest = column.partition("|")
    error = {"type": "data", "symmetric": False, "color": colour, "thickness": 2, "width": 4}
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "legendgroup": str(number),
        "x": ref(column),
        "y": ref(f"at{number}|{rest}"),
        "xaxis": f"x{axis}",
        "yaxis": f"y{axis}",
        "error_x": error | {"array": ref(f"{before}_above|{rest}"), "arrayminus": ref(f"{before}_below|{rest}")},
        "marker": {"color": colour, "symbol": symbol, "size": 10},
        "text": ref(f"names|{rest}"),
        "hovertemplate": hover.replace("%{y}", "%{text}"),
    }


def _choice(key: str, rows: Sequence[ReadOnlyRow]) -> Choice:
    values = [value for value in dict.fromkeys(str(row[key]) for row in rows) if value or key != "noise_model"]
    first = next((value for value in FIRST if value in values), values[-1] if key == "cameras" and values else "")
    return Choice(
        f"by_{key}",
        COLUMN_NAMES.get(key, key),
        tuple((value, MEASURE_NAMES.get(value, value) or "none") for value in values),
        first or (values[0] if values else ""),
    )


def _follows(key: str, before: Sequence[str], rows: Sequence[ReadOnlyRow]) -> bool:
    """Whether another column's value determines this one's, as a sweep does its number of cameras."""
    return any(
        len({(row[other], row[key]) for row in rows}) == len({row[other] for row in rows}) > 1 for other in before
    )


def _fits(row: ReadOnlyRow, name: str, value: str) -> bool:
    """A metric without a noise model is beside each."""
    own = str(row[name.removeprefix("by_")])
    return own == value or (name == "by_noise_model" and not own)


def _columns(
    stem: str, rows: Sequence[ReadOnlyRow], dots: Dots, labels: Sequence[str], names: Sequence[str]
) -> Columns:
    """What is drawn for one way to set the choices."""
    if len(rows) > SORTED_FROM:
        rows = sorted(rows, key=lambda row: -np.nan_to_num(_number(row, labels[0]), nan=-np.inf))
    right = "ratio" if dots.as_ratio else "difference"
    columns: Columns = {
        f"rows|{stem}": list(range(len(rows))),
        f"names|{stem}": [METRIC_NAMES.get(str(row[dots.down]), str(row[dots.down]) or "none") for row in rows],
        f"range|{stem}": [len(rows) - 0.5, -0.5],
        f"height|{stem}": REST_PX + ROW_PX * max(len(rows), 3) * max(1, len(labels) - 1),
    }
    signs: dict[str, list[Sign]] = {"": [], "2": []}
    for number, label in enumerate(labels):
        offset = ROW_SHARE * (number - (len(labels) - 1) / 2) / len(labels)
        columns[f"at{number}|{stem}"] = [row + offset for row in range(len(rows))]
        for name, column in ((f"value{number}", label), (f"{right}{number}", f"{label}_{right}"))[: 1 + (number > 0)]:
            values, low, high = (np.array([_number(row, f"{column}{end}") for row in rows]) for end in ("", *ENDS))
            columns[f"{name}|{stem}"] = plain(values)
            columns[f"{name}_above|{stem}"] = plain(high - values)
            columns[f"{name}_below|{stem}"] = plain(values - low)
            signs["2" if column != label else ""] += [
                Sign(names[number], row, row + offset, float(value)) for row, value in enumerate(values)
            ]
    columns[f"words|{stem}"] = [
        *([] if rows else [NO_ROWS]),
        *empty_row_words(signs[""], NO_ORDER if not dots.as_ratio else "undefined"),
        *empty_row_words(signs["2"], f"no {right}", "2"),
    ]
    return columns


ENDS = ("_ci_low", "_ci_high")
NO_ROWS = {
    "text": "the sides have no rows of this",
    "xref": "paper",
    "yref": "paper",
    "x": 0.3,
    "y": 0.5,
    "showarrow": False,
}


def _number(row: ReadOnlyRow, name: str) -> float:
    return float(str(row.get(name, math.nan)))
