"""Triangulation by routes that share no code: exact data, SciPy over `cv2.projectPoints`, OpenCV, Monte Carlo."""

import cv2
import numpy as np
import pytest
import scipy.optimize
import scipy.stats

from pss.cameras.camera import PTZCamera
from pss.errors import PSSError, RangeError, ShapeError
from validate.points.triangulate import BLUNDER_INFLATION, BLUNDER_TAIL, triangulate

# Double precision leaves about 1e-13 of 1000 px, which at 500 px/m and a crossing of some degrees is below 1e-14 m; the
# linear solution squares the condition number of its matrix.
EXACT_M, EXACT_LINEAR_M = 1e-12, 1e-9
# Two minimisers of the same sum, stopped where another step gains below 1e-12 of it: 1e-6 standard deviations.
SAME_MINIMUM = 1e-6
# Two triangulations of the same detections started from different pairs of views.
SAME_DETECTIONS_M = 1e-9
# Central differences of a smooth projection over 1e-5 m are good to about 1e-9 relatively.
SAME_COVARIANCE = 1e-6
# 900 px of a weight 4e-8 that of the other views' move them by 4e-5 px, at 80 px/m of depth; ten times that and more.
NO_INFLUENCE_M = 1e-5
# Between the linearised χ² of a two-view point and the true one, a few pixels off.
NEAR_THE_LIMIT = 0.02
# Probability outside the band of a chi-squared test; the seeds are fixed, so that a pass stays a pass.
OUTSIDE_BAND = 1e-3
# A blunder moves a detection by far more than any noise here (up to 2 px).
BLUNDER_PX = 60.0

POSITIONS_M = [(3, 3, 2.8), (-3, 3, 2.5), (3, -3, 2.2), (-3, -3, 2.8), (0, 3.5, 1.5), (3.5, 0, 2.0), (-3.5, 0.5, 1.0)]


def room_cameras(count=7):
    return [PTZCamera(p, 0, 0, zoom=1 + 0.2 * k).aimed_at((0, 0, 1)) for k, p in enumerate(POSITIONS_M[:count])]


def room_points(rng, count):
    return rng.uniform([-1, -1, 0.5], [1, 1, 1.8], size=(count, 3))


def exact_pixels(cameras, points_m, trials):
    return np.repeat(np.stack([camera.project(points_m)[0] for camera in cameras])[:, None], trials, axis=1)


def random_covariances(rng, shape, low_px=0.02, high_px=0.3):
    """Ellipses of any direction, whose axes spread over `low_px` to `high_px`."""
    angle = rng.uniform(0, np.pi, size=shape)
    axes = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=-1).reshape(*shape, 2, 2)
    variances = np.exp(rng.uniform(np.log(low_px), np.log(high_px), size=(*shape, 1, 2))) ** 2
    return (axes * variances) @ axes.mT


def detections(rng, cameras, points_m, trials, **spread_px):
    """Pixels with noise that follows the covariances beside them, which differ from detection to detection."""
    covariance = random_covariances(rng, (len(cameras), trials, len(points_m)), **spread_px)
    noise = np.linalg.cholesky(covariance) @ rng.standard_normal((*covariance.shape[:-1], 1))
    return exact_pixels(cameras, points_m, trials) + noise[..., 0], covariance


def project_by_opencv(camera, point_m):
    rotation = cv2.Rodrigues(camera.rotation)[0]
    image = cv2.projectPoints(point_m.reshape(1, 3), rotation, camera.translation_m, camera.intrinsic_matrix, None)
    return image[0].ravel()


def whitened(cameras, pixels, covariance):
    """The stacked residual, a function of the point, with unit covariance; pixels (C, 2)."""
    factors = np.linalg.inv(np.linalg.cholesky(covariance))
    return lambda point: np.concatenate(
        [W @ (project_by_opencv(camera, point) - z) for camera, z, W in zip(cameras, pixels, factors, strict=True)]
    )


@pytest.mark.parametrize("views", [2, 3, 7])
def test_pixels_without_noise_give_the_points_back(views):
    rng = np.random.default_rng(1)
    cameras, points = room_cameras(views), room_points(rng, 5)
    pixels = exact_pixels(cameras, points, 3)

    result = triangulate(cameras, pixels, random_covariances(rng, pixels.shape[:-1]))

    np.testing.assert_allclose(result.points_m, np.broadcast_to(points, (3, 5, 3)), rtol=0, atol=EXACT_M)
    np.testing.assert_allclose(result.linear_m, np.broadcast_to(points, (3, 5, 3)), rtol=0, atol=EXACT_LINEAR_M)
    assert (result.views == views).all()
    assert not result.rejected.any()


