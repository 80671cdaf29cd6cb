"""Reader and writer of CSV files that a spreadsheet opens as text and numbers, never as formulas.

A spreadsheet computes cells that begin with =, +, - or @ (or with a tab or a line's end before these), also where the
file quotes them: OWASP, "CSV Injection". Such a text (for example, the name of a sweep file) gets a leading
apostrophe, which spreadsheets hide and `read_csv` removes. Numbers stay numbers.
"""

from __future__ import annotations

import contextlib
import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pss import RangeError
from pss.files import open_plain
from pss.hints import CsvRow
from render.store.atomic import StoreError
from validate.runs.renamed_columns import current_names

__all__ = [
    "Row",
    "Tables",
    "all_of",
    "bounds",
    "csv_text",
    "first_of",
    "number_in",
    "one_of",
    "read_csv",
    "read_head",
    "read_tables",
    "value_of",
]

Tables = Mapping[str, Sequence[CsvRow]]
"""Rows of CSV files, by their names without the ending."""

# Characters, of what is quoted in a message.
LONGEST_VALUE, LONGEST_LIST = 60, 600

# With the apostrophes that a text has of its own before such a sign: what is read is what was written.
_COMPUTED = re.compile(r"'*[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20]")
_MARKED = re.compile(r"'+[=+\-@\t\r\n\uff1d\uff0b\uff0d\uff20]")


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Rows below their head as the text of a CSV file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    # Python before 3.13 takes a lone carriage return for no end of a line, which readers do.
    quoting = csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL)
    for row in (head, *rows):
        cells = [_cell(value) for value in row]
        (quoting if any("\r" in str(cell) for cell in cells) else writer).writerow(cells)
    return text.getvalue()


class Row(dict[str, str]):
    """A row of a CSV file by the names in its head, with its place in the file for error messages.

    Attributes:
        place: the file and the number of the line that the row ends in.
    """

    def __init__(self, values: Mapping[str, str], place: str) -> None:
        super().__init__(values)
        self.place = place

    def __missing__(self, column: str) -> str:
        """Refuse a column that the file does not have.

        Raises:
            StoreError: always.
        """
        known = ", ".join(name if name.isprintable() else repr(name) for name in self)
        raise StoreError(f"{self.place}: there is no column {column!r}; allowed: {known[:LONGEST_LIST]}")


def number_in(row: Mapping[str, str], column: str) -> float:
    """The number in a field of a row; nan where the field is empty.

    Raises:
        StoreError: it is no number, or there is no such column.
    """
    text = row[column]
    try:
        return float(text or "nan")
    except ValueError:
        place = row.place if isinstance(row, Row) else "a table"
        raise StoreError(f"{place}: {column} = {text[:LONGEST_VALUE]!r}; allowed: a number, or nothing") from None


def read_csv(path: Path) -> list[Row]:
    """The rows of a CSV file by the names in its head, as they were before `csv_text`.

    Raises:
        StoreError: it is no CSV file of text, or a row has more or fewer fields than the head; with the line's number.
    """
    with _lines(path) as reader:
        head = _checked_head(path, reader)
        rows = []
        for row in reader:
            if not row:
                continue
            if len(row) != len(head):
                raise StoreError(f"{path}: line {reader.line_num} has {len(row)} fields; allowed: {len(head)}")
            rows.append(Row(dict(zip(head, _texts(row), strict=True)), f"{path}: line {reader.line_num}"))
    return rows


def read_head(path: Path) -> list[str]:
    """The names of a CSV file's columns.

    Raises:
        StoreError: as `read_csv`, but for the rows.
    """
    with _lines(path) as reader:
        return _checked_head(path, reader)


@contextlib.contextmanager
def _lines(path: Path) -> Iterator[Any]:
    """A reader of a CSV file; what is wrong with the file becomes one line that names it."""
    reader = None
    try:
        with open_plain(path) as binary, io.TextIOWrapper(binary, encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            yield reader
    except UnicodeDecodeError:
        line = reader.line_num + 1 if reader is not None else 1
        raise StoreError(f"{path}: line {line} or one soon after it is no text; allowed: a table in UTF-8") from None
    except csv.Error as error:
        line = reader.line_num if reader is not None else 1
        raise StoreError(f"{path}: line {line} is no line of a CSV file ({error})") from None
    except RangeError as error:
        raise StoreError(f"{path}: {error}") from None
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror}; allowed: a file that can be read") from None


def _checked_head(path: Path, reader: Any) -> list[str]:
    head = _texts(next(reader, []))
    if twice := [name for name in head if head.count(name) > 1]:
        raise StoreError(f"{path}: line 1 has the column {twice[0][:LONGEST_VALUE]!r} twice; allowed: each once")
    return current_names(head)


def _cell(value: object) -> object:
    if isinstance(value, str) and _COMPUTED.match(value) and not _is_number(value):
        return f"'{value}"
    return value


def _texts(cells: Sequence[str]) -> list[str]:
    return [cell[1:] if _MARKED.match(cell) else cell for cell in cells]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


# ---- rows ------------------------------------------------------------------------------------------------------------
#
# A column that a file does not have reads as "": tables of an earlier version lack columns.


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
