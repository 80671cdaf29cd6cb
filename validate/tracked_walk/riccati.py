"""The metric's prediction of a walk: the Riccati recursion along its frames, not the steady state of any of them.

In a walk the cameras are set anew in each frame and points come into sight and go, so that no steady state is reached.
What the filter's covariance is to be held against is the recursion from the first frame on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import RangeError, ShapeError
from pss.hints import Floats
from pss.processes.process import ProcessModel, require_positive
from pss.processes.steady_state import SMALLEST_INFORMATION_RATIO, of_state
from pss.riccati.solve import posterior_covariance, require_semidefinite
from validate.tracked_walk.filter import STATES

__all__ = ["riccati_along"]


def riccati_along(
    information: ArrayLike, process: ProcessModel, start_speed_sigma_m_per_s: float = 1.5
) -> tuple[Floats, Floats]:
    """m², covariances of the position before and after each frame's update, (K, N, 3, 3) each, without any detection.

    A point starts in the first frame whose information fixes all three coordinates, as two views do, with
    C = (Σ HᵀR⁻¹H)⁻¹ and velocity 0; before that it is nan, and so is its prior in that frame. From then on
    P⁻ = A P⁺ Aᵀ + Q and P⁺ = (P⁻⁻¹ + Λ)⁻¹; a point out of sight coasts.

    Args:
        information: 1/m², Λ = Σ HᵀR⁻¹H over the views that see the point in each frame, (K, N, 3, 3), zero where none
            does: `pss.evaluate(…).information` of the frame's cameras and points.
        process: A and Q of one frame, for all points or for each; the states are the position, or position and
            velocity.
        start_speed_sigma_m_per_s: m/s along each axis, of the velocity at the start.

    Raises:
        ShapeError: `information` is not (K, N, 3, 3).
        RangeError: it is not finite or not positive semidefinite; a process with other states; a speed not above 0.
    """
    known = np.asarray(information, dtype=float)
    if known.ndim != 4 or known.shape[2:] != (3, 3):
        raise ShapeError(f"information has shape {known.shape}; allowed is (K, N, 3, 3)")
    if not np.isfinite(known).all():
        raise RangeError(f"information holds {known[~np.isfinite(known)][0]}; allowed: finite values in 1/m²")
    require_semidefinite("information", known)
    if process.states not in STATES:
        raise RangeError(f"process has {process.states} states; allowed: 3, the position, or 6, with its velocity")
    require_positive("start_speed_sigma_m_per_s", start_speed_sigma_m_per_s, "m/s")
    frames, points, states = *known.shape[:2], process.states
    # Of a point that has not started yet, any matrix will do.
    A, Q = (np.broadcast_to(matrix, (points, states, states)) for matrix in (process.A, process.Q))
    state, started = np.tile(np.eye(states), (points, 1, 1)), np.zeros(points, dtype=bool)
    prior, posterior = np.full((2, frames, points, 3, 3), np.nan)
    eigenvalues = np.linalg.eigvalsh(known)
    solid = eigenvalues[..., 0] > SMALLEST_INFORMATION_RATIO * eigenvalues.sum(axis=-1)
    for frame in range(frames):
        state[started] = A[started] @ state[started] @ A[started].mT + Q[started]
        prior[frame, started] = state[started, :3, :3]
        state[started] = posterior_covariance(state[started], of_state(known[frame, started], states))
        starting = solid[frame] & ~started
        state[starting] = start_speed_sigma_m_per_s**2 * np.eye(states)
        state[starting, :3, :3] = np.linalg.inv(known[frame, starting])
        started |= starting
        posterior[frame, started] = state[started, :3, :3]
    return prior, posterior
