"""Walks and strategies by hand in a small hallway, and the best assignment against brute force."""

import dataclasses
import math
import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from pss import GeometryError, PTZCamera, RangeError, ShapeError, evaluate
from pss.cameras.motors import PTZLimits, follow, moved_towards
from pss.surrogates import Cylinder, Surrogate, on_cylinder
from validate.schedule.state import Avatar, Plan, StrategyState
from validate.schedule.strategies import STRATEGIES, best_predicted, strategy_named
from validate.schedule.walk import Passing, Walk, passing

# Relative: one configuration and sixteen take other paths through BLAS.
SAME_TO_ROUNDING = 1e-9
CORNERS = [(-2.9, -4.9, 2.9), (2.9, -4.9, 2.9), (-2.9, 4.9, 2.9), (2.9, 4.9, 2.9)]
CAMERAS = tuple(PTZCamera(place, 0, 0).aimed_at((0, 0, 1)) for place in CORNERS)
LIMITS = PTZLimits(pan_speed_deg_per_s=90, tilt_speed_deg_per_s=60, zoom_factor_per_s=2, focus_speed_dioptre_per_s=1)
BODY = Avatar(on_cylinder(Cylinder("body", (0, 0, 0), 0.25, 1.8), 24, caps=False))
PLAN = Plan({"H1": BODY, "H2": BODY}, LIMITS)
FOLLOW = ("H1", "H1", "H2", "H2")
SWAPPED = ("H2", "H2", "H1", "H1")


def state(y1, y2, previous=None, plan=PLAN, cameras=CAMERAS, step=0):
    places = {"H1": np.array([-0.6, y1, 0.9]), "H2": np.array([0.6, y2, 0.9])}
    return StrategyState(step, 0.0, cameras, places, plan, previous)


# ---- walks -----------------------------------------------------------------------------------------------------------


def test_the_walks_pass_each_other_in_the_middle():
    scene = passing()
    first, second = scene.positions_m["H1"], scene.positions_m["H2"]
    assert len(first) >= 21
    np.testing.assert_allclose(first[:, 1], np.linspace(-4, 4, 21), atol=1e-12)
    np.testing.assert_allclose(second, first * [-1, -1, 1], atol=1e-12)
    assert scene.crossing_s == pytest.approx(scene.times_s[10])
    np.testing.assert_allclose(np.diff(first, axis=0), scene.step_s * np.tile([0, 1.2, 0], (20, 1)), atol=1e-12)
    assert scene.step_s == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("start_s", "speed", "steps", "expected"), [(0, 0.6, 21, 14), (1, 1.2, 33, 19), (0, 1.2, 20, 10)]
)
def test_the_crossing_is_the_first_step_at_which_they_are_level_or_past(start_s, speed, steps, expected):
    h1, h2 = Walk("H1", (0, -4, 1), (0, 4, 1), 1.2), Walk("H2", (1, 4, 1), (1, -4, 1), speed, start_s)
    scene = Passing(h1, h2, steps)
    past = scene.positions_m["H1"][:, 1] >= scene.positions_m["H2"][:, 1] - 1e-12
    # By hand: 8 m apart at first, closing at 1.2 + speed from when both walk; H2 extends backwards before it starts.
    meet_s = (8 + speed * start_s) / (1.2 + speed)
    assert scene.crossing_s == pytest.approx(meet_s)
    assert past.argmax() == math.ceil(meet_s / scene.step_s - 1e-9) == expected


def test_walks_that_cannot_be_are_refused():
    with pytest.raises(RangeError, match="speed_m_per_s = 0; allowed"):
        Walk("H1", (0, 0, 1), (0, 1, 1), 0)
    with pytest.raises(GeometryError, match="two places"):
        Walk("H1", (0, 0, 1), (0, 0, 1))
    with pytest.raises(ShapeError, match=r"\(2,\)"):
        Walk("H1", (0, 0), (0, 1, 1))
    one, back = Walk("H1", (0, -4, 1), (0, 4, 1)), Walk("H2", (1, 4, 1), (1, -4, 1))
    with pytest.raises(GeometryError, match="opposite directions"):
        Passing(one, dataclasses.replace(one, name="H2"))
    with pytest.raises(GeometryError, match="meet at"):
        Passing(one, dataclasses.replace(back, start_s=9))
    with pytest.raises(RangeError, match="two names"):
        Passing(one, dataclasses.replace(back, name="H1"))
    with pytest.raises(RangeError, match="steps = 1"):
        Passing(one, back, 1)


