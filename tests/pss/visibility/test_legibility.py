"""Whole targets and legible ones: against corners projected one by one, obstacles placed by hand, and sizes by hand."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import pss
import scenes
from pss import Appearance, Box, Legible, PTZCamera, RangeError, WholeTarget, visibility_tests
from pss.cameras.views import Views
from pss.noise import Calibration
from pss.visibility.points import VISIBILITY_TESTS, visible_in
from pss.visibility.targets import TARGET_VISIBILITY, blur_modules, narrow_side_px
from scenes import SceneError

MODULE_M = 0.02
LOOK = Appearance(MODULE_M, 1.0, 0.1)
# Looks along +y.
CAMERA = PTZCamera((0.0, 0.0, 1.5), pan_deg=0.0, tilt_deg=0.0, zoom=2.0, focus_distance_m=4.0)


def seen(points, tests=TARGET_VISIBILITY, occluder=(), appearance=LOOK, normals=None, camera=CAMERA) -> np.ndarray:
    points = np.atleast_2d(np.array(points, dtype=float))
    normals = np.tile((0.0, -1.0, 0.0), (len(points), 1)) if normals is None else normals
    return visible_in(Views([camera], points, normals, appearance), occluder, tests)[0]


def corners(point, normal, half_m: float) -> np.ndarray:
    """Metres, (4, 3), of an upright square."""
    up = np.array([0.0, 0.0, 1.0])
    along = np.cross(up, normal)
    return np.array([point + half_m * (u * along + v * up) for u in (-1, 1) for v in (-1, 1)])


@pytest.mark.parametrize("margin", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("distortion", [(0.0, 0.0), (-0.2, 0.03)])
def test_a_target_is_whole_if_its_corners_are_in_the_image(margin, distortion):
    """Against the four corners, projected one by one, of targets all over the image's border."""
    camera = dataclasses.replace(CAMERA, radial_distortion=distortion)
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-2.2, 2.2, 400), rng.uniform(3, 5, 400), rng.uniform(-0.1, 3.1, 400)])
    turn = rng.uniform(-1.2, 1.2, 400)
    normals = np.column_stack([np.sin(turn), -np.cos(turn), np.zeros(400)])
    expected = []
    for point, normal in zip(points, normals, strict=True):
        pixels, _ = camera.project(corners(point, normal, (3 + margin) * MODULE_M))
        centre = camera.project(point[None])[0]
        facing = normal @ (point - np.array(camera.position_m)) < 0
        width, height = camera.resolution
        inside = all((-0.5 <= x <= width - 0.5) and (-0.5 <= y <= height - 0.5) for x, y in [*pixels, *centre])
        expected.append(inside and facing)
    found = seen(points, (*VISIBILITY_TESTS, WholeTarget(margin)), normals=normals, camera=camera)
    assert 0.2 < np.mean(expected) < 0.8
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("low", "high", "hidden"),
    [
        ((0.03, 3.0, 1.53), (0.3, 3.1, 1.8), True),  # a corner
        ((0.03, 3.0, 1.49), (0.3, 3.1, 1.51), True),  # the middle of a side
        ((-0.3, 3.0, 1.53), (0.3, 3.1, 1.8), True),  # a whole side
        ((0.06, 3.0, 1.56), (0.3, 3.1, 1.8), False),  # nothing
        ((0.047, 3.0, 1.4), (0.3, 3.1, 1.6), False),  # the white around it alone
    ],
)
def test_something_before_a_part_of_a_target_hides_it(low, high, hidden):
    """A target of ±0.06 m at 4 m is ±0.045 m wide where an obstacle stands, at 3 m; its centre is clear."""
    box = Box("obstacle", low, high)
    assert seen((0.0, 4.0, 1.5), VISIBILITY_TESTS, (box,))[0]
    assert seen((0.0, 4.0, 1.5), occluder=(box,))[0] == (not hidden)


def test_an_own_surface_does_not_hide_its_target():
    """A target on a box that is itself an obstacle."""
    assert seen((0.0, 4.0, 1.5), occluder=(Box("own", (-0.5, 4.0, 1.0), (0.5, 4.5, 2.0)),))[0]


