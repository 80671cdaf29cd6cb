"""The process models of Eq. 2, by a second route: Van Loan's matrix exponential and the simulated motion itself."""

import dataclasses

import numpy as np
import pytest
import scipy.linalg
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from pss.errors import RangeError
from pss.process import ConstantAcceleration, ConstantVelocity, ProcessModel, RandomWalk

# Relative, entry by entry: polynomials of at most five powers against a matrix exponential of moderate norm.
SAME_TO_ROUNDING = 1e-12
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
