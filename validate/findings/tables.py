"""Rows of CSV files, and how their numbers are said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from validate.csv_files import read_csv

__all__ = ["Row", "Tables", "all_of", "number", "one_of", "percent", "read_tables", "with_range"]

Row = Mapping[str, str]
Tables = Mapping[str, Sequence[Row]]


def read_tables(folder: Path) -> dict[str, list[dict[str, str]]]:
    """The CSV files of a folder, by name without the ending."""
    return {path.stem: read_csv(path) for path in sorted(folder.glob("*.csv"))}


def all_of(rows: Sequence[Row], **wanted: str) -> list[Row]:
    """The rows that have these values."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def one_of(rows: Sequence[Row], **wanted: str) -> Row:
    """The first of them."""
    return all_of(rows, **wanted)[0]


def number(row: Row, name: str) -> str:
    """A number with its 95 % interval, in columns `name`, `name`_ci_low and `name`_ci_high."""
    return with_range(*(row.get(key, "") for key in (name, f"{name}_ci_low", f"{name}_ci_high")))


def with_range(value: str, low: str, high: str) -> str:
    """0.93 [0.85, 0.98]."""
    if not value:
        return "undefined"
    return f"{float(value):.2f} [{float(low or 'nan'):.2f}, {float(high or 'nan'):.2f}]".replace("-", "−")


def percent(value: str) -> str:
    """12.3 %."""
    return f"{100 * float(value):.1f} %"
