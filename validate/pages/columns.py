"""Columns of numbers of a run's tables, which may have been edited: missing or non-numeric values are named."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pss.hints import CsvRow, Floats
from render.store.folder import StoreError
from validate.runs.csv_file import number_in

__all__ = ["Columns", "check_counts", "is_number", "whole_number"]


def check_counts(name: str, counts: Mapping[str, int], table: str, needed: int) -> None:
    """That each noise model has as many rows as it needs.

    Raises:
        StoreError: one has not.
    """
    for model, count in counts.items():
        if count != needed:
            raise StoreError(
                f"{name}: {table}.csv has {count} rows of {model}; allowed: {needed}, a whole table, as a run left it"
            )


def whole_number(row: CsvRow, column: str) -> int:
    """The whole number in a field of a row.

    Raises:
        StoreError: it is none.
    """
    value = number_in(row, column)
    if not math.isfinite(value) or value != int(value):
        raise StoreError(
            f"{getattr(row, 'place', 'a table')}: {column} = {row[column][:60]!r}; allowed: a whole number"
        )
    return int(value)


class Columns(dict[str, Floats]):
    """Columns of numbers by name; for one that is not numeric, the wrong row is named."""

    def __init__(self, rows: Sequence[CsvRow], shape: tuple[int, ...]) -> None:
        super().__init__()
        self._rows = rows
        for key in rows[0]:
            fields = [row[key] for row in rows]
            if all(not field or is_number(field) for field in fields):
                self[key] = np.array([float(field) if field else np.nan for field in fields]).reshape(shape)

    def __missing__(self, key: str) -> Floats:
        """Refuse a column that is missing, or not of numbers.

        Raises:
            StoreError: always.
        """
        raise StoreError(next((message for row in self._rows if (message := _misfit(row, key))), f"{key} is no column"))


def _misfit(row: CsvRow, column: str) -> str:
    try:
        number_in(row, column)
    except StoreError as error:
        return str(error)
    return ""


def is_number(text: str) -> bool:
    """Whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
