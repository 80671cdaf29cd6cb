"""docs/findings.md says what the tables in results/reference/bank say, to the letter."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from validate.bank.findings import findings, read_tables

ROOT = Path(__file__).parents[1]
TABLES = ROOT / "results" / "reference" / "bank"


@pytest.fixture(scope="module")
def tables():
    return read_tables(TABLES)


def test_the_page_is_made_from_the_tables(tables):
    """Every sentence of the bank's findings stands on the page as the command writes it."""
    page = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8")
    assert findings(tables) in page


def test_another_number_is_another_page(tables):
    """The sentences follow the tables: a changed figure shows."""
    text = findings(tables)
    changed = {name: [dict(row) for row in rows] for name, rows in tables.items()}
    for row in changed["leaderboard"]:
        row["spearman"] = "0.123" if row["spearman"] else ""
    assert findings(changed).count("0.12 [") > 10 > text.count("0.12 [")


def test_every_finding_has_a_number(tables):
    """A sentence without a figure is none."""
    lines = [line for line in findings(tables).splitlines() if line.startswith("- ")]
    assert len(lines) > 25
    without = [line for line in lines if not re.search(r"\d", line)]
    assert len(without) == 1
    assert without[0].startswith("- The oracle's R are the pixel errors of one half of the trials")
