"""The tracked moments against pss's steady state, a textbook filter, and by hand where the residual is a pure bias."""

import numpy as np
import pytest
import scipy.stats

from pss.errors import RangeError, ShapeError
from pss.processes.process import ConstantAcceleration, ConstantVelocity, RandomWalk
from pss.riccati.solve import posterior_covariance, steady_state_covariance
from tests.helpers.residuals import exact_residuals, measured, pixel_covariances, room
from validate.points.static_filter import (
    FEWEST_AVERAGED_FRAMES,
    LONGEST_TIME_CONSTANT_FRAMES,
    SETTLING_TIME_CONSTANTS,
    track_static,
)

# Probability outside the band of a chi-squared test; the seeds are fixed, so that a pass stays a pass.
OUTSIDE_BAND = 1e-3
# Given the draws the error is deterministic, and e^-10 of the start is left after ten time constants.
SETTLED = 1e-4
# A batch of another size takes other paths through BLAS; P⁺ loses about Λ·P⁻ roundings, some thousands here.
SAME_TO_ROUNDING = 1e-9
TRIALS = 400

# Each process at about the same step within a frame; the filters forget within a few frames.
PROCESSES = {
    "random walk": RandomWalk(step_std_m=2e-4),
    "constant velocity": ConstantVelocity(acceleration_density_m2_s3=0.02),
    "constant acceleration": ConstantAcceleration(jerk_density_m2_s5=5.0),
}


class NoNoise:
    """A generator that draws zeros: the filter's error is then what the residuals alone make of it."""

    def standard_normal(self, size):
        return np.zeros(size)

    def integers(self, high, size):
        return np.zeros(size, dtype=int)


class Recorder:
    """A generator that remembers what it drew."""

    def __init__(self, seed):
        self.rng, self.normals, self.trials = np.random.default_rng(seed), [], []

    def standard_normal(self, size):
        self.normals.append(self.rng.standard_normal(size))
        return self.normals[-1]

    def integers(self, high, size):
        self.trials.append(self.rng.integers(high, size=size))
        return self.trials[-1]


def stacked(cameras, points_m, covariance, states):
    """H (N, 2C, n) and R (N, 2C, 2C) of Eq. 5, as a textbook writes them."""
    views, points = covariance.shape[:2]
    H, R = np.zeros((points, 2 * views, states)), np.zeros((points, 2 * views, 2 * views))
    for view, camera in enumerate(cameras):
        rows = slice(2 * view, 2 * view + 2)
        H[:, rows, :3] = camera.jacobian(points_m)
        R[:, rows, rows] = covariance[view]
    return H, R


def steady_state(process, H, R):
    """P∞, P⁺∞ and the modulus of the slowest mode, from pss."""
    prior = steady_state_covariance(process.A, process.Q, H, R)
    information = H.mT @ np.linalg.solve(R, H)
    posterior = posterior_covariance(prior, information)
    closed_loop = process.A @ (np.eye(process.states) - posterior @ information)
    return prior, posterior, np.abs(np.linalg.eigvals(closed_loop)).max()


def band(draws, slowest):
    """χ² band of a mean of squares over `draws` draws that forget by `slowest` a frame.

    Squares of a Gaussian sequence with autocorrelation ρᵏ have ρ²ᵏ, so that their mean is worth (1 − ρ²)/(1 + ρ²) as
    many independent ones; the slowest mode makes the band wide enough for all.
    """
    freedom = draws * (1 - slowest**2) / (1 + slowest**2)
    return np.array(scipy.stats.chi2(freedom).interval(1 - OUTSIDE_BAND)) / freedom


def whitened_squares(moment, expected):
    """Mean square of the error along each axis of `expected`, 1 where the moment is as expected, (N, 3)."""
    whiten = np.linalg.inv(np.linalg.cholesky(expected))
    return np.diagonal(whiten @ moment @ whiten.mT, axis1=-2, axis2=-1)


@pytest.mark.parametrize("name", PROCESSES)
def test_moments_are_the_steady_state_when_the_residuals_follow_the_covariance(name):
    process = PROCESSES[name]
    cameras, points = room()
    covariance = pixel_covariances(cameras, len(points))
    rng = np.random.default_rng(3)
    pixels = measured(cameras, points, exact_residuals(rng, covariance, TRIALS))
    each = np.broadcast_to(covariance[:, None], (*pixels.shape, 2))
    runs = 300

    result = track_static(cameras, points, pixels, each, np.ones(pixels.shape[1:3], bool), process, rng, runs)

    prior, posterior, slowest = steady_state(process, *stacked(cameras, points, covariance, process.states))
    settling = int(np.ceil(-SETTLING_TIME_CONSTANTS / np.log(slowest)))
    assert result.steps >= 2 * settling
    low, high = band(runs * len(points) * (result.steps - settling), slowest)
    for moment, expected in ((result.prior_moment_m2, prior), (result.posterior_moment_m2, posterior)):
        squares = whitened_squares(moment, expected[:, :3, :3]).mean(axis=0)
        assert (low < squares).all()
        assert (squares < high).all()


