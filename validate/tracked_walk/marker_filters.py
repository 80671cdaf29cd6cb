"""The filters of all markers between two frames: prediction, gate of each view, update, loss and start of a track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats

from pss import PTZCamera, RangeError
from pss.cameras.parameters import Cameras
from pss.cameras.views import Views
from pss.hints import Bools, Floats
from pss.processes.process import ProcessModel, require_positive
from pss.riccati.covariances import largest_standard_deviation
from validate.points.bundle import NEAREST_M
from validate.points.triangulate import VIEWS_TO_TRIANGULATE, detection_weights, triangulate

__all__ = ["PIXEL_COORDINATES", "MarkerFilters", "WalkFiltering"]


POSITION = slice(0, 3)
PIXEL_COORDINATES = 2
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


class MarkerFilters:
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
