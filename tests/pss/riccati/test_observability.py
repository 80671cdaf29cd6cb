"""Observability by cases whose answer is known, and the 3 × 3 eigenproblem against 40 digits."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pss.errors import RangeError, RiccatiError, ShapeError
from pss.processes.process import ConstantAcceleration, ConstantVelocity, RandomWalk
from pss.riccati.observability import (
    EIGENVALUE_ERROR,
    eigen_3x3,
    information_ratio,
    is_detectable,
    is_observable,
    observability_matrix,
    smallest_eigenvalue_3x3,
)
from pss.riccati.solve import steady_state_covariance

EPS = float(np.finfo(np.float64).eps)
MODELS = [RandomWalk(), ConstantVelocity(1.0), ConstantAcceleration(1.0)]
# Roundings of a 3 × 3 eigenproblem relative to the largest eigenvalue; up to 12 are measured, most of them LAPACK's.
ROUNDINGS = 24


def seen_from(camera, point=(0.2, -0.1, 1.0), focal_px=800.0):
    """Jacobian (2, 3) of a pinhole camera at `camera` that looks at the point: it annihilates the ray."""
    ray = np.subtract(point, camera)
    across = np.linalg.svd(ray[None])[2][1:]
    return focal_px / np.linalg.norm(ray) * across


def range_from(beacon, point=(0.2, -0.1, 1.0)):
    """Jacobian (1, 3) of the distance to a beacon."""
    ray = np.subtract(point, beacon)
    return ray[None] / np.linalg.norm(ray)


A_CAMERA, ANOTHER = seen_from((-3, 0, 2)), seen_from((3, 1, 2))
# Behind the first camera, on the line from the point through it.
IN_LINE = seen_from(np.array([0.2, -0.1, 1.0]) + 2.5 * (np.array([-3, 0, 2]) - [0.2, -0.1, 1.0]))
BEACONS = [range_from(beacon) for beacon in ((-3, 0, 2), (3, 1, 2), (0, -4, 0))]
CASES = {
    "one camera": (A_CAMERA, False),
    "one camera twice": (np.vstack([A_CAMERA, A_CAMERA]), False),
    "two cameras in line with the point": (np.vstack([A_CAMERA, IN_LINE]), False),
    "two cameras": (np.vstack([A_CAMERA, ANOTHER]), True),
    "one beacon": (BEACONS[0], False),
    "two beacons": (np.vstack(BEACONS[:2]), False),
    "three beacons": (np.vstack(BEACONS), True),
    "three beacons on one line through the point": (np.vstack([BEACONS[0], -BEACONS[0], BEACONS[0]]), False),
    "a camera and a beacon beside it": (np.vstack([A_CAMERA, BEACONS[0]]), True),
    "a position fix": (np.eye(3), True),
    "a position fix in other units": (np.diag([1e9, 1.0, 1e-9]), True),
    "the height alone": (np.eye(3)[2:], False),
    "nothing": (np.zeros((2, 3)), False),
}


def of_state(H, states):
    return np.concatenate([H, np.zeros((len(H), states - 3))], axis=1)


@pytest.mark.parametrize("process", MODELS, ids=lambda p: type(p).__name__)
@pytest.mark.parametrize("case", CASES)
def test_cases(process, case):
    """Motion models carry velocities into positions: they are observable just where their position is."""
    H, expected = CASES[case]
    H = of_state(H, process.states)
    assert is_observable(process.A, H) == expected
    assert is_detectable(process.A, H) == expected
    # In the units of J, the fix of 10⁹ beside 10⁻⁹ has lost the latter, and says so.
    if "units" not in case:
        assert is_detectable(process.A, J=H.T @ H) == expected
        try:
            steady_state_covariance(process.A, process.Q, H, np.eye(len(H)))
        except RiccatiError:
            assert not expected
        else:
            assert expected


def test_rank_of_the_observability_matrix_where_units_are_alike():
    """Steps of one second, so that all powers of A are of order one."""
    A = ConstantVelocity(1.0, 1.0).A
    for case, (H, expected) in CASES.items():
        if "units" not in case:
            H = of_state(H, 6)
            matrix = observability_matrix(A, H)
            assert matrix.shape == (6 * len(H), 6)
            np.testing.assert_allclose(matrix[len(H) : 2 * len(H)], H @ A)
            assert (np.linalg.matrix_rank(matrix) == 6) == expected, case


def test_velocities_alone_leave_the_position_unknown_and_decay_needs_no_measurement():
    velocity = np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1)
    assert not is_observable(ConstantVelocity(1.0).A, velocity)
    assert not is_detectable(ConstantVelocity(1.0).A, velocity)
    decaying = np.diag([1.0, 0.5])
    assert not is_observable(decaying, [[1.0, 0.0]])
    assert is_detectable(decaying, [[1.0, 0.0]])
    assert not is_detectable(decaying, [[0.0, 1.0]])
    # A rotating pair of states is observed through either; two alike modes need two measurements.
    rotation = [[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]
    assert is_observable(rotation, [[1.0, 0.0]])
    assert not is_observable(np.eye(2), [[1.0, 1.0]])
    # Modes that lie close together, but apart, are two.
    assert not is_observable(np.diag([0.99996, 0.99995]), [[1.0, 0.0]])
    assert is_observable(np.diag([0.99996, 0.99995]), [[1.0, 1.0]])


@pytest.mark.parametrize(("angle", "expected"), [(1e-2, True), (1e-6, True), (1e-9, False), (0.0, False)])
def test_how_parallel_two_rays_may_be(angle, expected):
    """An information of angle² against 64 eps."""
    first, second = np.eye(3)[:2], np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0]])
    assert is_observable(np.eye(3), np.vstack([first, second])) == expected


def test_batches_broadcast():
    H = np.stack([np.vstack([A_CAMERA, ANOTHER]), np.vstack([A_CAMERA, IN_LINE])])
    expected = np.array([True, False])
    np.testing.assert_array_equal(is_observable(np.eye(3), H), expected)
    np.testing.assert_array_equal(is_detectable(np.stack([np.eye(3), np.eye(3) / 2]), H), [True, True])
    np.testing.assert_array_equal(is_detectable(np.eye(3), J=np.swapaxes(H, -1, -2) @ H), expected)
    assert observability_matrix(np.eye(3)[None], H).shape == (2, 12, 3)


def test_information_ratio_is_that_of_the_eigenvalues():
    J = np.stack([np.diag([4.0, 1.0, 2.0]), np.eye(3), np.zeros((3, 3)), np.diag([1.0, 0.0, 1.0])])
    np.testing.assert_allclose(information_ratio(J), [0.25, 1, 0, 0])
    np.testing.assert_allclose(information_ratio(1e-9 * J), [0.25, 1, 0, 0])
    line = np.vstack([A_CAMERA, IN_LINE])
    assert 0 <= information_ratio(line.T @ line) < 1e-14


def test_wrong_arguments_are_refused():
    with pytest.raises(ShapeError, match=r"A has shape \(2, 3\)"):
        is_observable(np.eye(3)[:2], np.eye(3))
    with pytest.raises(ShapeError, match=r"H has shape \(2, 2\); allowed beside A \(3, 3\)"):
        observability_matrix(np.eye(3), np.eye(2))
    with pytest.raises(ShapeError, match="leading axes that broadcast"):
        is_observable(np.ones((2, 1, 1)) * np.eye(3), np.ones((3, 1, 1)) * np.eye(3))
    with pytest.raises(RangeError, match="H has the value nan"):
        is_detectable(np.eye(3), np.full((1, 3), np.nan))
    with pytest.raises(ShapeError, match=r"J has shape \(2, 3\)"):
        is_detectable(np.eye(3), J=np.eye(3)[:2])
    for both in ({}, {"H": np.eye(3), "J": np.eye(3)}):
        with pytest.raises(RangeError, match="exactly one"):
            is_detectable(np.eye(3), **both)
    with pytest.raises(ShapeError, match=r"allowed: six times \(N,\)"):
        smallest_eigenvalue_3x3(*[np.ones(2)] * 5, np.ones(3))
    with pytest.raises(RangeError, match="matrix 1 is not finite"):
        smallest_eigenvalue_3x3([1.0, np.nan], *[np.ones(2)] * 5)


def six(M):
    return [M[:, i, k] for i in range(3) for k in range(i, 3)]


def symmetric(rng, eigenvalues):
    U = np.linalg.qr(rng.normal(size=(len(eigenvalues), 3, 3)))[0]
    M = (U * eigenvalues[:, None, :]) @ np.swapaxes(U, -1, -2)
    return (M + np.swapaxes(M, -1, -2)) / 2


def middle(kind, condition, t):
    """Second eigenvalue between 1/condition and 1: anywhere, or within 10^(−16t) of an end, where formulas break."""
    return {
        "anywhere": condition**-t,
        "next to the smallest": (1 + 10 ** (-16 * t)) / condition,
        "next to the largest": 1 - 10 ** (-16 * t) * (1 - 1 / condition),
    }[kind]


@pytest.mark.parametrize("kind", ["anywhere", "next to the smallest", "next to the largest"])
@pytest.mark.parametrize("condition", [1 + 1e-12, 1.001, 10.0, 1e3, 1e6])
@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
def test_smallest_eigenvalues_are_right_to_a_billionth(kind, condition, size):
    rng, count = np.random.default_rng(31), 40
    t = rng.uniform(size=count)
    M = symmetric(rng, np.stack([np.full(count, 1 / condition), middle(kind, condition, t), np.ones(count)], axis=-1))
    M = size * M
    with mpmath.workdps(40):
        exact = [min(mpmath.eigsy(mpmath.matrix(m.tolist()), eigvals_only=True)) for m in M]
    np.testing.assert_allclose(smallest_eigenvalue_3x3(*six(M)), np.array(exact, dtype=float), rtol=EIGENVALUE_ERROR)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), decades=st.floats(0, 20), sign=st.booleans())
def test_eigenvectors_rebuild_any_symmetric_matrix(seed, decades, sign):
    """Also indefinite ones, and those so near the singular that LAPACK steps in."""
    rng = np.random.default_rng(seed)
    eigenvalues = 10 ** rng.uniform(-decades, 0, size=(8, 3)) * (rng.choice([-1, 1], size=(8, 3)) if sign else 1)
    M = symmetric(rng, eigenvalues)
    values, axes = eigen_3x3(*six(M))
    U = np.moveaxis(axes, -1, 0)
    largest = np.abs(M).max(axis=(-2, -1))[:, None, None]
    assert (np.abs((U * values.T[:, None, :]) @ np.swapaxes(U, -1, -2) - M) <= ROUNDINGS * EPS * largest).all()
    np.testing.assert_allclose(np.swapaxes(U, -1, -2) @ U, np.broadcast_to(np.eye(3), U.shape), atol=ROUNDINGS * EPS)
    off = np.sort(values.T) - np.linalg.eigvalsh(M)
    assert (np.abs(off) <= ROUNDINGS * EPS * largest[..., 0]).all()


def test_plain_matrices_are_exact():
    special = [np.zeros((3, 3)), np.eye(3), np.diag([3.0, 1, 2]), np.diag([1.0, 1, 5]), np.diag([5.0, 1, 5])]
    M = np.stack([*special, np.ones((3, 3))])
    np.testing.assert_allclose(np.sort(eigen_3x3(*six(M))[0].T), np.linalg.eigvalsh(M), atol=ROUNDINGS * EPS * 5)
    assert eigen_3x3(*six(M[:0]))[0].shape == (3, 0)
