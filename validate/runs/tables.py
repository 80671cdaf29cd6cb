"""The tables of a run by name, whether it has just been computed or was loaded from its files: the same numbers.

A number has seven digits in a table, wherever it is read: a figure or a report made from the run itself is the same as
one made again from its files.
"""

from __future__ import annotations

import importlib
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pss import MissingLibraryError, RangeError
from pss.hints import CsvRow, ReadOnlyRow
from render.store.atomic import write_text
from validate.runs.csv_file import csv_text

if TYPE_CHECKING:
    import pandas

__all__ = ["RunTables", "as_written", "columns_of", "table_file", "write_csv"]

# Digits that distinguish any two measured numbers, and few enough for a person.
DIGITS = 7
# Columns of names: text, though a camera may be called "2" and a view's hash may look like 1e5.
NAMES = frozenset(
    ("camera", "camera_names", "configuration", "exr", "metric", "noise_model", "object", "strategy", "sweep", "view")
)
# Columns of whole numbers.
COUNTS = frozenset(
    (
        "cameras", "common_points", "detected", "hidden_detected", "hidden_missed", "markers_visible", "n",
        "observable", "point", "points", "rejected_detections", "steps", "unexpected_ids", "views", "visible_detected",
        "visible_missed", "visible_missed_too_dark",
    )
)  # fmt: skip


def as_written(rows: Sequence[ReadOnlyRow]) -> list[dict[str, str]]:
    """Rows as their CSV file has them: the first row's columns as text, numbers with 7 digits, nan as an empty one."""
    head = list(rows[0]) if rows else []
    return [{key: _field(row[key]) for key in head} for row in rows]


def _field(value: object) -> str:
    if isinstance(value, float | np.floating):
        return "" if math.isnan(value) else f"{float(value):.{DIGITS}g}"
    return "" if value is None else str(value)


def table_file(written: Sequence[CsvRow], head: Sequence[str] = ()) -> str:
    """The text of a CSV file of written rows; without rows the head alone, or nothing."""
    head = list(written[0]) if written else list(head)
    return csv_text(head, ([row[key] for key in head] for row in written)) if head else ""


def write_csv(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows with the first row's keys as the head; nan is an empty field."""
    write_text(path, table_file(as_written(rows)))


def columns_of(written: Sequence[CsvRow]) -> dict[str, np.ndarray[Any, Any]]:
    """The columns of a table of R rows by name, (R,): numbers, nan where a field is empty, whole ones for counts.

    A column with a field that is no number is an array of str, as are all columns of names.
    """
    return {name: _column(name, [row[name] for row in written]) for name in (written[0] if written else ())}


def _column(name: str, fields: Sequence[str]) -> np.ndarray[Any, Any]:
    if name not in NAMES:
        try:
            numbers = np.array([float(field) if field else math.nan for field in fields])
        except ValueError:
            pass
        else:
            whole = name in COUNTS and np.isfinite(numbers).all() and bool((numbers == np.round(numbers)).all())
            return numbers.astype(np.int64) if whole else numbers
    return np.array(fields, dtype=object)


class RunTables(ABC):
    """The tables of a run."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the tables, without `.csv`."""

    @abstractmethod
    def written(self, name: str) -> Sequence[CsvRow]:
        """The rows of a table as its CSV file has them, text by column.

        Raises:
            RangeError: the run has no such table.
        """

    def columns(self, name: str) -> Mapping[str, np.ndarray[Any, Any]]:
        """The columns of a table as NumPy arrays (`columns_of`); none of a table without rows.

        Raises:
            RangeError: the run has no such table.
        """
        return columns_of(self.written(name))

    def table(self, name: str) -> pandas.DataFrame:
        """A table as a data frame of pandas, one row for each row of the CSV file.

        Args:
            name: such as "configurations", "points", "correlation"; all are in `names`, their columns in docs/runs.md.

        Raises:
            RangeError: the run has no such table.
            MissingLibraryError: pandas is not installed; `columns` gives the same without it.
        """
        columns = self.columns(name)
        try:
            library = importlib.import_module("pandas")
        except ImportError as error:
            raise MissingLibraryError(
                f"table({name!r}) needs pandas: pip install 'pss-testbed[pandas]'; columns({name!r}) needs nothing"
            ) from error
        return library.DataFrame(dict(columns))

    def _check_name(self, name: str) -> None:
        if name not in self.names:
            raise RangeError(f"table {name!r}; allowed: {', '.join(self.names)}")
