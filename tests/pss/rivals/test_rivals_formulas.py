"""Each rival that asks where the cameras are, against its source's closed cases and a slow route of its own."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from pss import PTZCamera, evaluate
from pss.rivals import occlusion
from pss.rivals.angles import best_pair_m2
from pss.rivals.coverage import camera_strength
from tests.helpers.rivals import (
    CAMERAS,
    TARGET,
    look,
    random_cameras,
    ring,
    scene,
    scene_points,
    score,
    single,
    towards,
)

# Relative; the same sums in another order.
SAME_TO_ROUNDING = 1e-9
# Degrees; an occluder turned in steps finds each border of a sector to one step.
STEP_DEG = 0.1


# ---- counting views --------------------------------------------------------------------------------------------------


def test_visibility_count_by_hand():
    """Points that 0, 1, 2, 3 and 4 cameras see: (0 + 1 + 2 + 3 + 3)/3 over five."""
    result = look(ring(0, 90, 180, 270), np.tile(TARGET, (5, 1)))
    mask = np.arange(4)[:, None] < np.arange(5)
    assert score("visibility-count", dataclasses.replace(result, visible=mask)) == pytest.approx(9 / 15)


@pytest.mark.parametrize(("distance_m", "expected"), [(4.0, 0.25), (2.0, 1.0), (1.0, 1.0)])
def test_observability_of_one_camera_is_its_squared_nearness(distance_m, expected):
    """Facing the target and looking at it: G = (2 m/d)², at most 1."""
    result = evaluate([single(0, -distance_m)], [TARGET], [[0, -1, 0]])
    assert score("observability", result) == pytest.approx(expected)


def test_observability_is_the_sum_of_the_source_in_any_order():
    """Σ_i G_i Π_{k<i}(1 − G_k), camera by camera, in every order of four cameras."""
    points, normals = scene_points()
    for order in itertools.permutations(CAMERAS[1:5]):
        result, total = scene(order), 0.0
        for j, (point, normal) in enumerate(zip(points, normals, strict=True)):
            left = 1.0
            for camera, seen in zip(order, result.visible[:, j], strict=True):
                if seen:
                    d = np.linalg.norm(np.array(camera.position_m) - point)
                    cosines = (towards(camera, point) @ normal) * (-towards(camera, point) @ camera.rotation[2])
                    gain = min(max(4 / d**2 * cosines, 0), 1)
                    total, left = total + left * gain, left * (1 - gain)
        assert score("observability", result) == pytest.approx(total / len(points), rel=SAME_TO_ROUNDING)


@pytest.mark.parametrize(
    ("azimuths_deg", "distinct"),
    [
        ([40], 1),
        ([0, 10], 1.3),
        ([-5, 5], 1.3),
        ([175, -175], 1.3),
        ([0, 10, 100], 2.3),
        ([0, 19, 38], 1.6),
        ([0, 25, 50], 3),
        ([0, 72, 144, 216, 288], 4),  # five views, of which four are enough
    ],
)
def test_distance_weighted_views_by_hand(azimuths_deg, distinct):
    """min(n, 4)/4 · s·Σ 1/√r /2, all from 4 m: s = 1/1.016."""
    expected = distinct / 4 * sum(1 / math.sqrt(r + 1) for r in range(len(azimuths_deg))) / 1.016 / 2
    assert score("distance-weighted-views", look(ring(*azimuths_deg))) == pytest.approx(expected)


def test_distance_weighted_views_are_the_sources_loop_where_it_starts_best():
    """The source goes from view to view by azimuth and adds 0.3 or 1; nearer views rank first."""
    rng = np.random.default_rng(11)
    for _ in range(30):
        azimuths, distances = np.sort(rng.uniform(0, 360, 5)), rng.uniform(1, 40, 5)
        counts = []
        for start in range(5):
            order, n = np.roll(azimuths, start), 1.0
            for before, after in itertools.pairwise(order):
                apart = abs((after - before + 180) % 360 - 180)
                n += 0.3 if apart < 20 else 1.0
            counts.append(n)
        s = sorted((1 / (1 + 0.001 * d**2) for d in distances), reverse=True)
        expected = min(*counts, 4) / 4 * sum(v / math.sqrt(r + 1) for r, v in enumerate(s)) / 2
        cameras = [c for a, d in zip(azimuths, distances, strict=True) for c in ring(a, distance_m=d)]
        assert score("distance-weighted-views", look(cameras)) == pytest.approx(expected)


# ---- coverage strength -----------------------------------------------------------------------------------------------


def strength(camera, point=TARGET, normal=(0, -1, 0)):
    result = evaluate([camera], [point], [normal])
    assert result.visible.all()
    return camera_strength(result)[0, 0]


SHARP = single(0, -4, zoom=4, focus_distance_m=4)


def test_a_perfect_view_has_the_strength_one():
    assert strength(SHARP) == 1


@pytest.mark.parametrize(("inside_px", "expected"), [(2.0, 0.1), (10.0, 0.5), (20.0, 1.0)])
@pytest.mark.parametrize("across", [True, False], ids=["left border", "lower border"])
def test_strength_falls_towards_the_border(inside_px, expected, across):
    """0 at the sensor's edge, which is half a pixel beyond the outermost centres; 1 from 20 px inside."""
    (width, height), f = SHARP.resolution, SHARP.focal_px
    out = (width / 2 if across else height / 2) - inside_px
    place = [-4 * out / f, 0, 1] if across else [0, 0, 1 - 4 * out / f]
    assert strength(SHARP, place, (0, -1, 0)) == pytest.approx(expected)


