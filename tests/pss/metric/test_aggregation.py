"""Aggregation by hand: norms, weights, objects, and what unobservable points count."""

import math

import numpy as np
import pytest

from pss import Aggregation, PTZCamera, RandomWalk, RangeError, Rectangle, ShapeError, evaluate
from pss.metric.aggregation import bounded_by_volume, cover_all, environment_size_m, grown_from_previous

NAN = np.nan
SIGMA = np.array([0.001, 0.002, NAN, 0.004])
OBJECTS = np.array(["board", "board", "ball", "ball"])


def test_the_default_is_equation_10():
    """(1000 + 500 + 0 + 250) / 4."""
    assert Aggregation()(SIGMA) == pytest.approx(437.5)
    camera = PTZCamera((-2, -2, 1.5), 0, 0, focus_distance_m=2.5).aimed_at((0, 0, 1.2))
    other = PTZCamera((2, -2, 1.5), 0, 0, focus_distance_m=2.5).aimed_at((0, 0, 1.2))
    points, normals = Rectangle("board", (0, 0, 1.2), 5, 2, facing_deg=180).grid(9, 5)
    result = evaluate([camera, other], points, normals)
    assert 0 < result.observable.sum() < len(points)
    assert Aggregation()(result.sigma_m) == pytest.approx(result.pss, rel=1e-12)


@pytest.mark.parametrize(
    ("norm", "expected"),
    [("1", 7e-3 / 3), ("2", math.sqrt(21e-6 / 3)), ("inf", 4e-3), ("inverse", 437.5)],
)
def test_norms_by_hand_over_the_observable_points(norm, expected):
    aggregation = Aggregation(norm=norm)
    assert aggregation(SIGMA) == pytest.approx(expected)
    assert aggregation.higher_is_better == (norm == "inverse")


@pytest.mark.parametrize(
    ("unobservable", "norm", "expected"),
    [
        ("drop", "inverse", 1750 / 3),
        (6.0, "inf", 6.0),
        (6.0, "1", 6.007 / 4),
        (0.01, "inverse", (1750 + 100) / 4),
        (np.array([9.0, 9.0, 0.02, 9.0]), "inf", 0.02),
    ],
    ids=["dropped", "environment, worst", "environment, mean", "bound", "bound by point"],
)
def test_unobservable_points_count_as_asked(unobservable, norm, expected):
    assert Aggregation(norm=norm, unobservable=unobservable)(SIGMA) == pytest.approx(expected)


def test_weights_count_points_more_or_less():
    assert Aggregation(weights=[1, 0, 0, 1])(SIGMA) == pytest.approx(625)
    assert Aggregation(norm="inf", weights=[1, 1, 1, 0])(SIGMA) == pytest.approx(2e-3)
    assert Aggregation(norm="1", weights=[3, 1, 0, 0])(SIGMA) == pytest.approx(1.25e-3)
    copies = np.repeat(SIGMA, [2, 3, 1, 4])
    for norm in ("inverse", "1", "2", "inf"):
        weighted = Aggregation(norm=norm, weights=[2, 3, 1, 4])(SIGMA)
        assert weighted == pytest.approx(Aggregation(norm=norm)(copies)), norm


def test_objects_by_themselves_and_together():
    """Board (1000 + 500)/2 = 750; ball (0 + 250)/2 = 125."""
    assert Aggregation(objects=OBJECTS).of_objects(SIGMA) == pytest.approx({"board": 750, "ball": 125})
    assert Aggregation(objects=OBJECTS, across="mean")(SIGMA) == pytest.approx(437.5)
    assert Aggregation(objects=OBJECTS, across="worst")(SIGMA) == pytest.approx(125)
    assert Aggregation(norm="1", objects=OBJECTS, across="worst")(SIGMA) == pytest.approx(4e-3)
    many = np.concatenate([np.repeat(SIGMA[:2], 50), SIGMA[2:]])
    labels = np.array(["board"] * 100 + ["ball"] * 2)
    assert Aggregation(objects=labels, across="mean")(many) == pytest.approx(437.5)
    assert Aggregation(objects=labels)(many) == pytest.approx(75250 / 102)


def test_priorities_weigh_objects():
    assert Aggregation(objects=OBJECTS, across="mean", priorities={"ball": 3})(SIGMA) == pytest.approx(
        (750 + 3 * 125) / 4
    )
    assert Aggregation(objects=OBJECTS, priorities={"ball": 3})(SIGMA) == pytest.approx((1500 + 3 * 250) / 8)
    assert Aggregation(objects=OBJECTS, across="worst", priorities={"ball": 0})(SIGMA) == pytest.approx(750)


