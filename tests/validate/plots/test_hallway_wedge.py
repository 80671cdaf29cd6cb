"""The fields of view in the hallway's plan, against where the camera projects points of the plane."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.path import Path as Outline

from pss import PTZCamera
from render.world.state import Room
from validate.plots.footprint import footprint_m, wedge_m

ROOM = Room(6.0, 10.0, 3.0, 0.6, 0.3, 0.75)
# A few roundings of metres, and of pixels at a focal length of thousands of them where a corner is close to the lens.
ROUNDING_M, ROUNDING_PX = 1e-9, 1e-5
POINTS = 400


def cameras(count: int = 60) -> list[PTZCamera]:
    """Settings all over, most of them looking down."""
    rng = np.random.default_rng(2)
    return [
        PTZCamera(
            tuple(rng.uniform([-2.9, -4.9, 0.5], [2.9, 4.9, 2.9])),
            rng.uniform(-180, 180),
            rng.uniform(-85, 30),
            zoom=rng.uniform(1, 8),
            focus_distance_m=4,
            resolution=(640, 480),
        )
        for _ in range(count)
    ]


def plane(height_m: float, seed: int = 6) -> np.ndarray:
    """Points of the room at a height, (POINTS, 3)."""
    places = np.random.default_rng(seed).uniform([-3, -5], [3, 5], (POINTS, 2))
    return np.column_stack([places, np.full(POINTS, height_m)])


def within(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """By matplotlib's own test; nothing is within nothing."""
    return Outline(corners).contains_points(places[:, :2]) if len(corners) else np.zeros(len(places), dtype=bool)


@pytest.mark.parametrize("height_m", [0.0, 0.9])
def test_what_is_in_the_wedge_projects_between_the_left_and_right_borders_and_nothing_else_does(height_m):
    points, inside = plane(height_m), 0
    for camera in cameras():
        pixels, depth = camera.project(points)
        between = (depth > 0) & (pixels[:, 0] > -0.5) & (pixels[:, 0] < camera.resolution[0] - 0.5)
        np.testing.assert_array_equal(within(wedge_m(camera, ROOM, height_m), points), between)
        inside += between.sum()
    assert 0.05 < inside / POINTS / len(cameras()) < 0.95


@pytest.mark.parametrize("height_m", [0.0, 0.9])
def test_the_footprint_is_what_the_image_shows(height_m):
    points, inside = plane(height_m), 0
    for camera in cameras():
        seen = camera.in_frustum(points)
        np.testing.assert_array_equal(within(footprint_m(camera, ROOM, height_m), points), seen)
        inside += seen.sum()
    assert inside > POINTS


def test_edges_of_the_wedge_project_onto_the_borders():
    """Every corner is one of the room's, or on a wall or where edges meet, and there at a border of the image."""
    walls = np.array([3.0, 5.0])
    for camera in cameras():
        corners = wedge_m(camera, ROOM)
        assert (np.abs(corners) <= walls + ROUNDING_M).all()
        of_room = (np.abs(np.abs(corners) - walls) < ROUNDING_M).all(axis=1)
        free = np.column_stack([corners[~of_room], np.zeros((~of_room).sum())])
        pixels, depth = camera.project(free)
        off = np.minimum(np.abs(pixels[:, 0] + 0.5), np.abs(pixels[:, 0] - camera.resolution[0] + 0.5))
        # Where both edges meet there is no depth, and so no pixel.
        assert off[np.abs(depth) > 1e-3].max(initial=0) < ROUNDING_PX


def test_at_the_cameras_own_height_the_wedge_is_a_triangle_at_the_camera():
    """For a level camera its angle is the field of view's own."""
    camera = PTZCamera((0.3, -1.0, 1.5), 0, 0, zoom=3, focus_distance_m=4)
    corners = wedge_m(camera, ROOM, 1.5)
    half = (5 + 1.0) * np.tan(np.radians(camera.horizontal_fov_deg / 2))
    expected = [(0.3, -1.0), (0.3 - half, 5.0), (0.3 + half, 5.0)]
    np.testing.assert_allclose(sorted(map(tuple, corners)), sorted(expected), atol=ROUNDING_M)


def test_a_camera_that_looks_up_shows_no_floor():
    camera = PTZCamera((0, 0, 1.5), 20, 60, focus_distance_m=4)
    assert footprint_m(camera, ROOM).shape == (0, 2)
    assert wedge_m(camera, ROOM).shape[1] == 2


@pytest.mark.parametrize("k1", [-0.08, 0.08])
def test_a_distorting_lens_has_its_borders_at_the_images_middle(k1):
    """A level camera images its own height onto the middle row, where the wedge is exact."""
    camera = PTZCamera((0.3, -4.0, 1.5), 10, 0, zoom=1.5, focus_distance_m=4, radial_distortion=(k1, 0.0))
    points = plane(1.5)
    np.testing.assert_array_equal(within(wedge_m(camera, ROOM, 1.5), points), camera.in_frustum(points))
    straight = PTZCamera((0.3, -4.0, 1.5), 10, 0, zoom=1.5, focus_distance_m=4)
    assert (within(wedge_m(straight, ROOM, 1.5), points) != camera.in_frustum(points)).any()
