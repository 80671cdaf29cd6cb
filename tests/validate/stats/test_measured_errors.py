"""Measured errors by second routes: loops over points, known distributions, and Monte Carlo for the bias of 1/σ̂."""

import math

import numpy as np
import pytest
import scipy.integrate
import scipy.stats

from pss.errors import RangeError, ShapeError
from pss.riccati.covariances import mean_inverse_sigma
from validate.stats.measured_errors import MeasuredErrors, inverse_sigma_bias, measured_inverse_sigma, measured_pss

# Sums of some twenty terms, in another order.
SAME_TO_ROUNDING = 1e-12
# Quadrature of a smooth density to its own default accuracy, with room.
QUADRATURE = 1e-7
# Standard errors: a Monte Carlo mean beyond this happens once in 15 000, and the seeds are fixed.
STANDARD_ERRORS = 4.0
# Of the shortfall that a docstring states to a hundredth: its rounding, and the chance of 40,000 points.
WITHIN_SHORTFALL = 0.015
# Triangulation errors are long along the line of sight; so slender that the largest eigenvalue is one component's.
SLENDER = np.array([1.0, 1e-3, 1e-3])


def some_errors(seed=3, trials=20, points=12, rate=0.7):
    rng = np.random.default_rng(seed)
    errors = rng.normal(size=(trials, points, 3)) * [1e-3, 2e-3, 5e-3] + rng.normal(size=(points, 3)) * 2e-3
    errors[rng.uniform(size=(trials, points)) > rate] = np.nan
    errors[:, 0] = np.nan  # never
    errors[:, 1] = np.nan
    errors[4, 1] = [1e-3, 0, 0]  # once
    return errors


def within_standard_errors(samples, truth):
    return abs(samples.mean() - truth) < STANDARD_ERRORS * samples.std(ddof=1) / math.sqrt(len(samples))


def test_moments_agree_with_a_loop_over_points():
    errors = some_errors()
    measured = MeasuredErrors(errors)
    covariance = np.broadcast_to(np.diag([1e-6, 4e-6, 9e-6]), (errors.shape[1], 3, 3))
    nees = measured.nees(covariance)
    for n in range(1, errors.shape[1]):
        e = errors[~np.isnan(errors[:, n, 0]), n]
        moment = e.T @ e / len(e)
        close = {"rtol": SAME_TO_ROUNDING, "atol": 0}
        np.testing.assert_allclose(measured.detection_rate[n], len(e) / len(errors), **close)
        np.testing.assert_allclose(measured.second_moment_m2[n], moment, rtol=SAME_TO_ROUNDING, atol=1e-20)
        np.testing.assert_allclose(measured.sigma_m[n], np.linalg.norm(e, 2) / math.sqrt(len(e)), **close)
        np.testing.assert_allclose(measured.rms_m[n], math.sqrt((e**2).sum(axis=1).mean()), **close)
        np.testing.assert_allclose(measured.bias_m[n], np.linalg.norm(e.mean(axis=0)), **close)
        np.testing.assert_allclose(nees[n], np.mean([x @ np.linalg.inv(covariance[n]) @ x for x in e]), **close)
        if n > 1:
            np.testing.assert_allclose(measured.std_m[n], math.sqrt(np.trace(np.cov(e.T))), **close)


def test_a_point_without_enough_detections_is_nan_but_counts_in_every_share():
    measured = MeasuredErrors(some_errors())
    assert measured.detection_rate[0] == 0
    for values in (measured.sigma_m, measured.rms_m, measured.bias_m, measured.std_m, measured.mean_error_m):
        assert np.isnan(values[0]).all()
    assert np.isfinite(measured.rms_m[1])
    assert np.isnan(measured.std_m[1])
    assert (measured.inverse_sigma[:2] == 0).all()
    assert (measured.inverse_sigma[2:] > 0).all()


