"""The steady state of Eq. 4 by routes that share no code: by hand, SciPy and 60 decimal digits."""

import math

import numpy as np
import pytest
import scipy.linalg
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pss.errors import PSSError, RangeError, RiccatiError, ShapeError
from pss.processes.process import ConstantAcceleration, ConstantVelocity, RandomWalk
from pss.riccati.methods import residuals
from pss.riccati.solve import (
    measurement_information,
    posterior_covariance,
    riccati_residual,
    steady_state_covariance,
    steady_state_covariance_from_information,
)
from tests.helpers.riccati_systems import (
    AGREES,
    EPS,
    METHODS,
    PRODUCT_ROUNDINGS,
    RESIDUAL,
    ROUNDINGS,
    SAME_TO_ROUNDING,
    by_scipy,
    camera_like,
    difference,
    in_sixty_digits,
    random_covariance,
    random_orthogonal,
    random_systems,
    transpose,
)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("q", "j", "expected"),
    [
        (2.0, 0.25, 4.0),  # p² = 2p + 8
        (1.0, 0.5, 2.0),  # p² = p + 2
        (6.0, 6 / 16, 8.0),  # p² = 6p + 16
    ],
)
def test_one_axis_by_hand(method, q, j, expected):
    P = steady_state_covariance_from_information([[1.0]], [[q]], [[j]], method)
    np.testing.assert_allclose(P, [[expected]], rtol=SAME_TO_ROUNDING)


@pytest.mark.parametrize("method", METHODS)
def test_an_unstable_axis_by_hand(method):
    """A = 2, Q = 1, H = R = 1: p = 4p/(1 + p) + 1, that is p² = 4p + 1."""
    P = steady_state_covariance([[2.0]], [[1.0]], [[1.0]], [[1.0]], method)
    np.testing.assert_allclose(P, [[2 + math.sqrt(5)]], rtol=SAME_TO_ROUNDING)


@pytest.mark.parametrize("method", ["auto", "eigenstructure", "doubling"])
@pytest.mark.parametrize("n", [3, 6, 9])
def test_methods_agree_with_scipy_on_random_systems(method, n):
    A, Q, H, R = random_systems(n, 150)
    P = steady_state_covariance(A, Q, H, R, method)
    reference = by_scipy(A, Q, H, R)
    assert difference(P, reference) < AGREES
    assert riccati_residual(A, Q, measurement_information(H, R), P).max() < RESIDUAL


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "process", [RandomWalk(), ConstantVelocity(1.0), ConstantAcceleration(1.0)], ids=lambda p: type(p).__name__
)
def test_methods_agree_with_scipy_on_cameras(method, process):
    H, R = camera_like(process, 100)
    reference = by_scipy(*(np.broadcast_to(M, (100, *M.shape)) for M in (process.A, process.Q)), H, R)
    P = steady_state_covariance(process.A, process.Q, H, R, method)
    assert difference(P, reference) < AGREES
    J = measurement_information(H, R)
    assert difference(steady_state_covariance_from_information(process.A, process.Q, J, method), reference) < AGREES
    assert np.array_equal(P, transpose(P))


@pytest.mark.parametrize("method", ["auto", "eigenstructure", "doubling"])
def test_alike_axes_do_not_upset_the_eigenvectors(method):
    """Isotropic measurements give the Hamiltonian n equal eigenvalues, whose eigenvectors rounding may align."""
    process = ConstantAcceleration(2.0)
    rotation = scipy.linalg.block_diag(*[random_orthogonal(np.random.default_rng(1), 3)] * 3)
    J = np.zeros((9, 9))
    J[:3, :3] = 1e6 * np.eye(3)
    A, Q, J = (rotation @ M @ rotation.T for M in (process.A, process.Q, J))
    P = steady_state_covariance_from_information(A, Q, (J + J.T) / 2, method)
    axis = np.ix_([0, 3, 6], [0, 3, 6])
    one = steady_state_covariance_from_information(process.A[axis], process.Q[axis], np.diag([1e6, 0, 0]), "scipy")
    assert difference(P, np.kron(one, np.eye(3))) < AGREES


@pytest.mark.parametrize("q", [1e-18, 1e-12, 1e-6, 1e2, 1e8])
@pytest.mark.parametrize("ratio", [1e-10, 1e-3, 1.0])
def test_closed_form_keeps_all_digits_that_the_information_has(q, ratio):
    rng = np.random.default_rng(8)
    for axes in (np.eye(3), random_orthogonal(rng, 3)):
        J = (axes * [1e6, 3e4 * ratio**0.5, 1e6 * ratio]) @ axes.T
        J = (J + J.T) / 2
        P = steady_state_covariance_from_information(np.eye(3), q * np.eye(3), J)
        reference = in_sixty_digits(np.eye(3), q * np.eye(3), J)
        # Along the coordinate axes J is exact; across them its smallest eigenvalue is known to eps / ratio.
        tolerance = SAME_TO_ROUNDING if np.array_equal(axes, np.eye(3)) else ROUNDINGS * EPS / ratio
        assert difference(P, reference) < tolerance
        assert riccati_residual(np.eye(3), q * np.eye(3), J, P) < RESIDUAL + ROUNDINGS * EPS / ratio