# ---- the paper's strategies ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [("follow", FOLLOW, FOLLOW), ("swap-to-farther", SWAPPED, FOLLOW), ("swap-to-closer", FOLLOW, SWAPPED)],
)
def test_the_papers_strategies_through_the_crossing(name, before, after):
    """(1) keeps its cameras; (2a) and (2b) swap when the avatars are past each other, a pair's cameras at once."""
    strategy, assignment, seen = STRATEGIES[name], None, []
    for y in np.linspace(-4, 4, 41):
        assignment = strategy(state(y, -y, assignment))
        seen.append(assignment)
    assert seen == [before] * 21 + [after] * 20


def test_a_camera_swaps_only_when_the_other_is_closer_by_the_margin():
    """Level or within the margin it keeps its avatar, so that noise does not make it swing."""
    swap = STRATEGIES["swap-to-closer"]
    for y, previous, expected in [
        (0.04, FOLLOW, FOLLOW),
        (0.06, FOLLOW, SWAPPED),
        (-0.04, SWAPPED, SWAPPED),
        (-0.06, SWAPPED, FOLLOW),
        (-0.04, None, FOLLOW),
        (0.04, None, SWAPPED),
        (0.0, None, ("H1",) * 4),
    ]:
        assert swap(state(y, -y, previous)) == expected, (y, previous)
    eager = dataclasses.replace(PLAN, swap_margin_m=0.0)
    assert swap(state(0.001, -0.001, FOLLOW, eager)) == SWAPPED


def test_following_shares_out_any_number_of_cameras():
    three = Plan({"A": BODY, "B": BODY, "C": BODY}, LIMITS)
    places = {name: np.array([0, y, 0.9]) for name, y in zip("ABC", (-1, 0, 1), strict=True)}
    assert STRATEGIES["follow"](StrategyState(0, 0.0, CAMERAS, places, three)) == ("A", "A", "B", "C")
    assert STRATEGIES["follow"](state(0, 0, cameras=CAMERAS[:3])) == ("H1", "H1", "H2")


def test_random_hangs_on_seed_and_step_alone():
    draw = STRATEGIES["random"]
    forwards = [draw(state(0, 1, step=step)) for step in range(64)]
    backwards = [draw(state(2, -1, SWAPPED, step=step)) for step in reversed(range(64))]
    assert forwards == backwards[::-1]
    assert len(set(forwards)) > 8
    other = dataclasses.replace(PLAN, seed=1)
    assert [draw(state(0, 1, plan=other, step=step)) for step in range(64)] != forwards
    # Binomial(256, 1/2) leaves 128 ± 4 σ once in 16,000 seeds.
    assert abs(sum(names.count("H1") for names in forwards) - 128) < 4 * 8


# ---- the best predicted ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("y1", "y2"), [(-3, 3), (-0.5, 0.4), (0.2, 0.1), (2.5, -2)])
def test_the_best_predicted_equals_brute_force(y1, y2):
    """All sixteen by `pss.evaluate`, one by one, on settings, points and occluders made here."""
    here = state(y1, y2, FOLLOW)
    points = np.concatenate([BODY.surrogate.points_m + [-0.6, y1, 0.9], BODY.surrogate.points_m + [0.6, y2, 0.9]])
    normals = np.concatenate([BODY.surrogate.normals] * 2)
    bodies = [Cylinder("1", (-0.6, y1, 0.9), 0.25, 1.8), Cylinder("2", (0.6, y2, 0.9), 0.25, 1.8)]
    pss = {}
    for choice in product(("H1", "H2"), repeat=4):
        cameras = [
            moved_towards(camera, follow(camera, here.predicted_m[name], 0.95, LIMITS), LIMITS, 1 / 3)
            for camera, name in zip(CAMERAS, choice, strict=True)
        ]
        assert here.reached(choice) == tuple(cameras)
        pss[choice] = evaluate(cameras, points, normals, noise="corrected", occluder=bodies).pss
    np.testing.assert_allclose(here.predicted_pss(here.assignments), list(pss.values()), rtol=SAME_TO_ROUNDING)
    assert pss[best_predicted(here)] == pytest.approx(max(pss.values()), rel=SAME_TO_ROUNDING)
    assert len({round(value, 6) for value in pss.values()}) > 8  # it has a choice


