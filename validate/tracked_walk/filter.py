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
import scipy.stats
from numpy.typing import ArrayLike

from pss import PTZCamera, RangeError, ShapeError
from pss.cameras.parameters import Cameras
from pss.cameras.views import Views
from pss.hints import Bools, Floats, Integers
from pss.processes.process import ProcessModel, require_positive
from pss.riccati.covariances import largest_standard_deviation
from validate.points.triangulate import NEAREST_M, VIEWS_TO_TRIANGULATE, detection_weights, triangulate

__all__ = ["WalkFiltering", "WalkTracks", "track_walk"]


POSITION = slice(0, 3)
PIXEL_COORDINATES = 2
# Position, and position with velocity: what the covariance at the start is defined for.
STATES = (3, 6)
# How often a view is linearised anew where the update has put the point. Of an error e at the distance D, a step of
# Gauss and Newton leaves about e²/D: at 5 m the first frame after a start (0.15 m) leaves 5 mm, which is several
# standard deviations, and 4 µm after one more. Of 1 m after coasting, 10 µm are left after the second. It is done in
# all frames alike: no threshold decides, so that a marker's track does not depend on the tracks beside it.
RELINEARISATIONS = 2


@dataclass(frozen=True)
class WalkFiltering:
    """How the markers of a walk are tracked.

    Attributes:
        gate_probability: of a detection that has the filter's and its own covariance to pass, for each view by itself
            (χ² with two degrees of freedom).
        lost_after_frames: frames in a row that did not confirm a track, after which it counts as lost. A frame confirms
            it if more views pass the gate than are thrown out.
        start_speed_sigma_m_per_s: m/s along each axis, of the velocity at a start, which is 0.
        lost_sigma_m: m, √λmax of the predicted position beyond which a track is lost, whatever a view measures: along
            one ray a filter that is linearized about its own estimate soon becomes overconfident. A tenth to a sixth of
            the distance to the cameras, and more than a start's velocity adds in a frame.
        measurement_floor_px: px along each axis, added in squares to the covariance of each detection: what its image
            cannot tell, such as a bias.

    Raises:
        RangeError: a value out of range.
    """

    gate_probability: float = 0.999
    lost_after_frames: int = 5
    start_speed_sigma_m_per_s: float = 1.5
    lost_sigma_m: float = 0.5
    measurement_floor_px: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.gate_probability < 1:
            raise RangeError(f"gate_probability = {self.gate_probability!r}; allowed: above 0 and below 1")
        if not self.lost_after_frames >= 1:
            raise RangeError(f"lost_after_frames = {self.lost_after_frames!r}; allowed: at least 1")
        require_positive("start_speed_sigma_m_per_s", self.start_speed_sigma_m_per_s, "m/s")
        require_positive("lost_sigma_m", self.lost_sigma_m, "m")
        if not 0 <= self.measurement_floor_px < np.inf:
            raise RangeError(f"measurement_floor_px = {self.measurement_floor_px!r}; allowed: 0 or more pixels")


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
    run = _Run(process, settings, trials, points)
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


