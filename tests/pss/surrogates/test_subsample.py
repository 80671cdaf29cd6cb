"""Fewer points for the same PSS: orders that are spread, tolerances that are kept at settings not seen."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

import pss
from pss import PSSError, PTZCamera, RangeError, Rectangle, ShapeError, Sphere
from pss.surrogates import (
    Capsule,
    Cylinder,
    Surrogate,
    balanced_order,
    farthest_point_order,
    on_capsule,
    on_cylinder,
    on_rectangle,
    on_sphere,
    relative_standard_error,
    subsample_adaptively,
    subsample_to_budget,
    subsample_to_tolerance,
)

TOLERANCE = 0.05
# A bound of 95 % confidence, over some tens of settings that are alike: at least this share has to keep it.
SHARE_KEPT = 0.9
# "Markedly fewer": all examples have 3,000 points or more but the one with cameras, which has 1,400.
LARGEST_SHARE_TAKEN = 0.25
LARGEST_SHARE_TAKEN_WITH_CAMERAS = 0.6
# Rounding of means of a few thousand numbers.
SAME_TO_ROUNDING = 1e-12

BALL = Sphere("ball", (0.0, 0.0, 1.0), 0.35)
TIN = Cylinder("tin", (0.9, 0.3, 0.8), 0.25, 1.6)
LIMB = Capsule("limb", (-0.8, 0.2, 0.4), (-0.9, 0.3, 1.4), 0.2)
BOARD = Rectangle("board", (0.0, 1.5, 1.5), 2.5, 1.2, facing_deg=180)


def scene(scale: float = 1.0) -> Surrogate:
    """Four objects, of which the board is far more thinly covered than the others."""
    parts = ((on_sphere, BALL, 400), (on_cylinder, TIN, 500), (on_capsule, LIMB, 400), (on_rectangle, BOARD, 100))
    return Surrogate.join([spread(shape, int(scale * count)) for spread, shape, count in parts])


def made_up(surrogate: Surrogate, settings: int, seed: int) -> np.ndarray:
    """1/m, (K, N): smooth in the place, with an edge beyond which nothing is seen, somewhat different each time."""
    rng = np.random.default_rng(seed)
    values = np.empty((settings, len(surrogate)))
    for row in values:
        place, edge = rng.normal(0, 1, 3), rng.normal([0.3, 0.8, 0.2], 0.3)
        seen = surrogate.normals @ edge > -0.2
        row[:] = seen * 100 / (1 + ((surrogate.points_m - place) ** 2).sum(axis=1))
    return values


# ---- orders ----------------------------------------------------------------------------------------------------------


def test_each_farthest_point_is_the_farthest():
    points = np.random.default_rng(1).normal(size=(200, 3))
    order = farthest_point_order(points)
    assert sorted(order) == list(range(200))
    distances = cdist(points, points)
    assert order[0] == np.linalg.norm(points - points.mean(axis=0), axis=1).argmin()
    for number in range(1, 200):
        from_chosen = distances[:, order[:number]].min(axis=1)
        assert from_chosen[order[number]] == pytest.approx(from_chosen.max(), rel=SAME_TO_ROUNDING)
    np.testing.assert_array_equal(farthest_point_order(points, 17), order[:17])


@given(
    count=st.integers(1, 90),
    places=st.integers(1, 90),
    seed=st.integers(0, 99),
)
def test_orders_take_each_point_once_even_of_many_in_one_place(count, places, seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(places, 3))[rng.integers(0, places, count)]
    for order in (farthest_point_order, balanced_order):
        assert sorted(order(points)) == list(range(count))
        np.testing.assert_array_equal(order(points), order(points.copy()))


@pytest.mark.parametrize("count", [1024, 1400])
def test_a_beginning_in_balanced_order_has_its_share_of_each_part(count):
    """On a line, halved at medians, 2ʲ points are one from each of 2ʲ runs of as many points: to within one of each."""
    rng = np.random.default_rng(2)
    line = np.zeros((count, 3))
    line[:, 1] = rng.exponential(size=count)
    rank = line[:, 1].argsort().argsort()
    order = balanced_order(line)
    for size in (2, 8, 64, 256):
        # Halves of odd runs differ by one point, so that one of a run's ends can count to its neighbour.
        runs = np.bincount(rank[order[:size]] * size // count, minlength=size)
        assert (runs.min(), runs.max()) == (1, 1) if count == 1024 else runs.max() <= 2
    for size in range(10, 1024, 97):
        in_halves = (rank[order[:size]] < (count + 1) // 2).mean() * size
        assert abs(in_halves - size / 2) <= 1


def test_balanced_order_follows_the_points_where_they_are_dense_and_the_farthest_ones_do_not():
    """Ten times as many points on one ball as on another: the mean of all is what the first few have to have."""
    points = Surrogate.join([on_sphere(BALL, 2000), on_sphere(Sphere("thin", (2, 0, 1), 0.35), 200)])
    of_thin = points.objects == "thin"
    balanced, farthest = (
        of_thin[order(points.points_m)[:128]].mean() for order in (balanced_order, farthest_point_order)
    )
    assert abs(balanced - 1 / 11) < 0.02
    assert farthest > 0.4


def test_balanced_points_have_a_smaller_error_than_random_ones():
    points = scene(3)
    values, order = made_up(points, 40, 3), balanced_order(points.points_m)
    whole = values.mean(axis=1)

    def error(indices):
        return math.sqrt(((values[:, indices].mean(axis=1) / whole - 1) ** 2).mean())

    rng = np.random.default_rng(4)
    for size in (64, 256, 1024):
        by_chance = [error(rng.choice(len(points), size, replace=False)) for _ in range(20)]
        assert error(order[:size]) < 0.6 * math.sqrt(np.mean(np.square(by_chance)))


# ---- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [64, 100, 256, 700])
def test_the_standard_error_is_that_of_settings(size):
    """|error| below 1.96 standard errors in most settings, and not a small part of them either."""
    points = scene(3)
    values, order = made_up(points, 200, 5), balanced_order(points.points_m)[:size]
    stated = relative_standard_error(points.points_m[order], values[:, order], len(points))
    true = values[:, order].mean(axis=1) / values.mean(axis=1) - 1
    assert (np.abs(true) < 1.96 * stated).mean() > SHARE_KEPT
    assert np.sqrt((true**2).mean()) > 0.25 * np.sqrt((stated**2).mean())


def test_the_standard_error_by_hand():
    points, values = np.array([[0.0, 0, 0], [1, 0, 0], [5, 0, 0]]), np.array([[1.0, 2.0, 3.0], [0, 0, 0]])
    # Fewer than 32 points count as drawn without order: √(1 / 3) of a mean of 2.
    np.testing.assert_allclose(relative_standard_error(points, values, 9), [math.sqrt(1 / 3) / 2, math.inf])
    np.testing.assert_array_equal(relative_standard_error(points, values, 3), [0, 0])
    assert relative_standard_error(points[:1], [1.0], 9) == math.inf
    # 32 on a line, each unlike its three nearest neighbours alike: half the mean square difference, a part left.
    line = np.zeros((32, 3))
    line[:, 0] = np.arange(32.0)
    ramp = 10 + np.arange(32.0)
    nearest = [sorted((abs(i - j), j) for j in range(32) if i != j)[:3] for i in range(32)]
    low = sum(d**2 for row in nearest for d, _ in row) / 96 / 2
    expected = math.sqrt(low * (1 - 32 / 128) / 32) / ramp.mean()
    assert relative_standard_error(line, ramp, 128)[0] == pytest.approx(expected, rel=SAME_TO_ROUNDING)


# ---- to a tolerance --------------------------------------------------------------------------------------------------


def held_out_errors(part, values):
    return np.abs(values[:, part.indices].mean(axis=1) / values.mean(axis=1) - 1)


@pytest.mark.parametrize("pilots", [1, 5, 40])
def test_the_tolerance_is_kept_with_markedly_fewer_points(pilots):
    points = scene(10)
    values = made_up(points, pilots + 100, 6)
    part = subsample_to_tolerance(points, values[:pilots] if pilots > 1 else values[0], TOLERANCE)
    np.testing.assert_array_equal(part.surrogate.points_m, points.points_m[part.indices])
    assert len(part) == len(part.surrogate) < LARGEST_SHARE_TAKEN * len(points)
    known, unknown = held_out_errors(part, values[:pilots]), held_out_errors(part, values[pilots:])
    assert known.max() <= TOLERANCE
    assert known.max() == pytest.approx(part.relative_error, abs=SAME_TO_ROUNDING)
    assert part.relative_bound <= TOLERANCE
    assert (unknown <= TOLERANCE).mean() >= SHARE_KEPT


def test_more_points_than_asked_for_keep_the_tolerance_at_the_known_settings():
    points = scene()
    values = made_up(points, 30, 7)
    part = subsample_to_tolerance(points, values, TOLERANCE)
    order = balanced_order(points.points_m)
    np.testing.assert_array_equal(part.indices, order[: len(part)])
    for size in range(len(part), len(points) + 1):
        error = np.abs(values[:, order[:size]].mean(axis=1) / values.mean(axis=1) - 1)
        assert error.max() <= TOLERANCE


def test_tighter_tolerances_take_more_points_and_at_last_all():
    points = scene()
    values = made_up(points, 5, 8)
    sizes = [len(subsample_to_tolerance(points, values, tolerance)) for tolerance in (0.2, 0.05, 0.01, 1e-9)]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[1] < sizes[3] == len(points)
    everything = subsample_to_tolerance(points, values, 1e-9)
    assert (everything.relative_error, everything.relative_bound) == (0, 0)


def test_settings_that_see_nothing_do_not_count():
    points = scene()
    values = made_up(points, 5, 9)
    padded = np.concatenate([np.zeros((50, len(points))), values])
    assert len(subsample_to_tolerance(points, padded, TOLERANCE)) == len(
        subsample_to_tolerance(points, values, TOLERANCE)
    )


def camera_settings(count: int, seed: int) -> list[list[PTZCamera]]:
    rng = np.random.default_rng(seed)
    places = [(x, y, 2.8) for x in (-2.4, 2.4) for y in (-3, 3)] + [(0, -3.4, 2.5), (0, -2, 2.9)]
    low, high = (-0.8, -0.3, 0.6), (0.8, 0.6, 1.4)
    return [
        [
            PTZCamera(place, 0, 0, zoom=rng.uniform(1, 2.5), focus_distance_m=rng.uniform(2, 5)).aimed_at(
                tuple(rng.uniform(low, high))
            )
            for place in places
        ]
        for _ in range(count)
    ]


def inverse_sigma_at(points: Surrogate, cameras: list[PTZCamera]) -> np.ndarray:
    sigma = pss.evaluate(
        cameras, points.points_m, points.normals, noise="corrected", occluder=[BALL, TIN, LIMB, BOARD]
    ).sigma_m
    return np.nan_to_num(1 / sigma)


def test_the_tolerance_is_kept_by_the_metric_at_settings_not_seen():
    """Pan, tilt, zoom and focus of six cameras at random; points hidden and out of view; ten settings to learn from."""
    points = scene()
    values = np.array([inverse_sigma_at(points, cameras) for cameras in camera_settings(40, 10)])
    part = subsample_to_tolerance(points, values[:10], TOLERANCE)
    assert len(part) < LARGEST_SHARE_TAKEN_WITH_CAMERAS * len(points)
    assert (held_out_errors(part, values[10:]) <= TOLERANCE).mean() >= SHARE_KEPT
    # What the part is evaluated to by itself is the mean over the same points of the whole.
    alone = inverse_sigma_at(part.surrogate, camera_settings(1, 10)[0])
    assert alone.mean() == pytest.approx(values[0, part.indices].mean(), rel=1e-9)


# ---- to a budget, and step by step -----------------------------------------------------------------------------------


def test_a_budget_buys_as_many_points_as_it_pays_for():
    points = scene()
    for seconds, budget_s, count in ((0.1, 0.3, 3), (1e-3, 0.2, 200), (1e-3, 1e9, len(points)), (0.5, 0.99, 1)):
        part = subsample_to_budget(points, seconds, budget_s)
        np.testing.assert_array_equal(part.indices, balanced_order(points.points_m)[:count])
    assert math.isnan(subsample_to_budget(points, 1, 5).relative_bound)
    assert subsample_to_budget(points, 1e-3, 1e9).relative_bound == 0


class Counted:
    """Evaluates one of the made-up settings, each point at most once, at a hundredth of a second a point."""

    def __init__(self, points: Surrogate, values: np.ndarray) -> None:
        self.values, self.asked = values, np.zeros(len(points), dtype=int)
        self.index = {tuple(point): number for number, point in enumerate(points.points_m)}

    def __call__(self, part: Surrogate) -> np.ndarray:
        indices = [self.index[tuple(point)] for point in part.points_m]
        self.asked[indices] += 1
        return self.values[..., indices]

    def clock(self) -> float:
        return 0.01 * self.asked.sum()


def test_evaluating_step_by_step_stops_early_and_keeps_the_tolerance():
    points = scene(3)
    values = made_up(points, 60, 11)
    errors, sizes = [], []
    for row in values:
        evaluation = Counted(points, row)
        part = subsample_adaptively(points, evaluation, TOLERANCE)
        assert evaluation.asked.max() == 1
        assert np.flatnonzero(evaluation.asked).tolist() == sorted(part.indices)
        assert part.relative_bound <= TOLERANCE
        errors.append(abs(row[part.indices].mean() / row.mean() - 1))
        sizes.append(len(part))
    assert (np.array(errors) <= TOLERANCE).mean() >= SHARE_KEPT
    assert np.mean(sizes) < LARGEST_SHARE_TAKEN * len(points)
    together = subsample_adaptively(points, Counted(points, values), TOLERANCE)
    assert len(together) == max(sizes)


@pytest.mark.parametrize(("budget_s", "count"), [(0.1, 32), (1.0, 100), (3.0, 300)])
def test_evaluating_step_by_step_stops_when_time_is_up(budget_s, count):
    points = scene(3)
    evaluation = Counted(points, made_up(points, 1, 12)[0])
    part = subsample_adaptively(points, evaluation, 1e-3, budget_s=budget_s, clock=evaluation.clock)
    assert len(part) in (count, count - 1)  # the rounding of the predicted time
    assert part.relative_bound > 1e-3
    assert math.isnan(part.relative_error)


def test_evaluating_step_by_step_ends_with_all_points_if_it_must():
    points = scene(0.2)
    evaluation = Counted(points, np.zeros(len(points)))
    part = subsample_adaptively(points, evaluation, TOLERANCE)
    assert len(part) == len(points)
    assert (part.relative_error, part.relative_bound) == (0, 0)


# ---- mistakes --------------------------------------------------------------------------------------------------------

POINTS = on_sphere(BALL, 40)
LINES = np.ones(40)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: farthest_point_order(np.zeros((0, 3))), ShapeError, "at least one point"),
        (lambda: farthest_point_order(np.zeros((4, 3)), 5), RangeError, "count = 5; allowed: 1 to 4"),
        (lambda: farthest_point_order(np.zeros((4, 3)), 0), RangeError, "count = 0; allowed: 1 or more"),
        (lambda: balanced_order(np.zeros(3)), ShapeError, r"shape \(3,\); allowed is \(N, 3\)"),
        (lambda: subsample_to_tolerance(POINTS, LINES, 0.0), RangeError, "tolerance = 0.0; allowed: above 0"),
        (lambda: subsample_to_tolerance(POINTS, LINES, 0.1, confidence=1.0), RangeError, "confidence = 1.0; allowed"),
        (lambda: subsample_to_tolerance(POINTS, LINES[1:], 0.1), ShapeError, r"shape \(39,\); allowed is \(40,\)"),
        (lambda: subsample_to_tolerance(POINTS, LINES * np.nan, 0.1), RangeError, "not finite or below 0"),
        (lambda: subsample_to_tolerance(POINTS, -LINES, 0.1), RangeError, "not finite or below 0"),
        (lambda: subsample_to_tolerance(POINTS, 0 * LINES, 0.1), RangeError, "0 everywhere; allowed: at least one"),
        (lambda: relative_standard_error(POINTS.points_m, LINES, 39), RangeError, "whole = 39; allowed: 40 or more"),
        (lambda: subsample_to_budget(POINTS, 0.0, 1.0), RangeError, "seconds_per_point = 0.0; allowed: above 0"),
        (lambda: subsample_to_budget(POINTS, 1.0, math.inf), RangeError, "budget_s = inf; allowed: above 0"),
        (lambda: subsample_to_budget(POINTS, 2.0, 1.0), RangeError, "budget_s = 1.0; allowed: 2.0 s or more"),
        (lambda: subsample_adaptively(POINTS, len, 0.1, budget_s=-1.0), RangeError, "budget_s = -1.0; allowed"),
        (lambda: subsample_adaptively(POINTS, lambda part: [1.0], 0.1), ShapeError, r"shape \(1,\); allowed is \(32,"),
        (
            lambda: subsample_adaptively(
                POINTS, lambda part: np.random.default_rng(1).uniform(size=(len(part), len(part))), 0.001
            ),
            ShapeError,
            "settings; allowed: always as many",
        ),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, error, message):
    with pytest.raises(error, match=message) as caught:
        make()
    assert isinstance(caught.value, PSSError)