def test_shares_and_medians_count_the_undetected():
    errors = np.full((4, 3, 3), np.nan)
    errors[:, 0] = [3e-3, 0, 4e-3]  # 5 mm each time
    errors[:2, 1] = [1e-3, 0, 0]
    measured = MeasuredErrors(errors)
    assert measured.share_under(5.1e-3) == 6 / 12
    assert measured.share_under(4.9e-3) == 2 / 12
    assert measured.median_rms_m == pytest.approx(5e-3, rel=SAME_TO_ROUNDING)
    assert measured.pooled_rms_m == pytest.approx(math.sqrt(13e-6), rel=SAME_TO_ROUNDING)
    assert MeasuredErrors(errors[:, 1:]).median_rms_m == np.inf
    nothing = MeasuredErrors(errors[:, 2:])
    assert nothing.median_rms_m == np.inf
    assert nothing.pss() == 0
    assert nothing.share_under(np.inf) == 0
    assert math.isnan(nothing.noise_share)
    assert math.isnan(nothing.pooled_rms_m)


def test_halves_are_disjoint_and_together_all_trials():
    errors = some_errors()
    even, odd = MeasuredErrors(errors).halves()
    np.testing.assert_array_equal(even.errors_m, errors[::2])
    np.testing.assert_array_equal(odd.errors_m, errors[1::2])


@pytest.mark.parametrize(("bias", "share"), [(0.0, 1.0), (1.0, 3 / 4), (4.0, 3 / 19)])
def test_noise_share_is_right_in_mean_for_few_trials(bias, share):
    """Three trials: uncorrected, the square of the mean error would be too large by a third of the variance."""
    rng = np.random.default_rng(5)
    measured = MeasuredErrors(rng.normal(size=(3, 60_000, 3)) + [0, 0, bias])
    # Delta method, generously: the share's scatter over 60 000 points is below 1/√60 000.
    assert measured.noise_share == pytest.approx(share, abs=STANDARD_ERRORS / math.sqrt(60_000))


def test_nees_of_the_right_covariance_is_three():
    rng = np.random.default_rng(6)
    shape = rng.normal(size=(3, 3)) * 1e-3
    measured = MeasuredErrors(rng.normal(size=(20, 2000, 3)) @ shape.T)
    nees = measured.nees(np.broadcast_to(shape @ shape.T, (2000, 3, 3)))
    assert within_standard_errors(nees, 3.0)
    assert not within_standard_errors(measured.nees(np.broadcast_to(1.1 * shape @ shape.T, (2000, 3, 3))), 3.0)


def test_nees_is_unknown_where_the_covariance_is():
    covariance = np.broadcast_to(np.eye(3), (12, 3, 3)).copy()
    covariance[5] = np.nan
    unknown = np.isnan(MeasuredErrors(some_errors()).nees(covariance))
    assert unknown[[0, 5]].all()
    assert unknown.sum() == 2


@pytest.mark.parametrize("k", [3, 7, 10, 20, 200])
def test_bias_of_inverse_sigma_agrees_with_quadrature(k):
    most = k + 25 * math.sqrt(2 * k)  # beyond 25 standard deviations there is nothing
    expected, _ = scipy.integrate.quad(lambda s: math.sqrt(k / s) * scipy.stats.chi2.pdf(s, k), 0, most)
    assert inverse_sigma_bias(k) == pytest.approx(expected, rel=QUADRATURE)


def test_bias_of_inverse_sigma_at_the_ends():
    assert inverse_sigma_bias(20) == pytest.approx(1.04, abs=0.001)  # the design's +4 %
    np.testing.assert_array_equal(inverse_sigma_bias([0, 1, np.inf]), [np.inf, np.inf, 1])
    # The next term of the expansion 1 + 3/(4k) is 25/(32k²).
    assert inverse_sigma_bias(1e6) == pytest.approx(1 + 0.75e-6, abs=2e-9)


@pytest.mark.parametrize("trials", [2, 3, 5, 10, 20])
def test_measured_pss_has_no_bias_by_monte_carlo(trials):
    rng = np.random.default_rng(trials)
    measured = MeasuredErrors(rng.normal(size=(trials, 40_000, 3)) * SLENDER * 1e-3)
    assert within_standard_errors(measured.inverse_sigma, 1e3)
    assert not within_standard_errors(1 / measured.sigma_m, 1e3)