def test_strength_falls_with_mm_per_pixel():
    """6 mm per pixel is half way from 10 to 2."""
    depth_m = 6e-3 * PTZCamera((0, 0, 1), 0, 0).focal_px
    assert strength(single(0, -depth_m, focus_distance_m=depth_m)) == pytest.approx(0.5)


@pytest.mark.parametrize("bracket", [(0.5, 4.0), (4.0, 400.0)], ids=["before", "behind"])
def test_strength_falls_out_of_focus(bracket):
    """Linear in depth between where the circle of confusion is 5 px and 1 px, found by the camera's own Eq. 14."""
    camera = PTZCamera((0, 0, 0), 0, 0, zoom=8, focus_distance_m=4.0)
    ends = [brentq(lambda z, c=c: camera.circle_of_confusion_px([0, z, 0]) - c, *bracket) for c in (5, 1)]
    for share in (0.25, 0.5, 0.75):
        depth = ends[0] + share * (ends[1] - ends[0])
        assert strength(camera, [0, depth, 0]) == pytest.approx(share)
    assert strength(camera, [0, ends[1], 0]) == pytest.approx(1)


def test_a_lens_that_is_sharp_to_infinity_has_no_limit_there():
    camera = PTZCamera((0, 0, 0), 0, 0, focus_distance_m=4.0, f_number=16)
    assert camera.circle_of_confusion_px([0, 1e9, 0]) < 1
    assert strength(camera, [0, 1.28, 0]) == pytest.approx(1)


def test_strength_falls_with_incidence_linearly_in_its_cosine():
    half = math.acos((math.cos(math.radians(30)) + math.cos(math.radians(80))) / 2)
    assert strength(SHARP, normal=(math.sin(half), -math.cos(half), 0)) == pytest.approx(0.5)
    steep = math.radians(81)
    assert strength(SHARP, normal=(math.sin(steep), -math.cos(steep), 0)) == 0


def test_coverage_strength_is_the_best_pairs_weaker_camera():
    result = scene(CAMERAS)
    of_cameras = camera_strength(result)
    assert ((of_cameras > 0) & (of_cameras < 1)).any()
    best = [max(min(pair) for pair in itertools.combinations(column, 2)) for column in of_cameras.T]
    assert score("coverage-strength", result) == pytest.approx(np.mean(best), rel=SAME_TO_ROUNDING)
    assert (of_cameras[~result.visible] == 0).all()


# ---- angles ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("apart_deg", "expected"), [(30, 0), (39.99, 0), (40.01, 1), (90, 1), (139.99, 1), (140.01, 0), (180, 0)]
)
def test_triangulable_is_40_to_140_degrees(apart_deg, expected):
    result = look(ring(20, 20 + apart_deg))
    assert score("triangulable-share", result) == expected
    assert score("triangulation-angle", result) == pytest.approx(math.sin(math.radians(apart_deg)), abs=1e-15)


def test_angles_are_those_of_the_best_pair_in_space():
    rng = np.random.default_rng(4)
    for _ in range(20):
        cameras = random_cameras(rng, 3)
        angles = [math.acos(towards(a) @ towards(b)) for a, b in itertools.combinations(cameras, 2)]
        result = look(cameras)
        assert score("triangulation-angle", result) == pytest.approx(max(map(math.sin, angles)))
        assert score("triangulable-share", result) == any(40 <= math.degrees(a) <= 140 for a in angles)


@pytest.mark.parametrize(("d1", "d2", "apart_deg"), [(4, 4, 90), (2, 5, 60), (3, 3, 150), (2, 6, 10)])
def test_a_pair_of_bearings_has_the_root_determinant_of_its_planar_covariance(d1, d2, apart_deg):
    """Bearings of 1 rad: J = Σ n nᵀ/d², √det J⁻¹ = d₁d₂/|sin θ|."""
    J = np.zeros((2, 2))
    for d, angle in ((d1, 0.3), (d2, 0.3 + math.radians(apart_deg))):
        across = np.array([-math.sin(angle), math.cos(angle)])
        J += np.outer(across, across) / d**2
    azimuth = math.degrees(0.3)
    result = look([*ring(azimuth, distance_m=d1), *ring(azimuth + apart_deg, distance_m=d2)])
    expected = math.sqrt(np.linalg.det(np.linalg.inv(J)))
    assert best_pair_m2(result)[0] == pytest.approx(expected)
    assert score("pairwise-bearing", result) == pytest.approx(expected)
    assert score("pairwise-bearing-count-zero", result) == pytest.approx(1 / math.sqrt(expected))


