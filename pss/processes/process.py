"""Motion of a point from one frame to the next: the process models of Eq. 2.

Every model is a transition matrix A and a process noise covariance Q for one time step; the state begins with position
x, y, z (m). In the three motion models velocity x, y, z (m/s) and acceleration x, y, z (m/s²) follow. Their axes are
independent and equal: each matrix is the Kronecker product of a small one with the 3 × 3 identity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np

from pss.errors import RangeError
from pss.hints import Floats

__all__ = [
    "ConstantAcceleration",
    "ConstantVelocity",
    "ProcessModel",
    "RandomWalk",
    "require_positive",
]


AXES = 3


class ProcessModel(Protocol):
    """Anything with a transition matrix and a process noise for one time step; position comes first in the state."""

    @property
    def A(self) -> Floats:
        """State transition matrix over one time step, (n, n), or one for each point, (N, n, n)."""
        ...

    @property
    def Q(self) -> Floats:
        """Covariance of the process noise of one time step, (n, n) or (N, n, n)."""
        ...

    @property
    def states(self) -> int:
        """Number of states n."""
        ...


class _AlikeAxes:
    """Three independent axes with a chain of ``order`` integrators each, the last of which integrates white noise.

    Attributes:
        time_step_s: s between two frames, > 0

    Raises:
        RangeError: the noise or the time step is not a finite positive number
    """

    order: ClassVar[int]
    noise: ClassVar[tuple[str, str]]  # name and unit
    time_step_s: float

    def __post_init__(self) -> None:
        for name, unit in (self.noise, ("time_step_s", "s")):
            require_positive(name, getattr(self, name), unit)

    @property
    def states(self) -> int:
        """Number of states: 3 for each integrator."""
        return AXES * self.order

    @cached_property
    def A(self) -> Floats:
        """State transition matrix over one time step, (n, n)."""
        return _for_each_axis(_taylor_transition(self.order, self.time_step_s))

    @cached_property
    def Q(self) -> Floats:
        """Covariance of the noise of one time step, (n, n); m² for positions."""
        return _for_each_axis(_integrated_white_noise(self.order, getattr(self, self.noise[0]), self.time_step_s))


@dataclass(frozen=True)
class RandomWalk(_AlikeAxes):
    """A point that takes an independent Gaussian step in every frame; three states, A = I and Q = step_std_m² · I.

    The step belongs to a frame, not to a second: changing ``time_step_s`` alone does not change Q.

    Attributes:
        step_std_m: m standard deviation of the step along each axis between two frames, > 0
    """

    order, noise = 1, ("step_std_m", "m")
    step_std_m: float = 1e-3
    time_step_s: float = 1 / 30

    @cached_property
    def Q(self) -> Floats:
        """m² covariance of one step, (3, 3)."""
        return _for_each_axis([[self.step_std_m**2]])


@dataclass(frozen=True)
class ConstantVelocity(_AlikeAxes):
    """A point whose acceleration is white noise; six states.

    Attributes:
        acceleration_density_m2_s3: m²/s³ spectral density of the white acceleration along each axis, > 0: after a time
            t the velocity has a variance of density · t
    """

    order, noise = 2, ("acceleration_density_m2_s3", "m²/s³")
    acceleration_density_m2_s3: float
    time_step_s: float = 1 / 30


@dataclass(frozen=True)
class ConstantAcceleration(_AlikeAxes):
    """A point whose jerk is white noise; nine states.

    Attributes:
        jerk_density_m2_s5: m²/s⁵ spectral density of the white jerk along each axis, > 0: after a time t the
            acceleration has a variance of density · t
    """

    order, noise = 3, ("jerk_density_m2_s5", "m²/s⁵")
    jerk_density_m2_s5: float
    time_step_s: float = 1 / 30


def _taylor_transition(order: int, time_step_s: float) -> list[list[float]]:
    """Transition of a chain of ``order`` integrators: entry (i, j) is Δt^(j−i)/(j−i)! on and above the diagonal."""
    return [
        [time_step_s ** (j - i) / math.factorial(j - i) if j >= i else 0.0 for j in range(order)] for i in range(order)
    ]


def _integrated_white_noise(order: int, density: float, time_step_s: float) -> list[list[float]]:
    """Noise covariance of a chain of ``order`` integrators with white noise at its input, over one time step.

    The response of state i to an impulse τ seconds ago is τ^a/a! with a = order − 1 − i. The covariance of states i and
    j is density · ∫₀^Δt τ^a/a! · τ^b/b! dτ = density · Δt^(a+b+1) / ((a+b+1) · a! · b!).
    """
    powers = range(order - 1, -1, -1)
    return [
        [density * time_step_s ** (a + b + 1) / ((a + b + 1) * math.factorial(a) * math.factorial(b)) for b in powers]
        for a in powers
    ]


def _for_each_axis(per_axis: list[list[float]]) -> Floats:
    """Expand a matrix over derivatives to the x, y and z axes, read-only because models are shared and hashed."""
    matrix: Floats = np.kron(np.array(per_axis, dtype=np.float64), np.eye(AXES)).astype(np.float64)
    matrix.flags.writeable = False
    return matrix


def require_positive(name: str, value: float, unit: str) -> None:
    """Raise `RangeError` unless `value` is a finite number above 0."""
    is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or value <= 0:
        raise RangeError(f"{name} = {value!r}; allowed: a finite number > 0 in {unit}")
