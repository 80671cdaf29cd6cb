"""The numerical methods for Eq. 4, called by `pss.riccati.solve`, which checks arguments and judges the result.

The methods raise no errors: each returns P and, for each reason of failure, a mask of the failed systems. The matrices
are those of `pss.riccati.solve`: A, Q and the information J = HᵀR⁻¹H, all (..., n, n) or a flat batch (N, n, n).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from pss.hints import Bools, Floats
from pss.riccati.observability import RANK_TOLERANCE, undetectable

__all__ = [
    "EPS",
    "RANK_TOLERANCE",
    "REFUSED",
    "REFUSE_ABOVE",
    "Failures",
    "Floats",
    "doubling",
    "eigenstructure",
    "failure_message",
    "posterior",
    "random_walk",
    "refined",
    "residuals",
    "scipy_loop",
    "symmetric_root",
    "transpose",
    "undetectable",
]

# For each reason of failure, a mask of the failed systems of the batch.
Failures = dict[str, Bools]

EPS = float(np.finfo(np.float64).eps)
# Once F^(2^k) is this small, the next increment of P, quadratic in it, is below eps.
POWER_TOLERANCE = 1e-8
# Eigenvalues of Ψ this close to the unit circle cannot be assigned to its inside or outside.
UNIT_CIRCLE_WIDTH = 1e-12
# 2^60 frames: slower convergence has a time constant that double precision cannot distinguish from infinity.
MAX_DOUBLINGS = 60
NO_CONVERGENCE = "no convergence: a mode that does not decay is not excited, or hardly measured"
# Relative error of P, as estimated from the residual, above which the result of a method is refined.
REFINE_ABOVE = 1e-13
MAX_NEWTON_STEPS = 3
# Relative error of P, as estimated from the residual, above which the result of any method is refused.
REFUSE_ABOVE = 1e-6
REFUSED = f"the residual of Eq. 4 allows a relative error above {REFUSE_ABOVE:g}"
INDICES_SHOWN = 5
# An iteration that reaches this value has diverged; its square is still finite in double precision.
DIVERGED = 1e100


def random_walk(q: Floats, information: Floats, axes: Floats) -> tuple[Floats, Failures]:
    """Closed form for A = I and Q = qI: Eq. 4 becomes P² = q(P + J⁻¹), one quadratic for each eigenvector of J.

    Args:
        q: variance of a step, (...)
        information: eigenvalues of J, ascending, (..., n)
        axes: its eigenvectors, in columns, (..., n, n)
    """
    not_detectable = information[..., 0] <= RANK_TOLERANCE * information[..., -1]
    safe = np.where(not_detectable[..., None], 1.0, information)
    # p = q/2 + √(q²/4 + q·c), c = 1/j: no difference of large numbers; hypot keeps q² from underflowing.
    half = q[..., None] / 2
    eigenvalues = half + np.hypot(half, np.sqrt(q[..., None] / safe))
    P = _symmetric((axes * eigenvalues[..., None, :]) @ transpose(axes))
    return P, {"not detectable": not_detectable, "a mode that does not decay is not excited": q <= 0}


def eigenstructure(A: Floats, Q: Floats, J: Floats) -> tuple[Floats, Failures]:
    """MacFarlane–Potter–Fath, flat batch (N, n, n). LAPACK balances Ψ itself, so that no scaling is needed here."""
    n = A.shape[-1]
    singular_values = np.linalg.svd(A, compute_uv=False)
    singular = singular_values[:, -1] <= RANK_TOLERANCE * singular_values[:, 0]
    inverse_transpose = transpose(_solve_or_nan(np.where(singular[:, None, None], np.eye(n), A), np.eye(n)))
    QA = Q @ inverse_transpose
    AJ = inverse_transpose @ J
    hamiltonian = np.block([[A + Q @ AJ, QA], [AJ, inverse_transpose]])  # Eq. 6
    usable = np.isfinite(hamiltonian).all(axis=(-2, -1))
    values, vectors = np.linalg.eig(np.where(usable[:, None, None], hamiltonian, np.eye(2 * n)))
    # Eq. 7: eigenvalues come in pairs λ, 1/λ; those outside the unit circle belong to the stabilising solution.
    outside = np.argsort(-np.abs(values), axis=-1)[:, :n]
    chosen = np.take_along_axis(vectors, outside[:, None, :], axis=-1)
    on_circle = np.abs(np.take_along_axis(values, outside[:, -1:], axis=-1))[:, 0] <= 1 + UNIT_CIRCLE_WIDTH
    B, C = chosen[:, :n], chosen[:, n:]
    P = _symmetric(np.real(transpose(_solve_or_nan(transpose(C), transpose(B)))))  # Eq. 8
    return P, {
        "A is singular, which this method cannot take (doubling can)": singular,
        "an eigenvalue lies on the unit circle: a mode that does not decay is not excited": on_circle,
    }


def refined(A: Floats, Q: Floats, J: Floats, P: Floats) -> tuple[Floats, Floats]:
    """P (N, n, n) after the Newton steps that reduce its error, and the residual's bound on its relative error (N,).

    A slow filter has pairs λ, 1/λ close to the unit circle, whose vectors mix: with a time constant of 10⁶ frames,
    eigenvectors and SciPy's Schur vectors are accurate to six digits at most. Newton's method recovers the others.
    """
    residual, error = residuals(A, Q, J, P)
    for _ in range(MAX_NEWTON_STEPS):
        rough = np.flatnonzero((error > REFINE_ABOVE) & (residual > EPS))
        if rough.size == 0:
            break
        better_P = _newton_step(A[rough], Q[rough], J[rough], P[rough])
        better_residual, better_error = residuals(A[rough], Q[rough], J[rough], better_P)
        better = better_error < error[rough]
        changed = rough[better]
        P[changed], residual[changed], error[changed] = better_P[better], better_residual[better], better_error[better]
        if not better.any():
            break
    return P, error


def _newton_step(A: Floats, Q: Floats, J: Floats, P: Floats) -> Floats:
    """One step of Newton's method on Eq. 4 (Kleinman): the covariance of a filter with the gain of the given P."""
    updated = posterior(P, J)
    F = A - A @ updated @ J  # the transition of the filter's error
    X = Q + A @ updated @ J @ updated @ transpose(A)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(MAX_DOUBLINGS):
            X = X + F @ X @ transpose(F)
            F = F @ F
            if np.all(~(_size_in_units_of(X, F) > POWER_TOLERANCE)):
                break
    return _symmetric(X)


