"""All rivals alike: what must not change them, what must not make them worse, and what must not break them."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import spearmanr

from pss import ConstantVelocity, PTZCamera, Sphere, evaluate
from pss.rivals import RIVALS
from tests.helpers.rivals import APPEARANCE, BALL, BY_NAME, CAMERAS, ring, scene, scene_points, single

# Relative; sums over a handful of cameras, in another order or another frame of the world. The general solution of
# Eq. 4 and the cancellation in ‖P⁻‖ − ‖P⁺‖ leave about two digits less than sums alone.
SAME_TO_ROUNDING = 1e-8
# Spearman's ρ of rivals made of distances and angles alone, their documented near ties: of all, and of close kin.
MUCH_THE_SAME_ORDER, NEARLY_THE_SAME_ORDER = 0.7, 0.95


# Not the same in a world that is turned by another angle than 90°: a hash of coordinates, and C's diagonal.
KNOWS_COORDINATES = {"random"}
KNOWS_AXES = {"worst-diagonal", "worst-diagonal-count-zero"}

# A further camera can make these worse. Each has its counter-example below.
NOT_MONOTONE = {
    "random",
    "mean-distance",  # a camera farther away
    "pixels-per-mm",  # a camera with fewer pixels on the target
    "distance-weighted-views",  # a view between two that are 30° apart leaves two near-duplicates of one
    "uncertainty-reward-steady-state",  # less to gain where more is known
}


def observable_scene():
    """The points that all cameras together, and cameras 0 and 4 alone, observe: no metric is infinite."""
    points, normals = scene_points()
    kept = scene([CAMERAS[0], CAMERAS[4]]).observable
    return points[kept], normals[kept]


def about_z(angle):
    return np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])


def each_rival(but=()):
    """Parametrises a test by all rivals but those named."""
    chosen = [metric for metric in RIVALS if metric.name not in but]
    assert len(chosen) == len(RIVALS) - len(but)
    return pytest.mark.parametrize("metric", chosen, ids=lambda metric: metric.name)


# ---- what must not change them ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("whole", [True, False], ids=["with unobservable points", "observable points"])
@each_rival(but=KNOWS_COORDINATES)
def test_turning_and_shifting_the_world_changes_nothing(metric, whole):
    angle_deg = 90 if metric.name in KNOWS_AXES else 137
    points, normals = scene_points() if whole else observable_scene()
    turn, shift = about_z(math.radians(angle_deg)), np.array([1.3, -0.7, 0.4])
    cameras = [
        dataclasses.replace(c, position_m=tuple(turn @ c.position_m + shift), pan_deg=c.pan_deg - angle_deg)
        for c in CAMERAS
    ]
    ball = Sphere("ball", tuple(turn @ BALL.centre_m + shift), BALL.radius_m)
    before = metric.score(scene(CAMERAS, points, normals))
    after = metric.score(scene(cameras, points @ turn.T + shift, normals @ turn.T, occluder=[ball]))
    assert after == pytest.approx(before, rel=SAME_TO_ROUNDING)
    assert whole or math.isfinite(before)


@pytest.mark.parametrize("whole", [True, False], ids=["with unobservable points", "observable points"])
@each_rival(but=KNOWS_COORDINATES)
def test_a_mirror_changes_nothing(metric, whole):
    points, normals = scene_points() if whole else observable_scene()
    mirror = np.diag([-1.0, 1.0, 1.0])
    cameras = [dataclasses.replace(c, position_m=tuple(mirror @ c.position_m), pan_deg=-c.pan_deg) for c in CAMERAS]
    ball = Sphere("ball", tuple(mirror @ BALL.centre_m), BALL.radius_m)
    before = metric.score(scene(CAMERAS, points, normals))
    after = metric.score(scene(cameras, points @ mirror, normals @ mirror, occluder=[ball]))
    assert after == pytest.approx(before, rel=SAME_TO_ROUNDING)


@pytest.mark.parametrize("whole", [True, False], ids=["with unobservable points", "observable points"])
@each_rival()
def test_the_order_of_cameras_and_points_does_not_matter(metric, whole):
    (points, normals), rng = scene_points() if whole else observable_scene(), np.random.default_rng(2)
    before = metric.score(scene(CAMERAS, points, normals))
    for _ in range(3):
        of_points, cameras = rng.permutation(len(points)), [CAMERAS[i] for i in rng.permutation(len(CAMERAS))]
        after = metric.score(scene(cameras, points[of_points], normals[of_points]))
        assert after == pytest.approx(before, rel=SAME_TO_ROUNDING)


@each_rival(but=KNOWS_COORDINATES)
def test_cameras_that_see_nothing_change_nothing(metric):
    points, normals = observable_scene()
    blind = [PTZCamera((0, 2.8, 2.8), 0, 60), PTZCamera((-2, -2.8, 2.8), 180, 60)]
    without, with_them = (
        scene(cameras, points, normals) for cameras in (CAMERAS[:5], [blind[0], *CAMERAS[:5], blind[1]])
    )
    assert not with_them.visible[[0, -1]].any()
    assert metric.score(with_them) == pytest.approx(metric.score(without), rel=SAME_TO_ROUNDING)


def test_what_knows_the_axes_does_change_with_them():
    """C's diagonal is not its eigenvalues; turned by 45°, they differ the most. The random score is a hash."""
    cameras = [PTZCamera((x, -4, 1), 0, 0).aimed_at((0, 0, 1)) for x in (-1, 1)]
    turn = about_z(math.radians(45))
    turned = [dataclasses.replace(c, position_m=tuple(turn @ c.position_m), pan_deg=c.pan_deg - 45) for c in cameras]
    for name in KNOWS_AXES | KNOWS_COORDINATES:
        before, after = (
            BY_NAME[name](cs, [[0, 0, 1]], [n]) for cs, n in ((cameras, [0, -1, 0]), (turned, turn @ [0, -1, 0]))
        )
        assert abs(after - before) > 0.1 * before, name


