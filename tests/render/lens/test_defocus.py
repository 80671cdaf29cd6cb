"""Rendered blur against Eq. 14: the circle of confusion of a bright disc in the dark, from its second moment."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import scipy.stats

from pss import PTZCamera
from render.lens import thin_lens
from tests.helpers.views import centroid, disc_scene, point_at, render_part, variance

pytestmark = pytest.mark.render

CAMERA = PTZCamera((0.5, -1.0, 2.0), 30.0, -20.0, zoom=8.0, focus_distance_m=3.0, f_number=1.4)
# Relative. Eq. 14 and a thin lens agree exactly; 25 000 to 55 000 rays that hit the disc leave a σ of 0.15 to 0.3 % per
# axis. The paper's blur has to be met within 2 %.
DIAMETER = 0.02
# The disc's own diameter over that of its blur: large enough that many rays hit it, small enough to hardly matter.
SOURCE_SHARE = 0.3
RAYS = 2_000_000

# Latin hypercube: each factor has one value in each of its 25 equal steps, in the logarithm but for the angle.
COMBINATIONS = 25
LOWEST, HIGHEST = {"zoom": 1.0, "focus_m": 1.0, "depth_m": 0.8}, {"zoom": 8.0, "focus_m": 6.0, "depth_m": 8.0}
OFF_AXIS_DEG = 40.0
# A seed whose widest fields also have the largest angles: up to 38.9°.
LARGE_ANGLES = 4
# Of the way from the middle of the image to its edge.
WITHIN_FIELD = 0.95
# Points of a scrambled Sobol net on film and lens.
NET = 1 << 20
# Relative, along each axis. Eq. 14 and a thin lens agree exactly; the 48 000 rays that hit are within 0.3 % (measured
# over all combinations and both axes; independent ones would leave a σ of 0.23 %).
DIAMETER_OVER_ALL = 0.01


def blur_diameter_px(mi, camera: PTZCamera, point_m: np.ndarray) -> np.ndarray:
    """Pixels, the diameter of the rendered circle of confusion along x and y, (2,).

    A uniform disc of diameter d has a variance of d²/16 along each axis. Variances add: the source's own disc and the
    pixel's square (1/12) are taken off.
    """
    pixel, _ = camera.project(point_m)
    expected = float(camera.circle_of_confusion_px(point_m))
    source = SOURCE_SHARE * expected
    # A third wider than the prediction: a blur that is larger than it shows, instead of being cut off.
    size = math.ceil(1.33 * (expected + source)) + 6
    scene = disc_scene(mi, camera, point_m, source)
    pixels, x, y = render_part(mi, scene, camera, pixel, size, max(64, RAYS // size**2))
    np.testing.assert_allclose(centroid(pixels, x, y), pixel, atol=0.005 * expected + 0.02)
    return 4 * np.sqrt(variance(pixels, x, y) - 1 / 12 - source**2 / 16)


@pytest.mark.parametrize("off_axis_px", [(0, 0), (450, -330)], ids=["on axis", "off axis"])
@pytest.mark.parametrize("depth_m", [1.5, 2.2, 2.7, 3.6, 6.0])
def test_circle_of_confusion_is_equation_14(mi, depth_m, off_axis_px):
    """Before and behind the plane of focus, the blur's diameter is Eq. 14's, by depth along the axis, not by range."""
    point = point_at(CAMERA, np.array(CAMERA.principal_point_px) + off_axis_px, depth_m)
    expected = float(CAMERA.circle_of_confusion_px(point))
    measured = blur_diameter_px(mi, CAMERA, point)
    print(f"{depth_m} m {off_axis_px}: Eq. 14 {expected:.3f} px, rendered {measured[0]:.3f}, {measured[1]:.3f} px")
    np.testing.assert_allclose(measured, expected, rtol=DIAMETER)


def settings() -> list[tuple[PTZCamera, np.ndarray]]:
    """Cameras, each with a point that it sees: zoom, focus, depth, angle off the axis and its direction all vary."""
    shares = scipy.stats.qmc.LatinHypercube(5, rng=np.random.default_rng(LARGE_ANGLES)).random(COMBINATIONS)
    found = []
    for *share, off_axis, turn in shares:
        zoom, focus_m, depth_m = (
            LOWEST[name] * (HIGHEST[name] / LOWEST[name]) ** way for name, way in zip(LOWEST, share, strict=True)
        )
        camera = dataclasses.replace(CAMERA, zoom=zoom, focus_distance_m=focus_m)
        way = np.array([math.cos(2 * math.pi * turn), math.sin(2 * math.pi * turn)])
        to_edge_px = WITHIN_FIELD * min(np.array(camera.resolution) / 2 / np.abs(way))
        farthest_px = min(to_edge_px, camera.focal_px * math.tan(math.radians(OFF_AXIS_DEG)))
        pixel = np.array(camera.principal_point_px) + off_axis * farthest_px * way
        found.append((camera, point_at(camera, pixel, depth_m)))
    return found


def diameter_by_rays_px(mi, camera: PTZCamera, point_m: np.ndarray, net: np.ndarray) -> np.ndarray:
    """Pixels, the diameter of the circle of confusion along x and y, (2,), from single rays: also far below a pixel.

    Where on the film the rays begin that pass the lens and hit a small disc in the dark.
    """
    pixel, _ = camera.project(point_m)
    expected = float(camera.circle_of_confusion_px(point_m))
    source = SOURCE_SHARE * expected
    places = pixel + (net[:, :2] - 0.5) * 1.33 * (expected + source)
    film = thin_lens.film_position(places) / camera.resolution
    sensor, scene = thin_lens.load_sensor(camera, mi), disc_scene(mi, camera, point_m, source)
    ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(*film.T), mi.Point2f(*net[:, 2:].T))
    hits = scene.ray_intersect(ray).is_valid().numpy()
    return 4 * np.sqrt(places[hits].var(axis=0) - source**2 / 16)


def test_circle_of_confusion_over_zoom_focus_depth_and_angle(mi):
    """Eq. 14 within 1 % wherever a camera may be set to, from a wide field near by to a narrow one far away."""
    net = scipy.stats.qmc.Sobol(4, rng=np.random.default_rng(14)).random(NET)
    ratios = []
    for camera, point in settings():
        expected = float(camera.circle_of_confusion_px(point))
        ratios.append(diameter_by_rays_px(mi, camera, point, net) / expected)
        print(
            f"zoom {camera.zoom:.2f}, focus {camera.focus_distance_m:.2f} m, depth {camera.project(point)[1]:.2f} m, "
            f"{math.degrees(math.acos(camera.cos_off_axis(point))):4.1f}°: Eq. 14 {expected:6.2f} px, "
            f"by rays {ratios[-1][0] - 1:+.2%}, {ratios[-1][1] - 1:+.2%}"
        )
    np.testing.assert_allclose(ratios, 1, atol=DIAMETER_OVER_ALL)


def test_half_the_f_number_is_twice_the_blur(mi):
    """The aperture's diameter is f/N, so that N halved doubles the blur."""
    point = point_at(CAMERA, np.array([500.0, 300.0]), 4.5)
    blurs = [
        blur_diameter_px(mi, dataclasses.replace(CAMERA, f_number=f_number), point).mean() for f_number in (2.8, 1.4)
    ]
    assert blurs[1] / blurs[0] == pytest.approx(2, rel=DIAMETER)


def test_no_blur_in_the_plane_of_focus(mi):
    """At depth d, off the axis too, a disc is as wide as the disc itself."""
    pixel = np.array([1100.0, 120.0])
    scene = disc_scene(mi, CAMERA, point_at(CAMERA, pixel, CAMERA.focus_distance_m), 6.0)
    pixels, x, y = render_part(mi, scene, CAMERA, pixel, 16, RAYS // 256)
    diameter = 4 * np.sqrt(variance(pixels, x, y) - 1 / 12)
    np.testing.assert_allclose(diameter, 6.0, rtol=DIAMETER)