def doubling(A: Floats, Q: Floats, J: Floats) -> tuple[Floats, Failures]:
    """Structure-preserving doubling, flat batch (N, n, n): step k yields the filter's covariance after 2^k frames.

    Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time algebraic Riccati equations",
    International Journal of Control 77 (2004); applied to the dual problem, so that the transition is transposed.
    """
    n = A.shape[-1]
    F, G, P = transpose(A).copy(), J.copy(), Q.copy()
    active = np.arange(A.shape[0])
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(MAX_DOUBLINGS):
            f, g, p = F[active], G[active], P[active]
            solved = _solve_or_nan(np.eye(n) + g @ p, np.concatenate([f, g], axis=-1))
            P[active] = _symmetric(p + transpose(f) @ p @ solved[..., :n])
            G[active] = _symmetric(g + f @ solved[..., n:] @ transpose(f))
            F[active] = f @ solved[..., :n]
            size = _size_in_units_of(P[active], transpose(F[active]))
            active = active[size > POWER_TOLERANCE]  # also drops nan, which cannot recover
            if active.size == 0:
                break
    failed = np.zeros(A.shape[0], dtype=np.bool_)
    failed[active] = True
    failed |= ~np.isfinite(P).all(axis=(-2, -1))
    return P, {NO_CONVERGENCE: failed}


def scipy_loop(A: Floats, Q: Floats, H: Floats, R: Floats) -> tuple[Floats, Failures]:
    """SciPy's solver of the control problem, whose dual is the filter (A and H transposed). P is (N, n, n)."""
    P = np.full_like(Q, np.nan)
    failed = np.zeros(A.shape[0], dtype=np.bool_)
    for i in range(A.shape[0]):
        try:
            P[i] = scipy.linalg.solve_discrete_are(A[i].T, H[i].T, Q[i], R[i])
        except (np.linalg.LinAlgError, ValueError):
            failed[i] = True
            continue
        # SciPy returns P = 0 for Q = 0 too, although no filter converges to it.
        innovation = H[i] @ P[i] @ H[i].T + R[i]
        closed_loop = A[i] - A[i] @ P[i] @ H[i].T @ np.linalg.solve(innovation, H[i])
        failed[i] = np.abs(np.linalg.eigvals(closed_loop)).max() >= 1
    return _symmetric(P), {"SciPy finds no stabilising solution": failed}