@pytest.mark.parametrize("method", ["eigenstructure", "doubling", "scipy"])
@pytest.mark.parametrize(
    ("process", "ratio"),
    [
        (RandomWalk(), 1e-10),
        (RandomWalk(1e-6), 1e-4),
        (ConstantVelocity(1e-6), 1e-6),
        (ConstantAcceleration(1e-3), 1e-8),
    ],
    ids=lambda value: type(value).__name__ if not isinstance(value, float) else f"{value:g}",
)
def test_methods_near_the_singular_against_sixty_digits(method, process, ratio):
    """Information that all but vanishes along one direction, and filters that take thousands of frames to settle."""
    axes = random_orthogonal(np.random.default_rng(21), 3)
    J = np.zeros((process.states, process.states))
    J[:3, :3] = (axes * [1e6, 1e5, 1e6 * ratio]) @ axes.T
    J = (J + J.T) / 2
    P = steady_state_covariance_from_information(process.A, process.Q, J, method)
    deviations = np.sqrt(np.diag(P))
    information = np.linalg.norm(J * deviations[:, None] * deviations, 2)
    assert riccati_residual(process.A, process.Q, J, P) < SAME_TO_ROUNDING + PRODUCT_ROUNDINGS * EPS * information
    reference = in_sixty_digits(process.A, process.Q, J)
    closed_loop = process.A @ np.linalg.inv(np.eye(process.states) + reference @ J)
    frames = 1 / (1 - np.abs(np.linalg.eigvals(closed_loop)).max())
    assert difference(P, reference) < ROUNDINGS * EPS * (frames + 1 / ratio)


@pytest.mark.parametrize("method", ["eigenstructure", "doubling"])
@pytest.mark.parametrize(
    "process",
    [RandomWalk(1e-8), ConstantVelocity(1e-12), ConstantAcceleration(1e-12)],
    ids=lambda p: type(p).__name__,
)
def test_slow_filters_keep_their_digits(method, process):
    """10³ to 10⁶ frames to settle; the eigenvectors alone lose as many digits squared, and are refined."""
    J = np.zeros((process.states, process.states))
    J[:3, :3] = 1e5 * random_covariance(np.random.default_rng(6), 3)
    reference = in_sixty_digits(process.A, process.Q, J)
    P = steady_state_covariance_from_information(process.A, process.Q, J, method)
    assert difference(P, reference) < AGREES


