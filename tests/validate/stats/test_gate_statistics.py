"""The gate's statistics on planted correlations: it opens for a real one, and for nothing else."""

import math

import numpy as np
import pytest

from pss.errors import RangeError, ShapeError
from tests.gate.gate import FEWEST_CONFIGURATIONS, Claim, format_claims, judge
from validate.stats.intervals import weighted_spearman

BOUND = 0.5
# Planted: the measured information differs from the predicted by 15 % a view and point; the correlation is near 0.95.
MODEL_ERROR = 0.15


def planted(seed, cameras=(2, 4), configurations=100, views=40, points=50):
    """Predicted and measured 1/σ (K, N) and views of a bank with several camera counts."""
    rng = np.random.default_rng(seed)
    information = np.exp(rng.normal(size=(views, 1)) * 0.5 + rng.normal(size=(views, points)) * 0.3)
    truth = information * np.exp(MODEL_ERROR * rng.normal(size=(views, points)))
    chosen = [rng.choice(views, c, replace=False).tolist() for c in cameras for _ in range(configurations)]
    predicted, measured = (np.array([np.sqrt(j[list(v)].sum(axis=0)) for v in chosen]) for j in (information, truth))
    return predicted, measured, chosen


def test_gate_passes_on_a_planted_correlation():
    predicted, measured, views = planted(1)
    claims = judge(predicted, measured, views, bound=BOUND)
    assert [claim.holds for claim in claims] == [True, True]
    assert ["2 cameras" in claims[0].name, "4 cameras" in claims[1].name] == [True, True]
    for claim in claims:
        assert BOUND <= claim.low <= claim.figure <= claim.high


@pytest.mark.parametrize("seed", range(5))
def test_gate_fails_on_shuffled_predictions(seed):
    predicted, measured, views = planted(seed, cameras=(2, 7))
    rng = np.random.default_rng(seed)
    shuffled = np.concatenate([rng.permutation(predicted[:100]), rng.permutation(predicted[100:])])
    claims = judge(shuffled, measured, views, bound=BOUND)
    assert not any(claim.holds for claim in claims)
    # The reason for equal counts: over both, the shuffled prediction still correlates, by counting alone.
    assert weighted_spearman(shuffled.mean(axis=1), measured.mean(axis=1)) > BOUND


def test_the_lower_end_decides_and_not_the_figure():
    predicted, measured, views = planted(2, cameras=(4,))
    (claim,) = judge(predicted, measured, views, bound=BOUND)
    between = (claim.low + claim.figure) / 2
    (stricter,) = judge(predicted, measured, views, bound=between)
    assert stricter.figure > between > stricter.low
    assert not stricter.holds


def test_the_figure_has_to_reach_what_is_required_too():
    predicted, measured, views = planted(2, cameras=(4,))
    (claim,) = judge(predicted, measured, views, bound=BOUND)
    for least, holds in ((claim.figure - 1e-3, True), (claim.figure + 1e-3, False)):
        (judged,) = judge(predicted, measured, views, bound=BOUND, least=least)
        assert judged.holds == holds
        assert f"of the figure {least:+.3f}" in format_claims([judged])


def test_one_count_can_be_asked_for():
    predicted, measured, views = planted(3)
    (claim,) = judge(predicted, measured, views, bound=BOUND, cameras=4)
    assert "4 cameras, 100 configurations" in claim.name


def test_too_few_configurations_and_constant_predictions_hold_nothing():
    predicted, measured, views = planted(4, cameras=(3,), configurations=FEWEST_CONFIGURATIONS)
    (enough,) = judge(predicted, measured, views, bound=-1)
    assert enough.holds
    (few,) = judge(predicted[1:], measured[1:], views[1:], bound=-1)
    (constant,) = judge(np.ones_like(predicted), measured, views, bound=-1)
    (absent,) = judge(predicted, measured, views, bound=-1, cameras=5)
    for claim in (few, constant, absent):
        assert math.isnan(claim.figure)
        assert not claim.holds


def test_the_same_numbers_make_the_same_claims():
    predicted, measured, views = planted(5)
    first, second = (judge(predicted, measured, views, bound=BOUND) for _ in range(2))
    assert first == second


def test_claims_print_one_line_each():
    lines = format_claims(
        [Claim("short", 0.912, 0.85, 0.95, 0.5, True), Claim("a longer name", np.nan, np.nan, np.nan, 0.5, False)]
    ).split("\n")
    assert lines == [
        "PASS  short          +0.912  [+0.850, +0.950]  bound +0.500",
        "FAIL  a longer name  +nan  [+nan, +nan]  bound +0.500",
    ]
    assert format_claims([]) == ""


def test_wrong_inputs_are_told():
    predicted, measured, views = planted(6, configurations=10)
    with pytest.raises(ShapeError, match="19 configurations"):
        judge(predicted, measured, views[1:], bound=BOUND)
    with pytest.raises(RangeError, match=r"1\.5"):
        judge(predicted, measured, views, bound=1.5)