# ---- more cameras, better cameras ------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [[0, 4], [3]], ids=str)
@each_rival(but=NOT_MONOTONE)
def test_a_further_camera_never_makes_it_worse(metric, start):
    """From two cameras that observe all points, and from one that observes none."""
    points, normals = observable_scene()
    order = start + [i for i in (6, 1, 3, 5, 2, 0, 4) if i not in start]
    values = np.array(
        [metric.score(scene([CAMERAS[i] for i in order[:k]], points, normals)) for k in range(len(start), len(order))]
    )
    better = values if metric.higher_is_better else -values
    slack = SAME_TO_ROUNDING * np.abs(better[1:])
    assert all(b >= a or b >= a - s for a, b, s in zip(better[:-1], better[1:], slack, strict=True)), values
    assert better[-1] >= better[0]


@pytest.mark.parametrize(
    ("name", "before", "further"),
    [
        ("mean-distance", ring(-70, -110), ring(-90, distance_m=5)),
        ("pixels-per-mm", ring(-70, -110, zoom=2), ring(-90, zoom=1)),
        ("distance-weighted-views", ring(-75, -105), ring(-90, distance_m=60)),
        ("uncertainty-reward-steady-state", ring(-20, -100, distance_m=1), ring(-100, distance_m=0.3)),
    ],
)
def test_where_a_further_camera_makes_it_worse(name, before, further):
    values = [BY_NAME[name](cameras, [[0, 0, 1]], [[0, -1, 0]]) for cameras in (before, [*before, *further])]
    assert values[1] < values[0] if BY_NAME[name].higher_is_better else values[1] > values[0]


def test_the_random_score_gets_worse_as_often_as_better():
    gains = [
        BY_NAME["random"].score(scene([*CAMERAS[:3], single(x, -4)])) - BY_NAME["random"].score(scene(CAMERAS[:3]))
        for x in np.linspace(-2, 2, 20)
    ]
    assert min(gains) < 0 < max(gains)
    assert set(NOT_MONOTONE) <= set(BY_NAME)


@each_rival(but={"random"})
def test_a_clearly_better_configuration_scores_better(metric):
    """Three sharp cameras near by and far apart against two blurred ones far away, 15° apart."""
    points = np.array([0, 0, 1]) + 0.1 * np.random.default_rng(3).standard_normal((12, 3))
    normals = np.tile([0.0, -1.0, 0.0], (12, 1))
    good = ring(-140, -90, -40, distance_m=2, zoom=2, focus_distance_m=2)
    bad = ring(-22, -37, distance_m=8, focus_distance_m=1)
    one, other = (metric.score(scene(cameras, points, normals, occluder=())) for cameras in (good, bad))
    assert one > other if metric.higher_is_better else one < other
    assert math.isfinite(one)
    assert math.isfinite(other)