def test_posterior_is_the_inverse_of_summed_inverses_and_takes_singular_priors():
    rng = np.random.default_rng(4)
    P, J = random_covariance(rng, 6, (50,)), random_covariance(rng, 6, (50,))
    expected = np.linalg.inv(np.linalg.inv(P) + J)
    assert difference(posterior_covariance(P, J), expected) < AGREES
    # What is known exactly stays known, and says nothing about the rest.
    singular = posterior_covariance(np.diag([2.0, 0.0]), [[3.0, 1.0], [1.0, 5.0]])
    np.testing.assert_allclose(singular, np.diag([1 / (1 / 2 + 3), 0.0]), atol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(posterior_covariance(P, np.zeros((6, 6))), P, rtol=1e-9)


def test_residual_sees_an_error_of_the_size_it_claims():
    """For A = I the residual's slope in P is 1 − (1 + PJ)⁻²; P = 2, J = 1/2, Q = 1 make it 3/4."""
    wrong = riccati_residual([[1.0]], [[1.0]], [[0.5]], [[2.0 * (1 + 1e-6)]])
    np.testing.assert_allclose(wrong, 0.75e-6, rtol=1e-5)


def test_a_residual_of_zero_by_chance_proves_nothing():
    """P = 1e-18 is a hundred times the solution √(q/j), yet neither 1/(1 + PJ) nor Q reach its last digit."""
    residual, error = residuals(*(np.array([[x]]) for x in (1.0, 1e-40, 1.0, 1e-18)))
    assert residual == 0
    assert error > 1


def test_eigenvectors_outside_the_unit_circle_are_the_ones():
    """Those inside give the other root of the quadratic, which is no covariance: p² = 2p + 8 has −2."""
    assert steady_state_covariance_from_information([[1.0]], [[2.0]], [[0.25]], "eigenstructure")[0, 0] > 0


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), batch=st.sampled_from([(), (1,), (4,), (2, 3), (0,), (2, 1, 2)]))
def test_batches_broadcast_and_equal_their_members(method, seed, batch):
    rng = np.random.default_rng(seed)
    A = ConstantVelocity(1.0, 0.5).A
    Q = random_covariance(rng, 6, batch[-1:])
    J = random_covariance(rng, 6, batch)
    P = steady_state_covariance_from_information(A, Q, J, method)
    assert P.shape == (*batch, 6, 6)
    Q = np.broadcast_to(Q, P.shape)
    for index in np.ndindex(batch):
        alone = steady_state_covariance_from_information(A, Q[index], J[index], method)
        assert difference(P[index], alone) < AGREES


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), log_ratio=st.floats(-6, 0), log_q=st.floats(-6, 3))
def test_turning_the_world_turns_the_covariance(method, seed, log_ratio, log_q):
    rng = np.random.default_rng(seed)
    turn, axes = random_orthogonal(rng, 3), random_orthogonal(rng, 3)
    J = (axes * [1.0, 0.3, 10**log_ratio]) @ axes.T
    Q = 10**log_q * np.eye(3)
    P = steady_state_covariance_from_information(np.eye(3), Q, J, method)
    turned = steady_state_covariance_from_information(np.eye(3), Q, turn @ J @ turn.T, method)
    frames = 1 + 10 ** (-log_q / 2) * 10 ** (-log_ratio / 2)
    assert difference(turned, turn @ P @ turn.T) < ROUNDINGS * EPS * (frames + 10**-log_ratio)


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), metres=st.floats(1e-3, 1e3))
def test_units_do_not_matter_and_more_information_never_hurts(method, seed, metres):
    rng = np.random.default_rng(seed)
    process = ConstantVelocity(1.0, 0.2)
    position = np.diag([1.0, 1, 1, 0, 0, 0])
    J = position @ random_covariance(rng, 6) @ position
    P = steady_state_covariance_from_information(process.A, process.Q, J, method)
    scaled = steady_state_covariance_from_information(process.A, process.Q * metres**2, J / metres**2, method)
    assert difference(scaled, P * metres**2) < AGREES
    more = steady_state_covariance_from_information(process.A, process.Q, J + 0.1 * position, method)
    assert np.linalg.eigvalsh(P - more)[0] > -AGREES * np.linalg.norm(P)


def test_information_adds_over_cameras_as_eq_5_stacks_them():
    H, R = (M[0] for M in camera_like(RandomWalk(), 1))
    cameras = [slice(2 * k, 2 * k + 2) for k in range(4)]
    total = sum(measurement_information(H[k], R[k, k]) for k in cameras)
    np.testing.assert_allclose(total, measurement_information(H, R), rtol=1e-12)
    np.testing.assert_allclose(total, H.T @ np.linalg.inv(R) @ H, rtol=1e-9)


def test_singular_transitions_are_for_doubling():
    A, Q, J = np.diag([1.0, 0.0]), np.eye(2), np.eye(2)
    expected = np.diag([(1 + math.sqrt(5)) / 2, 1.0])
    for method in ("auto", "doubling", "scipy"):
        assert difference(steady_state_covariance_from_information(A, Q, J, method), expected) < AGREES
    with pytest.raises(RiccatiError, match="A is singular"):
        steady_state_covariance_from_information(A, Q, J, "eigenstructure")


def test_modes_that_decay_need_no_measurement():
    """A = ½ without information keeps q / (1 − ¼)."""
    for method in METHODS:
        P = steady_state_covariance_from_information(np.diag([1.0, 0.5]), np.eye(2), np.diag([0.5, 0.0]), method)
        np.testing.assert_allclose(P, np.diag([2.0, 4 / 3]), atol=AGREES)


