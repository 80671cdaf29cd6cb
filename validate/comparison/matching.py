"""Rows of two or more tables matched, with differences and their intervals: rows in, rows out.

The interval of a difference is made of the two that the tables have (Zou and Donner's "method of variance estimates
recovery", Statistics in Medicine 27, 2008), as if both had been measured independently. Runs that share markers or
random numbers have errors in common, which a difference loses: for them it is wider than it would have to be.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss.hints import CsvRow
from validate.comparison.sides import Side

__all__ = ["QUANTITIES", "Quantity", "matched", "matched_rows", "separate"]


@dataclass(frozen=True)
class Quantity:
    """A column that is compared.

    Attributes:
        table: name of the CSV file without its ending.
        value, low, high: columns; "" for no interval.
        keys: columns by which rows are matched.
        as_ratio: whether sides are divided by the first, or the first is subtracted from them.
        only: values that columns must have for the short table of the terminal.
    """

    table: str
    value: str
    low: str
    high: str
    keys: tuple[str, ...]
    as_ratio: bool
    only: Mapping[str, tuple[str, ...]] | None = None


STEP = ("avatar", "zoom_limit", "strategy", "step", "sweep", "parameter", "value")
JUDGED = ("avatar", "sweep", "level", "cameras", "measure", "metric", "noise_model")
OF_PSS = {"level": ("configuration",), "metric": ("pss-single-frame",), "measure": ("measured_pss_single_frame",)}

QUANTITIES: dict[str, tuple[Quantity, ...]] = {
    # What is measured is the same for every noise model.
    "measured": (
        Quantity(
            "configurations", "measured_pss_single_frame", "measured_pss_ci_low", "measured_pss_ci_high", STEP, True
        ),
        Quantity("configurations", "measured_rms_m", "measured_rms_ci_low_m", "measured_rms_ci_high_m", STEP, True),
        Quantity("configurations", "measured_pss_filter", "", "", STEP, True),
        Quantity("configurations", "share_under_5mm", "", "", STEP, False),
    ),
    "predicted": tuple(
        Quantity("configurations", column, "", "", (*STEP, "noise_model"), True)
        for column in ("pss_single_frame", "pss", "predicted_rms_m", "sigma_inf_rms_m")
    ),
    "correlation": (
        Quantity("correlation", "spearman", "spearman_ci_low", "spearman_ci_high", JUDGED, False, OF_PSS),
        Quantity("correlation", "regret", "", "", JUDGED, False, OF_PSS),
    ),
    "leaderboard": (
        Quantity(
            "leaderboard", "spearman", "spearman_ci_low", "spearman_ci_high", JUDGED, False,
            {"measure": ("measured_pss_single_frame",), "metric": ("pss-single-frame",)},
        ),
        Quantity("leaderboard", "regret_of_20_mean", "", "", JUDGED, False, {"metric": ("pss-single-frame",)}),
    ),
    "agreement": (
        Quantity(
            "agreement", "spearman", "spearman_ci_low", "spearman_ci_high",
            ("avatar", "zoom_limit", "strategy", "kind", "noise_model"), False,
            {"avatar": ("both",), "zoom_limit": ("none",)},
        ),
    ),
    "strategies": (
        Quantity(
            "strategies", "value", "ci_low", "ci_high",
            ("avatar", "zoom_limit", "statistic", "noise_model", "strategy"),
            True, {"avatar": ("both",), "zoom_limit": ("none",)},
        ),
    ),
    "slopes": (
        Quantity(
            "slopes", "measured_slope", "measured_slope_ci_low", "measured_slope_ci_high", ("sweep", "parameter"), False
        ),
        Quantity("slopes", "predicted_slope", "", "", ("sweep", "parameter", "noise_model"), False),
    ),
}  # fmt: skip
"""What is compared, by the name that the command line has for it; more than one run's kind is among them."""


