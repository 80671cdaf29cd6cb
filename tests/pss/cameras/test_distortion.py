"""Radial distortion against OpenCV, finite differences and its own inverse."""

import dataclasses

import cv2
import numpy as np
import pytest

from pss import PTZCamera, RangeError, ShapeError
from pss.cameras.distortion import fold_radius, furthest_radius, stretch, undistorted
from validate.points.triangulate import triangulate

# Relative; a dozen roundings.
SAME_TO_ROUNDING = 1e-12
SAME_PIXEL_PX = 1e-9
# Central differences over 1e-5 m of a smooth projection.
SAME_DERIVATIVE = 1e-7

# At a focal length of 1,000 px. The fold is a double root, which doubles hold to half their digits.
LARGEST_ERROR_PX, FOCAL_PX = 1e-3, 1000.0
FOLDING = {"barrel": (-0.3, 0.0), "weak barrel": (-0.05, 0.0), "moustache": (0.1, -0.02), "both": (-0.2, -0.1)}
NOT_FOLDING = {"hardly": (-0.3, 0.0406), "strong": (0.8, 0.5), "pincushion": (0.09, 0.0), "barrel": (-0.18, 0.03)}

STRAIGHT = PTZCamera((0.3, -3, 1.2), 4, -3, zoom=1.2, focus_distance_m=3)
LENSES = {"barrel": (-0.18, 0.03), "pincushion": (0.09, 0.0), "moustache": (-0.12, 0.09)}


def points(count=200):
    rng = np.random.default_rng(5)
    return rng.uniform((-1.5, -0.5, 0.3), (1.5, 2.0, 2.0), (count, 3))


@pytest.fixture(params=LENSES.values(), ids=LENSES)
def camera(request):
    return dataclasses.replace(STRAIGHT, radial_distortion=request.param)


def test_projection_and_jacobian_are_those_of_opencv(camera):
    """OpenCV's derivative is by rotation and translation; by the translation, turned, it is that by the point."""
    rotation, _ = cv2.Rodrigues(camera.rotation)
    k = np.array([*camera.radial_distortion, 0, 0])
    pixels, jacobian = cv2.projectPoints(points(), rotation, camera.translation_m, camera.intrinsic_matrix, k)
    np.testing.assert_allclose(camera.project(points())[0], pixels[:, 0], atol=SAME_PIXEL_PX)
    by_point = jacobian[:, 3:6].reshape(-1, 2, 3) @ camera.rotation
    np.testing.assert_allclose(camera.jacobian(points()), by_point, rtol=1e-9, atol=1e-9)


def test_jacobian_is_the_derivative_of_project(camera):
    step = 1e-5
    numeric = np.stack(
        [(camera.project(points() + e)[0] - camera.project(points() - e)[0]) / (2 * step) for e in step * np.eye(3)], -1
    )
    np.testing.assert_allclose(camera.jacobian(points()), numeric, rtol=SAME_DERIVATIVE, atol=1e-4)


def test_undistorted_pixels_are_those_of_the_lens_without_distortion(camera):
    inside = points()[camera.in_frustum(points())]
    straight = camera.undistorted_px(camera.project(inside)[0])
    np.testing.assert_allclose(straight, STRAIGHT.project(inside)[0], atol=1e-8)
    assert len(inside) > 50


def test_a_lens_without_distortion_gives_pixels_back_bit_for_bit():
    pixels = np.random.default_rng(0).uniform(0, 1000, (50, 2))
    np.testing.assert_array_equal(STRAIGHT.undistorted_px(pixels), pixels)


def test_the_image_ends_where_the_sensor_ends_or_the_lens_folds():
    """Barrel distortion draws points in; beyond the fold they would be drawn onto what is inside, and are not seen."""
    barrel = dataclasses.replace(STRAIGHT, pan_deg=0, tilt_deg=0, radial_distortion=(-0.3, 0.0))
    fold = fold_radius(-0.3, 0.0)
    assert fold == pytest.approx((1 / 0.9) ** 0.5)
    assert fold_radius(0.1, 0.02) == np.inf
    for slope, seen in ((0.5, True), (1.0, True), (fold - 1e-6, True), (fold + 1e-6, False), (2.0, False)):
        point = np.array(barrel.position_m) + 2 * np.array([slope, 1.0, 0.0])
        # The fold's own image, two thirds of it, is at 0.70 focal lengths: within the sensor's 0.77.
        assert barrel.in_frustum(point) == seen, slope
    far = np.array(STRAIGHT.position_m) + np.array([0.9, 1.0, 0.0])
    level = dataclasses.replace(STRAIGHT, pan_deg=0, tilt_deg=0)
    assert not level.in_frustum(far)
    assert dataclasses.replace(level, radial_distortion=(-0.2, 0.0)).in_frustum(far)


@pytest.mark.parametrize("k", (FOLDING | NOT_FOLDING).values(), ids=str)
def test_undistortion_is_exact_up_to_the_very_fold(k):
    """Against the roots of the polynomial by its companion matrix, and there and back again."""
    furthest = furthest_radius(*k)
    assert np.isinf(furthest) == (k in NOT_FOLDING.values())
    shares = np.concatenate([np.linspace(0, 0.99, 12), 1 - np.geomspace(1e-2, 1e-12, 11), [1.0]])
    radii = shares * min(furthest, 3.0)
    direction = np.array([0.6, -0.8])
    found = undistorted(radii[:, None] * direction, *k) @ direction
    for radius, true in zip(radii, found, strict=True):
        roots = np.roots([k[1], 0, k[0], 0, 1, -radius]) if k[1] else np.roots([k[0], 0, 1, -radius])
        # At the fold rounding turns the double root into two complex ones, as far apart as its square root.
        nearest = np.abs(roots - true).min()
        assert nearest * FOCAL_PX < LARGEST_ERROR_PX
    assert (found <= fold_radius(*k)).all()
    back = found * stretch(found**2, *k)[0]
    np.testing.assert_allclose(back, radii, atol=1e-12)


def test_exact_detections_triangulate_exactly_through_distorting_lenses():
    """The linear start straightens its pixels, and the fit knows the lens."""
    places = [(3, 3, 2.8), (-3, 3, 2.5), (0, -3.5, 2.2)]
    cameras = [
        PTZCamera(p, 0, 0, zoom=1.2, radial_distortion=k).aimed_at((0, 0, 1))
        for p, k in zip(places, LENSES.values(), strict=True)
    ]
    truth = np.random.default_rng(1).uniform((-0.8, -0.8, 0.6), (0.8, 0.8, 1.5), (30, 3))
    pixels = np.stack([camera.project(truth)[0] for camera in cameras])[:, None]
    found = triangulate(cameras, pixels, np.broadcast_to(0.01 * np.eye(2), (*pixels.shape, 2)))
    np.testing.assert_allclose(found.points_m[0], truth, atol=1e-10)
    np.testing.assert_allclose(found.linear_m[0], truth, atol=1e-8)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: dataclasses.replace(STRAIGHT, radial_distortion=(0.1,)), ShapeError, "1 numbers; allowed is 2"),
        (lambda: dataclasses.replace(STRAIGHT, radial_distortion=(np.nan, 0)), RangeError, "nan.*allowed: finite"),
        (lambda: STRAIGHT.undistorted_px(np.zeros(3)), ShapeError, r"\(3,\); allowed is"),
        (
            lambda: dataclasses.replace(STRAIGHT, radial_distortion=(-0.3, 0)).undistorted_px((5000.0, 0.0)),
            RangeError,
            "focal lengths off the axis; allowed: up to 0.70",
        ),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, error, message):
    with pytest.raises(error, match=message):
        make()
