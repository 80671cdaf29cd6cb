"""Rank statistics against SciPy, and the intervals' coverage by simulated worlds whose truth is known."""

import math

import numpy as np
import pytest
import scipy.stats

from pss.errors import RangeError, ShapeError
from validate.stats.intervals import (
    interval,
    interval_with,
    kendall,
    oracle_regret,
    pearson_log,
    regret,
    spearman_of_groups,
    tie_groups,
    weighted_spearman,
)
from validate.stats.measured_errors import MeasuredErrors
from validate.sweeps.replicates import _largest_eigenvalue, sweep_replicates

# Sums of some hundred terms, in another order.
SAME_TO_ROUNDING = 1e-12
# arccos loses half of the digits where two eigenvalues meet.
CLOSED_FORM = 1e-7
# Coverage of a 95 % interval over 100 worlds has a standard error of 0.022; below 0.88 is beyond three of them. The
# product weights err to the long side, so that nothing is asked of the upper end here; lengths have their own test.
LEAST_COVERAGE = 0.88
# Where the whole sweep hangs on one variance from 40 trials, percentile intervals cover 0.88 (300 worlds): the usual
# weakness of the bootstrap for variances of few samples. Allowed is three standard errors less; without trial weights,
# near 0.
LEAST_COVERAGE_ONE_VARIANCE = 0.78
WORLDS = 100


@pytest.fixture
def rng():
    return np.random.default_rng(20)


# --- rank statistics


@pytest.mark.parametrize("ties", [False, True])
def test_spearman_agrees_with_scipy(rng, ties):
    x, y = rng.normal(size=(2, 60))
    y = x + y
    if ties:
        x, y = np.round(x), np.round(y)
    assert weighted_spearman(x, y) == pytest.approx(scipy.stats.spearmanr(x, y).statistic, rel=SAME_TO_ROUNDING)
    assert kendall(x, y) == pytest.approx(scipy.stats.kendalltau(x, y).statistic, rel=SAME_TO_ROUNDING)


def test_whole_weights_repeat_the_pairs(rng):
    x, y = np.round(rng.normal(size=(2, 40)) * 3)
    weights = rng.integers(0, 4, 40)
    repeated = scipy.stats.spearmanr(np.repeat(x, weights), np.repeat(y, weights)).statistic
    assert weighted_spearman(x, y, weights) == pytest.approx(repeated, rel=SAME_TO_ROUNDING)
    assert weighted_spearman(x, y, 0.01 * weights) == pytest.approx(repeated, rel=SAME_TO_ROUNDING)
    of_groups = spearman_of_groups(tie_groups(x), tie_groups(y), np.asarray(weights, dtype=float))
    assert of_groups == pytest.approx(repeated, rel=SAME_TO_ROUNDING)


def test_a_batch_is_its_rows(rng):
    x, y, w = rng.normal(size=(3, 5, 20))
    w = np.abs(w)
    rows = [weighted_spearman(x[b], y[0], w[b]) for b in range(5)]
    np.testing.assert_allclose(weighted_spearman(x, y[0], w), rows, rtol=SAME_TO_ROUNDING)


def test_values_that_differ_by_roundings_are_tied():
    counts = np.array([0.1 + 0.2, 0.3, 0.5, 0.5, 0.9])
    assert counts[0] != counts[1]
    y = np.array([2.0, 1.0, 3.0, 5.0, 4.0])
    tied = scipy.stats.spearmanr([1, 1, 2, 2, 3], y).statistic
    assert weighted_spearman(counts, y) == pytest.approx(tied, rel=SAME_TO_ROUNDING)


def test_infinity_is_the_largest_value():
    x, y = np.array([1.0, np.inf, 2.0, np.inf, -np.inf]), np.array([3.0, 5.0, 2.0, 4.0, 1.0])
    finite = scipy.stats.spearmanr([1, 9, 2, 9, -9], y).statistic
    assert weighted_spearman(x, y) == pytest.approx(finite, rel=SAME_TO_ROUNDING)


@pytest.mark.parametrize("x", [[1.0, 1.0, 1.0], [1.0, np.nan, 2.0]])
@pytest.mark.parametrize("statistic", [weighted_spearman, kendall, pearson_log])
def test_constant_and_unknown_values_have_no_correlation(statistic, x):
    y = [1.0, 2.0, 3.0]
    assert math.isnan(statistic(x, y))
    assert math.isnan(statistic(y, x))


