"""A user-defined sensor, by its measurement function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss.cameras.camera import as_points
from pss.errors import ShapeError
from pss.hints import Bools, Floats
from pss.inputs import numbers
from pss.surrogates import Shape

__all__ = ["FunctionSensor"]


# Cube root of double precision: the step with the smallest error of a central difference, relative to the state.
DIFFERENCE_STEP = 6e-6


@dataclass(frozen=True, eq=False)
class FunctionSensor:
    """A user-defined sensor: a function of the position, its noise covariance, and optionally its Jacobian.

    Attributes:
        function: from points (N, 3) to measurements (N, m).
        noise: covariance of a measurement, (m, m), in the measurements' units squared.
        of_position: ∂measurement/∂position, from points (N, 3) to (N, m, 3); None for central differences.
        reach: from points (N, 3) to (N,) booleans; None: the sensor measures everywhere.
    """

    function: Callable[[Floats], Floats]
    noise: ArrayLike
    of_position: Callable[[Floats], Floats] | None = None
    reach: Callable[[Floats], Bools] | None = None
    name: str = "function"

    def __post_init__(self) -> None:
        noise = np.atleast_2d(numbers(self.noise, f"noise of sensor {self.name!r}", "(m, m)"))
        if noise.ndim != 2 or noise.shape[0] != noise.shape[1]:
            raise ShapeError(f"noise of sensor {self.name!r} has shape {noise.shape}; allowed: (m, m)")
        object.__setattr__(self, "noise", noise)

    def measure(self, points_m: Floats) -> Floats:
        """(N, m)."""
        what = f"what sensor {self.name!r} measures"
        measured = numbers(self.function(as_points(points_m)), what, f"({len(points_m)}, m)")
        if measured.ndim != 2 or len(measured) != len(points_m):
            raise ShapeError(f"sensor {self.name!r} gives shape {measured.shape}; allowed: ({len(points_m)}, m)")
        return measured

    def jacobian(self, points_m: Floats) -> Floats:
        """(N, m, 3)."""
        points = as_points(points_m)
        if self.of_position is not None:
            return numbers(self.of_position(points), f"the Jacobian of sensor {self.name!r}", f"({len(points)}, m, 3)")
        step = DIFFERENCE_STEP * max(1.0, float(np.abs(points).max(initial=0.0)))
        sides = [(self.measure(points + e) - self.measure(points - e)) / (2 * step) for e in step * np.eye(3)]
        return np.stack(sides, axis=-1)

    def covariance(self, points_m: Floats) -> Floats:
        """(N, m, m)."""
        noise = np.asarray(self.noise, dtype=float)
        return np.broadcast_to(noise, (len(points_m), *noise.shape))

    def reaches(self, points_m: Floats, normals: Floats, occluder: Sequence[Shape]) -> Bools:
        """Whether it measures each point, (N,)."""
        if self.reach is None:
            return np.ones(len(points_m), dtype=np.bool_)
        return np.asarray(self.reach(points_m), dtype=np.bool_)
