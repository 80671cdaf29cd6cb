"""Motors with limits: the fit against the sphere's projected outline, steps, speeds and the way round by hand."""

import dataclasses
import math

import numpy as np
import pytest

from pss import GeometryError, PTZCamera, RangeError
from pss.cameras.motors import PTZLimits, fitting_zoom, follow, moved_towards, quantised

# Share of the image's half width or height; an outline of 1,440 points comes this near to its own extremes.
OUTLINE_SAMPLING = 1e-5
# Settings are rounded to nine decimals.
ROUNDED = 1e-9
# Part of a step that rounding may use up.
OF_A_STEP = 1e-5

FREE = PTZLimits(pan_step_deg=None, tilt_step_deg=None, zoom_step=None, focus_step_dioptre=None)
COARSE = PTZLimits(pan_step_deg=0.5, tilt_step_deg=0.3, zoom_step=0.05, focus_step_dioptre=0.02)
CAMERA = PTZCamera((3, -5, 2.9), 0, 0, zoom=2, name="corner")
TARGET_M, RADIUS_M = (0.6, 1.0, 0.9), 0.95
SETTINGS = ("pan_deg", "tilt_deg", "zoom", "focus_distance_m")


def outline(camera, centre, radius, count=1440):
    """Points where rays from the lens touch the sphere: a circle, written from the right triangle at the tangent."""
    towards = np.asarray(centre, dtype=float) - camera.position_m
    distance = np.linalg.norm(towards)
    towards /= distance
    aside = np.cross(towards, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)[:, None]
    circle = np.cos(angle) * aside + np.sin(angle) * np.cross(towards, aside)
    tangent = math.sqrt(distance**2 - radius**2)
    return camera.position_m + tangent * (tangent / distance * towards + radius / distance * circle)


def filled(camera, centre, radius):
    """The share of the image's half width or half height, the greater, that the outline reaches from the middle."""
    pixels, depth = camera.project(outline(camera, centre, radius))
    assert (depth > 0).all()
    return (np.abs(pixels - camera.principal_point_px) / (np.array(camera.resolution) / 2)).max()


def drawn(count, seed, max_zoom=8.0):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield PTZCamera(
            (3, -5, 2.9),
            rng.uniform(-400, 400),
            rng.uniform(-89, 89),
            zoom=math.exp(rng.uniform(0, math.log(max_zoom))),
            focus_distance_m=1 / rng.uniform(0.03, 2),
            max_zoom=max_zoom,
        )


# ---- the wanted setting ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("resolution", [(1280, 960), (960, 1280), (800, 800)])
@pytest.mark.parametrize("target", [TARGET_M, (-2, 4.5, 0.9), (2, -3, 1.8), (3, -3, 0.5)])
def test_the_sphere_just_fits_the_image(target, resolution):
    camera = follow(dataclasses.replace(CAMERA, resolution=resolution, max_zoom=100), target, RADIUS_M, FREE)
    assert filled(camera, target, RADIUS_M) == pytest.approx(1, abs=OUTLINE_SAMPLING)
    # On the axis, the narrower side has the sphere's own half angle.
    distance = math.dist(target, camera.position_m)
    narrow = math.tan(math.radians(camera.horizontal_fov_deg) / 2) * min(1, resolution[1] / resolution[0])
    assert narrow == pytest.approx(RADIUS_M / math.sqrt(distance**2 - RADIUS_M**2), rel=1e-7)


@pytest.mark.parametrize(("pan", "tilt"), [(12, 0), (-9, 8), (0, -14), (15, 15)])
def test_it_just_fits_off_the_axis_as_well(pan, tilt):
    """Where stops keep the target from the middle of the image."""
    target = (3, 1, 2.9)
    limits = dataclasses.replace(FREE, pan_range_deg=(pan, pan), tilt_range_deg=(tilt, tilt))
    camera = follow(CAMERA, target, RADIUS_M, limits)
    assert (camera.pan_deg, camera.tilt_deg) == (pan, tilt)
    assert filled(camera, target, RADIUS_M) == pytest.approx(1, abs=OUTLINE_SAMPLING)
    assert camera.focus_distance_m == pytest.approx(camera.to_camera_frame(target)[2], abs=ROUNDED)


