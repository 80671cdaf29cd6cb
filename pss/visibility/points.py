"""Which camera sees which point: field of view, the point's own surface, and occluders (section 4.1).

Each test is independent: it can be omitted, tightened, or combined with user-defined ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pss.cameras.views import Views
from pss.errors import RangeError
from pss.hints import Bools
from pss.surrogates import Shape, any_blocks

__all__ = ["VISIBILITY_TESTS", "FieldOfView", "Occlusion", "SelfOcclusion", "VisibilityTest", "visible_in"]


# A line of sight ends this far in front of its point, so that the surface at the point does not occlude it.
CLEARANCE_M = 1e-4


class VisibilityTest(Protocol):
    """One condition for a camera to see a point. User-defined tests have the same two members."""

    @property
    def name(self) -> str:
        """The test's name in lists."""
        ...

    def passed(self, views: Views, candidates: Bools, occluder: Sequence[Shape]) -> Bools:
        """Where the point stays visible, (C, N); values outside `candidates` (C, N) do not matter."""
        ...


@dataclass(frozen=True)
class FieldOfView:
    """The point projects onto the sensor's area, at least `margin_px` inside its edge."""

    margin_px: float = 0.0
    name: str = "field-of-view"

    def passed(self, views: Views, candidates: Bools, occluder: Sequence[Shape]) -> Bools:
        """Where the point is inside, (C, N)."""
        if self.margin_px == 0:
            return views.in_frustum
        pixels, arrays, margin = views.pixels, views.arrays, self.margin_px
        with np.errstate(invalid="ignore"):
            across = (pixels[..., 0] >= margin - 0.5) & (pixels[..., 0] <= arrays.width - 0.5 - margin)
            down = (pixels[..., 1] >= margin - 0.5) & (pixels[..., 1] <= arrays.height - 0.5 - margin)
        return np.asarray(views.in_frustum & across & down)


@dataclass(frozen=True)
class SelfOcclusion:
    """The surface faces the camera: its incidence angle is below `largest_incidence_deg`."""

    largest_incidence_deg: float = 90.0
    name: str = "self-occlusion"

    def __post_init__(self) -> None:
        if not 0 < self.largest_incidence_deg <= 90:
            raise RangeError(f"largest_incidence_deg = {self.largest_incidence_deg!r}; allowed: above 0, at most 90")

    def passed(self, views: Views, candidates: Bools, occluder: Sequence[Shape]) -> Bools:
        """Where the surface faces the camera, (C, N)."""
        smallest = 0.0 if self.largest_incidence_deg == 90 else math.cos(math.radians(self.largest_incidence_deg))
        with np.errstate(invalid="ignore"):
            return np.asarray(views.cos_incidence > smallest)


@dataclass(frozen=True)
class Occlusion:
    """No shape blocks the line of sight, which ends `clearance_m` in front of the surface."""

    clearance_m: float = CLEARANCE_M
    name: str = "occlusion"

    def passed(self, views: Views, candidates: Bools, occluder: Sequence[Shape]) -> Bools:
        """Where nothing blocks the line of sight, (C, N); False outside the candidates."""
        clear = candidates.copy()
        if not occluder:
            return clear
        camera, point = np.nonzero(candidates)
        ends = views.points_m
        if views.normals is not None:
            ends = ends + self.clearance_m * views.normals
        clear[camera, point] = ~any_blocks(occluder, views.arrays.position_m[camera], ends[point])
        return clear


VISIBILITY_TESTS: tuple[VisibilityTest, ...] = (FieldOfView(), SelfOcclusion(), Occlusion())


def visible_in(
    views: Views, occluder: Sequence[Shape] = (), tests: Sequence[VisibilityTest] = VISIBILITY_TESTS
) -> Bools:
    """Where all `tests` pass, (C, N); a point at or behind a camera's lens is never visible to it."""
    seen = np.asarray(views.depth_m > 0)
    for test in tests:
        seen &= test.passed(views, seen, occluder)
    return seen
