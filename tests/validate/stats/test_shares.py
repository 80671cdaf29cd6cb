"""Intervals of shares stay within 0 to 1, and have a length where none or all are found."""

from __future__ import annotations

import pytest

from validate.findings.places import Place
from validate.findings.size_tables import reliability_table, share_found
from validate.stats.shares import share_interval

TAIL = 0.025


@pytest.mark.parametrize("views", [3, 31])
def test_none_or_all_found_has_the_exact_binomial_bound(views):
    """With a true share at the bound, all of so many views agree by chance in a fortieth of cases."""
    _, high = share_interval(0.0, 0.0, 0.0, views)
    low, _ = share_interval(1.0, 1.0, 1.0, views)
    assert (1 - high) ** views == pytest.approx(TAIL)
    assert low**views == pytest.approx(TAIL)
    assert share_interval(0.0, 0.0, 0.0, views)[0] == 0
    assert share_interval(1.0, 1.0, 1.0, views)[1] == 1


def test_other_intervals_end_at_zero_and_one():
    assert share_interval(0.6, -0.1, 1.4, 10) == (0.0, 1.0)
    assert share_interval(0.6, 0.4, 0.8, 10) == (0.4, 0.8)


def test_a_table_from_before_is_read_so():
    rows = [
        {"probability_from": "0", "views": "12", "found": "0", "found_ci_low": "0", "found_ci_high": "0"},
        {"probability_from": "0.6", "views": "10", "found": "0.73", "found_ci_low": "0.38", "found_ci_high": "1.41"},
    ]
    assert share_found(rows[0])[2] == pytest.approx(1 - TAIL ** (1 / 12))
    text = reliability_table([Place("room", "the room's seven", {"reliability": rows})])
    assert "0.73 [0.38, 1.00]" in text
    assert "0.00 [0.00, 0.26]" in text
