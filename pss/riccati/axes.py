"""The steady state of Eq. 4 for three equal axes with position measurements only: many small filters.

With A = A₀ ⊗ I₃, Q = Q₀ ⊗ I₃ and J = diag(J₃, 0), the eigenvectors of J₃ = U diag(j) Uᵀ turn Eq. 4 into three filters
of d = 1, 2 or 3 states (position and its derivatives), each with one scalar measurement of information jᵢ. Block (a, b)
of P is then U diag(p_ab(j)) Uᵀ. Since p₀₀ decreases with j, λmax of the position block is p₀₀ at the smallest j.

All filters are solved at once, entry by entry: a matrix is a tuple of rows of arrays (M,), a symmetric one the tuple of
its upper triangle, row by row. All sums add equal units, so that neither units nor their ratios cost precision.
"""

from __future__ import annotations

import functools
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import RangeError, RiccatiError, ShapeError
from pss.hints import Bools
from pss.inputs import numbers
from pss.riccati.methods import (
    EPS,
    MAX_DOUBLINGS,
    NO_CONVERGENCE,
    POWER_TOLERANCE,
    RANK_TOLERANCE,
    REFUSE_ABOVE,
    REFUSED,
    Failures,
    Floats,
    failure_message,
)
from pss.riccati.observability import undetectable
from pss.riccati.small_matrices import AT, Entry, Matrix, Symmetric, adjugate, congruent, cross, full, product, trace

__all__ = ["axis_blocks", "axis_covariance", "position_variance", "three_axes"]

Unsolvable = Literal["raise", "nan"]

AXES = 3
# Cofactors are written out for 2 × 2 and 3 × 3.
MOST_STATES = 3
# The three copies of a number in A or Q may have been rounded differently.
SAME_ENTRY = 4 * EPS
# This number of filters keeps NumPy's overhead per call small, and the arrays of one doubling in the cache.
CHUNK = 8192
MODELS_REMEMBERED = 64
# A filter that settles within 2³ frames is rare; testing for it takes a fifth of a doubling.
FEWEST_DOUBLINGS = 3


def axis_blocks(A: Floats, Q: Floats, J: Floats) -> tuple[Floats, Floats] | None:
    """A₀ and Q₀, (d, d), if A and Q, (n, n), are A₀ ⊗ I₃ and Q₀ ⊗ I₃ and J, (..., n, n), measures positions only.

    None otherwise: A or Q have batch axes or another structure. Entries off the axes must be exactly zero.
    """
    n = A.shape[-1]
    if A.ndim != 2 or Q.ndim != 2 or n % AXES or n > AXES * MOST_STATES:
        return None
    small = A[::AXES, ::AXES], Q[::AXES, ::AXES]
    for M, block in zip((A, Q), small, strict=True):
        spread = np.kron(block, np.eye(AXES))
        if (np.abs(M - spread) > SAME_ENTRY * np.abs(spread)).any():
            return None
    if J[..., AXES:, :].any() or J[..., :AXES, AXES:].any():
        return None
    return small[0].copy(), small[1].copy()


def axis_covariance(
    A0: ArrayLike, Q0: ArrayLike, information: ArrayLike, *, unsolvable: Unsolvable = "raise"
) -> Floats:
    """A-priori covariance of one axis's steady state (Eq. 4), (M, d, d), for M scalar measurements of position.

    Args:
        A0: transition of position and its derivatives, (d, d), d = 1, 2, 3
        Q0: covariance of the process noise of one time step, (d, d), positive semidefinite
        information: 1/m², j = 1/r for a measurement of variance r, (M,), ≥ 0
        unsolvable: ``raise``, or ``nan`` for the filters without a steady state

    Raises:
        ShapeError: the shapes of the arrays do not match
        RangeError: a value is not finite, information negative, Q0 not symmetric positive semidefinite
        RiccatiError: a filter has no steady state that double precision can reach; the message names the indices
    """
    P = _axis(A0, Q0, information, unsolvable)
    rows = next(rows for rows in AT.values() if rows[-1][-1] == len(P) - 1)
    return np.stack([np.stack([P[k] for k in row], axis=-1) for row in rows], axis=-2)