@pytest.mark.parametrize("views", [2, 4])
def test_it_is_the_least_squares_solution(views):
    """Against SciPy's trust region over OpenCV's projection, and the covariance against its numerical Jacobian."""
    rng = np.random.default_rng(2)
    cameras, points = room_cameras(views), room_points(rng, 4)
    # So much noise that the projection's curvature matters.
    pixels, covariance = detections(rng, cameras, points, 1, low_px=0.3, high_px=5.0)

    result = triangulate(cameras, pixels, covariance)

    for n, truth in enumerate(points):
        residual = whitened(cameras, pixels[:, 0, n], covariance[:, 0, n])
        tightest = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
        best = scipy.optimize.least_squares(residual, truth, jac="3-point", **tightest).x
        steps = 1e-5 * np.eye(3)
        jacobian = np.stack([(residual(best + h) - residual(best - h)) / 2e-5 for h in steps], axis=-1)
        expected = np.linalg.inv(jacobian.T @ jacobian)
        assert np.abs(result.covariance_m2[0, n] - expected).max() < SAME_COVARIANCE * np.abs(expected).max()
        off = result.points_m[0, n] - best
        assert np.sqrt(off @ np.linalg.solve(expected, off)) < SAME_MINIMUM


@pytest.mark.parametrize("views", [2, 3, 7])
def test_errors_follow_the_covariance_when_the_noise_does(views):
    """Σ eᵀC⁻¹e is χ² with three degrees of freedom for each point of each trial, and e has no preferred sign."""
    rng = np.random.default_rng(3)
    cameras, points = room_cameras(views), room_points(rng, 6)
    trials = 400
    pixels, covariance = detections(rng, cameras, points, trials)

    result = triangulate(cameras, pixels, covariance)

    whiten = np.linalg.inv(np.linalg.cholesky(result.covariance_m2))
    error = (whiten @ (result.points_m - points)[..., None])[..., 0]  # unit covariance
    low, high = scipy.stats.chi2(trials * len(points)).interval(1 - OUTSIDE_BAND)
    for axis in range(3):
        assert low < (error[..., axis] ** 2).sum() < high
    mean = error.mean(axis=(0, 1)) * np.sqrt(trials * len(points))
    assert np.abs(mean).max() < scipy.stats.norm.isf(OUTSIDE_BAND / 2)


def test_the_linear_solution_is_opencvs_over_the_widest_pair():
    """Cameras 0 and 2 see the point at a right angle, 1 stands close to 0."""
    target = np.array([0.0, 0.0, 1.0])
    cameras = [PTZCamera(p, 0, 0).aimed_at(target) for p in [(3, 0, 1), (2.9, 0.8, 1), (0, 3, 1)]]
    rng = np.random.default_rng(4)
    points = target + rng.uniform(-0.1, 0.1, size=(5, 3))
    pixels, covariance = detections(rng, cameras, points, 2)

    result = triangulate(cameras, pixels, covariance)

    a, b = (pixels[view].reshape(-1, 2).T.copy() for view in (0, 2))
    homogeneous = cv2.triangulatePoints(cameras[0].projection_matrix, cameras[2].projection_matrix, a, b)
    expected = (homogeneous[:3] / homogeneous[3]).T.reshape(2, 5, 3)
    np.testing.assert_allclose(result.linear_m, expected, rtol=0, atol=EXACT_LINEAR_M)
    assert np.abs(result.points_m - expected).max() > 100 * EXACT_LINEAR_M  # three weighted views say something else


