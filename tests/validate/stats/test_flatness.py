"""A sweep whose steps are alike is called flat in 95 % of made-up worlds, and one that falls is not."""

from __future__ import annotations

import numpy as np
import pytest

from validate.stats.flatness import exchanged_ranges, is_flat, least_difference, spread_of_points
from validate.stats.measured_errors import MeasuredErrors
from validate.sweeps.replicates import sweep_replicates

WORLDS, EXCHANGES = 160, 19
# Of 160 worlds at 0.95 the share has a standard error of 0.017; two and a half of them.
LEAST_SHARE, LARGEST_SHARE = 0.907, 0.993
# Worlds in which resamples are drawn as well, and their number in each.
FEW_WORLDS, REPLICATES = 60, 200
# `least_difference` is not exact: 94 to 99 % in the module's own account, less three standard errors of 60 worlds.
LEAST_SHARE_OF_RESAMPLES = 0.86
# A weighted mean of four values is not quite normal: its quantile is up to 4 % off, the missing factor 13 % or more.
FEW_POINTS_RESAMPLES, NOT_NORMAL = 20_000, 0.08


def a_world(rng, kind, steps=3, trials=6, points=8):
    """Errors of a sweep whose steps are alike: (S, T, N, 3) in m."""
    sigma = 1e-4 * np.exp(rng.normal(0, 0.5, (1, 1, points, 1))) * np.array([1, 1, 3])
    errors = rng.normal(size=(steps, trials, points, 3)) * sigma
    if kind == "in common":  # views that all steps have, and trials that are bad for all points
        errors = errors + rng.normal(size=(1, trials, points, 3)) * sigma
        errors = errors * np.exp(rng.normal(0, 0.4, (steps, trials, 1, 1)))
    elif kind == "biased and missed":
        errors = errors + rng.normal(size=(1, 1, points, 3)) * sigma
        errors[rng.random((steps, trials, points)) > 0.7] = np.nan
    elif kind == "other markers":  # each step is good for markers of its own
        errors = errors * np.exp(rng.normal(0, 0.5, (steps, 1, points, 1)))
    return [MeasuredErrors(each) for each in errors]


def pss(errors):
    """1/m, (S,)."""
    return np.array([each.pss() for each in errors])


@pytest.mark.parametrize("kind", ["of their own", "in common", "biased and missed"])
def test_alike_steps_are_called_flat_in_95_percent_of_worlds(kind):
    """Whatever the errors have in common; corrected for choosing the highest and the lowest step."""
    rng = np.random.default_rng(3)
    worlds = [a_world(rng, kind) for _ in range(WORLDS)]
    flat = np.mean([is_flat(pss(errors), exchanged_ranges(errors, rng, EXCHANGES)) for errors in worlds])
    assert LEAST_SHARE <= flat <= LARGEST_SHARE


def test_a_curve_that_falls_is_not_flat():
    """To a third over the steps: in each of ten worlds."""
    rng = np.random.default_rng(4)
    for _ in range(10):
        alike = a_world(rng, "", trials=20)
        errors = [MeasuredErrors(each.errors_m * factor) for each, factor in zip(alike, (1, 1.5, 3), strict=True)]
        assert not is_flat(pss(errors), exchanged_ranges(errors, rng, 39))


def test_the_ranges_are_those_of_measured_pss():
    """Exchanged by hand with the same random numbers, and measured as any sweep is."""
    errors = a_world(np.random.default_rng(5), "biased and missed", steps=4)
    found = exchanged_ranges(errors, np.random.default_rng(6), 3)
    rng, ranges = np.random.default_rng(6), []
    arrays = np.array([each.errors_m for each in errors])
    for _ in range(3):
        order = rng.permuted(np.tile(np.arange(4), (6, 1)), axis=1)
        mixed = np.array([[arrays[order[trial, step], trial] for trial in range(6)] for step in range(4)])
        ranges.append(np.ptp(pss([MeasuredErrors(each) for each in mixed])))
    np.testing.assert_allclose(found, ranges, rtol=1e-12)


def test_what_is_shown_for_other_markers_too_is_rarely_chance():
    """Steps that are each good for markers of their own differ for these markers, and not in truth."""
    rng, below, flat = np.random.default_rng(7), 0, 0
    for _ in range(FEW_WORLDS):
        errors = a_world(rng, "other markers", trials=20, points=12)
        made = sweep_replicates(errors, np.ones((3, 12)), rng, REPLICATES)
        values = pss(errors)
        least = least_difference(
            values, made.measured_pss_of_trials, made.measured_pss_of_points, made.measured_pss, 20, 12
        )
        below += np.ptp(values) <= least
        flat += is_flat(values, exchanged_ranges(errors, rng, EXCHANGES))
    assert below / FEW_WORLDS >= LEAST_SHARE_OF_RESAMPLES
    assert flat / FEW_WORLDS < 0.7


@pytest.mark.parametrize("points", [4, 5, 8])
def test_the_spread_of_few_points_is_that_of_their_standard_error(points):
    """95 % of a normal mean are within 1.96 standard errors; Dirichlet's weights alone show less of so few."""
    rng = np.random.default_rng(8)
    found = rng.normal(size=points)
    weights = rng.dirichlet(np.ones(points), FEW_POINTS_RESAMPLES)
    values = np.array([found.mean(), 0.0])
    samples = np.stack([weights @ found, np.zeros(FEW_POINTS_RESAMPLES)], axis=1)
    spread = spread_of_points(values, samples, points)
    assert spread == pytest.approx(1.96 * found.std(ddof=1) / np.sqrt(points), rel=NOT_NORMAL)
    constant = np.broadcast_to(values, samples.shape)
    assert least_difference(values, constant, samples, samples, 20, points) >= spread
    assert least_difference(values, samples, constant, samples, points, 20) >= spread


def test_without_resamples_nothing_is_known():
    """Of one trial or one point; a range of nan is no flat curve."""
    values, samples = np.array([1.0, 2.0]), np.ones((5, 2))
    assert np.isnan(least_difference(values, samples, samples, samples, 1, 9))
    assert np.isnan(spread_of_points(values, samples, 1))
    assert not np.ptp(values) <= np.nan
