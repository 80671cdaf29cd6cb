"""CSV files: no cell is a formula, numbers stay numbers, and what is read is what was written."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validate.runs.csv_file import csv_text, read_csv, read_head
from validate.runs.renamed_columns import RENAMED_COLUMNS
from validate.runs.table_text import table_text
from validate.runs.tables import write_csv

ROOT = Path(__file__).parents[3]
# OWASP, "CSV Injection": a cell that begins with one of these is computed.
COMPUTED = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
SHEET_CALLS = [f"{sign}HYPERLINK(1)" for sign in COMPUTED]
words = st.text(
    st.sampled_from("=+-@'\t\r\n＝ab1.,;\"$") | st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=6
)


@pytest.mark.parametrize("words", SHEET_CALLS)
def test_no_cell_of_a_name_is_computed(tmp_path, words):
    """Neither of the tables of a run, nor of those that commands print; heads hold the names of runs."""
    write_csv(tmp_path / "a.csv", [{words: words, "number": -0.5}])
    texts = [(tmp_path / "a.csv").read_bytes().decode(), table_text([{words: words}], "csv")]
    cells = [cell for text in texts for row in csv.reader(io.StringIO(text, newline="")) for cell in row]
    assert cells == [f"'{words}", "number", f"'{words}", "-0.5", f"'{words}", f"'{words}"]
    assert read_csv(tmp_path / "a.csv") == [{words: words, "number": "-0.5"}]
    assert read_head(tmp_path / "a.csv") == [words, "number"]


@pytest.mark.parametrize("number", [-0.5, -1, "-0.5", "+1e-3", "-inf"])
def test_numbers_stay_numbers(number):
    assert csv_text(["x"], [[number]]) == f"x\n{number}\n"


@given(st.lists(st.tuples(words, words), min_size=1, max_size=3), words)
def test_what_is_read_is_what_was_written(tmp_path_factory, rows, head):
    path = tmp_path_factory.getbasetemp() / "again.csv"
    path.write_bytes(csv_text([f"a{head}", "b"], rows).encode())
    assert [tuple(row.values()) for row in read_csv(path)] == rows
    for row in csv.reader(io.StringIO(csv_text(["a", "b"], rows), newline="")):
        assert not [cell for cell in row if cell.startswith(COMPUTED) and not re.fullmatch(r"\s*[-+][\d.]+\s*", cell)]


def test_columns_of_version_0_1_are_read_under_their_present_names(tmp_path):
    """Also the head alone; an old name that stands beside its present one is another column."""
    path = tmp_path / "leaderboard.csv"
    path.write_text("metric,yardstick,twin_of\npss,median_rms_m,\n")
    assert read_head(path) == ["metric", "measure", "equivalent_to"]
    assert read_csv(path) == [{"metric": "pss", "measure": "median_rms_m", "equivalent_to": ""}]
    path.write_text("minus,baseline\na,b\n")
    assert read_csv(path) == [{"minus": "a", "baseline": "b"}]


def test_reference_tables_have_present_names():
    """A present name never becomes another by the table of old ones."""
    assert not set(RENAMED_COLUMNS) & set(RENAMED_COLUMNS.values())
    tables = sorted((ROOT / "results" / "reference").rglob("*.csv"))
    assert tables
    for table in tables:
        with table.open(encoding="utf-8") as file:
            assert not set(next(csv.reader(file))) & set(RENAMED_COLUMNS), table
