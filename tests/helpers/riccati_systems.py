"""Systems to filter, their solutions by SciPy and in 60 digits, and how exact the project's own must be."""

from __future__ import annotations

import mpmath
import numpy as np
import scipy.linalg

METHODS = ["auto", "eigenstructure", "doubling", "scipy"]  # and "axes": test_riccati_axes.py
EPS = float(np.finfo(np.float64).eps)
# All differences of covariances are in units of the standard deviations of the reference.
# Two double precision algorithms on systems whose filters settle within a few hundred frames lose at most six digits.
AGREES = 1e-9
# Results of a few roundings.
SAME_TO_ROUNDING = 1e-13
# A few hundred roundings in nine states; SciPy's balanced QZ leaves the largest, 2e-11 where J is nearly singular.
RESIDUAL = 1e-10
# A stable algorithm solves a system with entries off by some eps; that moves P by κ eps, with κ the number of frames
# over which the filter forgets, or the spread of J's eigenvalues. The factor covers the sums over n entries.
ROUNDINGS = 300
# Each entry of the product PJ is a sum over up to nine states, and each of its roundings is eps times the largest term:
# in units of P's standard deviations, the largest eigenvalue of J. Where J is nearly singular, P is large along the
# direction that J hardly sees, and these terms cancel in the residual. Over 60 orientations of the axes and all methods
# at most 2.9 roundings are measured.
PRODUCT_ROUNDINGS = 9
DIGITS = 60


def transpose(M):
    return np.swapaxes(M, -1, -2)


def difference(P, reference):
    """Largest difference of two (batches of) covariances, in units of the reference's standard deviations."""
    deviations = np.sqrt(np.diagonal(reference, axis1=-2, axis2=-1))
    return np.abs((P - reference) / deviations[..., :, None] / deviations[..., None, :]).max()


def random_orthogonal(rng, n, batch=()):
    return np.linalg.qr(rng.normal(size=(*batch, n, n)))[0]


def random_covariance(rng, n, batch=(), decades=1.0):
    axes = random_orthogonal(rng, n, batch)
    return (axes * 10 ** rng.uniform(-decades, decades, size=(*batch, 1, n))) @ transpose(axes)


def random_systems(n, count, seed=11):
    """Random stable and unstable A, full Q and R, fewer measurements than states."""
    rng = np.random.default_rng(seed + n)
    A = rng.normal(size=(count, n, n)) * 1.2 / np.sqrt(n)
    H = rng.normal(size=(count, 2 * n // 3, n))
    return A, random_covariance(rng, n, (count,)), H, random_covariance(rng, 2 * n // 3, (count,))


def camera_like(process, count, seed=3):
    """Four cameras' Jacobians of about 200 px/m on the position, pixel variances of about 1."""
    rng = np.random.default_rng(seed)
    H = np.zeros((count, 8, process.states))
    H[..., :3] = rng.normal(scale=200.0, size=(count, 8, 3))
    R = np.zeros((count, 8, 8))
    for camera in range(4):
        block = slice(2 * camera, 2 * camera + 2)
        R[:, block, block] = random_covariance(rng, 2, (count,), decades=0.5)
    return H, R


def by_scipy(A, Q, H, R):
    return np.stack([scipy.linalg.solve_discrete_are(a.T, h.T, q, r) for a, q, h, r in zip(A, Q, H, R, strict=True)])


def in_sixty_digits(A, Q, J):
    """Doubling in multiple precision: the covariance after 2^k frames from Q, until it stands still to 40 digits."""
    with mpmath.workdps(DIGITS):
        n = len(A)
        F, G, P, identity = mpmath.matrix(A.T), mpmath.matrix(J), mpmath.matrix(Q), mpmath.eye(n)
        for _ in range(200):
            inverse = (identity + G * P) ** -1
            P, G, F, before = P + F.T * P * inverse * F, G + F * inverse * G * F.T, F * inverse * F, P
            if mpmath.mnorm(P - before, "f") < mpmath.mpf(10) ** -40 * mpmath.mnorm(P, "f"):
                return np.array(P.tolist(), dtype=np.float64)
    raise AssertionError("multiple precision doubling did not settle")