def test_it_is_aimed_and_focused():
    camera = follow(CAMERA, TARGET_M, RADIUS_M, FREE)
    pixel, depth = camera.project(TARGET_M)
    np.testing.assert_allclose(pixel, camera.principal_point_px, atol=1e-4)
    assert depth == pytest.approx(camera.focus_distance_m, abs=2 * ROUNDED)
    assert camera == follow(camera, TARGET_M, RADIUS_M, FREE)


def test_with_steps_the_sphere_stays_whole_and_fits_within_a_step():
    for target in np.random.default_rng(3).uniform([-2, -3, 0.5], [2, 4, 1.5], size=(40, 3)):
        camera = follow(dataclasses.replace(CAMERA, max_zoom=100), target, RADIUS_M, COARSE)
        assert camera == quantised(camera, COARSE)
        best = fitting_zoom(camera, target, RADIUS_M)
        assert camera.zoom <= best * (1 + OF_A_STEP)
        assert camera.zoom >= best / (1 + COARSE.zoom_step) * (1 - OF_A_STEP)
        assert filled(camera, target, RADIUS_M) <= 1 + OUTLINE_SAMPLING


def test_zoom_is_limited_by_the_camera_and_by_the_limits():
    far = (-3, 20, 1)
    eight = PTZLimits(zoom_range=(1, 8))
    endless = dataclasses.replace(CAMERA, max_zoom=math.inf)
    assert follow(CAMERA, far, 0.2).zoom == 8
    assert follow(endless, far, 0.2, eight).zoom == 8
    assert follow(endless, far, 0.2, PTZLimits(zoom_range=(1, math.inf))).zoom > 20
    assert follow(CAMERA, (3, -5, 1.5), RADIUS_M, FREE).zoom == 1  # too near to fit
    with pytest.raises(RangeError, match=r"zoom_range = \(9.0, None\); allowed: .* at most 8"):
        follow(CAMERA, far, 0.2, PTZLimits(zoom_range=(9, None)))


def test_straight_below_is_as_far_down_as_the_tilt_goes():
    assert follow(CAMERA, (3, -5, 0.5), 0.3).tilt_deg == -90
    with pytest.raises(GeometryError, match="own position"):
        follow(CAMERA, CAMERA.position_m, 0.3)
    with pytest.raises(RangeError, match="radius_m = -1; allowed"):
        follow(CAMERA, TARGET_M, -1)


# ---- steps -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("limits", [PTZLimits(), COARSE, FREE, PTZLimits(pan_range_deg=(-170, 170.3))])
def test_quantising_is_idempotent_to_the_bit_and_within_half_a_step(limits):
    for camera in drawn(150, seed=5):
        once = quantised(camera, limits)
        again = quantised(once, limits)
        assert repr(once) == repr(again)
        assert hash(once) == hash(again)
        off = {
            "pan": abs((once.pan_deg - camera.pan_deg + 180) % 360 - 180) / (limits.pan_step_deg or math.inf),
            "tilt": abs(once.tilt_deg - camera.tilt_deg) / (limits.tilt_step_deg or math.inf),
            "zoom": abs(math.log(once.zoom / camera.zoom)) / math.log1p(limits.zoom_step or math.inf),
            "focus": abs(1 / once.focus_distance_m - 1 / camera.focus_distance_m)
            / (limits.focus_step_dioptre or math.inf),
        }
        if limits.pan_range_deg and not -170 <= (camera.pan_deg + 180) % 360 - 180 <= 170.3:
            assert once.pan_deg in limits.pan_range_deg
            del off["pan"]
        assert max(off.values()) <= 0.5 + OF_A_STEP, off


def test_equal_settings_have_equal_bits_whichever_way_they_came_about():
    limits = PTZLimits(pan_step_deg=0.1, tilt_step_deg=0.1)
    ways = [0.3, 0.1 * 3, 0.1 + 0.2, 360.3, -359.7, 0.3 + 720, 0.34, 0.26]
    assert len({repr(quantised(dataclasses.replace(CAMERA, pan_deg=pan), limits)) for pan in ways}) == 1
    zeros = [0.0, -0.0, -0.04, 360.0, -1e-12]
    assert {repr(quantised(dataclasses.replace(CAMERA, pan_deg=pan), limits).pan_deg) for pan in zeros} == {"0.0"}
    # Zero has two sets of bits as well, whichever side it is come to from.
    for camera in (dataclasses.replace(CAMERA, tilt_deg=tilt) for tilt in (-0.0, -1e-12)):
        assert repr(quantised(camera, FREE).tilt_deg) == "0.0"
    above, below = (dataclasses.replace(CAMERA, tilt_deg=tilt) for tilt in (1, -1))
    assert repr(moved_towards(above, below, PTZLimits(tilt_speed_deg_per_s=1), 1).tilt_deg) == "0.0"
    assert quantised(dataclasses.replace(CAMERA, pan_deg=180), limits).pan_deg == -180
    assert quantised(dataclasses.replace(CAMERA, pan_deg=-180.04), limits).pan_deg == -180