@pytest.mark.parametrize("name", PROCESSES)
def test_a_bias_of_the_residuals_stays_in_the_moments(name):
    """Settled, the mean error m⁻ solves m⁻ = A[(I − K H) m⁻ + K b], with the gain K = P Hᵀ (H P Hᵀ + R)⁻¹.

    Nothing but the bias: no process noise is drawn and all trials are alike, so that the moments are m mᵀ.
    """
    process = PROCESSES[name]
    cameras, points = room()
    covariance = pixel_covariances(cameras, len(points))
    bias = np.random.default_rng(4).uniform(-0.5, 0.5, size=(len(cameras), 1, len(points), 2))
    pixels = measured(cameras, points, bias)
    usable = np.ones((1, len(points)), bool)

    result = track_static(cameras, points, pixels, covariance[:, None], usable, process, NoNoise(), runs=2)

    H, R = stacked(cameras, points, covariance, process.states)
    prior, _, _ = steady_state(process, H, R)
    gain = prior @ H.mT @ np.linalg.inv(H @ prior @ H.mT + R)
    b = bias[:, 0].transpose(1, 0, 2).reshape(len(points), -1, 1)
    identity = np.eye(process.states)
    before = np.linalg.solve(identity - process.A @ (identity - gain @ H), process.A @ gain @ b)
    after = before - gain @ (H @ before - b)
    for moment, mean in ((result.prior_moment_m2, before), (result.posterior_moment_m2, after)):
        expected = (mean @ mean.mT)[:, :3, :3]
        assert np.abs(moment - expected).max() < SETTLED * np.abs(expected).max()


def test_a_bias_adds_its_square_to_the_moments_of_the_noise():
    """For a random walk the filter settles at the single frame's own bias, Λ⁻¹y."""
    process = RandomWalk(step_std_m=2e-4)
    cameras, points = room()
    covariance = pixel_covariances(cameras, len(points))
    rng = np.random.default_rng(5)
    bias = rng.uniform(-0.5, 0.5, size=(len(cameras), 1, len(points), 2))
    pixels = measured(cameras, points, bias + exact_residuals(rng, covariance, TRIALS))
    each = np.broadcast_to(covariance[:, None], (*pixels.shape, 2))
    runs = 300

    result = track_static(cameras, points, pixels, each, np.ones(pixels.shape[1:3], bool), process, rng, runs)

    H, R = stacked(cameras, points, covariance, 3)
    prior, posterior, slowest = steady_state(process, H, R)
    b = bias[:, 0].transpose(1, 0, 2).reshape(len(points), -1, 1)
    weighted = H.mT @ np.linalg.inv(R)
    mean = np.linalg.solve(weighted @ H, weighted @ b)
    settling = int(np.ceil(-SETTLING_TIME_CONSTANTS / np.log(slowest)))
    # The square of bias plus noise forgets as slowly as the noise, ρᵏ, where that of the noise alone forgets by ρ²ᵏ.
    draws = runs * len(points) * (result.steps - settling)
    for moment, noise in ((result.prior_moment_m2, prior), (result.posterior_moment_m2, posterior)):
        expected = noise + mean @ mean.mT
        assert (np.trace(expected, axis1=1, axis2=2) > 1.5 * np.trace(noise, axis1=1, axis2=2)).any()
        squares = whitened_squares(moment, expected).mean(axis=0)
        low, high = band(draws, np.sqrt(slowest))
        assert (low < squares).all()
        assert (squares < high).all()