def position_variance(
    A0: ArrayLike, Q0: ArrayLike, information: ArrayLike, *, unsolvable: Unsolvable = "raise"
) -> Floats:
    """m², a-priori variance of the position in the steady state, (M,): entry (0, 0) of `axis_covariance`.

    At the smallest eigenvalue of J₃ (`pss.riccati.observability.smallest_eigenvalue_3x3`) it is σ∞² of Eq. 9.

    Raises:
        ShapeError, RangeError, RiccatiError: as `axis_covariance`
    """
    return _axis(A0, Q0, information, unsolvable)[0]


def three_axes(A0: Floats, Q0: Floats, information: Floats, axes: Floats) -> tuple[Floats, Failures, Floats]:
    """P (N, 3d, 3d), the failures, and the bound on P's relative error by its residual (N,), from J₃'s eigenstructure.

    Args:
        A0, Q0: as in `axis_covariance`
        information: eigenvalues of J₃, (3, N)
        axes: its eigenvectors, (3, 3, N), by component and eigenvalue
    """
    blind = _blind(A0, information, information.max(axis=0))
    P, failures, error = _solve(A0, Q0, np.where(blind, 1.0, np.maximum(information, 0.0)).ravel())
    per_point = {reason: np.asarray(mask.reshape(AXES, -1).any(axis=0)) for reason, mask in failures.items()}
    failed: Failures = {"not detectable": np.asarray(blind.any(axis=0))} | per_point
    return _spread([p.reshape(AXES, -1) for p in P], axes), failed, error.reshape(AXES, -1).max(axis=0)


def _axis(A0: ArrayLike, Q0: ArrayLike, information: ArrayLike, unsolvable: Unsolvable) -> list[Floats]:
    """Upper triangle of P, (M,) each, for `axis_covariance`."""
    A, Q, j = _checked(A0, Q0, information)
    blind = _blind(A, j, np.zeros_like(j))
    P, failures, error = _solve(A, Q, np.where(blind, 1.0, j))
    failures = {"not detectable": blind} | failures
    failed: Bools = np.logical_or.reduce(list(failures.values()))
    if failed.any():
        if unsolvable == "raise":
            raise RiccatiError(failure_message(failed, failures, error))
        for entry in P:
            entry[failed] = np.nan
    return P


def _checked(A0: ArrayLike, Q0: ArrayLike, information: ArrayLike) -> tuple[Floats, Floats, Floats]:
    A, Q, j = (numbers(M, name) for name, M in (("A0", A0), ("Q0", Q0), ("information", information)))
    if A.ndim != 2 or A.shape[0] != A.shape[1] or len(A) not in AT:
        raise ShapeError(f"A0 has shape {A.shape}; allowed: (1, 1), (2, 2) or (3, 3)")
    if Q.shape != A.shape or j.ndim != 1:
        raise ShapeError(f"Q0 {Q.shape} and information {j.shape}; allowed beside A0 {A.shape}: {A.shape} and (M,)")
    for name, M in (("A0", A), ("Q0", Q), ("information", j)):
        if not np.isfinite(M).all():
            raise RangeError(f"{name} has the value {M[~np.isfinite(M)][0]}; allowed: finite values")
    eigenvalues = np.linalg.eigvalsh(Q)
    if (np.abs(Q - Q.T) > SAME_ENTRY * np.abs(Q)).any() or eigenvalues[0] < -RANK_TOLERANCE * eigenvalues[-1]:
        raise RangeError(f"Q0 = {Q.tolist()}; allowed: symmetric positive semidefinite")
    if (j < 0).any():
        raise RangeError(f"information has the value {j.min():.3g}; allowed: ≥ 0")
    return A, Q, j


def _blind(A: Floats, information: Floats, largest: Floats) -> Bools:
    """Whether a filter leaves a lasting mode of A unmeasured; same shape as `information`."""
    measured = information > RANK_TOLERANCE * largest
    d = len(A)
    blind = np.full(information.shape, _undetectable(d, A.tobytes(), measured=True))
    if not measured.all():
        blind[~measured] = _undetectable(d, A.tobytes(), measured=False)
    return blind


@functools.lru_cache(maxsize=MODELS_REMEMBERED)
def _undetectable(d: int, A: bytes, *, measured: bool) -> bool:
    """Whether a lasting mode of A is unmeasured, with or without position measurements; cached for each A."""
    position = np.zeros((d, d))
    position[0, 0] = measured
    return bool(undetectable(np.frombuffer(A).reshape(d, d), position))


