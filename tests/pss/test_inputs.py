"""What callers pass to pss: iterators, ragged lists, None, masked arrays, and arrays that they change afterwards."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pss
from pss import PSSError, RangeError, ShapeError
from pss.metric.aggregation import bounded_by_volume, cover_all, environment_size_m, grown_from_previous
from pss.noise import PixelCovariance
from pss.riccati.axes import axis_covariance, position_variance
from pss.riccati.observability import information_ratio, is_detectable, is_observable, observability_matrix
from pss.riccati.solve import (
    measurement_information,
    posterior_covariance,
    riccati_residual,
    steady_state_covariance_from_information,
)
from pss.surrogates import (
    Capsule,
    Cylinder,
    Mesh,
    Surrogate,
    balanced_order,
    convex_hull,
    dense_cloud,
    farthest_point_order,
    relative_standard_error,
    single_point,
    subsample_to_tolerance,
)

POINTS = np.random.default_rng(1).uniform(-0.5, 0.5, (30, 3)) + [0.0, 2.0, 1.0]
NORMALS = np.broadcast_to([0.0, -1.0, 0.0], POINTS.shape).copy()
CAMERAS = [pss.PTZCamera((x, -2.0, 1.0), 0.0, 0.0, name=str(x)) for x in (-0.5, 0.5)]
EVALUATION = pss.evaluate(CAMERAS, POINTS, NORMALS)
SIGMA = np.linspace(0.001, 0.01, 30)
A, Q = np.eye(3), 1e-6 * np.eye(3)
H, R = np.vstack([np.eye(3), np.eye(3)[:1]]), 1e-4 * np.eye(4)
J = H.T @ H * 1e4
BALL = pss.Sphere("ball", (0.0, 0.0, 1.0), 0.2)

# Every public function and type of pss that takes arrays or lists: what it is called with, and its name for each.
Call = Callable[[Any], Any]
ARRAYS: dict[str, tuple[Call, Any]] = {
    "evaluate points_m": (lambda v: pss.evaluate(CAMERAS, v, NORMALS).pss, POINTS),
    "evaluate normals": (lambda v: pss.evaluate(CAMERAS, POINTS, v).pss, NORMALS),
    "evaluate_many points_m": (lambda v: pss.evaluate_many([CAMERAS], v, NORMALS).pss, POINTS),
    "PTZCamera position_m": (lambda v: pss.PTZCamera(v, 0, 0).translation_m, (1.0, 2.0, 3.0)),
    "PTZCamera resolution": (lambda v: pss.PTZCamera((0, 0, 1), 0, 0, resolution=v).focal_px, (640, 480)),
    "PTZCamera distortion": (
        lambda v: pss.PTZCamera((0, 0, 1), 0, 0, radial_distortion=v).project([0.1, 2.0, 1.1])[0],
        (0.1, 0.01),
    ),
    "project": (lambda v: CAMERAS[0].project(v)[0], POINTS),
    "jacobian": (CAMERAS[0].jacobian, POINTS),
    "in_frustum": (CAMERAS[0].in_frustum, POINTS),
    "undistorted_px": (CAMERAS[0].undistorted_px, [[3.0, 4.0], [5.0, 6.0]]),
    "aimed_at": (lambda v: CAMERAS[0].aimed_at(v).rotation, POINTS[0]),
    "noise covariance": (lambda v: pss.noise_model("corrected").covariance(CAMERAS[0], v, NORMALS), POINTS),
    "Appearance module_m": (lambda v: pss.Appearance(v, 2.0, 1.0).sides_m(NORMALS)[0], SIGMA),
    "Appearance along": (lambda v: pss.Appearance(0.01, 2.0, 1.0, along=v).sides_m(NORMALS)[0], np.roll(NORMALS, 1, 1)),
    "LinearProcess A": (lambda v: pss.LinearProcess(v, Q).A, A),
    "LinearProcess Q": (lambda v: pss.LinearProcess(A, v).Q, Q),
    "linearised": (lambda v: pss.NonlinearProcess(lambda x: x, Q).linearised(v).A, POINTS),
    "PerPoint index": (lambda v: pss.PerPoint([pss.RandomWalk()], v).index, [0, 0, 0]),
    "steady_state A": (lambda v: pss.steady_state_covariance(v, Q, H, R), A),
    "steady_state Q": (lambda v: pss.steady_state_covariance(A, v, H, R), Q),
    "steady_state H": (lambda v: pss.steady_state_covariance(A, Q, v, R), H),
    "steady_state R": (lambda v: pss.steady_state_covariance(A, Q, H, v), R),
    "from information": (lambda v: steady_state_covariance_from_information(A, Q, v), J),
    "measurement_information": (lambda v: measurement_information(v, R), H),
    "posterior_covariance": (lambda v: posterior_covariance(v, J), Q),
    "riccati_residual": (lambda v: riccati_residual(A, Q, J, v), Q),
    "axis_covariance": (lambda v: axis_covariance([[1.0]], [[1e-6]], v), [1.0, 2.0]),
    "position_variance": (lambda v: position_variance([[1.0]], [[1e-6]], v), [1.0, 2.0]),
    "observability_matrix": (lambda v: observability_matrix(A, v), H),
    "is_observable": (lambda v: is_observable(A, v), H),
    "is_detectable": (lambda v: is_detectable(A, J=v), J),
    "information_ratio": (information_ratio, J),
    "RangeBeacon": (lambda v: pss.RangeBeacon(v, 0.01).measure(POINTS), (1.0, 2.0, 3.0)),
    "Bearing": (lambda v: pss.Bearing(v, 0.01).measure(POINTS), (1.0, 2.0, 3.0)),
    "PositionFix": (lambda v: pss.PositionFix(v).covariance(POINTS), (0.1, 0.2, 0.3)),
    "FunctionSensor noise": (lambda v: pss.FunctionSensor(lambda x: x, v).covariance(POINTS), A),
    "Rectangle": (lambda v: pss.Rectangle("r", v, 1.0, 1.0).centre_m, (1.0, 2.0, 3.0)),
    "Sphere": (lambda v: pss.Sphere("s", v, 1.0).centre_m, (1.0, 2.0, 3.0)),
    "Box": (lambda v: pss.Box("b", (0, 0, 0), v).highest_m, (1.0, 2.0, 3.0)),
    "Capsule": (lambda v: Capsule("c", (0, 0, 0), v, 0.1).end_m, (1.0, 2.0, 3.0)),
    "Cylinder": (lambda v: Cylinder("c", v, 0.1, 1.0).centre_m, (1.0, 2.0, 3.0)),
    "Mesh vertices": (lambda v: Mesh("m", v, [[0, 1, 2]]).vertices_m, POINTS),
    "Mesh faces": (lambda v: Mesh("m", POINTS, v).faces, [[0, 1, 2], [3, 4, 5]]),
    "Mesh moved": (lambda v: Mesh("m", POINTS, [[0, 1, 2]]).moved(v).vertices_m, (1.0, 2.0, 3.0)),
    "Surrogate points_m": (lambda v: Surrogate(v, NORMALS, "s").points_m, POINTS),
    "Surrogate normals": (lambda v: Surrogate(POINTS, v, "s").normals, NORMALS),
    "Surrogate moved": (lambda v: Surrogate(POINTS, NORMALS, "s").moved(v).points_m, (1.0, 2.0, 3.0)),
    "single_point": (lambda v: single_point(v, (0, 0, 1)).points_m, (1.0, 2.0, 3.0)),
    "dense_cloud": (lambda v: dense_cloud(v).normals, POINTS),
    "convex_hull": (lambda v: convex_hull(v).normals, POINTS),
    "farthest_point_order": (farthest_point_order, POINTS),
    "balanced_order": (balanced_order, POINTS),
    "relative_standard_error": (lambda v: relative_standard_error(POINTS, v, 100), 1 / SIGMA),
    "subsample_to_tolerance": (
        lambda v: subsample_to_tolerance(Surrogate(POINTS, NORMALS, "s"), v, 0.5).indices,
        1 / SIGMA,
    ),
    "Aggregation": (pss.Aggregation(), SIGMA),
    "Aggregation weights": (lambda v: pss.Aggregation(weights=v)(SIGMA), SIGMA),
    "Aggregation unobservable": (lambda v: pss.Aggregation(norm="1", unobservable=v)(np.full(30, np.nan)), SIGMA),
    "cover_all": (lambda v: cover_all(v, ["a"] * 30), SIGMA),
    "environment_size_m": (lambda v: environment_size_m((0, 0, 0), v), (1.0, 2.0, 3.0)),
    "bounded_by_volume": (lambda v: bounded_by_volume(EVALUATION, (0, 0, 0), v), (1.0, 2.0, 3.0)),
    "grown_from_previous": (lambda v: grown_from_previous(v, pss.RandomWalk(), 3), SIGMA),
}
# The same for lists of things.
LISTS: dict[str, tuple[Call, Any]] = {
    "cameras": (lambda v: pss.evaluate(v, POINTS, NORMALS).pss, CAMERAS),
    "configurations": (lambda v: pss.evaluate_many(v, POINTS, NORMALS).pss, [CAMERAS, CAMERAS[:1]]),
    "occluder": (lambda v: pss.evaluate(CAMERAS, POINTS, NORMALS, occluder=v).pss, [BALL]),
    "sensors": (lambda v: pss.evaluate(CAMERAS, POINTS, NORMALS, sensors=v).pss, [pss.PositionFix(0.1)]),
    "visibility": (lambda v: pss.evaluate(CAMERAS, POINTS, NORMALS, visibility=v).pss, [pss.FieldOfView()]),
    "process": (lambda v: pss.evaluate(CAMERAS, POINTS, NORMALS, process=v).pss, [pss.RandomWalk()] * 30),
    "PerPoint models": (lambda v: pss.PerPoint(v, [0, 0]).index, [pss.RandomWalk()]),
    "NoiseModel": (lambda v: pss.NoiseModel("m", v).name, pss.noise_model("as-printed").factors),
    "Surrogate.join": (lambda v: len(Surrogate.join(v)), [Surrogate(POINTS, NORMALS, "s")] * 2),
    "Aggregation objects": (lambda v: pss.Aggregation(objects=v, across="mean")(SIGMA), ["a", "b"] * 15),
    "cover_all objects": (lambda v: cover_all(SIGMA, v), ["a", "b"] * 15),
}
# None is the argument's own default there.
NONE_IS_A_VALUE = {"process", "Appearance along", "Aggregation weights", "Aggregation objects"}


@pytest.mark.parametrize("case", [*ARRAYS, *LISTS])
def test_iterators_are_read_to_their_end(case):
    """A generator, and a deque, give what the list gives; generators of generators too."""
    call, value = (ARRAYS | LISTS)[case]
    expected = call(value)

    def generated(items: Any) -> Any:
        return (generated(item) if isinstance(item, list | np.ndarray) and np.ndim(item) else item for item in items)

    np.testing.assert_array_equal(call(generated(value)), expected)
    np.testing.assert_array_equal(call(deque(value)), expected)
    np.testing.assert_array_equal(call(iter(value)), expected)


@pytest.mark.parametrize("case", [*ARRAYS, *LISTS])
def test_none_text_and_things_are_refused_by_name(case):
    call, value = (ARRAYS | LISTS)[case]
    wrong = [object(), 1j, [1j, 2j, 3j], [[0.0, 0.0, 0.0], [1.0, 2.0]], [object()] * len(value)]
    if case not in NONE_IS_A_VALUE:
        wrong.append(None)
    if "objects" not in case and case != "Aggregation unobservable":
        wrong.append("text")
        wrong.append(["text"] * len(value))
    if "objects" in case:
        wrong = [None, object(), [["a"], ["b", "c"]]][case == "Aggregation objects" :]
    for given in wrong:
        with pytest.raises(PSSError, match="allowed"):
            call(given)


@pytest.mark.parametrize("case", ARRAYS)
def test_masks_are_not_ignored(case):
    """An array without a masked value is one like any other."""
    call, value = ARRAYS[case]
    array = np.array(value)
    np.testing.assert_array_equal(call(np.ma.array(array)), call(value))
    mask = np.zeros(array.shape, dtype=bool)
    mask.flat[-1] = True
    for masked in (np.ma.array(array, mask=mask), list(np.ma.array(array, mask=mask))):
        if np.ndim(array) > 1 or not isinstance(masked, list):
            with pytest.raises(RangeError, match="has 1 masked values; allowed: none"):
                call(masked)


KEPT: dict[str, tuple[Callable[..., Any], tuple[Any, ...], Call]] = {
    "evaluate": (
        lambda points, normals: pss.evaluate(CAMERAS, points, normals),
        (POINTS, NORMALS),
        lambda e: (e.points_m, e.normals, e.noise_px2, e.jacobian),
    ),
    "Appearance": (
        lambda module, along: pss.Appearance(module, 2.0, 1.0, along, velocity_m_per_s=along),
        (SIGMA, np.roll(NORMALS, 1, 1)),
        lambda a: (*a.sides_m(NORMALS), a.velocity_m_per_s),
    ),
    "Aggregation": (
        lambda weights, objects: pss.Aggregation(weights=weights, objects=objects),
        (SIGMA, np.array(["a", "b"] * 15)),
        lambda a: tuple(a.of_objects(SIGMA).items()),
    ),
    "LinearProcess": (pss.LinearProcess, (A, Q), lambda p: (p.A, p.Q)),
    "FunctionSensor": (
        lambda noise: pss.FunctionSensor(lambda x: x, noise),
        (A,),
        lambda s: s.covariance(POINTS),
    ),
    "Surrogate": (
        Surrogate,
        (POINTS, NORMALS, np.array(["a", "b"] * 15)),
        lambda s: (s.points_m, s.normals, s.objects),
    ),
    "Mesh": (lambda v, f: Mesh("m", v, f), (POINTS, np.array([[0, 1, 2]])), lambda m: (m.vertices_m, m.faces)),
    "Sphere": (lambda c: pss.Sphere("s", c, 1.0), (POINTS[0],), lambda s: s.centre_m),
    "PTZCamera": (lambda c: pss.PTZCamera(c, 0, 0), (POINTS[0],), lambda c: c.position_m),
    "RangeBeacon": (lambda c: pss.RangeBeacon(c, 0.1), (POINTS[0],), lambda b: b.measure(POINTS + 1)),
}


@pytest.mark.parametrize("case", KEPT)
def test_later_changes_of_the_callers_arrays_change_nothing(case):
    make, given, shown = KEPT[case]
    mine = tuple(array.copy() for array in given)
    made = make(*mine)
    expected = shown(make(*given))
    for array in mine:
        array[...] = array.flat[0] if array.dtype.kind == "U" else 0
    assert repr(shown(made)) == repr(expected)


def test_one_thing_in_place_of_a_list_is_refused_with_its_type():
    for call, message in (
        (lambda: pss.evaluate(CAMERAS[0], POINTS, NORMALS), "cameras is of type PTZCamera; allowed: a list of cameras"),
        (lambda: pss.evaluate([POINTS], POINTS, NORMALS), r"cameras\[0\] is an array of float64"),
        (
            lambda: pss.evaluate_many(CAMERAS, POINTS, NORMALS),
            r"configurations\[0\] is of type PTZCamera; allowed: a li",
        ),
        (
            lambda: pss.evaluate(CAMERAS, POINTS, NORMALS, occluder=BALL),
            "occluder is Sphere.* of type Sphere; allowed: a list of",
        ),
        (lambda: pss.evaluate(CAMERAS, POINTS, NORMALS, visibility="target"), "visibility is 'target' of type str"),
        (
            lambda: pss.evaluate(CAMERAS, POINTS, NORMALS, noise=3),
            "noise is a int; allowed: a noise model, or its name",
        ),
        (
            lambda: pss.evaluate(CAMERAS, POINTS, NORMALS, appearance=3),
            "appearance is a int; allowed: a pss.Appearance",
        ),
        (lambda: pss.PTZCamera((0, 0, 0), None, 0), "pan_deg is None; allowed: a number"),
        (lambda: pss.PTZCamera((0, 0, 0), "90", 0), "pan_deg is '90' of type str; allowed: a number"),
        (lambda: pss.noise_model("corrected", switched_off="defocus"), "switched_off = 'defocus'; allowed: a list"),
    ):
        with pytest.raises(RangeError, match=message):
            call()


# ---- noise factors of one's own --------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Own:
    """A user's factor that returns `value`."""

    value: Any
    name: str = "own"

    def covariance(self, views):
        return self.value


