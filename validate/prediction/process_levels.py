"""Levels of process noise from "all measurement" to "all process", and the rule by which one of them is the headline.

With much process noise a filter forgets in one frame, σ∞ is the step between frames wherever a point is measured at
all, and PSS counts points. With little it averages over many frames. Only in between does σ∞ depend on how well a point
is measured and by which process it moves. Where that is depends on q/c: the variance q that a point's position gathers
between two frames, over the variance c of a single frame's triangulation.

- Random walk: q is the square of the step.
- Constant velocity: q = q̃ Δt³, with the density q̃ of the acceleration and the time step Δt: the square of the tracking
  index (Kalata 1984). Position and velocity × Δt obey equations in which nothing else of the process appears, so that
  one grid of q/c is a grid of accelerations and of frame rates alike. A person's 1 m²/s³ at 30 frames/s with errors of
  0.05 mm has q/c = 15,000; q/c = 1 takes 740 frames/s.

The headline is where q is nearest to c on a logarithmic scale. c is the median that is *predicted* for training views:
neither the evaluated configurations nor any measurement influence it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pss.errors import RangeError
from pss.processes.process import ConstantVelocity, RandomWalk

__all__ = ["STEPS_M", "Level", "headline_of", "levels_about", "nearest"]

# A frame, of the random walk.
STEPS_M = (3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)
# Of the constant velocity, about the density at which the tracking index is 1.
POWERS_OF_TEN = (-4, -2, -1, 0, 1, 2, 4)
TIME_STEP_S = 1 / 30


@dataclass(frozen=True)
class Level:
    """A process model, and where it stands.

    Attributes:
        q_over_c: variance gathered between two frames over the typical single-frame variance that is predicted.
        headline: the one of its kind of process that is nearest to 1.
    """

    process: RandomWalk | ConstantVelocity
    q_over_c: float
    headline: bool

    @property
    def walks(self) -> bool:
        """Whether it is a random walk."""
        return isinstance(self.process, RandomWalk)

    @property
    def variance_m2(self) -> float:
        """m², q."""
        if isinstance(self.process, RandomWalk):
            return self.process.step_std_m**2
        return self.process.acceleration_density_m2_s3 * self.process.time_step_s**3

    @property
    def row(self) -> dict[str, object]:
        """Columns of a table; what the process does not have is nan."""
        return {
            "process": "random-walk" if self.walks else "constant-velocity",
            "step_mm": 1e3 * getattr(self.process, "step_std_m", math.nan),
            "acceleration_density_m2_s3": getattr(self.process, "acceleration_density_m2_s3", math.nan),
            "time_step_s": self.process.time_step_s,
            "q_over_c": self.q_over_c,
            "headline": "yes" if self.headline else "no",
        }


def nearest(values: Sequence[float], target: float) -> int:
    """Which of positive `values` is nearest to `target` on a logarithmic scale.

    Raises:
        RangeError: the target is not a positive finite number.
    """
    if not (math.isfinite(target) and target > 0):
        raise RangeError(f"a typical error of {target!r} m; allowed: finite and above 0, so that q/c is defined")
    return int(np.argmin(np.abs(np.log(np.asarray(values) / target))))


def levels_about(sigma_m: float, time_step_s: float = TIME_STEP_S) -> list[Level]:
    """All levels, of which one random walk and one constant velocity is the headline of its kind.

    Args:
        sigma_m: m, typical √λmax of a single frame's covariance, predicted for views that are not judged.
        time_step_s: s, between two frames.
    """
    step, c = nearest(STEPS_M, sigma_m), sigma_m**2
    levels = [
        Level(RandomWalk(value, time_step_s), value**2 / c, number == step) for number, value in enumerate(STEPS_M)
    ]
    for power in POWERS_OF_TEN:
        density = 10.0**power * c / time_step_s**3
        levels.append(Level(ConstantVelocity(density, time_step_s), 10.0**power, power == 0))
    return levels


def headline_of(levels: Sequence[Level]) -> int:
    """Which level is the headline of a page: that of the random walk, which is the scenes' process."""
    return next(number for number, level in enumerate(levels) if level.walks and level.headline)