@pytest.mark.parametrize("views", [4, 7])
def test_a_blunder_is_thrown_out_and_counted(views):
    """With the blunder the result is what it is without that detection, whichever view it is in."""
    rng = np.random.default_rng(5)
    cameras, points = room_cameras(views), room_points(rng, views)
    pixels, covariance = detections(rng, cameras, points, 2)
    wrong, missing = pixels.copy(), pixels.copy()
    for view in range(views):
        wrong[view, 0, view] = pixels[view, 0, (view + 1) % views]  # the id of another point
        missing[view, 0, view] = np.nan
    assert np.linalg.norm(wrong - pixels, axis=-1).max(axis=(0, 1)).min() > BLUNDER_PX

    result, expected = triangulate(cameras, wrong, covariance), triangulate(cameras, missing, covariance)

    assert result.rejected.tolist() == [[1] * views, [0] * views]
    assert result.views.tolist() == [[views - 1] * views, [views] * views]
    np.testing.assert_array_equal(result.used, np.isfinite(missing).all(axis=-1))
    np.testing.assert_allclose(result.points_m, expected.points_m, rtol=0, atol=SAME_DETECTIONS_M)
    np.testing.assert_allclose(result.linear_m, expected.linear_m, rtol=0, atol=SAME_DETECTIONS_M)
    assert not expected.rejected.any()


def test_two_blunders_of_seven_are_thrown_out():
    rng = np.random.default_rng(6)
    cameras, points = room_cameras(), room_points(rng, 8)
    pixels, covariance = detections(rng, cameras, points, 1)
    wrong = pixels.copy()
    wrong[1] += BLUNDER_PX
    wrong[4] -= BLUNDER_PX

    result = triangulate(cameras, wrong, covariance)

    assert (result.rejected == 2).all()
    assert not result.used[[1, 4]].any()


def test_two_views_that_disagree_give_no_point():
    """Across the epipolar line: of two views no one can say which is wrong, and both are counted."""
    rng = np.random.default_rng(7)
    cameras = [PTZCamera(p, 0, 0).aimed_at((0, 0, 1)) for p in [(3, 0, 1), (0, 3, 1)]]  # epipolar lines are level
    points = room_points(rng, 3)
    pixels, covariance = detections(rng, cameras, points, 1)
    pixels[0, 0, 1, 1] += BLUNDER_PX

    result = triangulate(cameras, pixels, covariance)

    assert result.rejected.tolist() == [[0, 2, 0]]
    assert result.views.tolist() == [[2, 0, 2]]
    assert np.isnan(result.points_m[0, 1]).all()
    assert np.isnan(result.covariance_m2[0, 1]).all()
    assert np.isnan(result.linear_m[0, 1]).all()


@pytest.mark.parametrize(("factor", "views"), [(1 - NEAR_THE_LIMIT, 2), (1 + NEAR_THE_LIMIT, 0)])
def test_the_limit_of_the_reprojection_test(factor, views):
    """Level cameras at equal distance see a point in the same row; rows δ apart cost δ²/2σ², one degree of freedom."""
    cameras = [PTZCamera(p, 0, 0).aimed_at((0, 0, 1)) for p in [(3, 0, 1), (0, 3, 1)]]
    pixels = exact_pixels(cameras, np.array([[0.0, 0.0, 1.0]]), 1)
    deviations = scipy.stats.norm.isf(BLUNDER_TAIL / 2) * np.sqrt(BLUNDER_INFLATION)
    sigma_px = 0.1
    pixels[0, ..., 1] += factor * np.sqrt(2) * sigma_px * deviations
    result = triangulate(cameras, pixels, np.broadcast_to(sigma_px**2 * np.eye(2), (2, 1, 1, 2, 2)))
    assert result.views.tolist() == [[views]]


def test_a_frozen_bias_is_no_blunder():
    """Residuals thrice what the covariance says keep their place: to drop them would flatter the measured error."""
    rng = np.random.default_rng(8)
    cameras, points = room_cameras(), room_points(rng, 20)
    pixels, covariance = detections(rng, cameras, points, 5)
    result = triangulate(cameras, pixels + 3 * (pixels - exact_pixels(cameras, points, 5)), covariance)
    assert BLUNDER_INFLATION > 3**2
    assert not result.rejected.any()


def test_rays_that_meet_behind_the_cameras_give_no_point():
    """Two level cameras side by side, looking along +y; the left one's ray runs left and the right one's right."""
    cameras = [PTZCamera((-0.5, 0, 1), 0, 0), PTZCamera((0.5, 0, 1), 0, 0)]
    middle = cameras[0].principal_point_px
    pixels = np.array([middle, middle]) + [[-100, 0], [100, 0]]
    result = triangulate(cameras, pixels[:, None, None], np.broadcast_to(0.01 * np.eye(2), (2, 1, 1, 2, 2)))
    assert result.views.tolist() == [[0]]
    assert np.isnan(result.points_m).all()