def _solve(A: Floats, Q: Floats, information: Floats) -> tuple[list[Floats], Failures, Floats]:
    """Upper triangle of P, the failures, and the bound on the relative error by the residual; all (M,)."""
    if len(A) == 1:
        return _one_state(float(A[0, 0]), float(Q[0, 0]), information)
    entries = len(A) * (len(A) + 1) // 2
    P, error = np.empty((entries, len(information))), np.empty(len(information))
    converged = np.empty(len(information), dtype=np.bool_)
    with np.errstate(all="ignore"):  # divergence is detected by the residual, nan or large
        for start in range(0, len(information), CHUNK):
            part = slice(start, start + CHUNK)
            solution, converged[part] = _doubling(A, Q, information[part])
            error[part] = _error(A, Q, information[part], solution)
            P[:, part] = solution
    return list(P), {NO_CONVERGENCE: ~converged, REFUSED: ~(error <= REFUSE_ABOVE)}, error


def _one_state(a: float, q: float, j: Floats) -> tuple[list[Floats], Failures, Floats]:
    """Closed form for one state: j p² − 2b p − q = 0 with 2b = jq + a² − 1, its root computed without a difference."""
    b = (j * q + (a - 1) * (a + 1)) / 2
    root = np.hypot(b, np.sqrt(j * q))
    with np.errstate(divide="ignore", invalid="ignore"):
        p = np.where(b >= 0, (b + root) / j, q / (root - b))
    failed = ~np.isfinite(p) | ((abs(a) >= 1) & ~(j * p > 0))
    return [p], {NO_CONVERGENCE: failed}, np.zeros_like(p)


def _doubling(A: Floats, Q: Floats, j: Floats) -> tuple[Symmetric, Bools]:
    """Structure-preserving doubling as in `pss.riccati.methods.doubling`, and where it converged, (M,)."""
    d = len(A)
    upper = [(i, k) for i in range(d) for k in range(i, d)]
    # The first doubling written out, with G of rank one and scalars otherwise: (I + GQ)⁻¹ = I − weight · e (Qe)ᵀ.
    weight, twice, moved, whole = j / (1 + j * Q[0, 0]), A @ A, A @ Q[:, 0], A @ Q @ A.T + Q
    F: Matrix = tuple(tuple(twice[k, i] - weight * (A[0, i] * moved[k]) for k in range(d)) for i in range(d))
    P: Symmetric = tuple(whole[i, k] - weight * (moved[i] * moved[k]) for i, k in upper)
    G: Symmetric = tuple(weight * (A[0, i] * A[0, k]) + (j if k == 0 else 0.0) for i, k in upper)
    converged = np.zeros(len(j), dtype=np.bool_)
    for doubling in range(1, MAX_DOUBLINGS):
        F, G, P = (_double_2 if d == 2 else _double_3)(F, G, P)
        if doubling < FEWEST_DOUBLINGS:
            continue
        deviations = [_deviation(P[AT[d][i][i]]) for i in range(d)]
        size = np.zeros_like(j)
        for i in range(d):
            for k in range(d):
                np.maximum(size, np.abs(F[i][k]) * (deviations[i] / deviations[k]), out=size)
        converged = size <= POWER_TOLERANCE
        if (converged | np.isnan(size)).all():
            break
    return P, converged


def _double_2(F: Matrix, G: Symmetric, P: Symmetric) -> tuple[Matrix, Symmetric, Symmetric]:
    """One doubling for d = 2, with I + GP = W: sums of positive terms where cofactors of W itself would cancel."""
    adj_G, adj_P = (G[2], -G[1], G[0]), (P[2], -P[1], P[0])
    det_G, det_P = G[0] * G[2] - G[1] * G[1], P[0] * P[2] - P[1] * P[1]
    scale = 1 / (1 + trace(G, P) + det_G * det_P)  # 1 / det W
    updated = tuple((p + det_P * g) * scale for p, g in zip(P, adj_G, strict=True))  # (P⁻¹ + G)⁻¹
    dual = tuple((g + det_G * p) * scale for g, p in zip(G, adj_P, strict=True))  # (G⁻¹ + P)⁻¹
    rows = product(full(adj_P), full(adj_G))
    inverse = tuple(tuple((x + (i == k)) * scale for k, x in enumerate(row)) for i, row in enumerate(rows))
    return _doubled(F, G, P, inverse, updated, dual)