@pytest.mark.parametrize(
    ("trials", "elongation", "shortfall"),
    [(2, 10, 0.10), (2, 3, 0.30), (3, 10, 0.02), (3, 3, 0.15), (20, 10, 0.001), (20, 3, 0.008)],
)
def test_the_shortfall_of_few_trials_is_the_stated_one(trials, elongation, shortfall):
    """A world of known covariances, each a random rotation of diag(1, 1/r², 1/r²): measured over true PSS."""
    rng = np.random.default_rng(trials)
    sigma = np.exp(rng.normal(0, 0.4, 40_000)) * 1e-3
    axes = scipy.stats.special_ortho_group(3, seed=rng).rvs(40)
    errors = rng.normal(size=(trials, len(sigma), 3)) * [1, 1 / elongation, 1 / elongation] * sigma[:, None]
    turned = np.einsum("tnj,nij->tni", errors, np.tile(axes, (1000, 1, 1)))
    ratio = MeasuredErrors(turned).pss() / (1 / sigma).mean()
    assert ratio == pytest.approx(1 - shortfall, abs=WITHIN_SHORTFALL)


def test_detection_rate_enters_once():
    """Points seen in about half of 60 trials: on average rate × 1/σ, each point corrected by its own count."""
    rng = np.random.default_rng(8)
    errors = rng.normal(size=(60, 20_000, 3)) * SLENDER
    errors[rng.uniform(size=errors.shape[:2]) > 0.5] = np.nan
    assert within_standard_errors(MeasuredErrors(errors).inverse_sigma, 0.5)


def test_isotropic_errors_are_overestimated_as_the_docstring_says():
    """The stated sign and size of the approximation: 1/σ̂ of isotropic errors comes out about a fifth too small."""
    measured = MeasuredErrors(np.random.default_rng(9).normal(size=(20, 4000, 3)))
    assert 0.77 < measured.pss() < 0.83


def test_measured_pss_without_correction_is_equation_ten():
    sigma = np.array([1e-3, 2e-3, np.nan])
    assert measured_pss(sigma, 1.0) == pytest.approx(mean_inverse_sigma(sigma), rel=SAME_TO_ROUNDING)
    assert measured_pss(sigma, 1.0, np.inf) == measured_pss(sigma, 1.0)
    assert measured_pss(sigma, [0.5, 1.0, 0.0]) == pytest.approx(1000 / 3, rel=SAME_TO_ROUNDING)


def test_too_few_trials_count_zero():
    """Over one trial 1/σ̂ has no mean; over two it has, √π times 1/σ."""
    terms = measured_inverse_sigma([1.0] * 4, 1.0, [1, 2, 3, np.inf])
    expected = [0, 1 / math.sqrt(math.pi), 1 / inverse_sigma_bias(3), 1]
    np.testing.assert_allclose(terms, expected, rtol=SAME_TO_ROUNDING)


@pytest.mark.parametrize("shape", [(4, 3), (4, 2, 2), (0, 2, 3), (4, 0, 3)])
def test_wrong_shapes_are_told(shape):
    with pytest.raises(ShapeError, match=r"\(T, N, 3\)"):
        MeasuredErrors(np.zeros(shape))


@pytest.mark.parametrize("wrong", [[np.nan, 0, 0], [0, np.inf, 0]])
def test_half_known_and_infinite_errors_are_told(wrong):
    errors = np.zeros((2, 2, 3))
    errors[1, 1] = wrong
    with pytest.raises(RangeError):
        MeasuredErrors(errors)


def test_wrong_rates_sigmas_and_covariances_are_told():
    with pytest.raises(RangeError, match=r"1\.5"):
        measured_pss([1.0], [1.5])
    with pytest.raises(RangeError, match="σ of 0"):
        measured_pss([0.0], [1.0])
    with pytest.raises(ShapeError, match=r"\(2, 3, 3\)"):
        MeasuredErrors(np.zeros((4, 2, 3))).nees(np.eye(3))