C, N = len(CAMERAS), len(POINTS)
TILTED = np.array([[2.0, 0.5], [0.5, 1.0]])


def noise_of(value: Any, plus: bool = False) -> np.ndarray:
    model = pss.NoiseModel("own", (Own(value),))
    if plus:
        model = pss.noise_model("identity").plus(Own(value)).weighted({"own": 3.0})
    return pss.evaluate(CAMERAS, POINTS, NORMALS, noise=model).noise_px2


@pytest.mark.parametrize("shape", [(), (1, 1), (N,), (1, N), (C, 1), (C, N)])
def test_a_factor_may_return_matrices(shape):
    """Arrays (…, 2, 2) that broadcast to (C, N, 2, 2) are what a PixelCovariance of them is."""
    value = np.broadcast_to(TILTED, (*shape, 2, 2)) * np.linspace(1, 2, int(np.prod(shape))).reshape(*shape, 1, 1)
    expected = np.broadcast_to(value, (C, N, 2, 2))
    np.testing.assert_allclose(noise_of(value), expected)
    np.testing.assert_allclose(noise_of(PixelCovariance.from_matrix(value)), expected)
    np.testing.assert_allclose(noise_of(value, plus=True), np.eye(2) + 3 * expected)
    assert noise_of(value.tolist()).shape == (C, N, 2, 2)