def test_sizes_and_blur_by_hand():
    """20 mm at 4 m, facing the camera and turned by 60°; the circle of confusion over the narrow side."""
    points = np.array([(0.0, 4.0, 1.5)] * 2)
    turned = (-math.sin(math.radians(60)), -math.cos(math.radians(60)), 0.0)
    camera = dataclasses.replace(CAMERA, focus_distance_m=3.0)
    views = Views([camera], points, np.array([(0.0, -1.0, 0.0), turned]), LOOK)
    facing = camera.focal_px * MODULE_M / 4
    # Seen at an angle, the side's two ends are at different depths: second order here.
    np.testing.assert_allclose(narrow_side_px(views)[0], [facing, facing / 2], rtol=1e-6)
    np.testing.assert_allclose(blur_modules(views)[0] * [facing, facing / 2], views.circle_of_confusion_px[0])


def test_legible_by_its_two_limits():
    """Just within and just beyond each limit."""
    views = Views(
        [dataclasses.replace(CAMERA, focus_distance_m=3.0)], np.array([(0.0, 4.0, 1.5)]), -np.eye(3)[1:2], LOOK
    )
    side, blur = float(narrow_side_px(views)[0, 0]), float(blur_modules(views)[0, 0])
    everything = np.ones((1, 1), dtype=bool)
    for smallest, largest, legible in ((0.99, 1.01, True), (1.01, 1.01, False), (0.99, 0.99, False)):
        test = Legible(smallest * side, largest * blur)
        assert test.passed(views, everything, ())[0, 0] == legible
        assert not test.passed(views, ~everything, ())[0, 0]


def test_visibility_by_name_and_by_calibration(tmp_path):
    """ "point" is the paper's, "target" adds the whole target, a calibration its limits."""
    assert visibility_tests("point") == VISIBILITY_TESTS
    assert visibility_tests("target") == (*VISIBILITY_TESTS, WholeTarget())
    path = tmp_path / "mine.toml"
    limits = {"smallest_module_px": 2.5, "largest_blur_modules": 0.8}
    calibration = Calibration("mine", {"floor": 1.0}, {}, limits)
    path.write_text(calibration.to_toml())
    assert Calibration.from_file(path) == calibration
    assert visibility_tests(path) == (*TARGET_VISIBILITY, Legible(2.5, 0.8))
    path.write_text(Calibration("mine", {"floor": 1.0}, {}).to_toml())
    assert visibility_tests(str(path)) == TARGET_VISIBILITY


def test_evaluate_with_targets():
    """Two cameras, one of which has half the target in view: seen as a point by both, as a target by one."""
    point, normal = np.array([(0.0, 4.0, 1.5)]), np.array([(0.0, -1.0, 0.0)])
    half = math.degrees(math.atan(CAMERA.resolution[0] / 2 / CAMERA.focal_px))
    cameras = [CAMERA, dataclasses.replace(CAMERA, position_m=(0.3, 0.0, 1.5), pan_deg=half - 5.0)]
    appearance = {"appearance": LOOK, "noise": "identity"}
    assert pss.evaluate(cameras, point, normal, **appearance).visible.sum() == 2
    found = pss.evaluate(cameras, point, normal, visibility=visibility_tests("target"), **appearance)
    assert found.visible.tolist() == [[True], [False]]
    assert not found.observable[0]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: visibility_tests("marker"), r"'marker'; allowed: point, target, calibrated, or a calibration's path"),
        (lambda: visibility_tests("nowhere.toml"), "nowhere.toml: there is no such file"),
        (lambda: WholeTarget(-1.0), r"margin_modules = -1.0; allowed: 0 or more"),
        (lambda: Legible(0.0, 1.0), r"smallest_module_px = 0.0; allowed: above 0"),
        (lambda: Legible(2.0, float("nan")), r"largest_blur_modules = nan; allowed: above 0"),
        (lambda: seen((0.0, 4.0, 1.5), appearance=None), "'whole-target' has no appearance; allowed: evaluate"),
        (lambda: seen((0.0, 4.0, 1.5), (Legible(2.0, 1.0),), appearance=None), "'legible' has no appearance"),
    ],
)
def test_what_is_wrong_is_one_line(call, message):
    with pytest.raises(RangeError, match=message):
        call()


def test_a_scene_says_what_counts_as_seen():
    """`metric.visibility` of a scene file; the paper's by default."""
    room = Path(__file__).parents[3] / "scenes" / "room.toml"
    assert scenes.load(room).visibility == VISIBILITY_TESTS
    assert scenes.load(room, ("metric.visibility=target",)).visibility == TARGET_VISIBILITY
    with pytest.raises(SceneError, match=r"metric.visibility.*allowed: point, target, calibrated, or a calibration"):
        scenes.load(room, ("metric.visibility=marker",))
