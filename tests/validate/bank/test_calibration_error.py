"""Errors of calibration: their Jacobian, what they do to triangulated points, and what a term in R for them repairs."""

from __future__ import annotations

import dataclasses
from itertools import combinations

import numpy as np
import pytest

from pss import NoiseModel, PTZCamera, RandomWalk, RangeError, evaluate
from pss.cameras.views import Views
from pss.noise import IdentityNoise
from pss.riccati.covariances import largest_standard_deviation
from pss.visibility.points import VISIBILITY_TESTS, visible_in
from render.random_streams import random_stream
from validate.bank.calibration_errors import (
    CalibrationNoise,
    CalibrationSizes,
    _moved,
    disturbed,
    error_jacobian,
    passing_covariance,
    shifts_px,
    without_blunders,
)
from validate.bank.calibration_measured import MeasuredMoments, carried_through, triangulated
from validate.bank.calibration_predicted import Predictions, second_moments
from validate.bank.calibration_study import study
from validate.bank.measured import BankData, measure_all
from validate.points.triangulate import triangulate

RNG = np.random.default_rng(4)
POINTS = RNG.uniform((-0.4, -0.3, 0.7), (0.4, 0.3, 1.3), (24, 3))
NORMALS = np.tile([0.0, -1.0, 0.0], (24, 1))
# px, of detections.
NOISE_PX = 0.05
TRIALS = 12
PLAIN = NoiseModel("noise", (IdentityNoise(NOISE_PX**2),))
ALL = CalibrationSizes(0.05, 0.002, 0.003)
LARGE = CalibrationSizes(0.1, 0.001, 0.001)
OVER_ALL = "over calibrations"
# A median over points and pairs of RMS over 12 trials, or six draws, of errors that all points of a view share.
SMALL_SAMPLE = 0.3
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


VIEWS = Views(list(CAMERAS), POINTS, NORMALS)
PREDICTIONS = Predictions(VIEWS, visible_in(VIEWS, (), VISIBILITY_TESTS), PLAIN, PAIRS)


def predict(model):
    """Terms of the single-frame PSS of all pairs, by the metric itself."""
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


def displaced(data, sizes, draw=None, term_in_weights=False):
    """The detections as if their cameras were wrong; blunders are left out."""
    pixels = without_blunders(data).pixels - shifts_px(data, sizes, draw)
    return dataclasses.replace(data, pixels=pixels, covariance=passing_covariance(data, sizes, term_in_weights))


def test_displaced_detections_are_wrong_cameras(data):
    """Triangulating them with the true cameras is triangulating the detections with the wrong ones, within 1 %."""
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
    assert not shifts_px(data, CalibrationSizes()).any()
    assert disturbed(CAMERA, CalibrationSizes(), np.random.default_rng(1)) == CAMERA
    row, frozen = study(data, PREDICTIONS, [CalibrationSizes()], processes=1)
    same = ("spearman_plain", "spearman_plain_low", "median_pss", "median_rms_m")
    assert [row[name] for name in same] == [frozen[name] for name in same]
    plain = [found.errors.inverse_sigma for found in measure_all(data, PAIRS.tolist(), processes=1)]
    assert row["median_pss"] == np.median(np.mean(plain, axis=1))
    assert row["spearman_with_term"] == row["spearman_plain"] > 0.9
    assert row["spearman_gain"] == row["spearman_gain_low"] == row["spearman_gain_high"] == 0


@pytest.fixture(scope="module")
def rows(data):
    """Of small and of large errors."""
    sizes = [CalibrationSizes(0.0002), LARGE]
    return study(data, PREDICTIONS, sizes, draws=6, processes=1)


def row_of(rows, size, kind, judged, weights="own"):
    (found,) = (
        row
        for row in rows
        if (row["pan_tilt_deg"], row["kind"], row["judged"], row["weights"]) == (size, kind, judged, weights)
    )
    return found


def test_the_term_restores_the_ranking_over_calibrations(rows):
    """Wrong angles make the far cameras the worse ones; with the term, PSS knows."""
    small, large = (row_of(rows, size, "each frame", "over calibrations") for size in (0.0002, 0.1))
    assert small["spearman_plain"] > 0.9
    assert large["spearman_plain"] < 0.6
    assert large["spearman_with_term"] > 0.85
    assert large["spearman_gain_low"] > 0
    assert large["median_rms_m"] > 5 * small["median_rms_m"]
    frozen = row_of(rows, 0.1, "frozen", "over calibrations")
    assert frozen["spearman_with_term"] > 0.8
    assert frozen["spearman_with_term"] - frozen["spearman_plain"] > 0.2


def test_within_one_frozen_calibration_luck_decides(rows):
    """The bias of one draw is not its spread: ρ differs between draws and is lower than over them, also with a term."""
    over, within = (row_of(rows, 0.1, "frozen", judged) for judged in ("over calibrations", "within one calibration"))
    assert within["spearman_with_term"] < over["spearman_with_term"] - 0.05
    assert within["spearman_with_term_min"] < within["spearman_with_term"] < within["spearman_with_term_max"]
    # Where noise rules, a frozen draw is as good as any.
    small = [row_of(rows, 0.0002, *which) for which in (("frozen", "within one calibration"), ("each frame", OVER_ALL))]
    assert abs(small[0]["spearman_plain"] - small[1]["spearman_plain"]) < 0.1


def test_sizes_are_predicted_by_what_is_like_the_weights(rows):
    """√tr of C + GΣGᵀ with own weights, of the C with the term in R with the term: measured within 15 %."""
    for weights in ("own", "with term"):
        for kind in ("each frame", "frozen"):
            row = row_of(rows, 0.1, kind, OVER_ALL, weights)
            assert abs(row["rms_over_matching"] - 1) < SMALL_SAMPLE, (weights, kind)
            assert row["rms_over_plain"] > 5
        assert abs(row_of(rows, 0.1, "each frame", OVER_ALL, weights)["first_order_rms_ratio"] - 1) < 0.01