def test_the_best_pair_counts_and_only_visible_ones():
    """90° apart at 4 m (16 m²) beats 90° at 4 and 6 m (24 m²); a pair in line is none."""
    cameras = [*ring(0, 90), *ring(180, distance_m=6)]
    result = look(cameras)
    assert best_pair_m2(result)[0] == pytest.approx(16)
    hidden = dataclasses.replace(result, visible=np.array([[False], [True], [True]]))
    assert best_pair_m2(hidden)[0] == pytest.approx(24)
    assert score("triangulation-angle", dataclasses.replace(result, visible=np.eye(3, dtype=bool)[:, :1])) == 0
    for apart_deg in (0, 1e-7):  # 2e-9 rad, of which double precision keeps no distance
        pair = [*ring(30), *ring(30 + apart_deg, distance_m=6)]
        assert score("pairwise-bearing", look(pair)) == math.inf


# ---- a turning occluder ----------------------------------------------------------------------------------------------


def turned(cameras, step_deg=STEP_DEG):
    """Who is left as the occluder turns: the cameras on its front side, step by step."""
    for angle in np.radians(np.arange(step_deg / 2, 360, step_deg)):
        front = np.array([math.cos(angle), math.sin(angle), 0])
        yield [camera for camera in cameras if towards(camera) @ front > 0]


@pytest.mark.parametrize(
    ("azimuths_deg", "expected_deg"),
    [
        ([], 360),
        ([10], 360),
        ([0, 30], 360),
        ([0, 90], 270),
        ([0, 120], 300),
        ([0, 120, 240], 180),
        ([0, 90, 180, 270], 0),  # each quarter of the circle is left a pair of neighbours
        ([0, 60, 120, 180, 240, 300], 0),
    ],
)
def test_dynamic_occlusion_by_hand(azimuths_deg, expected_deg):
    """Two views at θ are both in front for 180° − θ of the circle."""
    assert score("dynamic-occlusion", look(ring(*azimuths_deg))) == pytest.approx(expected_deg, abs=1e-9)


def test_dynamic_occlusion_is_what_a_turning_occluder_finds():
    rng, values = np.random.default_rng(6), []
    for count in (2, 3, 4, 5, 6):
        for _ in range(3):
            cameras = random_cameras(rng, count)
            lost = 0.0
            for left in turned(cameras):
                angles = (math.degrees(math.acos(towards(a) @ towards(b))) for a, b in itertools.combinations(left, 2))
                lost += 0 if any(40 <= angle <= 140 for angle in angles) else STEP_DEG
            values.append(score("dynamic-occlusion", look(cameras)))
            assert values[-1] == pytest.approx(lost, abs=2 * count * STEP_DEG)
    assert 0 < min(values) < max(values)


def test_a_camera_above_is_never_hidden():
    """Beside it, one camera 90° away is lost for half of the circle."""
    above = PTZCamera((0, 0, 4), 0, -89.9)
    assert score("dynamic-occlusion", look([above, *ring(50)])) == pytest.approx(180)


def test_occlusion_robustness_by_hand():
    """R = I, two cameras at right angles: both are left for 90° with √λmax = d/f; else the bound."""
    cameras = ring(0, 90)
    result = look(cameras, noise="identity")
    expected = (4 / cameras[0].focal_px + 3 * occlusion.BOUND_M) / 4
    assert score("occlusion-robustness", result) == pytest.approx(expected)
    assert score("occlusion-robustness", look(ring(0), noise="identity")) == occlusion.BOUND_M


def test_occlusion_robustness_is_what_a_turning_occluder_finds():
    rng = np.random.default_rng(7)
    for count in (3, 5):
        cameras, step_deg, errors = random_cameras(rng, count), 0.5, []
        for left in turned(cameras, step_deg):
            J = sum((c.jacobian(TARGET).T @ c.jacobian(TARGET) for c in left), np.zeros((3, 3)))
            errors.append(1 / math.sqrt(np.linalg.eigvalsh(J)[0]) if len(left) > 1 else occlusion.BOUND_M)
        found = score("occlusion-robustness", look(cameras, noise="identity"))
        assert found < occlusion.BOUND_M
        assert found == pytest.approx(np.mean(errors), abs=2 * count * step_deg / 360 * occlusion.BOUND_M)
