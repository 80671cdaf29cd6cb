"""Which camera sees which point: cases by hand, and a walk along each line of sight."""

import math

import numpy as np
import pytest

from pss import Box, PTZCamera, Rectangle, Sphere
from pss.visibility.points import CLEARANCE_M
from tests.helpers.visible_points import visible_points

BALL = Sphere("ball", (0, 0, 1), 0.5)
# A camera 3 m in front of the ball, at its height, and the points of the ball nearest to it, furthest from it, on top.
FRONT = PTZCamera((0, -3, 1), 0, 0)
NEAR, FAR, TOP = (0, -0.5, 1), (0, 0.5, 1), (0, 0, 1.5)
# The walk steps along 1000 places of a line; a line that comes nearer to an edge than this is left out.
GRAZING_M = 0.02


def sees(camera, point, normal, occluder=()):
    return bool(visible_points([camera], np.array([point], float), np.array([normal], float), occluder)[0, 0])


def test_a_point_in_front_that_looks_at_the_camera_is_seen():
    assert sees(FRONT, NEAR, (0, -1, 0))
    assert sees(FRONT, NEAR, (0, -1, 0), [BALL])


def test_a_surface_that_looks_away_is_hidden_by_itself():
    """Self-occlusion by the normal alone: no occluder is given."""
    assert not sees(FRONT, FAR, (0, 1, 0))
    assert not sees(FRONT, TOP, (0, 0, 1))  # edge on, cos α = 0
    grazing = math.radians(89)
    assert sees(FRONT, NEAR, (math.sin(grazing), -math.cos(grazing), 0))
    grazing = math.radians(91)
    assert not sees(FRONT, NEAR, (math.sin(grazing), -math.cos(grazing), 0))


def test_a_body_hides_what_is_behind_it_whatever_its_normal_says():
    assert sees(FRONT, FAR, (0, -1, 0))
    assert not sees(FRONT, FAR, (0, -1, 0), [BALL])


def test_the_object_that_bears_a_point_does_not_hide_it():
    """Every point of the spiral that looks at the camera is seen past its own ball, and no other."""
    points, normals = BALL.spiral(500)
    seen = visible_points([FRONT], points, normals, [BALL])[0]
    np.testing.assert_array_equal(seen, FRONT.cos_incidence(points, normals) > 0)
    # A ball of radius r at distance d shows the cap beyond cos = r/d.
    assert seen.mean() == pytest.approx((1 - 0.5 / 3) / 2, abs=0.005)


@pytest.mark.parametrize(
    ("occluder", "hides"),
    [
        (Rectangle("in between", (0, -2, 1), 0.5, 0.5), True),
        (Rectangle("beside", (0.3, -2, 1), 0.5, 0.5), False),
        (Rectangle("behind the point", (0, 0.7, 1), 5, 5), False),
        (Rectangle("behind the camera", (0, -4, 1), 5, 5), False),
        (Sphere("in between", (0.1, -2, 1), 0.2), True),
        (Sphere("beside", (0.3, -2, 1), 0.2), False),
        (Sphere("behind the camera", (0, -4, 1), 0.9), False),
        (Box("in between", (-0.1, -2, 0), (0.1, -1.5, 2)), True),
        (Box("below", (-0.1, -2, 0), (0.1, -1.5, 0.9)), False),
        (Box("behind the camera", (-1, -9, 0), (1, -3.1, 3)), False),
    ],
    ids=lambda value: f"{type(value).__name__} {value.name}" if hasattr(value, "name") else "",
)
def test_occlusion_by_another_object(occluder, hides):
    """Only what lies between the camera and the point hides it: the line of sight has two ends."""
    assert sees(FRONT, NEAR, (0, -1, 0), [occluder, BALL]) is not hides


@pytest.mark.parametrize(("zoom", "half_m"), [(1, 3.0), (2, 3 * math.tan(math.radians(22.5)))])
def test_the_frustum_ends_at_the_edge_of_the_sensor(zoom, half_m):
    camera = PTZCamera((0, -3, 1), 0, 0, zoom=zoom)
    for direction, half in (((1, 0, 0), half_m), ((0, 0, 1), half_m * 3 / 4)):
        for sign in (1, -1):
            inside, outside = (np.array([0, 0, 1.0]) + sign * s * half * np.array(direction) for s in (0.9999, 1.0001))
            assert sees(camera, inside, (0, -1, 0))
            assert not sees(camera, outside, (0, -1, 0))


