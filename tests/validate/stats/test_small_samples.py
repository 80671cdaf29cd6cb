"""What a right covariance shows after a few trials: by Bartlett's decomposition, by errors themselves, and closed."""

from __future__ import annotations

import numpy as np
import pytest

from validate.stats.consistency import anisotropy
from validate.stats.measured_errors import MeasuredErrors
from validate.stats.small_samples import after_trials

# Medians and means of 40,000 draws each way: five of their standard errors are below 1.5 %.
DRAWS, SAMPLED = 40_000, 0.015
SHAPES = [(1.0, 1.0, 1.0), (3.0, 1.0, 1.0), (3.0, 3.0, 1.0), (10.0, 3.0, 1.0)]


def turned(axes, rng):
    """A covariance with these axes in any direction."""
    q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return (q * np.square(axes)) @ q.T


@pytest.mark.parametrize("axes", SHAPES)
@pytest.mark.parametrize("trials", [3, 5, 10, 20])
def test_moments_of_errors_look_alike(axes, trials):
    """Errors are drawn, and measured as those of a configuration are."""
    rng = np.random.default_rng(trials)
    covariance = 1e-6 * turned(axes, rng)
    found = after_trials(covariance[None], np.array([trials]), rng, DRAWS)
    errors = MeasuredErrors(rng.standard_normal((trials, DRAWS, 3)) @ np.linalg.cholesky(covariance).T)
    values, vectors = np.linalg.eigh(errors.second_moment_m2)
    ratio = np.sqrt(values[:, 2] / values[:, 0])
    angle = np.degrees(np.arccos(np.abs(vectors[:, :, 2] @ np.linalg.eigh(covariance)[1][:, 2])))
    assert np.median(found.axis_ratio) == pytest.approx(np.median(ratio), rel=3 * SAMPLED if trials == 3 else SAMPLED)
    # Shapes with two long axes have no longest one.
    if axes[0] > axes[1]:
        assert np.median(found.axis_angle_deg) == pytest.approx(np.median(angle), rel=2 * SAMPLED)
    assert found.inverse_sigma.mean() == pytest.approx(errors.inverse_sigma.mean(), rel=SAMPLED)


@pytest.mark.parametrize("trials", [2 + 1, 5, 20])
def test_a_needle_is_freed_of_all_its_bias(trials):
    """Closed form: only one direction counts, whose 1/σ̂ has the factor of `inverse_sigma_bias`; flat ones keep some."""
    rng = np.random.default_rng(1)
    needle, ball = (
        after_trials(np.diag(axes)[None], np.array([trials]), rng, DRAWS).inverse_sigma.mean()
        for axes in ([1.0, 1e-6, 1e-6], [1.0, 1.0, 1.0])
    )
    assert needle == pytest.approx(1, rel=3 * SAMPLED)
    assert ball < 0.85


def test_a_right_prediction_is_told_from_a_wrong_one():
    """Twenty trials of 3 to 1: measured and predicted after twenty trials agree, where 3.0 against 3.7 seemed wrong."""
    rng = np.random.default_rng(2)
    covariance = np.array([[turned((3e-3, 1e-3, 1e-3), rng) for _ in range(50)] for _ in range(80)])
    root = np.linalg.cholesky(covariance)
    errors = np.einsum("knij,tknj->tkni", root, rng.standard_normal((20, 80, 50, 3)))
    moment = np.einsum("tkni,tknj->knij", errors, errors) / 20
    found = anisotropy(moment, covariance, np.full((80, 50), 20))
    assert found["predicted_axis_ratio_median"] == pytest.approx(3)
    assert found["measured_axis_ratio_median"] > 3.5
    for measured, expected in (
        ("measured_axis_ratio_median", "axis_ratio_after_trials_median"),
        ("axis_angle_median_deg", "axis_angle_after_trials_median_deg"),
        ("measured_inverse_sigma_mean", "inverse_sigma_after_trials_mean"),
    ):
        assert found[measured] == pytest.approx(found[expected], rel=3 * SAMPLED)
    twice = anisotropy(4 * moment, covariance, np.full((80, 50), 20))
    assert twice["measured_inverse_sigma_mean"] == pytest.approx(found["measured_inverse_sigma_mean"] / 2)
    assert twice["inverse_sigma_after_trials_mean"] == found["inverse_sigma_after_trials_mean"]