def two_cameras_in_line_with_the_point(states):
    """Both Jacobians annihilate the common line of sight, up to the rounding of the sum."""
    rng = np.random.default_rng(0)
    sight = rng.normal(size=3)
    J = np.zeros((states, states))
    for _ in range(2):
        H = rng.normal(scale=300.0, size=(2, 3))
        H -= np.outer(H @ sight, sight) / (sight @ sight)
        J[:3, :3] += H.T @ H
    return J


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "process", [RandomWalk(), ConstantVelocity(1.0), ConstantAcceleration(1.0)], ids=lambda p: type(p).__name__
)
def test_unobservable_points_are_named(method, process):
    J = np.zeros((3, 2, process.states, process.states))
    J[..., :3, :3] = 1e6 * np.eye(3)
    J[1, 1] = two_cameras_in_line_with_the_point(process.states)
    J[2, 0] = 0.0
    with pytest.raises(RiccatiError, match=r"2 of 6 .*\(1, 1\): not detectable.*\(2, 0\): not detectable"):
        steady_state_covariance_from_information(process.A, process.Q, J, method)
    P = steady_state_covariance_from_information(process.A, process.Q, J, method, unsolvable="nan")
    solved = np.isfinite(P).all(axis=(-2, -1))
    np.testing.assert_array_equal(solved, [[True, True], [True, False], [False, True]])
    assert np.isnan(P[1, 1]).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "process", [RandomWalk(), ConstantVelocity(1.0), ConstantAcceleration(1.0)], ids=lambda p: type(p).__name__
)
def test_a_point_that_is_never_disturbed_has_no_steady_state(method, process):
    """Without process noise the error falls as 1/√frames for ever; no filter settles."""
    J = np.zeros_like(process.Q)
    J[:3, :3] = np.eye(3)
    with pytest.raises(RiccatiError, match="no steady state for 1 of 1"):
        steady_state_covariance_from_information(process.A, 0 * process.Q, J, method)


@pytest.mark.parametrize("method", ["eigenstructure", "doubling", "scipy"])
@settings(max_examples=25, deadline=None)
@given(log_q=st.floats(-40, -12), seed=st.integers(0, 1000))
def test_never_wrong_without_saying_so(method, log_q, seed):
    """Filters that take 10⁶ to 10²⁰ frames to settle: a result is right to 1e-5, or it is refused."""
    J = random_covariance(np.random.default_rng(seed), 3)
    Q = 10**log_q * np.eye(3)
    reference = steady_state_covariance_from_information(np.eye(3), Q, J)
    try:
        P = steady_state_covariance_from_information(np.eye(3), Q, J, method)
    except RiccatiError:
        assume(log_q < -13)
    else:
        assert difference(P, reference) < 1e-5


I3 = np.eye(3)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((I3[:2], I3, I3, I3), ShapeError, r"A has shape \(2, 3\)"),
        ((I3, np.eye(2), I3, I3), ShapeError, r"Q has shape \(2, 2\); allowed: \(\.\.\., 3, 3\)"),
        ((I3, I3, np.ones((4, 2)), np.eye(4)), ShapeError, r"J has shape|H has shape"),
        ((I3, I3, I3, np.eye(2)), ShapeError, r"R has shape \(2, 2\); allowed: \(\.\.\., 3, 3\)"),
        ((1.0, I3, I3, I3), ShapeError, r"A has shape \(\)"),
        ((np.ones((2, 1, 1)) * I3, np.ones((3, 1, 1)) * I3, I3, I3), ShapeError, r"A \(2, 3, 3\), Q \(3, 3, 3\)"),
        ((I3, I3, I3, np.diag([1.0, -2, 1])), RangeError, r"R has the eigenvalue -2"),
        ((I3, I3, I3, np.zeros((3, 3))), RangeError, r"R has the eigenvalue 0"),
        ((I3, np.diag([1.0, -3, 1]), I3, I3), RangeError, r"Q has the eigenvalue -3"),
        ((I3, I3 + np.eye(3, k=1), I3, I3), RangeError, r"Q differs from its transpose by 1"),
        ((I3, I3, I3, I3 + np.eye(3, k=1) / 4), RangeError, r"R differs from its transpose by 0.25"),
        ((I3 * np.nan, I3, I3, I3), RangeError, r"A\[0, 0\] = nan"),
        ((I3, I3, np.full((3, 3), np.inf), I3), RangeError, r"H\[0, 0\] = "),
        ((I3, I3, I3, I3, "fast"), RangeError, r"method = 'fast'; allowed: auto, axes, eigenstructure"),
    ],
)
def test_wrong_arguments_are_refused_with_what_is_allowed(arguments, error, message):
    with pytest.raises(error, match=message) as caught:
        steady_state_covariance(*arguments)
    assert isinstance(caught.value, PSSError)
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize("method", METHODS)
def test_negative_or_lopsided_information_is_refused(method):
    with pytest.raises(RangeError, match="J has the eigenvalue -1"):
        steady_state_covariance_from_information(I3, I3, np.diag([1.0, 2, -1]), method)
    with pytest.raises(RangeError, match="J differs from its transpose by 1"):
        steady_state_covariance_from_information(I3, I3, I3 + np.eye(3, k=1), method)


def test_posterior_and_residual_refuse_what_is_no_covariance():
    with pytest.raises(RangeError, match="P has the eigenvalue -1"):
        posterior_covariance(-I3, I3)
    with pytest.raises(RangeError, match="P has the eigenvalue -1"):
        riccati_residual(I3, I3, I3, -I3)
    with pytest.raises(ShapeError, match=r"J has shape \(2, 2\)"):
        posterior_covariance(I3, np.eye(2))