def test_the_ends_of_a_range_are_settings_too():
    limits = PTZLimits((-170.25, 170.25), (-89, 10.05), (1, 7.3), pan_step_deg=0.5, tilt_step_deg=0.5, zoom_step=0.1)
    end = dataclasses.replace(CAMERA, pan_deg=175, tilt_deg=30, zoom=8)
    assert [getattr(quantised(end, limits), name) for name in SETTINGS[:3]] == [170.25, 10.05, 7.3]
    assert quantised(dataclasses.replace(CAMERA, pan_deg=-175), limits).pan_deg == -170.25
    assert quantised(dataclasses.replace(CAMERA, pan_deg=270), limits).pan_deg == -90


# ---- speeds ----------------------------------------------------------------------------------------------------------


def paced(limits):
    speeds = {"pan_speed_deg_per_s": 60, "tilt_speed_deg_per_s": 40, "focus_speed_dioptre_per_s": 0.7}
    return dataclasses.replace(limits, zoom_factor_per_s=1.8, **speeds)


PACED = [paced(limits) for limits in (PTZLimits(), COARSE, FREE)]


def coordinates(camera):
    return np.array([camera.pan_deg, camera.tilt_deg, math.log(camera.zoom), 1 / camera.focus_distance_m])


@pytest.mark.parametrize("limits", PACED)
def test_no_speed_is_exceeded_and_the_wanted_setting_is_reached(limits):
    seconds = 0.1
    speed = np.array([60, 40, math.log(1.8), 0.7])
    steps = [limits.pan_step_deg, limits.tilt_step_deg, math.log1p(limits.zoom_step or 0), limits.focus_step_dioptre]
    step = np.array([value or 0.0 for value in steps])
    for start, requested in zip(drawn(12, seed=6), drawn(12, seed=7), strict=True):
        now, requested = quantised(start, limits), quantised(requested, limits)
        left = coordinates(requested) - coordinates(now)
        left[0] = (left[0] + 180) % 360 - 180
        # A motor may fall short of its speed by less than a step in each move.
        pace = speed * seconds - step
        fewest, most = (np.abs(left) / (speed * seconds)).max(), (np.abs(left) / pace).max()
        moves = 0
        while now != requested:
            following = moved_towards(now, requested, limits, seconds)
            assert following == quantised(following, limits)
            way = coordinates(following) - coordinates(now)
            way[0] = (way[0] + 180) % 360 - 180
            assert (np.abs(way) <= speed * seconds + OF_A_STEP * step + 3 * ROUNDED).all()
            assert (way * left >= -(3 * ROUNDED)).all()  # never back
            now, moves = following, moves + 1
            assert moves <= math.ceil(most) + 1
        assert moves >= math.floor(fewest * (1 - OF_A_STEP))


def test_without_steps_the_way_is_speed_times_time():
    limits = paced(FREE)
    now = PTZCamera((0, 0, 2), 10, -20, zoom=2, focus_distance_m=4)
    requested = dataclasses.replace(now, pan_deg=100, tilt_deg=-80, zoom=8, focus_distance_m=1)
    half = moved_towards(now, requested, limits, 0.5)
    expected = PTZCamera((0, 0, 2), 40, -40, zoom=2 * math.sqrt(1.8), focus_distance_m=1 / (0.25 + 0.35))
    np.testing.assert_allclose(coordinates(half), coordinates(expected), rtol=1e-8)
    assert moved_towards(now, requested, limits, 0) == now
    assert moved_towards(now, requested, limits, 60) == requested
    assert moved_towards(now, requested, FREE, 0) == requested  # no speed limit is no time at all


@pytest.mark.parametrize(
    ("start", "goal", "reached"),
    [(170, -170, 176), (-170, 170, -176), (-10, 10, -4), (350, 20, -4), (0, 179, 6), (0, -179, -6), (1, 1, 1)],
)
def test_an_endless_pan_takes_the_shorter_way_round(start, goal, reached):
    now, requested = (dataclasses.replace(CAMERA, pan_deg=pan) for pan in (start, goal))
    assert moved_towards(now, requested, PTZLimits(pan_speed_deg_per_s=60), 0.1).pan_deg == reached


