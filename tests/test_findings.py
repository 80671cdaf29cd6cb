"""docs/findings.md says what the tables in results/reference say, to the letter."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from validate.findings.bank import bank_findings
from validate.findings.budget import budget_findings
from validate.findings.factors import factor_findings
from validate.findings.page import findings_page
from validate.findings.tables import read_tables

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "results" / "reference"


@pytest.fixture(scope="module")
def tables():
    return read_tables(REFERENCE / "bank")


def test_the_page_is_made_from_the_tables():
    """`python -m validate.findings > docs/findings.md` changes nothing."""
    page = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8")
    assert page == findings_page(REFERENCE)
    for heading in (
        "In more and in less light",
        "One factor at a time",
        "Where the sweeps' errors are from",
        "If the calibration is wrong",
        "Two people pass each other",
    ):
        assert f"## {heading}" in page


def test_another_number_is_another_page(tables):
    """The sentences follow the tables: a changed figure shows."""
    text = bank_findings(tables)
    changed = {name: [dict(row) for row in rows] for name, rows in tables.items()}
    for row in changed["leaderboard"]:
        row["spearman"] = "0.123" if row["spearman"] else ""
    assert bank_findings(changed).count("0.12 [") > 10 > text.count("0.12 [")


def test_every_finding_has_a_number(tables):
    """A sentence without a figure is none."""
    lines = [line for line in bank_findings(tables).splitlines() if line.startswith("- ")]
    assert len(lines) > 25
    without = [line for line in lines if not re.search(r"\d", line)]
    assert len(without) == 1
    assert without[0].startswith("- The oracle's R are the pixel errors of one half of the trials")


def test_the_budget_by_hand():
    """Of two steps the lower and the higher factor; one number where they are the same; other models are left out."""
    factors = {"budget_noise_model": "0.9", "budget_detector": "1.1", "budget_geometry": "1"}
    step = {"sweep": "s", "noise_model": "physical", "pss_single_frame": "4", **factors}
    rows = [
        {**step, "measured_pss_single_frame": "3", "budget_visibility": "0.7576"},
        {**step, "measured_pss_single_frame": "2", "budget_visibility": "0.5051"},
        {**step, "noise_model": "corrected", "measured_pss_single_frame": "9", "budget_visibility": "9"},
    ]
    last = budget_findings(rows).splitlines()[-1]
    assert last == "| s | 2 | 0.50 to 0.75 | 0.51 to 0.76 | 0.90 | 1.10 | 1.00 |"


def test_factors_by_hand():
    """Two sweeps, two models: who is inside the interval, who has the wrong sign."""
    measured = {"measured_slope": "-0.5", "measured_slope_ci_low": "-0.6", "measured_slope_ci_high": "-0.4"}
    rows = [
        {"sweep": sweep, "noise_model": model, "predicted_slope": slope, **measured}
        for sweep, model, slope in (
            ("exposure", "physical", "-0.55"),
            ("exposure", "corrected", "0.1"),
            ("exposure", "as-printed", "-0.3"),
            ("mine", "physical", "-0.2"),
            ("mine", "corrected", "-0.5"),
            ("mine", "as-printed", "-0.5"),
        )
    ]
    text = factor_findings(rows)
    assert "| exposure time | exposure | −0.50 [−0.60, −0.40] | −0.55 | 0.10 | −0.30 |" in text
    assert "- physical: the slope lies in the measured one's interval in 1 of 2 sweeps, and is off by 0.30" in text
    assert text.count("wrong sign") == 1
    assert "wrong sign in exposure." in text