@pytest.mark.parametrize(
    ("value", "error", "message"),
    [
        (
            1.0,
            ShapeError,
            r"'own' returns an array of shape \(\); allowed: a PixelCovariance, such as PixelCovariance.iso",
        ),
        (np.ones((C, N)), ShapeError, rf"shape \(2, 30\); allowed: .* that broadcasts to \({C}, {N}, 2, 2\)"),
        (np.ones((N, C, 2, 2)), ShapeError, r"returns an array of shape \(30, 2, 2, 2\)"),
        (np.ones((4, C, N, 2, 2)), ShapeError, r"returns an array of shape \(4, 2, 30, 2, 2\)"),
        (None, RangeError, "what noise factor 'own' returns is None; allowed: a PixelCovariance"),
        ("text", RangeError, "what noise factor 'own' returns is 'text' of type str"),
        (
            [[1.0, 0.5], [0.0, 1.0]],
            RangeError,
            r"the matrix \[\[1.0, 0.5\], \[0.0, 1.0\]\]; allowed: symmetric positive",
        ),
        ([[1.0, 2.0], [2.0, 1.0]], RangeError, "symmetric positive semidefinite"),
        ([[-1.0, 0.0], [0.0, 1.0]], RangeError, "symmetric positive semidefinite"),
        (PixelCovariance.isotropic(np.ones((N, C))), ShapeError, r"entries of shapes .* broadcast to \(2, 30\)"),
    ],
)
def test_what_a_factor_may_not_return_is_refused_with_what_it_may(value, error, message):
    with pytest.raises(error, match=message):
        noise_of(value)


def test_a_factor_without_its_members_is_refused():
    class Nameless:
        def covariance(self, views):
            return TILTED

    with pytest.raises(RangeError, match="a noise factor of type Nameless has no name"):
        pss.NoiseModel("own", (Nameless(),))
    with pytest.raises(RangeError, match=r"factors\[0\] is .*; allowed: a list of noise factors, with name and cov"):
        pss.NoiseModel("own", (object(),))