@pytest.mark.parametrize(
    ("stops", "start", "goal", "reached"),
    [
        ((-175, 175), 170, -170, 164),  # not across the stops
        ((-175, 175), 170, 190, 164),  # the same direction, said otherwise
        ((-350, 350), 170, -170, 176),  # 190 is within reach and nearer
        ((-350, 350), 340, 10, 334),  # 370 is not
        ((10, 350), 340, -15, 344 + 1),  # as 345
        ((0, 90), 85, 120, 90),  # the nearer stop
        ((0, 90), 5, -60, 0),
    ],
)
def test_a_pan_with_stops_never_passes_them(stops, start, goal, reached):
    now, requested = (dataclasses.replace(CAMERA, pan_deg=pan) for pan in (start, goal))
    limits = PTZLimits(pan_range_deg=stops, pan_speed_deg_per_s=60)
    assert moved_towards(now, requested, limits, 0.1).pan_deg == reached


def test_what_cannot_be_moved_is_refused():
    limits = PTZLimits(pan_range_deg=(-90, 90), pan_speed_deg_per_s=60)
    with pytest.raises(RangeError, match=r"pan_deg = 120.0; allowed: within the limits' \(-90.0, 90.0\)"):
        moved_towards(dataclasses.replace(CAMERA, pan_deg=120), CAMERA, limits, 0.1)
    with pytest.raises(RangeError, match="zoom"):
        moved_towards(CAMERA, CAMERA, PTZLimits(zoom_range=(3, None)), 0.1)
    with pytest.raises(RangeError, match=r"requested.position_m = \(0.0, 0.0, 1.0\); allowed: \(3.0"):
        moved_towards(CAMERA, dataclasses.replace(CAMERA, position_m=(0, 0, 1)), limits, 0.1)
    with pytest.raises(RangeError, match="seconds = -1; allowed"):
        moved_towards(CAMERA, CAMERA, limits, -1)
    slow = PTZLimits(pan_speed_deg_per_s=1, pan_step_deg=0.1)
    with pytest.raises(RangeError, match=r"pan_deg: speed · time = 0.03333; allowed: at least one step of 0.1"):
        moved_towards(CAMERA, CAMERA, slow, 1 / 30)


# ---- the limits themselves -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("pan_range_deg", (10, -10), "lowest <= highest"),
        ("pan_range_deg", (-math.inf, 90), "no limit"),
        ("pan_range_deg", 90, "two numbers"),
        ("tilt_range_deg", (91, 95), "±90°"),
        ("zoom_range", (0.5, 8), "1 <= lowest <= highest"),
        ("zoom_range", (4, 2), "1 <= lowest <= highest"),
        ("zoom_range", (1, 2, 3), "two numbers"),
        ("pan_speed_deg_per_s", 0, "above 0"),
        ("tilt_speed_deg_per_s", math.nan, "a number"),
        ("zoom_factor_per_s", 1, "above 1"),
        ("focus_speed_dioptre_per_s", "fast", "a number"),
        ("pan_step_deg", 0.7, "whole part of 360"),
        ("tilt_step_deg", -0.1, "above 0"),
        ("zoom_step", math.inf, "above 0"),
        ("focus_step_dioptre", True, "a number"),
    ],
)
def test_wrong_limits_are_refused_in_one_line(key, value, allowed):
    with pytest.raises(RangeError) as caught:
        PTZLimits(**{key: value})
    assert str(caught.value).startswith(f"{key} = {value!r}; allowed: ")
    assert allowed in str(caught.value)
    assert "\n" not in str(caught.value)


def test_infinite_is_none_and_whole_numbers_are_their_floats():
    infinite = PTZLimits((-math.inf, math.inf), None, (1, math.inf), math.inf, math.inf, math.inf, math.inf)
    assert infinite == PTZLimits()
    assert repr(infinite) == repr(PTZLimits())
    assert repr(PTZLimits(pan_speed_deg_per_s=60)) == repr(PTZLimits(pan_speed_deg_per_s=60.0))
    assert PTZLimits(pan_range_deg=(-100, 100), pan_step_deg=0.7).pan_step_deg == 0.7