@pytest.mark.parametrize(("sigma_px", "rejected"), [(0.1, 1), (500.0, 0)])
def test_a_start_behind_the_cameras_is_survived(sigma_px, rejected):
    """Four level cameras side by side; the first's ray, in the widest pair, leaves the others' behind it.

    Where its own covariance says that it knows nothing, it is neither thrown out nor of any influence.
    """
    cameras = [PTZCamera((x, 0, 1), 0, 0) for x in (-2.0, 0.0, 1.0, 2.0)]
    truth = np.array([[0.0, 4.0, 1.2]])
    pixels = exact_pixels(cameras, truth, 1)
    pixels[0, 0, 0, 0] = 2 * cameras[0].principal_point_px[0] - pixels[0, 0, 0, 0] - 200
    covariance = np.full((4, 1, 1, 1, 1), 0.1**2) * np.eye(2)
    covariance[0] = sigma_px**2 * np.eye(2)
    result = triangulate(cameras, pixels, covariance)
    assert result.rejected.tolist() == [[rejected]]
    np.testing.assert_allclose(result.points_m[0], truth, rtol=0, atol=EXACT_M if rejected else NO_INFLUENCE_M)


def test_nearly_parallel_rays_are_no_blunders():
    """30 m off cameras within 0.4 m, Gauss–Newton alone overshoots past them, and the detections get the blame."""
    rng = np.random.default_rng(11)
    cameras = [PTZCamera((x, 0, 1), 0, 0) for x in (-0.2, 0.0, 0.2)]
    pixels, covariance = detections(
        rng, cameras, rng.uniform([-2, 30, 0], [2, 30, 2], (400, 3)), 1, low_px=3, high_px=3
    )
    result = triangulate(cameras, pixels, covariance)
    assert not result.rejected.any()


def test_cameras_in_one_place_give_no_depth():
    """Rounding gives some of the points an information about depth that is above zero, but it is no knowledge."""
    cameras = [PTZCamera((0, -3, 1), 0, 0, zoom=zoom) for zoom in (1, 2)]
    pixels = exact_pixels(cameras, room_points(np.random.default_rng(10), 50), 1)
    result = triangulate(cameras, pixels, np.broadcast_to(0.01 * np.eye(2), (2, 1, 50, 2, 2)))
    assert np.isnan(result.covariance_m2).all()
    assert not result.views.any()


def test_points_seen_by_fewer_than_two_views_are_nan():
    rng = np.random.default_rng(9)
    cameras, points = room_cameras(3), room_points(rng, 4)
    pixels, covariance = detections(rng, cameras, points, 2)
    detected = np.ones((3, 2, 4), dtype=bool)
    detected[:, 0, 0] = False
    detected[1:, 0, 1] = False
    detected[0, 0, 2] = False
    pixels[~detected], covariance[~detected] = np.nan, np.nan

    result = triangulate(cameras, pixels, covariance)

    assert result.views.tolist() == [[0, 0, 2, 3], [3, 3, 3, 3]]
    assert not result.rejected.any()
    missing = result.views == 0
    for values in (result.points_m, result.linear_m, result.covariance_m2):
        known = np.isfinite(values).reshape(2, 4, -1)
        assert (known.all(axis=-1) == ~missing).all()
        assert (known.any(axis=-1) == ~missing).all()


def test_nothing_detected_is_no_mistake():
    cameras = room_cameras(2)
    result = triangulate(cameras, np.full((2, 3, 4, 2), np.nan), np.full((2, 3, 4, 2, 2), np.nan))
    assert result.points_m.shape == (3, 4, 3)
    assert np.isnan(result.points_m).all()
    assert not result.views.any()


@pytest.mark.parametrize(
    ("pixels", "covariance", "error", "says"),
    [
        ((3, 1, 1, 2), (3, 1, 1, 2, 2), ShapeError, r"\(3, 1, 1, 2\)"),
        ((2, 1, 2), (2, 1, 2, 2), ShapeError, r"\(2, 1, 2\)"),
        ((2, 1, 1, 2), (2, 1, 1, 2), ShapeError, r"\(2, 1, 1, 2\)"),
        ((2, 1, 1, 2), (2, 1, 1, 2, 2), RangeError, "positive definite"),
    ],
)
def test_wrong_input_is_named(pixels, covariance, error, says):
    with pytest.raises(error, match=says) as caught:
        triangulate(room_cameras(2), np.zeros(pixels), np.zeros(covariance))
    assert isinstance(caught.value, PSSError)