def test_too_few_values_have_no_correlation():
    assert math.isnan(weighted_spearman([1.0], [2.0]))
    assert math.isnan(weighted_spearman([1.0, 2.0], [1.0, 2.0], [1.0, 0.0]))
    assert math.isnan(pearson_log([0.0, 1.0, 2.0], [1.0, 2.0, 3.0]))


def test_pearson_log_sees_a_power_law(rng):
    x = rng.uniform(1, 10, 30)
    assert pearson_log(x, 3 * x**-2.5) == pytest.approx(-1, rel=SAME_TO_ROUNDING)
    y = rng.uniform(1, 10, 30)
    assert pearson_log(x, y) == pytest.approx(scipy.stats.pearsonr(np.log(x), np.log(y))[0], rel=SAME_TO_ROUNDING)


def test_interval_holds_its_share_of_the_samples():
    low, high = interval(np.arange(101.0), 0.9)
    assert (low, high) == pytest.approx((5.0, 95.0), rel=SAME_TO_ROUNDING)
    assert np.isnan(interval([1.0, np.nan])).all()
    with pytest.raises(RangeError):
        interval([1.0], 95)


def test_an_interval_is_never_beside_its_estimate():
    samples = np.linspace(0.8, 0.99, 101)
    low, high = interval_with(1.0, samples)
    assert (low, high) == (pytest.approx(interval(samples)[0]), 1.0)
    assert interval_with(0.9, samples) == pytest.approx(interval(samples))
    assert interval_with(0.7, samples)[0] == 0.7
    assert np.isnan(interval_with(np.nan, samples)).all()


# --- a sweep: trials and points


def test_closed_form_eigenvalue_agrees_with_lapack(rng):
    factor = rng.normal(size=(1000, 3, 3)) * 10.0 ** rng.uniform(-4, 0, size=(1000, 1, 3))
    matrices = np.concatenate([factor @ factor.mT, [np.eye(3), np.diag([2.0, 2.0, 1.0]), np.diag([2.0, 1.0, 1.0])]])
    i, j = np.triu_indices(3)
    np.testing.assert_allclose(
        _largest_eigenvalue(matrices[:, i, j]), np.linalg.eigvalsh(matrices)[:, -1], rtol=CLOSED_FORM
    )


def sweep_world(rng, trials=20, points=60, spread=0.5, common=False):
    """Two configurations with errors in common, the second 1.5 times as good; 1/σ of a point has mean 1000 and 1500.

    `spread` is that of ln σ over the points; with `common`, a trial's error is the same at all of them.
    """
    inverse = 1e3 * np.exp(spread * rng.normal(size=points) - spread**2 / 2)
    errors = rng.normal(size=(trials, 1 if common else points, 3)) * [0.1, 0.2, 1.0] / inverse[:, None]
    return [MeasuredErrors(errors), MeasuredErrors(errors / 1.5)], np.stack([inverse, 1.5 * inverse])


@pytest.mark.parametrize(
    ("world", "least"),
    [
        ({}, LEAST_COVERAGE),
        ({"spread": 0.0}, LEAST_COVERAGE),
        ({"spread": 0.0, "common": True, "trials": 40}, LEAST_COVERAGE_ONE_VARIANCE),
    ],
)
def test_sweep_interval_covers_the_true_pss(rng, world, least):
    """Points alike: all chance is in the trials, and an interval with the resample's own 4 % bias would miss.

    Errors in common: the points say nothing of the chance, only the trials do.
    """
    covered = 0
    for _ in range(WORLDS):
        errors, predicted = sweep_world(rng, **world)
        low, high = interval(sweep_replicates(errors, predicted, rng, 200).measured_pss)
        covered += low[0] <= 1000 <= high[0]
    assert covered / WORLDS >= least


def test_sweep_interval_is_not_needlessly_long(rng):
    """Length against the true scatter over worlds, 2 × 1.96 standard deviations."""
    worlds = [sweep_world(rng) for _ in range(WORLDS)]
    scatter = np.std([errors[0].pss() for errors, _ in worlds])
    ends = [interval(sweep_replicates(*world, rng, 200).measured_pss[:, 0]) for world in worlds[:30]]
    lengths = np.mean([high - low for low, high in ends])
    # 100 worlds know the scatter to 7 %; the weights' products add some 10 %.
    assert 0.8 < lengths / (2 * 1.96 * scatter) < 1.35