def _double_3(F: Matrix, G: Symmetric, P: Symmetric) -> tuple[Matrix, Symmetric, Symmetric]:
    """One doubling for d = 3: adj(X + Y) = adj X + X × Y + adj Y with the mixed cofactors of `cross`."""
    adj_G, adj_P = adjugate(G), adjugate(P)
    det_G, det_P = (S[0] * T[0] + S[1] * T[1] + S[2] * T[2] for S, T in ((G, adj_G), (P, adj_P)))
    one_more = 1 + trace(G, P)
    scale = 1 / (one_more + trace(adj_G, adj_P) + det_G * det_P)  # 1 / det W
    updated = tuple((p + x + det_P * g) * scale for p, x, g in zip(P, cross(adj_P, G), adj_G, strict=True))
    dual = tuple((g + x + det_G * p) * scale for g, x, p in zip(G, cross(adj_G, P), adj_P, strict=True))
    GP, cofactors = product(full(G), full(P)), product(full(adj_P), full(adj_G))
    inverse = tuple(
        tuple(((one_more - x if i == k else -x) + y) * scale for k, (x, y) in enumerate(zip(*rows, strict=True)))
        for i, rows in enumerate(zip(GP, cofactors, strict=True))
    )
    return _doubled(F, G, P, inverse, updated, dual)


def _doubled(
    F: Matrix, G: Symmetric, P: Symmetric, inverse: Matrix, updated: Symmetric, dual: Symmetric
) -> tuple[Matrix, Symmetric, Symmetric]:
    """F W⁻¹ F, G + F (G⁻¹ + P)⁻¹ Fᵀ and P + Fᵀ (P⁻¹ + G)⁻¹ F."""
    more_G, more_P = congruent(F, dual), congruent(tuple(zip(*F, strict=True)), updated)
    return (
        product(product(F, inverse), F),
        tuple(g + x for g, x in zip(G, more_G, strict=True)),
        tuple(p + x for p, x in zip(P, more_P, strict=True)),
    )


def _error(A: Floats, Q: Floats, j: Floats, P: Symmetric) -> Floats:
    """Bound on the relative error of P by the residual of Eq. 4, (M,), as in `pss.riccati.methods.residuals`."""
    d = len(A)
    upper = [(i, k) for i in range(d) for k in range(i, d)]
    shrink = j / (1 + j * P[0])
    seen = P[:d]  # the covariances with the position
    updated = tuple(p - shrink * seen[i] * seen[k] for p, (i, k) in zip(P, upper, strict=True))
    transition = tuple(tuple(map(float, row)) for row in A)
    moved = congruent(transition, updated)
    gain = [sum(a * s for a, s in zip(row, seen, strict=True) if a) for row in transition]  # A P e, of which P⁺J's is
    deviations = [_deviation(P[AT[d][i][i]]) for i in range(d)]
    off, whole, fresh = np.zeros_like(j), np.zeros_like(j), np.zeros_like(j)
    for index, (i, k) in enumerate(upper):
        weight = (1 if i == k else 2) / (deviations[i] * deviations[k]) ** 2
        off += weight * (moved[index] + Q[i, k] - P[index]) ** 2
        whole += weight * P[index] ** 2
        # A P⁺ J P⁺ Aᵀ with P⁺e = Pe / (1 + jp)
        fresh += weight * (Q[i, k] + gain[i] * gain[k] * shrink / (1 + j * P[0])) ** 2
    least = np.maximum(off, EPS**2 * whole)
    return np.asarray(np.sqrt(least / np.where(fresh > 0, fresh, least + 1e-300)))


def _spread(P: list[Floats], axes: Floats) -> Floats:
    """Blocks U diag(p) Uᵀ, (N, 3d, 3d), of the upper triangle's entries p (3, N) and U (3, 3, N)."""
    d = max(size for size in AT if size * (size + 1) // 2 <= len(P))
    whole = np.empty((axes.shape[-1], AXES * d, AXES * d))
    for r in range(AXES):
        for s in range(r, AXES):
            shares = axes[r] * axes[s]
            for a in range(d):
                for b in range(a, d):
                    p = P[AT[d][a][b]]
                    value = shares[0] * p[0] + shares[1] * p[1] + shares[2] * p[2]
                    row, column = AXES * a + r, AXES * b + s
                    whole[:, row, column] = whole[:, column, row] = value
                    row, column = AXES * a + s, AXES * b + r
                    whole[:, row, column] = whole[:, column, row] = value
    return whole


def _deviation(variance: Entry) -> Floats:
    """Standard deviation, one in place of zero."""
    return np.sqrt(np.where(np.asarray(variance) > 0, variance, 1.0))