def test_predictions_are_the_metrics_own():
    """In closed form here, by `evaluate` with the factor added there."""
    np.testing.assert_allclose(PREDICTIONS.plain().inverse_sigma, predict(PLAIN), rtol=1e-9)
    np.testing.assert_allclose(
        PREDICTIONS.term_in_r(ALL).inverse_sigma, predict(PLAIN.plus(CalibrationNoise(ALL))), rtol=1e-9
    )


@pytest.mark.parametrize("term_in_weights", [False, True])
@pytest.mark.parametrize("frozen", [False, True])
def test_the_closed_form_is_the_simulated_second_moment(data, term_in_weights, frozen):
    """Over many draws √tr and √λmax are what linear propagation says, for both kinds and both weights.

    Of frozen draws the views' errors are drawn in another way, and the cameras here stand at eight places.
    """
    many, pairs = 400, np.array([[0, 3], [1, 4], [2, 7]])
    true = data.pixels[:, :1] - data.residuals()[:, :1]
    noise = NOISE_PX * np.random.default_rng(8).standard_normal((len(CAMERAS), many, len(POINTS), 2))
    covariance = np.repeat(passing_covariance(data, ALL, term_in_weights)[:, :1], many, axis=1)
    record = dataclasses.replace(data, pixels=true + noise, covariance=covariance)
    if frozen:
        shifts = np.concatenate([shifts_px(record, ALL, draw) for draw in range(many)], axis=1)
    else:
        shifts = shifts_px(record, ALL)
    (moments,) = carried_through(record, [shifts], pairs)
    predictions = Predictions(VIEWS, PREDICTIONS.visible, PLAIN, pairs)
    expected = predictions.term_in_r(ALL) if term_in_weights else predictions.propagated(ALL)
    # √tr and √λmax over 400 draws are good to 1/√800 = 3.5 %; the points of a pair share the draws.
    np.testing.assert_allclose(moments.rms_m / expected.rms_m, 1, atol=0.13)
    np.testing.assert_allclose(largest_standard_deviation(moments.second_m2) * expected.inverse_sigma, 1, atol=0.13)


@pytest.mark.parametrize("draw", [None, 2])
@pytest.mark.parametrize("term_in_weights", [False, True])
def test_first_order_is_full_triangulation(data, draw, term_in_weights):
    """The errors carried through are those of maximum likelihood, within 1 % of their size."""
    sizes = CalibrationSizes(0.005, 2e-4, 3e-4)
    moved = displaced(data, sizes, draw, term_in_weights)
    full = triangulated(moved, PAIRS, 1)
    base = dataclasses.replace(moved, pixels=data.pixels)
    (first,) = carried_through(base, [shifts_px(data, sizes, draw)], PAIRS)
    np.testing.assert_array_equal(first.detections, full.detections)
    np.testing.assert_allclose(np.median(first.rms_m / full.rms_m), 1, atol=0.002)
    np.testing.assert_allclose(first.rms_m, full.rms_m, rtol=0.02)


def test_frozen_errors_are_one_draw_for_all_trials_and_shared_by_a_camera(data):
    """Place and focal length are one camera's at all its settings, pan and tilt each setting's own."""
    turned = dataclasses.replace(CAMERAS[0], pan_deg=CAMERAS[0].pan_deg + 3)
    points = np.broadcast_to(data.pixels[:1], (3, *data.pixels.shape[1:]))
    pair = dataclasses.replace(
        data,
        cameras=(CAMERAS[0], turned, CAMERAS[1]),
        pixels=points.copy(),
        covariance=np.ascontiguousarray(data.covariance[:3]),
    )
    assert shifts_px(pair, ALL, 0).shape[1] == 1

    def moved_alike(sizes):
        """Errors of the place and focal length fitted from each view's shifts agree."""
        fitted = []
        for view in range(3):
            jacobian = error_jacobian(Views([pair.cameras[view]], POINTS))[0].reshape(-1, 6)
            shift = shifts_px(pair, sizes, 1)[view, 0].ravel()
            fitted.append(np.linalg.lstsq(jacobian, shift, rcond=None)[0])
        return np.array(fitted) / np.where(sizes.sigmas > 0, sizes.sigmas, 1)

    errors = moved_alike(CalibrationSizes(1e-3, 1e-5, 1e-5))
    np.testing.assert_allclose(errors[0, 2:], errors[1, 2:], atol=1e-3)
    assert np.abs(errors[0, :2] - errors[1, :2]).min() > 0.01
    assert np.abs(errors[0, 2:] - errors[2, 2:]).min() > 0.01
    assert not np.allclose(shifts_px(pair, ALL, 0), shifts_px(pair, ALL, 1))


def test_draws_together_are_one_record():
    """Second moments over all trials of all draws, detections added up."""
    errors = np.random.default_rng(2).standard_normal((3, 5, 2, 3))
    counts = np.full((1, 2), 5)
    parts = [MeasuredMoments(second_moments(one)[None], counts, 5) for one in errors]
    whole = MeasuredMoments.together(parts)
    np.testing.assert_allclose(whole.second_m2[0], second_moments(errors.reshape(15, 2, 3)))
    assert (whole.detections == 15).all()
    assert whole.trials == 15


def test_sizes_are_zero_or_more():
    """A standard deviation below zero is refused, by name."""
    with pytest.raises(RangeError, match=r"focal_share = -1; allowed: 0 or more"):
        CalibrationSizes(focal_share=-1)
