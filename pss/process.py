"""How a point moves from one frame to the next: the process models of Eq. 2.

Every model is a transition matrix A and a process noise covariance Q for one time step. The states are ordered by
derivative, then by axis: position x, y, z (m), velocity x, y, z (m/s), acceleration x, y, z (m/s²). The axes are
independent and alike, so each matrix is the Kronecker product of a small one with the 3 × 3 identity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pss.errors import RangeError

__all__ = ["ConstantAcceleration", "ConstantVelocity", "ProcessModel", "RandomWalk"]

Floats = NDArray[np.float64]

AXES = 3


class ProcessModel(Protocol):
    """Anything with a transition matrix and a process noise for one time step; position comes first in the state."""

    @property
    def A(self) -> Floats:
        """State transition matrix over one time step, (n, n)."""
        ...

    @property
    def Q(self) -> Floats:
        """Covariance of the process noise gathered over one time step, (n, n)."""
        ...

    @property
    def states(self) -> int:
        """Number of states n."""
        ...


@dataclass(frozen=True)
class RandomWalk:
    """A point that takes an independent Gaussian step in every frame; three states, A = I and Q = step_std_m² · I.

    The intensity belongs to a time step, not to a second: changing ``time_step_s`` alone leaves Q as it is.

    Attributes:
        step_std_m: m standard deviation of the step along each axis between two frames, > 0
        time_step_s: s between two frames, > 0

    Raises:
        RangeError: a value is not a finite positive number
    """

    step_std_m: float = 1e-3
    time_step_s: float = 1 / 30

    def __post_init__(self) -> None:
        _require_positive("step_std_m", self.step_std_m, "m")
        _require_positive("time_step_s", self.time_step_s, "s")

    @property
    def states(self) -> int:
        """Number of states: 3."""
        return AXES

    @cached_property
    def A(self) -> Floats:
        """State transition matrix over one time step, (3, 3)."""
        return _for_each_axis([[1.0]])

    @cached_property
    def Q(self) -> Floats:
        """m² covariance of one step, (3, 3)."""
        return _for_each_axis([[self.step_std_m**2]])


@dataclass(frozen=True)
class ConstantVelocity:
    """A point whose acceleration is white noise; six states.

    Attributes:
        acceleration_density_m2_s3: m²/s³ spectral density of the white acceleration along each axis, > 0: after a
            time t the velocity has gathered a variance of density · t
        time_step_s: s between two frames, > 0

    Raises:
        RangeError: a value is not a finite positive number
    """

    acceleration_density_m2_s3: float
    time_step_s: float = 1 / 30

    def __post_init__(self) -> None:
        _require_positive("acceleration_density_m2_s3", self.acceleration_density_m2_s3, "m²/s³")
        _require_positive("time_step_s", self.time_step_s, "s")

    @property
    def states(self) -> int:
        """Number of states: 6."""
        return 2 * AXES

    @cached_property
    def A(self) -> Floats:
        """State transition matrix over one time step, (6, 6)."""
        return _for_each_axis(_taylor_transition(2, self.time_step_s))

    @cached_property
    def Q(self) -> Floats:
        """m², m²/s and m²/s² covariance gathered over one time step, (6, 6)."""
        return _for_each_axis(_integrated_white_noise(2, self.acceleration_density_m2_s3, self.time_step_s))


@dataclass(frozen=True)
class ConstantAcceleration:
    """A point whose jerk is white noise; nine states.

    Attributes:
        jerk_density_m2_s5: m²/s⁵ spectral density of the white jerk along each axis, > 0: after a time t the
            acceleration has gathered a variance of density · t
        time_step_s: s between two frames, > 0

    Raises:
        RangeError: a value is not a finite positive number
    """

    jerk_density_m2_s5: float
    time_step_s: float = 1 / 30

    def __post_init__(self) -> None:
        _require_positive("jerk_density_m2_s5", self.jerk_density_m2_s5, "m²/s⁵")
        _require_positive("time_step_s", self.time_step_s, "s")

    @property
    def states(self) -> int:
        """Number of states: 9."""
        return 3 * AXES

    @cached_property
    def A(self) -> Floats:
        """State transition matrix over one time step, (9, 9)."""
        return _for_each_axis(_taylor_transition(3, self.time_step_s))

    @cached_property
    def Q(self) -> Floats:
        """m² to m²/s⁴ covariance gathered over one time step, (9, 9)."""
        return _for_each_axis(_integrated_white_noise(3, self.jerk_density_m2_s5, self.time_step_s))


def _taylor_transition(order: int, time_step_s: float) -> list[list[float]]:
    """Transition of a chain of ``order`` integrators: entry (i, j) is Δt^(j−i)/(j−i)! on and above the diagonal."""
    return [
        [time_step_s ** (j - i) / math.factorial(j - i) if j >= i else 0.0 for j in range(order)] for i in range(order)
    ]


def _integrated_white_noise(order: int, density: float, time_step_s: float) -> list[list[float]]:
    """Noise gathered by a chain of ``order`` integrators whose last input is white.

    State i answers an impulse τ seconds old with τ^a/a!, a = order − 1 − i, so that the covariance of states i and j
    is density · ∫₀^Δt τ^a/a! · τ^b/b! dτ = density · Δt^(a+b+1) / ((a+b+1) · a! · b!).
    """
    powers = range(order - 1, -1, -1)
    return [
        [density * time_step_s ** (a + b + 1) / ((a + b + 1) * math.factorial(a) * math.factorial(b)) for b in powers]
        for a in powers
    ]


def _for_each_axis(per_axis: list[list[float]]) -> Floats:
    """Spread a matrix over derivatives to the x, y and z axes, read-only because models are shared and hashed."""
    matrix: Floats = np.kron(np.array(per_axis, dtype=np.float64), np.eye(AXES)).astype(np.float64)
    matrix.flags.writeable = False
    return matrix


def _require_positive(name: str, value: float, unit: str) -> None:
    is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or value <= 0:
        raise RangeError(f"{name} = {value!r}; allowed: a finite number > 0 in {unit}")
