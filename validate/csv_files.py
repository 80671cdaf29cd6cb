"""CSV files that a spreadsheet takes for text and numbers, and for nothing else; the only reader and writer of them.

A spreadsheet computes cells that begin with =, +, - or @ (or with a tab or a line's end before these), also where the
file quotes them: OWASP, "CSV Injection". Such a text, as a sweep file's name may be, gets an apostrophe before it, that
spreadsheets do not show and `read_csv` takes away. Numbers stay numbers.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

__all__ = ["csv_text", "read_csv", "read_head"]

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


def read_csv(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file by the names in its head, as they were before `csv_text`."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        head = _texts(next(reader, []))
        return [dict(zip(head, _texts(row), strict=False)) for row in reader if row]


def read_head(path: Path) -> list[str]:
    """The names of a CSV file's columns."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        return _texts(next(csv.reader(file), []))


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