def posterior(P: Floats, J: Floats) -> Floats:
    """P⁺ = L (I + Lᵀ J L)⁻¹ Lᵀ with P = L Lᵀ, (..., n, n): the inverted matrix has no eigenvalue below one."""
    root: Floats
    try:
        root = np.linalg.cholesky(P).astype(np.float64)
    except np.linalg.LinAlgError:
        root = transpose(symmetric_root(P))
    inner: Floats = np.eye(P.shape[-1]) + transpose(root) @ J @ root
    return _symmetric(root @ np.linalg.solve(inner, transpose(root)))


def symmetric_root(M: Floats) -> Floats:
    """A matrix S (..., n, n) with SᵀS = M for a semidefinite M; at unit diagonal, for the precision of small states."""
    deviations = _deviations(M)
    eigenvalues, axes = np.linalg.eigh(M / (deviations[..., :, None] * deviations[..., None, :]))
    root = np.sqrt(np.maximum(eigenvalues, 0.0))[..., :, None] * np.swapaxes(axes, -1, -2) * deviations[..., None, :]
    return np.asarray(root, dtype=np.float64)


def residuals(A: Floats, Q: Floats, J: Floats, P: Floats) -> tuple[Floats, Floats]:
    """Relative residual of Eq. 4, (...,), and the bound on P's relative error by it, (...,).

    A residual of ε times the noise W of one frame changes P = Σ Fᵏ W Fᵀᵏ by ε relatively. For a slow filter W is small
    relative to P, so that a small residual alone is weak evidence: below the rounding of P it may be zero by chance,
    and counts as that rounding.
    """
    finite = np.asarray((np.abs(P) < DIVERGED).all(axis=(-2, -1)))  # false for nan
    P = np.where(finite[..., None, None], P, np.eye(P.shape[-1]))
    updated = posterior(P, J)
    difference = A @ updated @ transpose(A) + Q - P  # Eq. 4
    entering = Q + A @ updated @ J @ updated @ transpose(A)
    deviations = _deviations(P)
    units = deviations[..., :, None] * deviations[..., None, :]
    off, whole, fresh = (np.linalg.norm(M / units, axis=(-2, -1)) for M in (difference, P, entering))
    # P = 0 has the residual 0 only if Q = 0.
    least = np.maximum(off, EPS * whole)
    residual, error = (
        np.where(x > 0, x / np.where(M > 0, M, x + 1e-300), 0.0) for x, M in ((off, whole), (least, fresh))
    )
    return np.where(finite, residual, np.nan), np.where(finite, error, np.nan)


def failure_message(failed: Bools, failures: Failures, error: Floats) -> str:
    """Message with the first failing systems and the first reason for each; for a residual, with the error of P."""
    lines = []
    for index in np.argwhere(failed)[:INDICES_SHOWN]:
        at = tuple(int(i) for i in index)
        reason = next(reason for reason, mask in failures.items() if np.broadcast_to(mask, failed.shape)[at])
        if reason == REFUSED:
            reason += f", {np.broadcast_to(error, failed.shape)[at]:.1e}"
        lines.append(f"batch index {at}: {reason}" if at else reason)
    rest = "; …" if failed.sum() > INDICES_SHOWN else ""
    return f"no steady state for {failed.sum()} of {failed.size} systems: " + "; ".join(lines) + rest


def _size_in_units_of(P: Floats, F: Floats) -> Floats:
    """Norm of a transition in units of P's standard deviations, (N,), which does not depend on the states' units."""
    deviations = _deviations(P)
    return np.asarray(np.linalg.norm(F * deviations[..., None, :] / deviations[..., :, None], axis=(-2, -1)))


def _deviations(P: Floats) -> Floats:
    """Standard deviations, (..., n), with one in place of zero."""
    variances = np.diagonal(P, axis1=-2, axis2=-1)
    return np.sqrt(np.where(variances > 0, variances, 1.0))


def _solve_or_nan(A: NDArray[Any], B: NDArray[Any]) -> NDArray[Any]:
    """A⁻¹B, nan for the singular matrices of the batch, for which NumPy would reject the whole batch."""
    try:
        return np.linalg.solve(A, B)
    except np.linalg.LinAlgError:
        return np.stack(
            [_one_solution_or_nan(a, b) for a, b in zip(A, np.broadcast_to(B, A.shape[:1] + B.shape[-2:]), strict=True)]
        )


def _one_solution_or_nan(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    try:
        return np.linalg.solve(a, b)
    except np.linalg.LinAlgError:
        return np.full_like(b, np.nan)


def transpose(M: Floats) -> Floats:
    """Mᵀ of each matrix, (..., n, m)."""
    return np.swapaxes(M, -1, -2)


def _symmetric(M: Floats) -> Floats:
    return (M + transpose(M)) / 2