def test_views_that_come_and_go_against_a_textbook_filter():
    """The same draws through a filter that stacks H and R and knows no Λ; every other trial has two views of four."""
    process = RandomWalk(step_std_m=5e-5)
    cameras, points = room(points=2)
    covariance = pixel_covariances(cameras, 2)
    residuals = exact_residuals(np.random.default_rng(6), covariance, TRIALS)
    pixels = measured(cameras, points, residuals)
    pixels[2:, ::2] = np.nan
    each = np.broadcast_to(covariance[:, None], (*pixels.shape, 2))
    rng, runs = Recorder(7), 3

    result = track_static(cameras, points, pixels, each, np.ones((TRIALS, 2), bool), process, rng, runs)

    H, R = stacked(cameras, points, covariance, 3)
    settling = result.steps // 2  # a filter this slow is averaged over as many frames as it had to settle
    assert settling > FEWEST_AVERAGED_FRAMES
    expected = np.zeros((2, 2, 3, 3))
    for run, point in np.ndindex(runs, 2):
        P, error = steady_state(process, H, R)[0][point], np.zeros(3)
        for frame in range(result.steps):
            trial = rng.trials[frame][run, point]
            rows = slice(0, 4 if trial % 2 == 0 else 8)
            h, r = H[point, rows], R[point, rows, rows]
            gain = P @ h.T @ np.linalg.inv(h @ P @ h.T + r)
            updated = error + gain @ (residuals[:, trial, point].ravel()[rows] - h @ error)
            if frame >= settling:
                expected[:, point] += [np.outer(error, error), np.outer(updated, updated)]
            P = (np.eye(3) - gain @ h) @ P + process.Q
            error = updated - process.step_std_m * rng.normals[1 + frame][run, point]  # the first is the start
    expected /= runs * settling
    for moment, reference in zip((result.prior_moment_m2, result.posterior_moment_m2), expected, strict=True):
        assert np.abs(moment - reference).max() < SETTLED * np.abs(reference).max()


def test_only_usable_trials_are_drawn():
    """One trial of three is far off; it shows exactly where it may be drawn."""
    cameras, points = room(points=2)
    covariance = pixel_covariances(cameras, 2)
    residuals = np.zeros((len(cameras), 3, 2, 2))
    residuals[:, 1] = 100.0
    pixels = measured(cameras, points, residuals)
    each = np.broadcast_to(covariance[:, None], (*pixels.shape, 2))
    usable = np.array([[True, True], [False, True], [True, True]])
    process = RandomWalk(step_std_m=2e-4)
    result = track_static(cameras, points, pixels, each, usable, process, np.random.default_rng(7))
    rms_m = np.sqrt(np.trace(result.posterior_moment_m2, axis1=1, axis2=2))
    assert rms_m[0] < 1e-3
    assert rms_m[1] > 1e-2


def test_points_without_a_usable_trial_are_nan():
    """Neither never usable nor usable with a single view (no depth) can be tracked; the others are as without them."""
    cameras, points = room(points=3)
    covariance = pixel_covariances(cameras, 3)
    rng = np.random.default_rng(8)
    pixels = measured(cameras, points, exact_residuals(rng, covariance, 20))
    pixels[:, :, 0] = np.nan
    pixels[1:, :, 1] = np.nan
    each = np.broadcast_to(covariance[:, None], (*pixels.shape, 2))
    usable = np.ones((20, 3), bool)
    usable[:, 0] = False
    process = RandomWalk()

    result = track_static(cameras, points, pixels, each, usable, process, np.random.default_rng(9))
    alone = track_static(
        cameras, points[2:], pixels[:, :, 2:], each[:, :, 2:], usable[:, 2:], process, np.random.default_rng(9)
    )

    for moment, expected in (
        (result.prior_moment_m2, alone.prior_moment_m2),
        (result.posterior_moment_m2, alone.posterior_moment_m2),
    ):
        assert np.isnan(moment[:2]).all()
        np.testing.assert_allclose(moment[2:], expected, rtol=0, atol=SAME_TO_ROUNDING * np.abs(expected).max())
    nothing = track_static(cameras, points, pixels, each, np.zeros((20, 3), bool), process, rng)
    assert nothing.steps == 0
    assert np.isnan(nothing.prior_moment_m2).all()


def test_a_filter_slower_than_the_limit_is_cut_short():
    cameras, points = room(points=1)
    covariance = pixel_covariances(cameras, 1)[:, None]
    pixels = measured(cameras, points, np.zeros((len(cameras), 1, 1, 2)))
    usable = np.ones((1, 1), bool)
    slow = RandomWalk(step_std_m=1e-9)
    result = track_static(cameras, points, pixels, covariance, usable, slow, np.random.default_rng(10), runs=1)
    assert result.steps == 20 * LONGEST_TIME_CONSTANT_FRAMES


@pytest.mark.parametrize(
    ("points", "usable", "runs", "error", "says"),
    [
        (2, (1, 1), 1, ShapeError, r"\(2, 3\)"),
        (1, (1, 2), 1, ShapeError, r"\(1, 2\)"),
        (1, (1, 1), 0, RangeError, "runs = 0"),
    ],
)
def test_wrong_input_is_named(points, usable, runs, error, says):
    cameras, points_m = room(points=points)
    pixels, covariance = np.zeros((4, 1, 1, 2)), np.broadcast_to(np.eye(2), (4, 1, 1, 2, 2))
    with pytest.raises(error, match=says):
        track_static(
            cameras, points_m, pixels, covariance, np.ones(usable), RandomWalk(), np.random.default_rng(11), runs
        )