def test_what_is_behind_or_at_the_camera_is_not_seen():
    assert not sees(FRONT, (0, -6, 1), (0, 1, 0))
    assert not sees(FRONT, (0, -6, 1), (0, -1, 0))
    assert not sees(FRONT, (0, -3, 1), (0, -1, 0))


def test_a_line_of_sight_ends_just_before_its_point():
    """A board with the point on it hides nothing in front of it; one that stands off further than that does."""
    assert sees(FRONT, NEAR, (0, -1, 0), [Rectangle("flush", (0, -0.5, 1), 1, 1)])
    ahead = -0.5 - 2 * CLEARANCE_M
    assert not sees(FRONT, NEAR, (0, -1, 0), [Rectangle("ahead", (0, ahead, 1), 1, 1)])


def inside(shape, points, grow_m):
    """Whether `points` lie in a shape that is larger by `grow_m` all around (a board is as thick as that)."""
    if isinstance(shape, Sphere):
        return np.linalg.norm(points - shape.centre_m, axis=-1) < shape.radius_m + grow_m
    if isinstance(shape, Box):
        return ((points > np.array(shape.lowest_m) - grow_m) & (points < np.array(shape.highest_m) + grow_m)).all(-1)
    local = points - shape.centre_m
    sizes = (shape.width_m / 2 + grow_m, shape.height_m / 2 + grow_m, abs(grow_m))
    axes = (shape.right, shape.up, shape.normal)
    return np.all([np.abs(local @ axis) < size for axis, size in zip(axes, sizes, strict=True)], axis=0)


def test_a_room_by_walking_along_every_line_of_sight():
    """Pixels for the field of view, the angle at the surface, and 1000 places on the way, one point at a time."""
    rng = np.random.default_rng(7)
    ball, box = Sphere("ball", (0.3, 0.1, 1.2), 0.45), Box("box", (-1.2, -0.6, 0), (-0.6, 0.2, 1.4))
    shapes = [ball, box]
    ball_points, ball_normals = ball.spiral(120)
    free_points, free_normals = rng.uniform((-2, -2, 0.1), (2, 2, 2.5), (150, 3)), rng.normal(size=(150, 3))
    points = np.concatenate([ball_points + 1e-3 * ball_normals, free_points])
    normals = np.concatenate([ball_normals, free_normals / np.linalg.norm(free_normals, axis=1, keepdims=True)])
    cameras = [
        PTZCamera((x, y, 2.8), 0, 0, zoom=zoom, focus_distance_m=3).aimed_at((0, 0, 1.2))
        for x, y, zoom in ((-2.8, 0.2, 1.3), (0.1, 2.8, 2.5), (2.7, -2.6, 1.8), (-2, -2.8, 4))
    ]
    got = visible_points(cameras, points, normals, shapes)
    assert got.shape == (4, 270)
    steps = np.linspace(0, 1, 1000)[:, None]
    compared = hidden = 0
    for camera, row in zip(cameras, got, strict=True):
        width, height = camera.resolution
        for point, normal, seen in zip(points, normals, row, strict=True):
            way = np.array(camera.position_m) - point
            (u, v), depth = camera.project(point)
            expected = depth > 0 and -0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5 and way @ normal > 0
            # The first steps may graze the surface that bears the point: they are judged by the normal.
            walk = (point + steps * way)[10:]
            within = any(inside(shape, walk, -GRAZING_M / 2).any() for shape in shapes)
            near = any(inside(shape, walk, GRAZING_M).any() for shape in shapes)
            if expected and near and not within:
                continue
            compared += 1
            hidden += expected and within
            assert seen == (expected and not within), (camera, point)
    assert compared > 900
    assert hidden > 20


def test_no_cameras_and_no_points():
    assert visible_points([], np.zeros((4, 3)), np.tile([0, 0, 1.0], (4, 1))).shape == (0, 4)
    assert visible_points([FRONT], np.zeros((0, 3)), np.zeros((0, 3)), [BALL]).shape == (1, 0)