def matched(sides: Sequence[Side], quantity: Quantity) -> list[dict[str, object]]:
    """`matched_rows` of the tables that the sides' runs left; none, if one of them left no such table."""
    tables = {side.label: side.table(quantity.table) for side in sides}
    present = {label: rows for label, rows in tables.items() if rows is not None}
    if len(present) < len(sides):
        return []
    return matched_rows(present, quantity, [column for side in sides for column in side.chosen])


def matched_rows(
    tables: Mapping[str, Sequence[CsvRow]], quantity: Quantity, chosen: Sequence[str] = ()
) -> list[dict[str, object]]:
    """A row for each key that all `tables` have: value and interval of each side, and those against the first side.

    Args:
        tables: rows by the side's label, the first of which the others are compared with.
        chosen: columns that distinguish the sides and are no keys.

    Returns:
        The keys, `quantity`, then for each side LABEL, LABEL_ci_low, LABEL_ci_high and for each but the first
        LABEL_ratio or LABEL_difference with `_ci_low` and `_ci_high`, and LABEL_apart: "yes" where that interval
        excludes equality. nan where there is no number.
    """
    columns = [set(rows[0]) if rows else set() for rows in tables.values()]
    keys = [key for key in quantity.keys if key not in chosen and all(key in each for each in columns)]
    if not all(quantity.value in each for each in columns):
        return []
    by_key = [_first_by_key(rows, keys) for rows in tables.values()]
    found: list[dict[str, object]] = []
    for key, first in by_key[0].items():
        rows = [each.get(key) for each in by_key]
        if any(row is None for row in rows):
            continue
        line: dict[str, object] = {**dict(zip(keys, key, strict=True)), "quantity": quantity.value}
        base = _numbers(first, quantity)
        for number, (label, row) in enumerate(zip(tables, rows, strict=True)):
            assert row is not None
            own = _numbers(row, quantity)
            line |= _columns_of(label, own, bool(quantity.low))
            if number:
                against = separate(base, own, quantity.as_ratio)
                name = f"{label}_{'ratio' if quantity.as_ratio else 'difference'}"
                line |= _columns_of(name, against, bool(quantity.low))
                if quantity.low:
                    none = 1.0 if quantity.as_ratio else 0.0
                    line[f"{label}_apart"] = "yes" if against[1] > none or against[2] < none else ""
        found.append(line)
    return found


def separate(
    first: tuple[float, float, float], other: tuple[float, float, float], as_ratio: bool
) -> tuple[float, float, float]:
    """other − first, or other / first, with the limits of its interval; each a value with its own limits.

    nan where a number is missing, or for a ratio not above 0.
    """
    if as_ratio:
        return _exp(separate(_log(first), _log(other), False))
    (a, a_low, a_high), (b, b_low, b_high) = first, other
    return b - a, b - a - math.hypot(b - b_low, a_high - a), b - a + math.hypot(b_high - b, a - a_low)


def _log(values: tuple[float, float, float]) -> tuple[float, float, float]:
    a, b, c = (math.log(value) if value > 0 else math.nan for value in values)
    return a, b, c


def _exp(values: tuple[float, float, float]) -> tuple[float, float, float]:
    with np.errstate(over="ignore"):
        a, b, c = (float(np.exp(value)) for value in values)
    return a, b, c


def _first_by_key(rows: Sequence[CsvRow], keys: Sequence[str]) -> dict[tuple[str, ...], CsvRow]:
    """Rows that differ in nothing but what the quantity does not depend on are one."""
    found: dict[tuple[str, ...], CsvRow] = {}
    for row in rows:
        found.setdefault(tuple(row[key] for key in keys), row)
    return found


def _numbers(row: CsvRow, quantity: Quantity) -> tuple[float, float, float]:
    value, low, high = (_number(row.get(column, "")) for column in (quantity.value, quantity.low, quantity.high))
    return value, low, high


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _columns_of(name: str, values: tuple[float, float, float], with_interval: bool) -> dict[str, object]:
    limits = {f"{name}_ci_low": values[1], f"{name}_ci_high": values[2]} if with_interval else {}
    return {name: values[0], **limits}
