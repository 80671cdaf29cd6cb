"""The process models of Eq. 2, by a second route: Van Loan's matrix exponential and the simulated motion itself."""

import dataclasses

import numpy as np
import pytest
import scipy.linalg
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from pss import ConstantAcceleration, ConstantVelocity, LinearProcess, NonlinearProcess, PerPoint, RandomWalk
from pss.errors import PSSError, RangeError, ShapeError
from pss.processes.process import ProcessModel
from pss.riccati.solve import steady_state_covariance_from_information

# Relative, entry by entry: polynomials of at most five powers against a matrix exponential of moderate norm.
SAME_TO_ROUNDING = 1e-12
# Five-point differences of smooth transitions of states up to about 10: eps^(4/5) and a few powers of the step.
DIFFERENCES = 1e-11
# Probability outside the band of a chi-squared test; the seeds are fixed, so that a pass stays a pass.
OUTSIDE_BAND = 1e-3

INTEGRATORS = [(ConstantVelocity, 2), (ConstantAcceleration, 3)]
MODELS = [RandomWalk(), ConstantVelocity(0.3), ConstantAcceleration(0.3)]
time_steps = st.floats(1e-3, 2.0)
densities = st.floats(1e-6, 1e3)


def by_van_loan(order: int, density: float, time_step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """A and Q of a chain of integrators on three axes, from one matrix exponential (Van Loan 1978)."""
    n = 3 * order
    drift = np.kron(np.eye(order, k=1), np.eye(3))
    diffusion = np.zeros((n, n))
    diffusion[-3:, -3:] = density * np.eye(3)
    exponential = scipy.linalg.expm(np.block([[-drift, diffusion], [np.zeros((n, n)), drift.T]]) * time_step_s)
    transition = exponential[n:, n:].T
    return transition, transition @ exponential[:n, n:]


@pytest.mark.parametrize(("model", "order"), INTEGRATORS)
@settings(max_examples=30, deadline=None)
@given(density=densities, time_step_s=time_steps)
def test_closed_form_integrals_agree_with_van_loan(model, order, density, time_step_s):
    process = model(density, time_step_s)
    transition, noise = by_van_loan(order, density, time_step_s)
    # Entries span many powers of the time step: each is compared in the unit of its own row and column.
    spread = np.sqrt(np.diag(noise))
    np.testing.assert_allclose(
        process.A * spread / spread[:, None], transition * spread / spread[:, None], atol=SAME_TO_ROUNDING
    )
    np.testing.assert_allclose(
        process.Q / np.outer(spread, spread), noise / np.outer(spread, spread), atol=SAME_TO_ROUNDING
    )


@pytest.mark.parametrize(("model", "order"), INTEGRATORS)
@settings(max_examples=20, deadline=None)
@given(density=densities, time_step_s=time_steps)
def test_two_half_steps_are_one_step(model, order, density, time_step_s):
    whole, half = model(density, time_step_s), model(density, time_step_s / 2)
    spread = np.sqrt(np.diag(whole.Q))
    np.testing.assert_allclose(half.A @ half.A, whole.A, rtol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(
        (half.A @ half.Q @ half.A.T + half.Q) / np.outer(spread, spread),
        whole.Q / np.outer(spread, spread),
        atol=SAME_TO_ROUNDING,
    )


@pytest.mark.parametrize(("model", "order"), INTEGRATORS)
def test_motion_simulated_in_fine_steps_has_the_covariance_q(model, order):
    """White noise held over 200 slices of a frame; the slicing itself costs 1/200² of Q, below the band."""
    rng, runs, slices, density, time_step_s = np.random.default_rng(5), 4000, 200, 0.7, 0.4
    slice_s = time_step_s / slices
    state = np.zeros((runs, order, 3))
    for _ in range(slices):
        highest = rng.normal(scale=np.sqrt(density / slice_s), size=(runs, 1, 3))
        inputs = np.concatenate([state[:, 1:], highest], axis=1)
        # exact for an input held constant over the slice, to second order
        state = state + slice_s * inputs
        state[:, :-1] += slice_s**2 / 2 * inputs[:, 1:]
    flat = state.reshape(runs, -1)
    assert_has_covariance(flat, model(density, time_step_s).Q)


def assert_has_covariance(samples: np.ndarray, covariance: np.ndarray) -> None:
    """Two-sided chi-squared tests of the size (whitened squares) and of the shape (whitened second moments)."""
    runs, n = samples.shape
    white = np.linalg.solve(np.linalg.cholesky(covariance), samples.T)
    low, high = scipy.stats.chi2.ppf([OUTSIDE_BAND / 2, 1 - OUTSIDE_BAND / 2], runs * n)
    assert low < (white**2).sum() < high
    moment = white @ white.T / runs - np.eye(n)
    assert runs * (moment**2).sum() / 2 < scipy.stats.chi2.ppf(1 - OUTSIDE_BAND, n * (n + 1) // 2)


def test_random_walk_noise_belongs_to_a_step_and_defaults_to_one_millimetre():
    np.testing.assert_array_equal(RandomWalk().Q, 1e-6 * np.eye(3))
    np.testing.assert_array_equal(RandomWalk(step_std_m=2e-3, time_step_s=1.0).Q, 4e-6 * np.eye(3))
    np.testing.assert_array_equal(RandomWalk().A, np.eye(3))


def test_one_axis_by_hand():
    """Convention: position x, y, z, then velocity x, y, z, then acceleration x, y, z."""
    velocity = ConstantVelocity(acceleration_density_m2_s3=6.0, time_step_s=2.0)
    np.testing.assert_allclose(velocity.A[[0, 0, 3], [0, 3, 3]], [1, 2, 1])
    np.testing.assert_allclose(velocity.Q[[0, 0, 3], [0, 3, 3]], [16, 12, 12])
    acceleration = ConstantAcceleration(jerk_density_m2_s5=20.0, time_step_s=1.0)
    np.testing.assert_allclose(acceleration.A[0, [0, 3, 6]], [1, 1, 0.5])
    np.testing.assert_allclose(acceleration.Q[0, [0, 3, 6]], [1, 2.5, 20 / 6])


@pytest.mark.parametrize("process", MODELS, ids=lambda model: type(model).__name__)
def test_a_model_is_a_read_only_value(process: ProcessModel):
    n = process.states
    assert process.A.shape == process.Q.shape == (n, n)
    assert np.linalg.eigvalsh(process.Q)[0] > 0
    for matrix in (process.A, process.Q):
        with pytest.raises(ValueError, match="read-only"):
            matrix[0, 0] = 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        process.time_step_s = 1.0
    assert process == dataclasses.replace(process)
    assert hash(process) == hash(dataclasses.replace(process))


def test_states_are_3_6_9():
    assert [process.states for process in MODELS] == [3, 6, 9]


@pytest.mark.parametrize("model", [RandomWalk, ConstantVelocity, ConstantAcceleration])
@pytest.mark.parametrize("value", [0.0, -1.5, np.nan, np.inf, "1", None, True])
@pytest.mark.parametrize("position", [0, 1])
def test_wrong_values_are_refused_with_the_value_and_what_is_allowed(model, value, position):
    arguments = [1.0, 1.0]
    arguments[position] = value
    name = [field.name for field in dataclasses.fields(model)][position]
    with pytest.raises(RangeError, match=f"{name} = .*> 0 in ") as caught:
        model(*arguments)
    assert repr(value) in str(caught.value)


def turn(states, time_step_s=1 / 30):
    """A walking person on a curve: x, y, z, vx, vy, vz and the turn rate ω about z, rad/s; exact over a step."""
    x, y, z, vx, vy, vz, rate = states.T
    angle = rate * time_step_s
    across, along = np.sin(angle) / rate, (1 - np.cos(angle)) / rate
    c, s = np.cos(angle), np.sin(angle)
    moved = [x + across * vx - along * vy, y + along * vx + across * vy, z + time_step_s * vz]
    return np.stack([*moved, c * vx - s * vy, s * vx + c * vy, vz, rate], axis=1)


def turn_by_hand(states, time_step_s=1 / 30):
    """Its Jacobian, (N, 7, 7): for the position and velocity that of a known rate, and a column for the rate."""
    vx, vy, rate = states[:, 3], states[:, 4], states[:, 6]
    angle = rate * time_step_s
    c, s = np.cos(angle), np.sin(angle)
    A = np.zeros((len(states), 7, 7))
    A[:] = np.eye(7)
    A[:, 2, 5] = time_step_s
    A[:, 0, 3], A[:, 0, 4], A[:, 1, 3], A[:, 1, 4] = s / rate, -(1 - c) / rate, (1 - c) / rate, s / rate
    A[:, 3, 3], A[:, 3, 4], A[:, 4, 3], A[:, 4, 4] = c, -s, s, c
    across, along = (angle * c - s) / rate**2, (angle * s - (1 - c)) / rate**2
    A[:, 0, 6], A[:, 1, 6] = across * vx - along * vy, along * vx + across * vy
    A[:, 3, 6], A[:, 4, 6] = -time_step_s * (s * vx + c * vy), time_step_s * (c * vx - s * vy)
    return A


def walking(count=20):
    rng = np.random.default_rng(8)
    states = rng.uniform(-3, 3, size=(count, 7))
    states[:, 6] = rng.uniform(0.2, 2, size=count)
    return states


TURN_NOISE = np.diag([1e-8, 1e-8, 1e-8, 1e-3, 1e-3, 1e-3, 1e-4])


@pytest.mark.parametrize("jacobian", [None, turn_by_hand], ids=["differences", "analytic"])
def test_a_curve_is_linearised_about_each_state(jacobian):
    process = NonlinearProcess(turn, TURN_NOISE, jacobian).linearised(walking())
    assert process.states == 7
    assert process.points == 20
    np.testing.assert_allclose(process.A, turn_by_hand(walking()), atol=DIFFERENCES)
    np.testing.assert_array_equal(process.Q, TURN_NOISE)


def test_differences_keep_their_digits_far_from_the_origin():
    """A state of 10⁴ m takes steps in proportion; x² has the derivative 2x."""
    process = NonlinearProcess(lambda x: x**2, np.eye(3)).linearised([[1e4, -2.0, 0.0]])
    np.testing.assert_allclose(process.A[0], np.diag([2e4, -4.0, 0.0]), rtol=DIFFERENCES, atol=DIFFERENCES)


def test_a_known_turn_rate_is_the_matrix_exponential():
    """With ω known, x' = exp(Ω Δt) x is linear: all states have the same A."""
    drift = np.zeros((6, 6))
    drift[:3, 3:] = np.eye(3)
    drift[3, 4], drift[4, 3] = -0.7, 0.7
    states = walking()[:, :6]
    process = NonlinearProcess(
        lambda x: turn(np.column_stack([x, np.full(len(x), 0.7)]))[:, :6], TURN_NOISE[:6, :6]
    ).linearised(states)
    expected = scipy.linalg.expm(drift / 30)
    np.testing.assert_allclose(process.A, np.broadcast_to(expected, (20, 6, 6)), atol=DIFFERENCES)


def test_each_point_of_a_linear_process_has_its_own_steady_state():
    """What the batch gives is what each gives alone, and `at` picks them."""
    process = NonlinearProcess(turn, TURN_NOISE).linearised(walking())
    J = np.diag([1e5, 3e4, 1e5, 0, 0, 0, 0])
    P = steady_state_covariance_from_information(process.A, process.Q, J)
    for indices in ([4], [7, 2, 7], np.arange(20) % 3 == 0):
        chosen = process.at(indices)
        np.testing.assert_array_equal(chosen.A, process.A[indices])
        np.testing.assert_array_equal(chosen.Q, process.Q)
        alone = steady_state_covariance_from_information(chosen.A, chosen.Q, J)
        np.testing.assert_allclose(alone, P[indices], rtol=1e-9)
    shared = LinearProcess(np.eye(3), np.eye(3))
    assert shared.points is None
    assert shared.at([0, 5]) is shared


def test_a_linear_process_is_a_read_only_copy():
    A = np.eye(4)
    process = LinearProcess(A, np.stack([np.eye(4)] * 2), time_step_s=0.1)
    A[0, 0] = 9
    assert process.A[0, 0] == 1
    assert (process.states, process.points, process.time_step_s) == (4, 2, 0.1)
    for matrix in (process.A, process.Q):
        with pytest.raises(ValueError, match="read-only"):
            matrix[..., 0, 0] = 2


I3 = np.eye(3)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((I3[:2], I3), ShapeError, r"A has shape \(2, 3\); allowed: \(n, n\) or \(N, n, n\)"),
        ((np.eye(2), np.eye(2)), ShapeError, r"A has shape \(2, 2\).*n ≥ 3"),
        ((I3, np.eye(4)), ShapeError, r"Q has shape \(4, 4\); allowed beside A \(3, 3\)"),
        ((np.stack([I3] * 2), np.stack([I3] * 3)), ShapeError, r"Q has shape \(3, 3, 3\)"),
        ((np.ones((1, 1, 3, 3)), I3), ShapeError, "A has shape"),
        ((np.full((3, 3), np.inf), I3), RangeError, "A has the value"),
        ((I3, I3 * np.nan), RangeError, "Q has the value nan"),
        ((I3, np.diag([1.0, 1, -2])), RangeError, "Q has the eigenvalue -2"),
        ((I3, I3 + np.eye(3, k=1)), RangeError, "Q differs from its transpose by 1"),
        ((I3, I3, 0.0), RangeError, "time_step_s = 0.0"),
    ],
)
def test_wrong_linear_processes_are_refused(arguments, error, message):
    with pytest.raises(error, match=message) as caught:
        LinearProcess(*arguments)
    assert isinstance(caught.value, PSSError)


def test_wrong_nonlinear_processes_are_refused():
    with pytest.raises(RangeError, match="Q has the eigenvalue -1"):
        NonlinearProcess(turn, np.diag([1.0, 1, -1]))
    process = NonlinearProcess(turn, TURN_NOISE)
    for states in (np.zeros(7), np.zeros((2, 6)), 0.0):
        with pytest.raises(ShapeError, match="states has shape"):
            process.linearised(states)
    with pytest.raises(RangeError, match="states has the value nan"):
        process.linearised(np.full((1, 7), np.nan))
    with pytest.raises(ShapeError, match=r"transition\(states\) has shape \(1, 3\); allowed: \(1, 7\)"):
        NonlinearProcess(lambda x: x[:, :3], TURN_NOISE).linearised(walking(1))
    with pytest.raises(ShapeError, match=r"jacobian\(states\) has shape \(7, 7\); allowed: \(1, 7, 7\)"):
        NonlinearProcess(turn, TURN_NOISE, lambda x: np.eye(7)).linearised(walking(1))


def test_points_of_one_evaluation_may_move_by_different_models():
    wall, curve = RandomWalk(1e-5), NonlinearProcess(turn, TURN_NOISE).linearised(walking(5))
    mixed = PerPoint([wall, ConstantVelocity(1.0), curve], [2, 0, 0, 2, 0])
    groups = list(mixed.groups())
    assert len(groups) == 2  # nothing moves at constant velocity
    assert groups[0][0] is wall
    np.testing.assert_array_equal(groups[0][1], [1, 2, 4])
    np.testing.assert_array_equal(groups[1][1], [0, 3])
    np.testing.assert_array_equal(groups[1][0].A, curve.A[[0, 3]])
    assert not mixed.index.flags.writeable
    assert list(PerPoint([wall], []).groups()) == []


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (([], [0]), ShapeError, "0 models"),
        (([RandomWalk()], [[0]]), ShapeError, r"index \(1, 1\)"),
        (([RandomWalk()], [0.5]), RangeError, "index has the type float64; allowed: integers"),
        (([RandomWalk()], [0, 1]), RangeError, "index has the value 1; allowed: 0 to 0"),
        (([RandomWalk()], [-1]), RangeError, "index has the value -1"),
        (([LinearProcess(np.stack([I3] * 2), I3)], [0, 0, 0]), ShapeError, r"models\[0\].* N = 3"),
    ],
)
def test_wrong_assignments_are_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        PerPoint(*arguments)