class _Run:
    """The filters of T × N markers between two frames.

    Attributes:
        tracked: (T, N), there is a track.
        lost, losses, reacquired: (T, N), as in `WalkTracks`, so far.
    """

    def __init__(self, process: ProcessModel, settings: WalkFiltering, trials: int, points: int) -> None:
        self.process, self.settings = process, settings
        self.largest_chi2 = float(scipy.stats.chi2.ppf(settings.gate_probability, PIXEL_COORDINATES))
        self.state = np.full((trials, points, process.states), np.nan)
        self.covariance = np.full((trials, points, process.states, process.states), np.nan)
        self.tracked, self.lost = np.zeros((2, trials, points), dtype=bool)
        self.missed, self.losses, self.reacquired = np.zeros((3, trials, points), dtype=np.int64)

    @property
    def claimed(self) -> tuple[Floats, Floats]:
        """m, positions (T, N, 3), and m², their covariances (T, N, 3, 3); nan without a track."""
        return self.state[..., POSITION], self.covariance[..., POSITION, POSITION]

    def predict(self) -> None:
        """Go on to the next frame."""
        A, Q = self.process.A, self.process.Q
        self.state = (A @ self.state[..., None])[..., 0]
        covariance = A @ self.covariance @ A.mT + Q
        self.covariance = (covariance + covariance.mT) / 2  # rounding must not gather over the frames

    def take(self, cameras: Sequence[PTZCamera], pixels: Floats, noise: Floats) -> tuple[Bools, Bools]:
        """Take a frame's detections.

        Args:
            pixels, noise: px (C, T, N, 2) and px² (C, T, N, 2, 2).

        Returns:
            The detections used, and those thrown out, (C, T, N) each.
        """
        detected, weight = detection_weights(cameras, pixels, noise)
        used, thrown_out = np.zeros((2, *detected.shape), dtype=bool)

        spread = largest_standard_deviation(np.nan_to_num(self.covariance[..., POSITION, POSITION]))
        hopeless = self.tracked & (spread > self.settings.lost_sigma_m)
        rows = self.tracked & ~hopeless & detected.any(axis=0)
        state, covariance, arrays = self.state[rows], self.covariance[rows], Cameras(cameras)
        passed = self._gate(arrays, state, covariance, pixels[:, rows], noise[:, rows]) & detected[:, rows]
        # Where nothing passed, the weights are all zero, and the update changes nothing.
        self.state[rows], self.covariance[rows] = _updated(
            arrays, state, covariance, pixels[:, rows], weight[:, rows] * passed[..., None, None]
        )
        used[:, rows], thrown_out[:, rows] = passed, detected[:, rows] & ~passed

        confirmed = used.sum(axis=0) > thrown_out.sum(axis=0)
        self.reacquired += confirmed & self.lost
        self.missed = np.where(confirmed, 0, self.missed + self.tracked)
        self.missed = np.where(hopeless, np.maximum(self.missed, self.settings.lost_after_frames), self.missed)
        self.losses += self.missed == self.settings.lost_after_frames
        self.lost = self.missed >= self.settings.lost_after_frames

        rows = (~self.tracked | self.lost) & (detected.sum(axis=0) >= VIEWS_TO_TRIANGULATE)
        used[:, rows], disagreeing = self._start(cameras, rows, pixels[:, rows], noise[:, rows])
        thrown_out[:, rows] |= disagreeing
        thrown_out &= ~used
        return used, thrown_out

    def _gate(self, cameras: Cameras, state: Floats, covariance: Floats, pixels: Floats, noise: Floats) -> Bools:
        """Which views (C, S) have an innovation consistent with the covariance of S tracks."""
        residual, jacobian = _linearised(cameras, state[:, POSITION], pixels)
        spread = jacobian @ covariance[:, POSITION, POSITION] @ jacobian.mT + noise
        known = np.asarray(np.isfinite(residual).all(axis=-1))
        residual = np.where(known[..., None], residual, 0.0)[..., None]
        spread = np.where(known[..., None, None], spread, np.eye(PIXEL_COORDINATES))
        chi2 = (residual * np.linalg.solve(spread, residual)).sum(axis=(-2, -1))
        return np.asarray(known & (chi2 <= self.largest_chi2))

    def _start(self, cameras: Sequence[PTZCamera], rows: Bools, pixels: Floats, noise: Floats) -> tuple[Bools, Bools]:
        """Start tracks at `rows` (T, N), S of them, if their views agree; detections used and thrown out, (C, S)."""
        found = triangulate(cameras, pixels[:, None], noise[:, None])
        started = found.views[0] > 0
        place = tuple(index[started] for index in np.nonzero(rows))
        self.state[place], self.covariance[place] = 0.0, 0.0
        self.state[place + (POSITION,)] = found.points_m[0, started]
        self.covariance[place + (POSITION, POSITION)] = found.covariance_m2[0, started]
        for axis in range(3, self.process.states):
            self.covariance[place + (axis, axis)] = self.settings.start_speed_sigma_m_per_s**2
        self.reacquired[place] += self.lost[place]
        self.tracked[place], self.lost[place], self.missed[place] = True, False, 0
        detected = np.asarray(np.isfinite(pixels).all(axis=-1))
        return found.used[:, 0], detected & ~found.used[:, 0] & (found.rejected[0] > 0)


def _linearised(cameras: Cameras, points: Floats, pixels: Floats) -> tuple[Floats, Floats]:
    """At points (S, 3) in m: px, pixel − projection, (C, S, 2), and px/m, H, (C, S, 2, 3).

    The former is nan where nothing was detected or the point is not in front of the camera; the latter is 0 behind it.
    """
    views = Views(cameras, points)
    in_front = views.depth_m > NEAREST_M
    residual = np.asarray(np.where(in_front[..., None], pixels - views.pixels, np.nan))
    return residual, np.where(in_front[..., None, None], views.jacobian, 0.0)


def _updated(
    cameras: Cameras, state: Floats, covariance: Floats, pixels: Floats, weight: Floats
) -> tuple[Floats, Floats]:
    """States (S, n) and covariances (S, n, n) of S tracks after the views with `weight` R⁻¹, 1/px², (C, S, 2, 2).

    Λ = Σ HᵀR⁻¹H and y = Σ HᵀR⁻¹(pixel − projection) are all that the update needs of the views, however many: with G
    the columns of P⁺ that belong to the position, x⁺ = x⁻ + G (y + Λ (x̂ − x⁻)), linearised at x̂.
    """
    prior = state[:, POSITION]
    at, seen = prior, np.asarray(weight.any(axis=(-2, -1)))
    for _ in range(1 + RELINEARISATIONS):
        residual, jacobian = _linearised(cameras, at, pixels)
        residual = np.where(seen[..., None], np.nan_to_num(residual), 0.0)
        weighted = jacobian.mT @ weight
        information = (weighted @ jacobian).sum(axis=0)
        pull = (weighted @ residual[..., None]).sum(axis=0) + information @ (at - prior)[..., None]
        # P⁺ = P⁻ − P⁻(Λ⁻¹ + P⁻)⁻¹P⁻ in these columns, without inverting Λ, which is singular for one view.
        across = np.eye(3) + covariance[:, POSITION, POSITION] @ information
        gain = np.linalg.solve(across, covariance[:, POSITION]).mT
        updated = state + (gain @ pull)[..., 0]
        at = updated[:, POSITION]
    # Joseph's form, (I − KH) P⁻ (I − KH)ᵀ + K R Kᵀ: stays symmetric and positive, however good a detection is.
    rest = np.broadcast_to(np.eye(state.shape[1]), covariance.shape).copy()
    rest[..., POSITION] -= gain @ information
    return updated, rest @ covariance @ rest.mT + gain @ information @ gain.mT