def test_replicates_are_centred_on_the_estimates(rng):
    errors, predicted = sweep_world(rng)
    replicates = sweep_replicates(errors, predicted, rng, 2000)
    estimates = [e.pss() for e in errors], predicted.mean(axis=1), [e.pooled_rms_m for e in errors]
    samples = replicates.measured_pss, replicates.predicted_pss, replicates.rms_m
    for estimate, sample, bias in zip(estimates, samples, (0.0, 0.0, 0.01), strict=True):
        # The root of the mean square is low by about an eighth of its relative variance: allowed is one per cent.
        allowed = 4 * sample.std(axis=0) / math.sqrt(len(sample)) + bias * np.array(estimate)
        assert (np.abs(sample.mean(axis=0) - estimate) < allowed).all()


def test_configurations_of_a_sweep_share_their_weights(rng):
    errors, predicted = sweep_world(rng)
    replicates = sweep_replicates(errors, predicted, rng, 100)
    for name in ("measured_pss", "predicted_pss"):
        pair = getattr(replicates, name)
        np.testing.assert_allclose(pair[:, 1], 1.5 * pair[:, 0], rtol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(replicates.rms_m[:, 1] * 1.5, replicates.rms_m[:, 0], rtol=SAME_TO_ROUNDING)


def test_undetected_points_count_zero_in_every_replicate(rng):
    errors = rng.normal(size=(20, 10, 3)) * 1e-3
    errors[:, :5] = np.nan
    errors[2:, 5] = np.nan  # twice: too few for 1/σ
    half, nothing = MeasuredErrors(errors), MeasuredErrors(np.full((20, 10, 3), np.nan))
    replicates = sweep_replicates([half, nothing], np.zeros((2, 10)), rng, 200)
    assert (replicates.measured_pss[:, 0] > 0).all()
    assert replicates.measured_pss[:, 0].mean() == pytest.approx(half.pss(), rel=0.15)
    assert (replicates.measured_pss[:, 1] == 0).all()
    assert np.isfinite(replicates.rms_m[:, 0]).all()
    assert np.isnan(replicates.rms_m[:, 1]).all()


def test_sweep_shapes_are_told(rng):
    errors = MeasuredErrors(np.ones((4, 5, 3)))
    with pytest.raises(ShapeError, match=r"\(1, 6\)"):
        sweep_replicates([errors], np.ones((1, 6)), rng)
    with pytest.raises(ShapeError):
        sweep_replicates([errors, MeasuredErrors(np.ones((3, 5, 3)))], np.ones((2, 5)), rng)


# --- regret

HALF_A, HALF_B = np.array([1.0, 4.0, 2.0]), np.array([1.0, 4.0, 5.0])


def test_regret_by_hand():
    assert regret([0, 1, 0], HALF_A, HALF_B) == pytest.approx((0 + 1 / 5) / 2)
    assert regret([0, 1, 0], HALF_B, HALF_A) == pytest.approx((0 + 1 / 5) / 2)
    assert regret([2, 1, 9], HALF_A, HALF_B, higher_is_better=False) == pytest.approx((0 + 1 / 5) / 2)
    assert regret([9, np.nan, 0], HALF_A, HALF_B) == pytest.approx((3 / 4 + 4 / 5) / 2)


def test_regret_of_a_tie_is_the_average_of_the_tied():
    assert regret([1, 1, 0], HALF_A, HALF_B) == pytest.approx((1 - 2.5 / 4 + 1 - 2.5 / 5) / 2)
    assert regret([np.inf, 3, 3], HALF_A, HALF_B, higher_is_better=False) == pytest.approx((1 / 4 + 1 / 10) / 2)
    assert regret([np.inf] * 3, HALF_A, HALF_B, False) == pytest.approx((1 - 7 / 12 + 1 - 10 / 15) / 2)


def test_oracle_regret_by_hand():
    # A's best scores 4 of 5 on B; B's best scores 2 of 4 on A.
    assert oracle_regret(HALF_A, HALF_B) == pytest.approx((1 / 5 + 1 / 2) / 2)
    assert oracle_regret(HALF_A, HALF_A) == 0


def test_regret_degenerate_inputs():
    assert math.isnan(regret([np.nan] * 3, HALF_A, HALF_B))
    assert math.isnan(regret([1, 2, 3], np.zeros(3), HALF_B))
    assert math.isnan(oracle_regret(np.zeros(3), HALF_B))
    with pytest.raises(ShapeError, match=r"\(2,\)"):
        regret([1, 2], HALF_A, HALF_B)
