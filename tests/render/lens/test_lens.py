"""Mitsuba's thin lens is the metric's camera: pixels, field of view, aperture and plane of focus."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pss import PTZCamera
from render.lens import thin_lens
from tests.helpers.views import centroid, disc_scene, point_at, render_part

pytestmark = pytest.mark.render

CAMERA = PTZCamera((0.5, -1.0, 2.0), 30.0, -20.0, zoom=3.0, focus_distance_m=3.0)
# px. 130 000 rays hit the disc: its centroid has a σ of 0.002 px.
CENTROID_PX = 0.01
# px. A disc as wide as this (the third zero of J₁ over π) has no component at one cycle a pixel, so that pixels do not
# shift its centroid; at 3.0 px they do, by up to 0.012 px.
DISC_PX = 3.2383
WINDOW_PX = 12
SAMPLES = 16384
# Mitsuba computes rays in single precision: 24 bits of numbers of order one, some roundings.
SINGLE = 3e-6


def rays(mi, camera: PTZCamera, film, aperture) -> tuple[np.ndarray, np.ndarray]:
    """Origins (N, 3) and unit directions (N, 3) of Mitsuba's rays; film and aperture positions in [0, 1], (N, 2)."""
    film, aperture = (mi.Point2f(*np.asarray(uv, dtype=np.float32).T) for uv in (film, aperture))
    ray, _ = thin_lens.load_sensor(camera, mi).sample_ray(0.0, 0.5, film, aperture)
    return ray.o.numpy().T.astype(float), ray.d.numpy().T.astype(float)


@pytest.mark.parametrize("pixel", [(639.5, 479.5), (0.0, 0.0), (1279.0, 959.0), (100.25, 820.75), (1000.0, 40.5)])
def test_a_known_point_lands_on_its_pixel(mi, pixel):
    """Convention: the centre of the top left pixel is (0, 0), x to the right and y down.

    A bright disc at a known place in the world is rendered, and the centroid of its light is where `project` says. A
    disc in the corner would be cut by the sensor's edge: it is asked for a window further in.
    """
    pixel = np.clip(pixel, WINDOW_PX, np.array(CAMERA.resolution) - WINDOW_PX)
    point = point_at(CAMERA, pixel, CAMERA.focus_distance_m)
    projected, _ = CAMERA.project(point)
    np.testing.assert_allclose(projected, pixel, atol=1e-9)
    scene = disc_scene(mi, CAMERA, point, DISC_PX)
    found = centroid(*render_part(mi, scene, CAMERA, pixel, WINDOW_PX, SAMPLES))
    np.testing.assert_allclose(found, projected, atol=CENTROID_PX)


def test_film_position_is_half_a_pixel_on():
    """Convention: Mitsuba's film has the centre of the top left pixel at (0.5, 0.5)."""
    np.testing.assert_array_equal(thin_lens.film_position(np.array([0.0, 10.25])), [0.5, 10.75])


@pytest.mark.parametrize("zoom", [1.0, 3.0, 8.0])
def test_field_of_view(mi, zoom):
    """The sensor's left and right edges are 90°/zoom apart, and every direction in between is the camera's own."""
    camera = dataclasses.replace(CAMERA, zoom=zoom)
    _, (left, right) = rays(mi, camera, [(0, 0.5), (1, 0.5)], [(0.5, 0.5)] * 2)
    angle_deg = np.degrees(2 * np.arcsin(np.linalg.norm(right - left) / 2))
    assert angle_deg == pytest.approx(90 / zoom, rel=10 * SINGLE)

    film = np.random.default_rng(1).random((200, 2)).astype(np.float32).astype(float)
    origin, direction = rays(mi, camera, film, np.full((200, 2), 0.5))
    pixels, _ = camera.project(origin + direction)
    np.testing.assert_allclose(pixels, film * camera.resolution - 0.5, atol=SINGLE * camera.focal_px)


@pytest.mark.parametrize(("pan_deg", "tilt_deg"), [(0, -90), (35, -90), (-120, 90)])
def test_rays_of_a_camera_that_looks_straight_down_or_up(mi, pan_deg, tilt_deg):
    """Mitsuba has the camera's own directions there, too: it is given a rotation and no "up" of its own."""
    camera = dataclasses.replace(CAMERA, pan_deg=pan_deg, tilt_deg=tilt_deg)
    film = np.random.default_rng(1).random((200, 2)).astype(np.float32).astype(float)
    origin, direction = rays(mi, camera, film, np.full((200, 2), 0.5))
    pixels, _ = camera.project(origin + direction)
    np.testing.assert_allclose(pixels, film * camera.resolution - 0.5, atol=SINGLE * camera.focal_px)


@pytest.mark.parametrize("f_number", [1.0, 1.8, 8.0])
def test_rays_fill_the_aperture_and_meet_in_the_plane_of_focus(mi, f_number):
    """All rays of one film position pass a disc of diameter f/N about the lens centre and meet at depth d.

    The plane of focus is a plane: the depth is d off the axis, too.
    """
    camera = dataclasses.replace(CAMERA, f_number=f_number, focus_distance_m=2.5, zoom=2.0)
    count = 4000
    aperture = np.random.default_rng(2).random((count, 2))
    origin, direction = rays(mi, camera, np.tile((0.93, 0.12), (count, 1)), aperture)
    # Rays begin at the near clip plane; back to the lens.
    local, forward = camera.to_camera_frame(origin), direction @ camera.rotation.T
    at_lens = local - forward * (local[:, 2:] / forward[:, 2:])
    radius = np.hypot(*at_lens[:, :2].T)
    half = camera.aperture_diameter_m / 2
    assert radius.max() <= half + SINGLE
    # Uniform over a disc: the mean of r² is half of its radius squared; its σ is r²/√(12 N).
    assert (radius**2).mean() == pytest.approx(half**2 / 2, abs=5 * half**2 / np.sqrt(12 * count))

    in_focus = at_lens + forward * ((camera.focus_distance_m - at_lens[:, 2:]) / forward[:, 2:])
    # Metres: single precision of positions some metres from the world's origin.
    assert np.ptp(in_focus, axis=0).max() < 5 * SINGLE
    pixels, depth = camera.project(camera.rotation.T @ in_focus.mean(axis=0) + camera.position_m)
    assert depth == pytest.approx(2.5, abs=SINGLE)
    np.testing.assert_allclose(pixels, (0.93 * 1280 - 0.5, 0.12 * 960 - 0.5), atol=5 * SINGLE * camera.focal_px)
