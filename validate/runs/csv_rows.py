"""Rows of CSV files, and how their numbers and tables are written.

A column that a file does not have reads as "", and what is "" is left out or shown as "–": tables of an earlier version
lack columns, and a page is made from what is there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from pss.hints import CsvRow
from validate.runs.csv_file import read_csv

__all__ = [
    "NOTHING",
    "Tables",
    "all_of",
    "bounds",
    "first_of",
    "folded",
    "in_powers",
    "markdown_table",
    "number",
    "one_of",
    "percent",
    "percent_with_range",
    "read_tables",
    "signed",
    "value_of",
    "with_range",
]

Tables = Mapping[str, Sequence[CsvRow]]

# What a table's cell shows where there is no number.
NOTHING = "–"
# What two decimals round up to 1, and what they round to 0 but three do not.
ALMOST_ONE, ALMOST_ZERO = 0.995, (0.0005, 0.005)


def read_tables(folder: Path) -> dict[str, list[dict[str, str]]]:
    """The CSV files of a folder, by name without the ending; none for a folder that is not there."""
    return {path.stem: [dict(row) for row in read_csv(path)] for path in sorted(folder.glob("*.csv"))}


def all_of(rows: Sequence[CsvRow], **values: str) -> list[CsvRow]:
    """The rows that have these values."""
    return [row for row in rows if all(row.get(key, "") == value for key, value in values.items())]


def one_of(rows: Sequence[CsvRow], **values: str) -> CsvRow:
    """The first of them."""
    return all_of(rows, **values)[0]


def first_of(rows: Sequence[CsvRow], **values: str) -> CsvRow | None:
    """The first of them; None if there is none."""
    return next(iter(all_of(rows, **values)), None)


def value_of(row: CsvRow | None, name: str) -> float:
    """A number; nan where there is no row, no such column, or nothing in it."""
    return float((row or {}).get(name) or "nan")


def bounds(row: CsvRow | None, name: str) -> tuple[float, float, float]:
    """A number and the ends of its 95 % interval, from columns `name`, `name`_ci_low and `name`_ci_high; nan if not."""
    value, low, high = (value_of(row, key) for key in (name, f"{name}_ci_low", f"{name}_ci_high"))
    return value, low, high


def number(row: CsvRow | None, name: str) -> str:
    """A number with its 95 % interval, in columns `name`, `name`_ci_low and `name`_ci_high."""
    return with_range(*((row or {}).get(key, "") for key in (name, f"{name}_ci_low", f"{name}_ci_high")))


def with_range(value: str, low: str, high: str) -> str:
    """0.93 [0.85, 0.98]; the number alone where it has no interval.

    A correlation just below 1 has three decimals: two would call it 1. So has an interval with an end so near to 0 that
    two would hide on which side it is.
    """
    numbers = [float(each or "nan") for each in (value, low, high)]
    if math.isnan(numbers[0]):
        return NOTHING
    known = [number for number in numbers if not math.isnan(number)]
    near_one = ALMOST_ONE <= numbers[0] < 1 and max(known) <= 1
    near_zero = any(ALMOST_ZERO[0] <= abs(end) < ALMOST_ZERO[1] for end in known[1:])
    decimals = 3 if near_one or near_zero else 2
    text = f"{numbers[0]:.{decimals}f}"
    if len(known) == len(numbers):
        text += f" [{numbers[1]:.{decimals}f}, {numbers[2]:.{decimals}f}]"
    return signed(text)


def signed(text: str) -> str:
    """Numbers with the sign for minus, and none before what is rounded to 0."""
    return re.sub(r"-(?=0\.?0*(?![\d.]))", "", text).replace("-", "−")


def in_powers(value: float, digits: int = 2) -> str:
    """0.0064 as 6.4·10⁻³ and 10,000 as 10⁴ where decimals would be many; 0.35, 420 and 1,170 as they are."""
    if not value or not math.isfinite(value):
        return f"{value:g}"
    rounded = float(f"{value:.{digits}g}")
    exponent = math.floor(math.log10(abs(rounded)))
    if -2 <= exponent < 4:
        return signed(f"{rounded:,.{max(digits - 1 - exponent, 0)}f}")
    factor = f"{rounded / 10**exponent:.{digits - 1}f}".rstrip("0").rstrip(".")
    power = "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return power if factor == "1" else f"{signed(factor)}·{power}"


def percent(value: str) -> str:
    """12.3 %."""
    return f"{100 * float(value):.1f} %" if value else NOTHING


def percent_with_range(row: CsvRow | None, name: str) -> str:
    """0.7 % [0.4, 1.1]; without what is not there."""
    value, low, high = (100 * number for number in bounds(row, name))
    if math.isnan(value):
        return NOTHING
    text = f"{value:.1f} %"
    if not (math.isnan(low) or math.isnan(high)):
        text += f" [{low:.1f}, {high:.1f}]"
    return signed(text)


def markdown_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; columns in which no row has anything are left out, and it is "" without rows."""
    if not rows:
        return ""
    kept = [place for place in range(len(heads)) if place == 0 or any(row[place] not in ("", NOTHING) for row in rows)]
    lines = [f"| {' | '.join(row[place] for place in kept)} |" for row in (heads, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(kept), *lines[1:]])


def folded(summary: str, body: str) -> str:
    """A part that a browser opens by a click and plain Markdown shows as it is; "" without a body."""
    return f"<details>\n<summary>{summary}</summary>\n\n{body}\n\n</details>" if body else ""
