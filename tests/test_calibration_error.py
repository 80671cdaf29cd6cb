"""Errors of calibration: their Jacobian, what they do to triangulated points, and what a term in R for them repairs."""

from __future__ import annotations

import dataclasses
from itertools import combinations

import numpy as np
import pytest

from pss import NoiseModel, PTZCamera, RandomWalk, RangeError, evaluate
from pss.noise import IdentityNoise
from pss.views import Views
from validate.bank.measured import BankData, measure_all
from validate.calibration_error import (
    CalibrationNoise,
    CalibrationSizes,
    _moved,
    calibration_noise,
    displaced,
    disturbed,
    error_jacobian,
    study,
)
from validate.triangulate import triangulate

RNG = np.random.default_rng(4)
POINTS = RNG.uniform((-0.4, -0.3, 0.7), (0.4, 0.3, 1.3), (24, 3))
NORMALS = np.tile([0.0, -1.0, 0.0], (24, 1))
# px, of detections.
NOISE_PX = 0.05
TRIALS = 12
PLAIN = NoiseModel("noise", (IdentityNoise(NOISE_PX**2),))
ALL = CalibrationSizes(0.05, 0.002, 0.003)
CAMERA = PTZCamera((-1.5, -2.5, 1.9), 0, 0, zoom=2.5, focus_distance_m=3, radial_distortion=(-0.1, 0.02)).aimed_at(
    (0.1, 0, 0.9)
)


def camera(distance_m, pan_deg, px_per_m):
    """One that looks at the points from a distance, with so many pixels a metre there."""
    angle = np.radians(pan_deg)
    place = (-distance_m * np.sin(angle), -distance_m * np.cos(angle), 1.4)
    focal_px = px_per_m * distance_m
    fov_deg = 2 * np.degrees(np.arctan(640 / focal_px))
    return PTZCamera(place, 0, 0, zoom=90 / fov_deg, max_zoom=30, focus_distance_m=distance_m).aimed_at((0, 0, 1))


# The nearer, the fewer pixels a metre: by pixel noise alone the far ones are better, by wrong angles the near ones.
CAMERAS = tuple(
    camera(distance, pan, 330 * (distance / 2))
    for distance, pan in zip((2, 2.6, 3.4, 4.4, 5.7, 7.4, 2.3, 5), (-50, 45, -30, 25, -40, 50, 10, -5), strict=True)
)
PAIRS = np.array(list(combinations(range(len(CAMERAS)), 2)))


@pytest.fixture(scope="module")
def data():
    """Detections of all points in all views, right but for their noise."""
    true = np.array([c.project(POINTS)[0] for c in CAMERAS])[:, None]
    pixels = true + NOISE_PX * RNG.standard_normal((len(CAMERAS), TRIALS, len(POINTS), 2))
    covariance = np.broadcast_to(NOISE_PX**2 * np.eye(2), (*pixels.shape, 2)).copy()
    return BankData(CAMERAS, POINTS, pixels, covariance, RandomWalk(), 5)


def predict(model):
    """Terms of the single-frame PSS of all pairs."""
    found = [evaluate([CAMERAS[view] for view in pair], POINTS, NORMALS, noise=model) for pair in PAIRS]
    return np.array([np.nan_to_num(1 / evaluation.single_frame_sigma_m) for evaluation in found])


@pytest.mark.parametrize("number", range(6))
def test_the_jacobian_is_the_finite_difference(number):
    """∂pixel/∂(pan, tilt, focal length, place) of a camera with distortion, by central differences."""
    views = Views([CAMERA], POINTS)
    step = 1e-6
    errors = np.zeros(6)
    errors[number] = step
    ahead, behind = (_moved(CAMERA, sign * errors).project(POINTS)[0] for sign in (1, -1))
    np.testing.assert_allclose(
        error_jacobian(views)[0, :, :, number], (ahead - behind) / (2 * step), rtol=1e-6, atol=1e-4
    )