def test_near_ties_where_the_noise_is_the_same_for_all_views():
    """What the package says of its rivals: with R fixed, those made of distances and angles order alike."""
    rng = np.random.default_rng(5)
    kin = (("quantisation-volume", "d-optimality"), ("gdop", "a-optimality", "planar-estimator"))
    kin = (*kin, ("worst-diagonal", "e-optimality"), ("pairwise-bearing",))
    points = np.array([0, 0, 1]) + 0.2 * rng.standard_normal((10, 3))
    normals, values = np.tile([0.0, -1.0, 0.0], (10, 1)), []
    for _ in range(40):
        places = zip(rng.uniform(-170, -10, 3), rng.uniform(2, 6, 3), strict=True)
        result = evaluate([c for a, d in places for c in ring(a, distance_m=d)], points, normals, noise="identity")
        assert result.visible.all()
        values.append([BY_NAME[f"{name}-count-zero"].score(result) for names in kin for name in names])
    rho = spearmanr(np.array(values)).statistic
    assert rho.min() > MUCH_THE_SAME_ORDER
    assert rho[0, 1] > 1 - SAME_TO_ROUNDING
    assert min(rho[2:5, 2:5].min(), rho[5, 6]) > NEARLY_THE_SAME_ORDER


# ---- what must not break them ----------------------------------------------------------------------------------------

POINT, TOWARDS = [[0, 0, 1.0]], [[0, -1.0, 0]]
IN_FRONT = single(0, -4)
NASTY = {
    "no camera": ([], POINT, TOWARDS),
    "one camera": ([IN_FRONT], POINT, TOWARDS),
    "nothing visible": (ring(-80, -100), POINT, [[0, 1.0, 0]]),
    "a point at a camera": ([IN_FRONT, single(2, -2)], [[0, -4, 1.0], [0, 0, 1.0]], TOWARDS * 2),
    "a point in the plane of a lens": ([PTZCamera((0, -4, 1), 0, 0), single(2, -2)], [[1, -4, 1.0]], TOWARDS),
    "a camera twice": ([IN_FRONT, IN_FRONT], POINT, TOWARDS),
    "cameras in line": ([IN_FRONT, single(0, -2)], POINT, TOWARDS),
    "cameras face to face": ([PTZCamera((-4, 0, 1), 90, 0), PTZCamera((4, 0, 1), -90, 0)], POINT, [[0, 0, 1.0]]),
    "cameras above": ([PTZCamera((0, 0, z), 0, -89.9) for z in (4, 5)], POINT, [[0, 0, 1.0]]),
    "in the plane of focus": (ring(-60, -120, focus_distance_m=4), POINT, TOWARDS),
    "at grazing incidence": (ring(-1e-7, -90), POINT, TOWARDS),
    "nine cameras": (ring(*range(-170, -10, 18)), POINT, TOWARDS),
}


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("case", NASTY)
@each_rival()
def test_it_is_a_number_whatever_the_configuration(metric, case):
    """Finite, or infinite where less is better: never nan, never an error."""
    cameras, points, normals = NASTY[case]
    for models in ({}, {"appearance": APPEARANCE}, {"process": ConstantVelocity(0.1)}):
        value = metric.score(evaluate(cameras, points, normals, **models))
        assert isinstance(value, float)
        assert -math.inf < value < math.inf or (value == math.inf and not metric.higher_is_better)


@each_rival(but={"random"})
def test_nothing_seen_is_the_worst_value(metric):
    points, normals = scene_points()
    nothing = metric.score(scene([], points, normals))
    for count in range(1, len(CAMERAS) + 1):
        something = metric.score(scene(CAMERAS[:count], points, normals))
        assert something >= nothing if metric.higher_is_better else something <= nothing


# ---- both conventions for unobservable points ------------------------------------------------------------------------

TWINS = [name for name in BY_NAME if f"{name}-count-zero" in BY_NAME]


def test_those_that_say_nothing_of_unobservable_points_are_there_twice():
    assert set(TWINS) == {
        "quantisation-volume",
        "worst-diagonal",
        "gdop",
        "a-optimality",
        "d-optimality",
        "e-optimality",
        "t-optimality",
        "planar-estimator",
        "pairwise-bearing",
    }


@pytest.mark.parametrize("name", TWINS)
def test_unobservable_points_are_infinite_or_count_zero(name):
    """With as many points that nobody sees: one is infinite (T: half), the other half of what it was."""
    own, count_zero = BY_NAME[name], BY_NAME[f"{name}-count-zero"]
    points, normals = observable_scene()
    alone = scene(CAMERAS, points, normals)
    half = scene(CAMERAS, np.concatenate([points, points]), np.concatenate([normals, 0 * normals + [0, 0, -1]]))
    assert half.observable.mean() == 0.5
    assert count_zero.higher_is_better
    assert count_zero.unobservable == "count zero"
    assert count_zero.score(half) == pytest.approx(count_zero.score(alone) / 2, rel=SAME_TO_ROUNDING)
    assert 0 < own.score(alone) < math.inf or name == "d-optimality"
    if name == "t-optimality":
        assert own.score(half) == pytest.approx(own.score(alone) / 2, rel=SAME_TO_ROUNDING)
    else:
        assert not own.higher_is_better
        assert own.score(half) == math.inf