def test_the_other_avatar_hides_what_is_behind_it():
    """One behind the other on the line of sight: with the bodies in the way there is less to see."""
    places = {"H1": np.array([0, -2.0, 0.9]), "H2": np.array([0, 2.0, 0.9])}
    low = tuple(
        dataclasses.replace(c, position_m=(x, -4.9, 0.9)).aimed_at((0, 0, 0.9))
        for c, x in zip(CAMERAS, (-0.1, 0.1), strict=False)
    )
    thin = dataclasses.replace(BODY, surrogate=BODY.surrogate, radius_m=1e-3)
    seen = []
    for avatar in (BODY, thin):
        plan = Plan({"H1": avatar, "H2": avatar}, LIMITS)
        seen.append(StrategyState(0, 0.0, low, places, plan).predicted_pss([("H1", "H1")])[0])
    assert 0 < seen[0] < 0.8 * seen[1]


def test_equally_good_ones_leave_nobody_out_and_change_little():
    """Cameras that look away see nothing, whatever they follow."""
    frozen = PTZLimits(pan_range_deg=(180, 180))
    away = tuple(PTZCamera(place, 180, 0) for place in CORNERS[:2])
    plan = dataclasses.replace(PLAN, limits=frozen)
    for previous in (("H1", "H2"), ("H2", "H1")):
        blind = state(1, 2, previous, plan, away)
        assert not blind.predicted_pss(blind.assignments).any()
        assert best_predicted(blind) == previous
    assert best_predicted(state(1, 2, None, plan, away)) == ("H1", "H2")


# ---- mistakes --------------------------------------------------------------------------------------------------------


def test_an_unknown_strategy_has_a_nearest_one():
    assert strategy_named("follow") is STRATEGIES["follow"]
    with pytest.raises(
        RangeError, match=r"strategy = 'swap-to-closr', did you mean \"swap-to-closer\"\?; allowed: fol"
    ):
        strategy_named("swap-to-closr")
    with pytest.raises(RangeError, match="strategy = 'zzz'; allowed: follow, swap-to-farther, swap-to-closer, random"):
        strategy_named("zzz")


def test_an_assignment_must_name_an_avatar_for_each_camera():
    here = state(0, 1)
    assert here.checked(["H1", "H2", "H1", "H2"]) == ("H1", "H2", "H1", "H2")
    with pytest.raises(RangeError, match="'H11', did you mean"):
        here.checked(("H1", "H2", "H11", "H2"))
    for wrong in (("H1", "H2"), "H1H1"):
        with pytest.raises(RangeError, match="4 names, one for each camera"):
            here.checked(wrong)


def test_a_state_fits_its_plan():
    place = np.zeros(3)
    with pytest.raises(RangeError, match=r"predicted_m is of \['H1'\]"):
        StrategyState(0, 0.0, CAMERAS, {"H1": place}, PLAN)
    with pytest.raises(ShapeError, match=r"shape \(2,\)"):
        StrategyState(0, 0.0, CAMERAS, {"H1": place, "H2": place[:2]}, PLAN)
    with pytest.raises(RangeError, match="one for each camera"):
        state(0, 1, previous=("H1",))
    inside = Surrogate(np.array([[0.1, 0, 0.0]]), np.array([[1.0, 0, 0]]), np.array("x"))
    with pytest.raises(RangeError, match="inside its own body"):
        Avatar(inside)
    for wrong in ({"avatars": {}}, {"step_s": 0}, {"radius_m": -1}, {"swap_margin_m": -0.1}):
        with pytest.raises(RangeError, match=next(iter(wrong))):
            dataclasses.replace(PLAN, **wrong)


# ---- the page --------------------------------------------------------------------------------------------------------


def test_the_pages_own_strategy_runs_and_does_what_it_says():
    """docs/hallway.md: each avatar gets the two cameras that are closest to it."""
    page = (Path(__file__).resolve().parents[3] / "docs" / "hallway.md").read_text(encoding="utf-8")
    names = {}
    for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(block, names)
    assert isinstance(names["limits"], PTZLimits)
    assert names["two_closest_each"](state(-2, 2)) == FOLLOW
    assert names["two_closest_each"](state(2, -2)) == SWAPPED
    assert len(names["run"].cameras) == 21
    for name in STRATEGIES:
        assert f"`{name}`" in page
