"""The filter of the rendered walk: each marker is followed by its own extended Kalman filter, from pixels alone.

In each frame, with cameras that are set differently in each: predict by the process model, throw out each view whose
pixel is too far from where the filter expects it, and update with the views that are left, one view being enough. A
detection has the weight of its own covariance, as estimated from its image; neither the truth nor a noise model under
test is known here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss import PTZCamera, RangeError, ShapeError
from pss.hints import Bools, Floats, Integers
from pss.processes.process import ProcessModel
from validate.tracked_walk.marker_filters import PIXEL_COORDINATES, MarkerFilters, WalkFiltering

__all__ = ["WalkTracks", "track_walk"]


# Position, and position with velocity: what the covariance at the start is defined for.
STATES = (3, 6)


@dataclass(frozen=True, eq=False)
class WalkTracks:
    """Tracks of N markers through K frames of T trials, each trial a run of its own; nan where there is no track.

    A lost track coasts on, or follows what passes its gate, and stays in the arrays with the covariance that it has.

    Attributes:
        prior_m: m, (K, T, N, 3), predicted from the frame before; nan in the frame in which a track starts.
        posterior_m: m, (K, T, N, 3), after the frame's update; the triangulated point in the frame of a start.
        prior_covariance_m2, posterior_covariance_m2: m², (K, T, N, 3, 3), of the positions, the filter's own.
        used: (K, C, T, N), detections that updated or started a track.
        gated: (K, C, T, N), detections that the gate threw out, or at a start the triangulation's own test.
        lost: (K, T, N), the last `lost_after_frames` frames or more, this one among them, did not confirm the track.
        losses: (T, N), how often a track was lost.
        reacquired: (T, N), how often a lost one was confirmed again, or started anew.
    """

    prior_m: Floats
    posterior_m: Floats
    prior_covariance_m2: Floats
    posterior_covariance_m2: Floats
    used: Bools
    gated: Bools
    lost: Bools
    losses: Integers
    reacquired: Integers


def track_walk(
    cameras: Sequence[Sequence[PTZCamera]],
    pixels: ArrayLike,
    covariance: ArrayLike,
    process: ProcessModel,
    settings: WalkFiltering | None = None,
) -> WalkTracks:
    """Track every marker of every trial through the frames of a walk.

    A track starts where two views or more detect the marker and triangulation, which has a test of its own, lets two
    stand: with the covariance (Σ HᵀR⁻¹H)⁻¹ and velocity 0. From then on each view is gated by its own innovation,
    against H P⁻ Hᵀ + R. Views are not tested against each other: while P⁻ is large, as in the frame after a start, a
    false detection near the marker can pass.

    A track that has gone astray, by a false detection or by a motion that the process has no room for, rejects the
    views that are right. It often keeps one that is nearly in line with its error, and then drifts along that ray with
    the others rejected for good. So an update alone does not confirm a track: most of the views must pass. A lost track
    is found again when a frame confirms it or, failing that, when two views agree, which start it anew.

    Args:
        cameras: the settings of C cameras in each of K frames.
        pixels: px, (K, C, T, N, 2), nan where a marker was not detected.
        covariance: px², (K, C, T, N, 2, 2), of each detection, from its own image; anything where not detected.
        process: A and Q of one frame, for all markers or for each; the states are the position, or position and
            velocity.
        settings: None for `WalkFiltering()`.

    Raises:
        ShapeError: the arrays do not fit each other, the cameras or the process.
        RangeError: the covariance of a detection is not positive definite; a process with other states.
    """
    settings = WalkFiltering() if settings is None else settings
    measured, noise = _checked(cameras, pixels, covariance, process)
    noise = noise + settings.measurement_floor_px**2 * np.eye(PIXEL_COORDINATES)
    frames, views, trials, points = measured.shape[:-1]
    run = MarkerFilters(process, settings, trials, points)
    position = np.full((2, frames, trials, points, 3), np.nan)
    claimed = np.full((2, frames, trials, points, 3, 3), np.nan)
    used, gated = np.zeros((2, frames, views, trials, points), dtype=bool)
    lost = np.zeros((frames, trials, points), dtype=bool)
    for frame, settings_now in enumerate(cameras):
        run.predict()
        position[0, frame], claimed[0, frame] = run.claimed
        used[frame], gated[frame] = run.take(settings_now, measured[frame], noise[frame])
        position[1, frame], claimed[1, frame] = run.claimed
        lost[frame] = run.lost
    return WalkTracks(
        prior_m=position[0],
        posterior_m=position[1],
        prior_covariance_m2=claimed[0],
        posterior_covariance_m2=claimed[1],
        used=used,
        gated=gated,
        lost=lost,
        losses=run.losses,
        reacquired=run.reacquired,
    )


def _checked(
    cameras: Sequence[Sequence[PTZCamera]], pixels: ArrayLike, covariance: ArrayLike, process: ProcessModel
) -> tuple[Floats, Floats]:
    """Pixels and covariances as arrays, if their frames and the process fit; each frame is checked as it is taken."""
    measured, noise = np.asarray(pixels, dtype=float), np.asarray(covariance, dtype=float)
    if measured.ndim != 5 or measured.shape[-1] != PIXEL_COORDINATES or len(measured) != len(cameras):
        raise ShapeError(f"pixels has shape {measured.shape}; allowed is ({len(cameras)}, C, T, N, 2), a row a frame")
    if noise.shape != (*measured.shape, PIXEL_COORDINATES):
        raise ShapeError(f"covariance has shape {noise.shape}; allowed beside these pixels is {(*measured.shape, 2)}")
    for frame, of_frame in enumerate(cameras):
        if len(of_frame) != measured.shape[1]:
            raise ShapeError(f"frame {frame} has {len(of_frame)} cameras; allowed beside pixels: {measured.shape[1]}")
    if process.states not in STATES:
        raise RangeError(f"process has {process.states} states; allowed: 3, the position, or 6, with its velocity")
    allowed = {(process.states,) * 2, (measured.shape[3], process.states, process.states)}
    if {process.A.shape, process.Q.shape} - allowed:
        raise ShapeError(f"process has A {process.A.shape}, Q {process.Q.shape}; allowed: {sorted(allowed, key=len)}")
    return measured, noise
