"""Second moments that are solved for: against those simulated, and against pss where trials are alike."""

from __future__ import annotations

import numpy as np
import pytest

from pss.errors import ShapeError
from pss.processes.process import ConstantVelocity, RandomWalk
from pss.riccati.solve import posterior_covariance, steady_state_covariance_from_information
from tests.helpers.residuals import exact_residuals, measured, pixel_covariances, room
from validate.points.filter_moments import steady_moments
from validate.points.static_filter import track, trial_terms
from validate.points.triangulate import detection_weights

ROUNDING = 1e-9
# Of 400 runs over 60 frames and more: about three standard errors of a mean square, and what the P⁻ of the trials' mean
# information leaves out where views come and go.
SIMULATED = 0.03
# Of 4,000 points of three axes: five standard errors of a mean of squares.
MEAN_OF_POINTS = 0.03
TRIALS = 20
# Singular values of made-up rigs: 0.05 to 0.3 px at 3 m are about 0.1 to 0.3 mm.
STEPS = (3e-5, 1e-4, 3e-4, 1e-3)
DENSITIES = (1e-5, 1e-3, 1e-1)


def summed(missed=0.0, bias_px=0.0, seed=3, trials=TRIALS, exact=False):
    """Λ, y and usable of a made-up rig of four cameras: `missed` of the detections are missing, R differs by trial."""
    cameras, points = room(points=6)
    covariance = pixel_covariances(cameras, len(points))
    rng = np.random.default_rng(seed)
    residuals = exact_residuals(rng, covariance, trials)
    if bias_px:
        residuals = residuals + bias_px * rng.standard_normal((len(cameras), 1, len(points), 2))
    pixels = measured(cameras, points, residuals)
    pixels[rng.uniform(size=pixels.shape[:3]) < missed] = np.nan
    own = 1.0 if exact else rng.uniform(0.8, 1.25, size=pixels.shape[:3])[..., None, None]
    each = covariance[:, None] * own * np.ones((*pixels.shape, 2))
    detected, weight = detection_weights(cameras, pixels, each)
    information, pull = (t.sum(axis=0) for t in trial_terms(cameras, points, pixels, detected, weight))
    return information, pull, detected.sum(axis=0) >= 2


@pytest.mark.parametrize(
    "process",
    [*map(RandomWalk, STEPS), *map(ConstantVelocity, DENSITIES)],
    ids=lambda process: f"{process.Q[-1, -1]:.0e}",
)
def test_solved_and_simulated_moments_agree(process):
    """Detections that come and go, covariances that differ by trial, and a frozen bias: √tr of each point."""
    information, pull, usable = summed(missed=0.15, bias_px=0.05)
    solved = steady_moments(information, pull, usable, process)
    tracked = track(information, pull, usable, process, np.random.default_rng(4), runs=400)
    for moment, simulated in zip(solved, (tracked.prior_moment_m2, tracked.posterior_moment_m2), strict=True):
        ratio = np.sqrt(np.trace(moment, axis1=1, axis2=2) / np.trace(simulated, axis1=1, axis2=2))
        np.testing.assert_allclose(ratio, 1, atol=SIMULATED)


@pytest.mark.parametrize("process", [RandomWalk(1e-4), ConstantVelocity(1e-3)], ids=["walk", "velocity"])
def test_residuals_that_follow_the_covariance_give_the_steady_state(process):
    """Second moments exactly R, none missing: P∞ of Eq. 4 and its update, to rounding."""
    information, pull, usable = summed(trials=400, exact=True)
    before, after = steady_moments(information, pull, usable, process)
    J = np.zeros((len(before), process.states, process.states))
    J[:, :3, :3] = information[0]
    prior = steady_state_covariance_from_information(process.A, process.Q, J)
    for moment, expected in ((before, prior), (after, posterior_covariance(prior, J))):
        np.testing.assert_allclose(moment, expected[:, :3, :3], rtol=0, atol=1e-7 * expected[:, :3, :3].max())


def test_points_without_a_usable_trial_are_nan_and_shapes_are_checked():
    """One point is never usable, one seen by a single camera alone; the others are as without them."""
    information, pull, usable = summed()
    usable[:, 0] = False
    whole = steady_moments(information, pull, usable, RandomWalk(1e-4))
    alone = steady_moments(information[:, 1:], pull[:, 1:], usable[:, 1:], RandomWalk(1e-4))
    for found, expected in zip(whole, alone, strict=True):
        assert np.isnan(found[0]).all()
        np.testing.assert_allclose(found[1:], expected, rtol=0, atol=ROUNDING * expected.max())
    assert np.isnan(steady_moments(information, pull, np.zeros_like(usable), RandomWalk(1e-4))[0]).all()
    with pytest.raises(ShapeError, match=r"\(20, 6, 3\), usable \(20, 5\)"):
        steady_moments(information, pull, usable[:, 1:], RandomWalk(1e-4))


def test_a_frozen_bias_adds_its_square():
    """The filter of a random walk settles at the single frame's own bias Λ⁻¹y; but for it residuals follow R."""
    process = RandomWalk(1e-4)
    information, pull, usable = summed(trials=400, exact=True, bias_px=0.3)
    mean = np.linalg.solve(information[0], pull.mean(axis=0)[..., None])
    prior = steady_state_covariance_from_information(process.A, process.Q, information[0])
    before, _ = steady_moments(information, pull, usable, process)
    assert (np.trace(before, axis1=1, axis2=2) > 1.5 * np.trace(prior, axis1=1, axis2=2)).any()
    np.testing.assert_allclose(before, prior + mean @ mean.mT, rtol=0, atol=1e-6 * before.max())


def test_a_slow_filter_keeps_the_mean_error_of_its_trials():
    """What the module states of few trials: C/T (1 − K/(2 − K)) on top of P∞, K the gain; C/T for a slow filter."""
    points, trials, c = 4000, 20, 1e-8
    rng = np.random.default_rng(5)
    information = np.broadcast_to(np.eye(3) / c, (trials, points, 3, 3))
    pull = rng.standard_normal((trials, points, 3)) / np.sqrt(c)
    for ratio in (0.01, 1.0):
        process = RandomWalk(np.sqrt(ratio * c))
        prior = c * (ratio / 2 + np.sqrt(ratio**2 / 4 + ratio))
        gain = prior / (prior + c)
        floor = c / trials * (1 - gain / (2 - gain))
        before, _ = steady_moments(information, pull, np.ones((trials, points), bool), process)
        found = np.trace(before, axis1=1, axis2=2).mean() / 3
        assert found == pytest.approx(prior + floor, rel=MEAN_OF_POINTS)
        assert found > prior + 0.8 * floor
        assert (floor / prior < 0.1) == (ratio > (10 / trials) ** 2)
