"""A Kalman filter of one avatar's position under constant velocity, and the noisy positions it is given.

Nothing here is the metric's: this filter stands for whatever a deployed network steers by.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pss import ConstantVelocity, RangeError, ShapeError
from pss.hints import Floats
from pss.processes.process import require_positive
from render.random_streams import random_stream

__all__ = ["Measure", "Track", "Tracking", "noisy_positions"]

Measure = Callable[[str, int, Floats], Floats | None]
"""From an avatar's name, the number of the frame and the true position, m, (3,), to a measured one; None for none."""

POSITION = slice(0, 3)


@dataclass(frozen=True)
class Tracking:
    """How the avatars are tracked.

    Attributes:
        frame_s: s between two measurements; the cameras get a new setting to go to as often.
        sigma_m: m, the filter's standard deviation of a measured position along each axis.
        latency_s: s, how old a measurement is when it arrives.
        acceleration_density_m2_s3: m²/s³, of the filter's constant-velocity process.
        lost_after_frames: frames without a measurement after which an avatar counts as lost.
        start_sigma_m, start_speed_sigma_m_per_s: m and m/s along each axis, how well the place of entry is known and
            how fast an avatar may be.
        warm_up_s: s of walking and tracking before the first step.
        seed: of the measurements.

    Raises:
        RangeError: a value out of range.
    """

    frame_s: float = 1 / 30
    sigma_m: float = 0.03
    latency_s: float = 0.1
    acceleration_density_m2_s3: float = 0.5
    lost_after_frames: int = 15
    start_sigma_m: float = 1.0
    start_speed_sigma_m_per_s: float = 1.5
    warm_up_s: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, unit in (
            ("frame_s", "s"),
            ("sigma_m", "m"),
            ("acceleration_density_m2_s3", "m²/s³"),
            ("start_sigma_m", "m"),
            ("start_speed_sigma_m_per_s", "m/s"),
        ):
            require_positive(name, getattr(self, name), unit)
        for name in ("latency_s", "warm_up_s"):
            if not 0 <= getattr(self, name) < math.inf:
                raise RangeError(f"{name} = {getattr(self, name)!r}; allowed: 0 or more seconds")
        if self.lost_after_frames < 1:
            raise RangeError(f"lost_after_frames = {self.lost_after_frames!r}; allowed: at least 1")


def noisy_positions(sigma_m: float, seed: int) -> Measure:
    """Measurements with Gaussian noise of `sigma_m` along each axis; reproducible by the seed."""

    def measure(name: str, frame: int, position_m: Floats) -> Floats:
        rng = random_stream(seed, name, "measured position", frame)
        return np.asarray(position_m + sigma_m * rng.standard_normal(3))

    return measure


class Track:
    """The filter of one avatar. It keeps time with its measurements, `latency_s` behind the clock.

    Attributes:
        state: m and m/s, position and velocity, (6,), at the time of the newest measurement.
        covariance: of `state`, (6, 6).
        missed: frames since the last measurement, 0 right after one.
        losses: how often the avatar was lost so far.
    """

    def __init__(self, place_m: Floats, tracking: Tracking) -> None:
        self.tracking = tracking
        self.process = ConstantVelocity(tracking.acceleration_density_m2_s3, tracking.frame_s)
        self.state: Floats = np.concatenate([np.asarray(place_m, dtype=float), np.zeros(3)])
        spread = np.repeat([tracking.start_sigma_m, tracking.start_speed_sigma_m_per_s], 3)
        self.covariance: Floats = np.diag(spread**2)
        self.missed = 0
        self.losses = 0

    @property
    def lost(self) -> bool:
        """Whether the last `lost_after_frames` frames or more brought no measurement."""
        return self.missed >= self.tracking.lost_after_frames

    def update(self, measured_m: Floats | None) -> None:
        """Take a frame's measurement, m, (3,), or note that there was none.

        A lost avatar coasts at its last velocity. Its covariance has grown meanwhile, so that the next measurement
        finds it without a start from nothing.

        Raises:
            ShapeError, RangeError: a measurement that is not (3,) or not finite.
        """
        if measured_m is None:
            self.missed += 1
            self.losses += self.missed == self.tracking.lost_after_frames
            return
        measured = np.asarray(measured_m, dtype=float)
        if measured.shape != (3,):
            raise ShapeError(f"a measured position has shape {measured.shape}; allowed is (3,), or None")
        if not np.isfinite(measured).all():
            raise RangeError(f"a measured position is {measured.tolist()}; allowed: finite metres, or None")
        innovation = self.covariance[POSITION, POSITION] + self.tracking.sigma_m**2 * np.eye(3)
        gain = np.linalg.solve(innovation, self.covariance[POSITION]).T
        self.state = self.state + gain @ (measured - self.state[POSITION])
        # Joseph's form: stays symmetric and positive, however good a measurement is.
        rest = np.eye(6)
        rest[:, POSITION] -= gain
        self.covariance = rest @ self.covariance @ rest.T + self.tracking.sigma_m**2 * gain @ gain.T
        self.missed = 0

    def advance(self) -> None:
        """Go on to the next frame."""
        A, Q = self.process.A, self.process.Q
        self.state, self.covariance = A @ self.state, A @ self.covariance @ A.T + Q

    def ahead(self, seconds: float) -> tuple[Floats, Floats]:
        """Metres, the position expected `seconds` after the filter's own time, (3,), and its covariance, m², (3, 3)."""
        if seconds == 0:
            return self.state[POSITION].copy(), self.covariance[POSITION, POSITION].copy()
        process = ConstantVelocity(self.tracking.acceleration_density_m2_s3, seconds)
        covariance = process.A @ self.covariance @ process.A.T + process.Q
        return (process.A @ self.state)[POSITION], covariance[POSITION, POSITION]
