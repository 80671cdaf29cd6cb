"""The error budget: factors that multiply to measured over predicted, each moved by one cause alone."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pss import NoiseModel, PTZCamera, evaluate
from pss.noise.factors import IdentityNoise
from validate.points.error_budget import error_budget, propagated_errors
from validate.points.triangulate import triangulate
from validate.stats.measured_errors import FEWEST_TRIALS, MeasuredErrors

TRIALS = 4000
# σ of σ̂ over T draws is σ/√(2T), and of a mean over N points less; four of them.
CHANCE = 4 / math.sqrt(2 * TRIALS)
PIXEL_NOISE_PX = 0.05
# Triangulation departs from its linear part by about (error / distance), here below 1e-4.
LINEAR = 1e-3

CAMERAS = [
    PTZCamera(place, 0, 0, zoom=2).aimed_at((0.0, 0.0, 1.0)) for place in ((-2.5, 2, 2), (0, 2.9, 1.6), (2.5, 2.2, 2.4))
]
POINTS_M = np.array([(x, 0.2 * x, z) for x in (-0.4, 0.0, 0.4) for z in (0.8, 1.2)])
NORMALS = np.tile([0.0, 1.0, 0.0], (len(POINTS_M), 1))


def budget(noise=1.0, bias_px=0.0, model=1.0, found=1.0, blind=(), claimed_px=PIXEL_NOISE_PX, seed=3):
    """The factors where detections are `noise` times as noisy as they claim, with the errors and the prediction."""
    rng = np.random.default_rng(seed)
    pixels = np.array([camera.project(POINTS_M)[0] for camera in CAMERAS])[:, None]
    pixels = pixels + noise * claimed_px * rng.standard_normal((len(CAMERAS), TRIALS, len(POINTS_M), 2))
    pixels[0, ..., 0] += bias_px
    pixels[:, rng.random((TRIALS, len(POINTS_M))) > found] = np.nan
    pixels[list(blind)] = np.nan
    covariance = np.broadcast_to(claimed_px**2 * np.eye(2), (*pixels.shape, 2))
    predicted = evaluate(
        CAMERAS,
        POINTS_M,
        NORMALS,
        noise=NoiseModel("given", (IdentityNoise((model * claimed_px) ** 2),)),
        visibility=(),
    )
    triangulated = triangulate(CAMERAS, pixels, covariance)
    errors = MeasuredErrors(triangulated.points_m - POINTS_M)
    propagated = propagated_errors(CAMERAS, POINTS_M, pixels, covariance, triangulated.used)
    factors = error_budget(predicted, triangulated, propagated, errors.pss())
    return dataclasses.asdict(factors), errors, predicted


def expected(**causes):
    return {name: causes.get(name, 1.0) for name in ("visibility", "noise_model", "detector", "geometry")}


CASES = {
    "all is as predicted": ({}, {}),
    "detections twice as noisy as they claim": ({"noise": 2.0}, {"detector": 0.5}),
    "R predicted three times too large in σ": ({"model": 3.0}, {"noise_model": 3.0}),
    "markers found in half of the trials": ({"found": 0.5}, {"visibility": 0.5}),
}


@pytest.mark.parametrize("case", CASES)
def test_each_cause_moves_its_factor_alone(case):
    given, causes = CASES[case]
    factors, errors, predicted = budget(**given)
    for name, value in expected(**causes).items():
        assert factors[name] == pytest.approx(value, rel=LINEAR if name == "geometry" else CHANCE), name
    assert math.prod(factors.values()) == pytest.approx(errors.pss() / predicted.pss_single_frame, rel=1e-9)


def test_views_that_find_nothing_are_lost_visibility():
    """By hand: C of the other two views alone over C of all three."""
    factors, _, predicted = budget(blind=(2,))
    given = {"noise": NoiseModel("given", (IdentityNoise(PIXEL_NOISE_PX**2),)), "visibility": ()}
    of_two = evaluate(CAMERAS[:2], POINTS_M, NORMALS, **given)
    requested = of_two.pss_single_frame / predicted.pss_single_frame
    assert requested < 0.9
    assert factors["visibility"] == pytest.approx(requested, rel=1e-9)
    for name in ("noise_model", "detector"):
        assert factors[name] == pytest.approx(1, rel=CHANCE)


def test_a_bias_that_every_trial_repeats_is_the_detectors():
    """With the bias known, by hand: √λmax of C + bbᵀ, b what the weights make of a shift in one view."""
    factors, _, predicted = budget(bias_px=0.2)
    jacobian = CAMERAS[0].jacobian(POINTS_M)
    covariance = predicted.single_frame_covariance
    shift = np.einsum("nij,nkj,k->ni", covariance, jacobian, np.array([0.2, 0.0]))
    raised = covariance + np.einsum("ni,nj->nij", shift, shift) / PIXEL_NOISE_PX**4
    of_each = np.sqrt(np.linalg.eigvalsh(covariance)[:, -1] / np.linalg.eigvalsh(raised)[:, -1])
    weight = 1 / predicted.single_frame_sigma_m
    assert factors["detector"] == pytest.approx((weight * of_each).sum() / weight.sum(), rel=CHANCE)
    assert factors["noise_model"] == pytest.approx(1, rel=CHANCE)


def test_large_errors_are_no_longer_linear_and_geometry_says_so():
    """Noise of 400 px, known and predicted: a point moves by a quarter of its distance."""
    factors, errors, predicted = budget(claimed_px=400.0)
    assert abs(factors["geometry"] - 1) > 10 * LINEAR
    assert math.prod(factors.values()) == pytest.approx(errors.pss() / predicted.pss_single_frame, rel=1e-9)


def test_what_is_never_found_leaves_the_rest_undefined():
    pixels = np.full((len(CAMERAS), FEWEST_TRIALS, len(POINTS_M), 2), np.nan)
    covariance = np.broadcast_to(np.eye(2), (*pixels.shape, 2))
    triangulated = triangulate(CAMERAS, pixels, covariance)
    propagated = propagated_errors(CAMERAS, POINTS_M, pixels, covariance, triangulated.used)
    predicted = evaluate(CAMERAS, POINTS_M, NORMALS, noise=NoiseModel("given", (IdentityNoise(),)), visibility=())
    factors = dataclasses.asdict(error_budget(predicted, triangulated, propagated, 0.0))
    assert all(math.isnan(value) for value in factors.values())
