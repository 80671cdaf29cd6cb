"""Rows as CSV, Markdown and LaTeX."""

from __future__ import annotations

import csv
import io
import math

import pytest

from pss import RangeError
from validate.runs.numbers import written
from validate.runs.table_text import table_text

ROWS = [
    {"name": "a|b & 50 %", "value": 1234.56789, "count": 3, "none": math.nan},
    {"name": "σ_max", "value": 0.5, "count": 12, "none": 2.0},
]


def test_csv_is_read_back():
    """Quoted where needed; nan is an empty field."""
    rows = list(csv.DictReader(io.StringIO(table_text([{"a": "x, y", "b": math.nan, "c": 1 / 3}], "csv"))))
    assert rows == [{"a": "x, y", "b": "", "c": "0.3333333"}]


def test_markdown_keeps_its_columns():
    """As many bars in every line, numbers to the right."""
    lines = table_text(ROWS, "md").splitlines()
    assert [line.replace(r"\|", "").count("|") for line in lines] == [5] * 4
    assert lines[1] == "|---|---:|---:|---:|"
    assert lines[2] == r"| a\|b & 50 % | 1235 | 3 |  |"


def test_latex_escapes_its_signs():
    """What LaTeX would take for its own, and Greek."""
    text = table_text(ROWS, "tex")
    assert r"a|b \& 50 \% & 1235 & 3 &  \\" in text
    assert r"$\sigma$\_max & 0.5 & 12 & 2 \\" in text
    assert text.startswith("\\begin{tabular}{lrrr}\n\\toprule\n")


def test_no_rows_and_unknown_kinds():
    """Nothing is nothing; a kind that is none is named."""
    assert table_text([], "tex") == ""
    with pytest.raises(RangeError, match="html"):
        table_text(ROWS, "html")


def test_numbers_for_a_reader_have_no_small_powers_of_ten():
    assert [written(value, 3) for value in (0.039712, 7.6, 999.6, 1000.4, 39712.0, 2.5e6)] == (
        ["0.0397", "7.6", "1,000", "1,000", "39,700", "2.5e+06"]
    )
    assert written(float("nan"), 3) == "nan"
