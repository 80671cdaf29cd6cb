"""A textbook Kalman filter, simulated from (A, Q, H, R), makes the errors that P∞ and P⁺∞ promise.

The filter here knows nothing of pss.riccati.solve: it starts ignorant, propagates its own covariance, and computes its
own gain in each frame. Only the errors it makes in the end are compared.
"""

import numpy as np
import pytest
import scipy.stats

from pss import ConstantAcceleration, ConstantVelocity, LinearProcess, RandomWalk
from pss.riccati.solve import measurement_information, posterior_covariance, steady_state_covariance
from tests.helpers.riccati_systems import camera_like, difference

RUNS = 2000
# Probability that a right covariance is refused, over all tests of this file together; the seeds are fixed.
OUTSIDE_BAND = 0.01
TESTS = 8
# The filter's own covariance after settling against the solved one, in standard deviations: e^(−2 · 12) is left.
SETTLED = 1e-9
TIME_CONSTANTS = 12
# An error of P that the band must notice with 2,000 runs: this share of all variances.
NOTICED = 0.2

WALKING_CURVE = LinearProcess(
    np.block([[np.eye(3), np.eye(3) / 30], [np.zeros((3, 3)), np.diag([0.9, 0.9, 0.5])]]),
    np.kron(np.array([[1e-6, 0], [0, 1e-3]]), np.diag([1.0, 2.0, 0.3])),
)
MODELS = [RandomWalk(), ConstantVelocity(1.0), ConstantAcceleration(50.0), WALKING_CURVE]


def likelihood_ratio(errors, covariance):
    """Statistic of "the errors (N, n) are N(0, covariance)" against any covariance, chi-squared with n(n + 1)/2.

    −2 ln λ = N (tr W − ln det W − n) of the whitened second moment W, with Bartlett's factor, which takes the mean from
    its value for finite N to that of chi-squared up to 1/N² (Muirhead, Aspects of Multivariate Statistical Theory, 8).
    """
    runs, n = errors.shape
    white = np.linalg.solve(np.linalg.cholesky(covariance), errors.T)
    eigenvalues = np.linalg.eigvalsh(white @ white.T / runs)
    bartlett = 1 - (2 * n + 1 - 2 / (n + 1)) / (6 * runs)
    return bartlett * runs * (eigenvalues - np.log(eigenvalues) - 1).sum()


def band(n):
    """What the statistic exceeds in one of a hundred repetitions of all tests (Bonferroni)."""
    return scipy.stats.chi2.ppf(1 - OUTSIDE_BAND / TESTS, n * (n + 1) // 2)


def simulate(A, Q, H, R, rng):
    """Prior and posterior errors of `RUNS` filters in their last frame, and the covariance they believe in."""
    n, m = len(A), len(R)
    root_q, root_r = np.linalg.cholesky(Q + 1e-300 * np.eye(n)), np.linalg.cholesky(R)
    P = 1e4 * Q + 1e-4 * np.eye(n)
    truth = rng.normal(size=(RUNS, n)) @ np.linalg.cholesky(P).T
    estimate = np.zeros((RUNS, n))
    contraction, frames = np.eye(n), 0
    while np.linalg.norm(contraction, 2) > 1e-3 * np.exp(-TIME_CONSTANTS) or frames < TIME_CONSTANTS:
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        prior = truth - estimate
        z = truth @ H.T + rng.normal(size=(RUNS, m)) @ root_r.T
        estimate = estimate + (z - estimate @ H.T) @ K.T
        posterior, P_prior = truth - estimate, P
        closed = np.eye(n) - K @ H
        P = A @ (closed @ P @ closed.T + K @ R @ K.T) @ A.T + Q  # Joseph's form
        contraction = A @ closed @ contraction
        truth = truth @ A.T + rng.normal(size=(RUNS, n)) @ root_q.T
        estimate = estimate @ A.T
        frames += 1
        assert frames < 10_000
    return prior, posterior, P_prior


@pytest.mark.parametrize("process", MODELS, ids=lambda p: type(p).__name__)
def test_simulated_errors_have_the_predicted_covariances(process):
    H, R = (M[0] for M in camera_like(process, 1))
    prior_errors, posterior_errors, believed = simulate(
        process.A, process.Q, H, R, np.random.default_rng((7, process.states))
    )
    P = steady_state_covariance(process.A, process.Q, H, R)
    updated = posterior_covariance(P, measurement_information(H, R))
    assert difference(P, believed) < SETTLED
    n = process.states
    assert likelihood_ratio(prior_errors, P) < band(n)
    assert likelihood_ratio(posterior_errors, updated) < band(n)
    # The band is narrow enough to notice both a wrong size and one for the other.
    for wrong in (P * (1 + NOTICED), P / (1 + NOTICED), updated):
        assert likelihood_ratio(prior_errors, wrong) > band(n)


def test_the_statistic_is_chi_squared_where_the_covariance_is_right():
    """Mean and variance of 400 repetitions of 2,000 draws in six dimensions, within four standard errors."""
    rng, repetitions, n = np.random.default_rng(11), 400, 6
    C = np.diag([1e-6, 1.0, 1e3, 1.0, 1.0, 2.0])
    drawn = [likelihood_ratio(rng.normal(size=(RUNS, n)) * np.sqrt(np.diag(C)), C) for _ in range(repetitions)]
    degrees = n * (n + 1) // 2
    assert abs(np.mean(drawn) - degrees) < 4 * np.sqrt(2 * degrees / repetitions)
    # Variance of a sample variance of chi-squared: kurtosis 3 + 12/k.
    assert abs(np.var(drawn) / (2 * degrees) - 1) < 4 * np.sqrt((2 + 12 / degrees) / repetitions)