def test_the_factor_is_the_spread_of_disturbed_projections():
    """Over 5,000 draws; a variance is then good to 2 %, and five standard errors are allowed."""
    rng = np.random.default_rng(6)
    right = CAMERA.project(POINTS[:3])[0]
    moved = np.array([disturbed(CAMERA, ALL, rng).project(POINTS[:3])[0] - right for _ in range(5_000)])
    spread = np.einsum("tni,tnj->nij", moved, moved) / len(moved)
    expected = CalibrationNoise(ALL).covariance(Views([CAMERA], POINTS[:3])).matrix(1, 3)[0]
    scale = np.sqrt(expected[:, [0, 1], [0, 1]])
    np.testing.assert_allclose(
        spread / (scale[:, :, None] * scale[:, None]), expected / (scale[:, :, None] * scale[:, None]), atol=0.1
    )
    # On the axis a turn by σ is f·σ px, and pan less by the cosine of the tilt.
    axis = CAMERA.rotation[2] * 3 + CAMERA.position_m
    turned = CalibrationNoise(CalibrationSizes(0.1)).covariance(Views([CAMERA], axis[None])).matrix(1, 1)[0, 0]
    px = CAMERA.focal_px * np.radians(0.1)
    np.testing.assert_allclose(turned, np.diag([(px * np.cos(np.radians(CAMERA.tilt_deg))) ** 2, px**2]), atol=1e-9)


def test_displaced_detections_are_wrong_cameras(data):
    """Triangulating them with the true cameras is triangulating the detections with the wrong ones, within 1 %."""
    from render.view import random_stream

    quiet = dataclasses.replace(data, pixels=data.pixels + data.residuals() * -0.99)
    moved = displaced(quiet, ALL)
    pair, trial = [1, 4], 3
    believed = [
        disturbed(CAMERAS[v], ALL, random_stream(data.seed, f"view {v}", "calibration error", trial)) for v in pair
    ]
    exact = triangulate(believed, quiet.pixels[pair][:, [trial]], moved.covariance[pair][:, [trial]]).points_m[0]
    fast = triangulate([CAMERAS[v] for v in pair], moved.pixels[pair], moved.covariance[pair]).points_m[trial]
    error = np.linalg.norm(exact - POINTS, axis=1)
    assert np.median(error) > 1e-3  # m
    np.testing.assert_allclose(fast, exact, atol=0.02 * np.median(error))


def test_no_detection_is_thrown_out_for_its_cameras_error_but_blunders_are(data):
    """Also where that is a hundred times the detection's own; a wrong id stays out."""
    pixels = data.pixels.copy()
    pixels[0, 0, 0] += 40.0
    moved = displaced(dataclasses.replace(data, pixels=pixels), CalibrationSizes(0.1, 0.005, 0.005))
    assert np.isnan(moved.pixels[0, 0, 0]).all()
    assert np.isfinite(moved.pixels).sum() == np.isfinite(pixels).sum() - 2
    found = measure_all(moved, [(0, 3, 5), (1, 2, 7)], processes=1)
    assert [errors.rejected for errors in found] == [0, 0]


def test_without_errors_nothing_changes(data):
    """The row of size zero is the plain ranking, to the last bit."""
    assert displaced(data, CalibrationSizes()) is data
    assert disturbed(CAMERA, CalibrationSizes(), np.random.default_rng(1)) == CAMERA
    (row,) = study(data, PAIRS, PLAIN, predict, [CalibrationSizes()], processes=1)
    plain = [found.errors.inverse_sigma for found in measure_all(data, PAIRS.tolist(), processes=1)]
    assert row["median_pss"] == np.median(np.mean(plain, axis=1))
    assert row["spearman_with_term"] == row["spearman_plain"] > 0.9
    assert row["spearman_gain"] == row["spearman_gain_low"] == row["spearman_gain_high"] == 0


def test_the_term_restores_the_ranking(data):
    """Wrong angles make the far cameras the worse ones; with the term, PSS knows."""
    small, large = study(
        data, PAIRS, PLAIN, predict, [CalibrationSizes(0.0002), CalibrationSizes(0.1, 0.001, 0.001)], processes=1
    )
    assert small["spearman_plain"] > 0.9
    assert large["spearman_plain"] < 0.6
    assert large["spearman_with_term"] > 0.85
    assert large["spearman_gain_low"] > 0
    assert large["median_rms_m"] > 5 * small["median_rms_m"]


def test_sizes_are_zero_or_more():
    """A standard deviation below zero is refused, by name."""
    with pytest.raises(RangeError, match=r"focal_share = -1; allowed: 0 or more"):
        CalibrationSizes(focal_share=-1)
    assert calibration_noise(ALL) == CalibrationNoise(ALL)
