"""The input of a strategy: the cameras, the expected positions of the targets, and the constants of a run."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np

from pss import PTZCamera, RangeError, ShapeError, evaluate_many
from pss.cameras.motors import PTZLimits, follow, moved_towards
from pss.hints import Floats
from pss.noise import NoiseModel
from pss.processes.process import require_positive
from pss.processes.steady_state import Process
from pss.surrogates import Box, Cylinder, Mesh, Shape, Surrogate
from scenes.errors import nearest

__all__ = ["Assignment", "Avatar", "Plan", "StrategyState"]

Assignment = tuple[str, ...]
"""The name of the avatar that each camera is assigned to."""

# Points this deep inside the body are on its surface but for rounding; a line of sight ends farther out than that.
SURFACE_M = 1e-6


@dataclass(frozen=True, eq=False)
class Avatar:
    """A walking target: points of interest, on an upright cylinder or a solid of its own that hides what is behind it.

    Attributes:
        surrogate: points and normals about the middle of the avatar, N of them, none inside the cylinder.
        radius_m, height_m: m, the cylinder.
        solid: a box or a mesh about the middle, in place of the cylinder.

    Raises:
        RangeError: a size that is not above 0, or a point inside the cylinder, which no camera could ever see.
    """

    surrogate: Surrogate
    radius_m: float = 0.25
    height_m: float = 1.8
    solid: Box | Mesh | None = None

    def __post_init__(self) -> None:
        require_positive("radius_m", self.radius_m, "m")
        require_positive("height_m", self.height_m, "m")
        if self.solid is not None:
            return
        points = self.surrogate.points_m
        inside = np.hypot(points[:, 0], points[:, 1]) < self.radius_m - SURFACE_M
        inside &= np.abs(points[:, 2]) < self.height_m / 2 - SURFACE_M
        if inside.any():
            place = tuple(points[inside.argmax()].tolist())
            raise RangeError(f"a point of interest at {place} is inside its own body; allowed: on it or outside")

    def body(self, name: str, middle_m: Floats) -> Cylinder | Box | Mesh:
        """What hides things about `middle_m`, m, (3,)."""
        x, y, z = (float(value) for value in middle_m)
        if isinstance(self.solid, Mesh):
            return dataclasses.replace(self.solid.moved((x, y, z)), name=name)
        if isinstance(self.solid, Box):
            low, high = (
                tuple((np.array(corner) + middle_m).tolist()) for corner in (self.solid.lowest_m, self.solid.highest_m)
            )
            return Box(name, low, high)
        return Cylinder(name, (x, y, z), self.radius_m, self.height_m)


@dataclass(frozen=True, eq=False)
class Plan:
    """What stays the same throughout a run.

    Attributes:
        avatars: by name; their order is H1, H2 of the paper.
        limits: of all cameras' motors.
        step_s: s between two decisions, in which the motors move.
        radius_m: m, the sphere about an avatar's middle that a camera is zoomed to.
        noise, process: models that the PSS is predicted with.
        occluder: what else stands in the way, such as furniture; the avatars' bodies are added where they are expected.
        swap_margin_m: m along y by which an avatar must be closer (or farther) before a camera swaps to it: a tracker's
            noise would otherwise make the cameras swing to and fro while the avatars are level.
        seed: of a strategy that draws at random.

    Raises:
        RangeError: no avatars, a time or radius that is not above 0, a negative margin.
    """

    avatars: Mapping[str, Avatar]
    limits: PTZLimits = field(default_factory=PTZLimits)
    step_s: float = 1 / 3
    radius_m: float = 0.95
    noise: NoiseModel | str = "corrected"
    process: Process | None = None
    occluder: Sequence[Shape] = ()
    swap_margin_m: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.avatars:
            raise RangeError("avatars is empty; allowed: at least one by name")
        require_positive("step_s", self.step_s, "s")
        require_positive("radius_m", self.radius_m, "m")
        if not self.swap_margin_m >= 0:
            raise RangeError(f"swap_margin_m = {self.swap_margin_m!r}; allowed: 0 or more, in metres")


@dataclass(frozen=True, eq=False)
class StrategyState:
    """What is known when a strategy decides. Nothing in it is the truth about the avatars.

    Attributes:
        step: number of the decision, from 0.
        time_s: s, now.
        cameras: the C cameras with their settings now.
        predicted_m: m, by name, where a tracker expects the avatars' middles at the next decision, when the motors have
            moved, (3,) each.
        plan: what stays the same.
        previous: the last assignment, None at the first decision.

    Raises:
        RangeError: positions of other avatars than the plan's, or an assignment that does not fit.
        ShapeError: a position that is not (3,).
    """

    step: int
    time_s: float
    cameras: tuple[PTZCamera, ...]
    predicted_m: Mapping[str, Floats]
    plan: Plan
    previous: Assignment | None = None

    def __post_init__(self) -> None:
        if set(self.predicted_m) != set(self.plan.avatars):
            raise RangeError(f"predicted_m is of {sorted(self.predicted_m)}; allowed: {sorted(self.plan.avatars)}")
        for name, place in self.predicted_m.items():
            if np.shape(place) != (3,):
                raise ShapeError(f"predicted_m[{name!r}] has shape {np.shape(place)}; allowed is (3,)")
        if self.previous is not None:
            self.checked(self.previous)

    @property
    def names(self) -> tuple[str, ...]:
        """The avatars, in the plan's order."""
        return tuple(self.plan.avatars)

    @cached_property
    def assignments(self) -> list[Assignment]:
        """All ways to assign the cameras, the last camera's changing fastest."""
        return list(product(self.names, repeat=len(self.cameras)))

    def checked(self, assignment: Sequence[str]) -> Assignment:
        """`assignment` as a tuple, if it names an avatar for each camera.

        Raises:
            RangeError: it does not; the message has the nearest name.
        """
        if isinstance(assignment, str) or len(assignment) != len(self.cameras):
            raise RangeError(f"assignment = {assignment!r}; allowed: {len(self.cameras)} names, one for each camera")
        for name in assignment:
            if name not in self.plan.avatars:
                hint = nearest(str(name), self.names)[0]
                raise RangeError(f"assignment to {name!r}{hint}; allowed: {', '.join(self.names)}")
        return tuple(assignment)

    def reached(self, assignment: Assignment) -> tuple[PTZCamera, ...]:
        """The cameras' settings at the next decision, if they are assigned so: as far as their motors come by then."""
        return tuple(self._reached(index, name) for index, name in enumerate(self.checked(assignment)))

    def predicted_pss(self, assignments: Sequence[Assignment]) -> Floats:
        """1/m, Eq. 10 over all avatars' points where they are expected, of each of the K `assignments`, (K,)."""
        bodies = [avatar.body(name, self.predicted_m[name]) for name, avatar in self.plan.avatars.items()]
        points, normals = self.expected_points
        return evaluate_many(
            [self.reached(assignment) for assignment in assignments],
            points,
            normals,
            noise=self.plan.noise,
            process=self.plan.process,
            occluder=[*self.plan.occluder, *bodies],
        ).pss

    @property
    def expected_points(self) -> tuple[Floats, Floats]:
        """Metres and unit normals of all avatars' points at the next decision, (N, 3) each."""
        moved = [
            (avatar.surrogate.points_m + self.predicted_m[name], avatar.surrogate.normals)
            for name, avatar in self.plan.avatars.items()
        ]
        points, normals = zip(*moved, strict=True)
        return np.concatenate(points), np.concatenate(normals)

    @cached_property
    def _settings(self) -> dict[tuple[int, str], PTZCamera]:
        """By camera and avatar, computed on first use."""
        return {}

    def _reached(self, index: int, name: str) -> PTZCamera:
        if (index, name) not in self._settings:
            camera, plan = self.cameras[index], self.plan
            setting = follow(camera, self.predicted_m[name], plan.radius_m, plan.limits)
            self._settings[index, name] = moved_towards(camera, setting, plan.limits, plan.step_s)
        return self._settings[index, name]