def test_nothing_observable_is_the_worst_number():
    nothing = np.full(3, NAN)
    assert Aggregation()(nothing) == 0
    for norm in ("1", "2", "inf"):
        assert Aggregation(norm=norm)(nothing) == math.inf


def test_cover_all_prefers_coverage_to_any_mean():
    """Both objects poorly beats one object superbly; with equal coverage the better worst object wins."""
    both, one = np.array([0.1, 0.1, 0.1, 0.1]), np.array([1e-5, 1e-5, NAN, NAN])
    better = np.array([0.1, 0.1, 0.05, 0.05])
    assert cover_all(both, OBJECTS) > cover_all(one, OBJECTS)
    assert Aggregation()(both) < Aggregation()(one)
    assert cover_all(np.array([0.05, 0.05, 0.05, 0.05]), OBJECTS) > cover_all(better, OBJECTS) - 1e-12
    assert cover_all(both, OBJECTS) == pytest.approx(2 + 10 / 11)
    half = np.array([0.1, 0.1, 0.1, NAN])
    assert math.floor(cover_all(half, OBJECTS)) == 1
    assert math.floor(cover_all(half, OBJECTS, share=0.5)) == 2


def test_bounds_by_hand():
    assert environment_size_m((-3, -3, 0), (3, 3, 3)) == pytest.approx(9)
    np.testing.assert_allclose(
        grown_from_previous([0.003, NAN], RandomWalk(step_std_m=2e-3), 4), [math.sqrt(9e-6 + 16e-6), NAN]
    )


def test_a_point_seen_once_is_bounded_along_its_ray():
    """From a camera far away along y: across, what it measures; along, anywhere in the box: side/√12."""
    camera = PTZCamera((0, -3, 1), 0, 0, zoom=4, focus_distance_m=3)
    points, normals = np.array([[0.0, 0, 1], [0, -6, 1]]), np.array([[0.0, -1, 0], [0, -1, 0]])
    result = evaluate([camera], points, normals)
    bound = bounded_by_volume(result, (-1, -0.5, 0), (1, 0.5, 2))
    np.testing.assert_allclose(bound, [1 / math.sqrt(12), 2 / math.sqrt(12)], rtol=1e-6)
    pair = evaluate(
        [camera, PTZCamera((3, 0, 1), -90, 0, focus_distance_m=3)], points[:1], [[0.7071068, -0.7071068, 0]]
    )
    np.testing.assert_array_equal(bounded_by_volume(pair, (-1, -1, 0), (1, 1, 2)), pair.sigma_m)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Aggregation(norm="3"), RangeError, "norm = '3'; allowed: inverse, 1, 2, inf"),
        (lambda: Aggregation(across="sum"), RangeError, "across = 'sum'; allowed"),
        (lambda: Aggregation(unobservable="zero"), RangeError, "'zero'; allowed: ignore, drop, or metres"),
        (lambda: Aggregation(unobservable=-1.0), RangeError, "-1.0; allowed: above 0"),
        (lambda: Aggregation(weights=[1, -1]), RangeError, "weight is .*-1"),
        (lambda: Aggregation(objects=OBJECTS, priorities={"wall": 1}), RangeError, "'wall'; allowed: the labels"),
        (lambda: Aggregation(objects=OBJECTS, priorities={"ball": -1}), RangeError, "-1; allowed: 0 or more"),
        (lambda: Aggregation(weights=[1, 1])(SIGMA), ShapeError, r"weights has shape \(2,\); allowed: \(4,\)"),
        (lambda: Aggregation()(SIGMA[None]), ShapeError, r"\(1, 4\); allowed: \(N,\)"),
        (lambda: Aggregation()([0.1, -0.1]), RangeError, "-0.1.*above 0"),
        (lambda: environment_size_m((0, 0, 0), (1, -1, 1)), RangeError, "allowed: above 0"),
        (lambda: cover_all(SIGMA, OBJECTS, share=0.0), RangeError, "share = 0.0; allowed"),
        (lambda: grown_from_previous([1.0], RandomWalk(), -1), RangeError, "frames = -1"),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, error, message):
    with pytest.raises(error, match=message):
        make()
