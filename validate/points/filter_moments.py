"""Second moments of the linearised filter in the steady state, solved for instead of simulated.

`validate.points.static_filter` simulates the filter frame by frame. Its error is linear in what drives it, so that its
second moment in the steady state is the solution of a linear system, with nothing left to chance and no wait for a slow
filter:

    e⁺ = F e⁻ + u,     e⁻ ← A e⁺ − w,     F = I − P⁺Λ,  u = P⁺ y,  w ~ N(0, Q),
    X⁺ = E[F X⁻ Fᵀ] + E[F m uᵀ] + E[u mᵀ Fᵀ] + E[u uᵀ],     X⁻ = A X⁺ Aᵀ + Q,     m = A (E[F] m + E[u])

with means over the trials of a point, each as likely. One thing is simplified: P⁻ is P∞ of the trials' mean information
in every frame, where the simulated filter carries its own, which follows the trials that were drawn. P⁺ has each
trial's own Λ in both.

A slow filter averages the same few trials over and over, so that their own mean error stays as if it were a bias: of
T trials it adds up to C/T, where C is a single frame's covariance. For a random walk of variance q this is below a
tenth of P⁻ ≈ √(qC) while q > (10/T)² C.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.errors import ShapeError
from pss.hints import Floats
from pss.processes.process import ProcessModel
from pss.riccati.solve import steady_state_covariance_from_information
from validate.points.static_filter import embedded, mean_over

__all__ = ["steady_moments"]


def steady_moments(
    information: ArrayLike, pull: ArrayLike, usable: ArrayLike, process: ProcessModel
) -> tuple[Floats, Floats]:
    """m², second moments of the a-priori and the a-posteriori position error, (N, 3, 3) each.

    Args:
        information: 1/m², Λ of each trial, (T, N, 3, 3) (`validate.points.static_filter.trial_terms`).
        pull: 1/m, y of each trial, (T, N, 3).
        usable: (T, N), the trials that a frame may be.
        process: A and Q; the first three states are the position.

    Returns:
        nan where a point has no usable trial, or its mean information no steady state.

    Raises:
        ShapeError: the arrays do not fit each other.
    """
    known, forces, drawable = (np.asarray(a) for a in (information, pull, usable))
    trials, points = drawable.shape if drawable.ndim == 2 else (0, 0)
    if known.shape != (trials, points, 3, 3) or forces.shape != (trials, points, 3):
        raise ShapeError(
            f"information {known.shape}, pull {forces.shape}, usable {drawable.shape}; "
            "allowed: (T, N, 3, 3), (T, N, 3), (T, N)"
        )
    moments = np.full((2, points, 3, 3), np.nan)
    item = np.flatnonzero(drawable.any(axis=0))
    if item.size:
        mean = embedded(mean_over(known, drawable)[item], process.states)
        prior = steady_state_covariance_from_information(process.A, process.Q, mean, unsolvable="nan")
        solved = np.isfinite(prior).all(axis=(-2, -1))
        item, prior = item[solved], prior[solved]
    if item.size:
        moments[:, item] = _solved(known[:, item], forces[:, item], drawable[:, item], prior, process)
    return moments[0], moments[1]


def _solved(
    information: Floats, pull: Floats, drawable: NDArray[np.bool_], prior: Floats, process: ProcessModel
) -> tuple[Floats, Floats]:
    """`steady_moments` of V points that have a P∞, (V, n, n)."""
    A, Q, n = process.A, process.Q, process.states
    # In units of P∞'s own deviations m and m/s weigh alike in the linear system.
    unit = np.sqrt(np.diagonal(prior, axis1=-2, axis2=-1))
    A_of = A * unit[:, None, :] / unit[:, :, None]
    Q_of = Q / (unit[:, :, None] * unit[:, None, :])
    position = prior[:, :3, :3]
    gain = np.linalg.solve(np.eye(3) + information @ position, information)  # G = (I + ΛP⁻)⁻¹Λ, (T, V, 3, 3)
    to_state = (prior[:, :, :3] - prior[:, :, :3] @ (gain @ position)) / unit[:, :, None]  # P⁺[:, :3], (T, V, n, 3)
    step = np.broadcast_to(np.eye(n), (*to_state.shape[:2], n, n)).copy()
    step[..., :3] -= (to_state @ information) * unit[:, None, :3]
    kick = (to_state @ pull[..., None])[..., 0]
    weight = drawable / drawable.sum(axis=0)

    def mean(values: Floats) -> Floats:
        return np.asarray(np.einsum("tv,tv...->v...", weight, values))

    # E[F ⊗ F] and E[F ⊗ u] as products over the trials; long products are quicker than many small ones.
    rows = (np.sqrt(weight)[..., None] * step.reshape(*step.shape[:2], n * n)).transpose(1, 2, 0)
    pairs = (rows @ rows.mT).reshape(-1, n, n, n, n)  # [v, i, k, j, l] = E[F_ik F_jl]
    kicks = (np.sqrt(weight)[..., None] * kick).transpose(1, 2, 0)
    crossed = (rows @ kicks.mT).reshape(-1, n, n, n)  # [v, i, k, j] = E[F_ik u_j]
    bias = np.linalg.solve(np.eye(n) - A_of @ mean(step), A_of @ mean(kick)[..., None])[..., 0]
    forced = np.einsum("vikj,vk->vij", crossed, bias)
    forced = forced + forced.mT + kicks @ kicks.mT
    updated = pairs.transpose(0, 1, 3, 2, 4).reshape(-1, n * n, n * n)  # rows (i, j), columns (k, l)
    moved = np.einsum("vik,vjl->vijkl", A_of, A_of).reshape(-1, n * n, n * n)
    driven = (A_of @ forced @ A_of.mT + Q_of).reshape(-1, n * n, 1)
    before = np.linalg.solve(np.eye(n * n) - moved @ updated, driven)
    after = (updated @ before).reshape(-1, n, n) + forced
    before = before.reshape(-1, n, n)
    scale = unit[:, :3, None] * unit[:, None, :3]
    first, second = (scale * (M + M.mT)[:, :3, :3] / 2 for M in (before, after))
    return first, second
