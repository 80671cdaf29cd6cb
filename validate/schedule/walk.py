"""Two straight walks past each other along the hallway, as steps that are even in Y of the first (Fig. 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pss.cameras.camera import as_points
from pss.errors import GeometryError, RangeError, ShapeError
from pss.hints import Floats
from pss.processes.process import require_positive

__all__ = ["Passing", "Walk", "passing"]


Y = 1  # the hallway's long side


@dataclass(frozen=True)
class Walk:
    """A straight walk at constant speed. Before its start and after its end it goes on along the same line.

    Attributes:
        name: of the avatar.
        start_m, end_m: m, where the middle of the avatar is at first and at last, (3,).
        speed_m_per_s: m/s.
        start_s: s, when it starts.

    Raises:
        ShapeError, RangeError: places that are not (3,); a speed that is not above 0.
        GeometryError: start and end are one place.
    """

    name: str
    start_m: tuple[float, float, float]
    end_m: tuple[float, float, float]
    speed_m_per_s: float = 1.2
    start_s: float = 0.0

    def __post_init__(self) -> None:
        for field in ("start_m", "end_m"):
            place = as_points(getattr(self, field), field)
            if place.shape != (3,):
                raise ShapeError(f"{field} has shape {place.shape}; allowed is (3,)")
            object.__setattr__(self, field, tuple(place.tolist()))
        require_positive("speed_m_per_s", self.speed_m_per_s, "m/s")
        if not math.isfinite(self.start_s):
            raise RangeError(f"start_s = {self.start_s!r}; allowed: finite seconds")
        if self.length_m == 0:
            raise GeometryError(f"start_m = end_m = {self.end_m}; allowed: two places")

    @property
    def length_m(self) -> float:
        """Metres from start to end."""
        return math.dist(self.start_m, self.end_m)

    @property
    def end_s(self) -> float:
        """Seconds, when it arrives."""
        return self.start_s + self.length_m / self.speed_m_per_s

    @property
    def velocity_m_per_s(self) -> Floats:
        """Metres per second, (3,)."""
        return (np.array(self.end_m) - self.start_m) * (self.speed_m_per_s / self.length_m)

    def position_m(self, time_s: ArrayLike) -> Floats:
        """Metres, where the middle of the avatar is at `time_s` (...); shape (..., 3)."""
        elapsed = np.asarray(time_s, dtype=float)[..., None] - self.start_s
        return np.asarray(np.array(self.start_m) + elapsed * self.velocity_m_per_s)


@dataclass(frozen=True)
class Passing:
    """Two walks in opposite directions along y, looked at in steps that are even in Y of the first.

    Attributes:
        first, second: H1 and H2 of the paper.
        steps: positions of the first from its start to its end, both among them, K.

    Raises:
        RangeError: fewer than two steps, or one name for both.
        GeometryError: they do not walk in opposite directions along y, or do not meet between the first step and the
            last.
    """

    first: Walk
    second: Walk
    steps: int = 21

    def __post_init__(self) -> None:
        if self.steps < 2:
            raise RangeError(f"steps = {self.steps!r}; allowed: at least 2")
        if self.first.name == self.second.name:
            raise RangeError(f"both walks are named {self.first.name!r}; allowed: two names")
        speeds = tuple(float(walk.velocity_m_per_s[Y]) for walk in self.walks)
        if not speeds[0] * speeds[1] < 0:
            raise GeometryError(f"the walks go at {speeds} m/s along y; allowed: opposite directions")
        if not self.times_s[0] < self.crossing_s <= self.times_s[-1]:
            raise GeometryError(
                f"the walks meet at {self.crossing_s:.4g} s; allowed: after {self.times_s[0]:.4g} s, when the first "
                f"starts, and by {self.times_s[-1]:.4g} s, when it ends"
            )

    @property
    def walks(self) -> tuple[Walk, Walk]:
        """Both, H1's first."""
        return self.first, self.second

    @property
    def step_s(self) -> float:
        """Seconds between two steps."""
        return (self.first.end_s - self.first.start_s) / (self.steps - 1)

    @cached_property
    def times_s(self) -> Floats:
        """Seconds of the steps, (K,)."""
        return self.first.start_s + self.step_s * np.arange(self.steps)

    @property
    def positions_m(self) -> dict[str, Floats]:
        """Metres, by name, the positions at the steps, (K, 3) each."""
        return {walk.name: walk.position_m(self.times_s) for walk in self.walks}

    @property
    def crossing_s(self) -> float:
        """Seconds, when both have the same y."""
        (a, b), (u, v) = ([walk.position_m(0.0)[Y] for walk in self.walks], [w.velocity_m_per_s[Y] for w in self.walks])
        return float((b - a) / (u - v))


def passing(
    *,
    reach_m: float = 4.0,
    lane_m: float = 0.6,
    middle_height_m: float = 0.9,
    speed_m_per_s: float = 1.2,
    steps: int = 21,
    names: tuple[str, str] = ("H1", "H2"),
) -> Passing:
    """The paper's scene: H1 walks from y = −reach to +reach at x = −lane, H2 the other way at x = +lane.

    Args:
        reach_m: m, from the hallway's middle to where a walk starts and ends; 5 are to the wall.
        lane_m: m, from the hallway's middle line; 0 would make them walk through each other.
        middle_height_m: m, half an avatar's height.

    Raises:
        RangeError, GeometryError: as `Walk` and `Passing`.
    """
    walks = (
        Walk(
            name,
            (side * lane_m, side * reach_m, middle_height_m),
            (side * lane_m, -side * reach_m, middle_height_m),
            speed_m_per_s,
        )
        for name, side in zip(names, (-1.0, 1.0), strict=True)
    )
    return Passing(*walks, steps=steps)
