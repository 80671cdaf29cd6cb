"""Round solids that approximate people and furniture: an upright cylinder, and a capsule in any direction.

Both are convex: a line intersects them in one interval, and blocking compares its two ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pss.errors import GeometryError
from pss.hints import Bools, Floats
from pss.surrogates._checks import check_positive, set_places
from pss.surrogates.shapes import Sphere

__all__ = ["Capsule", "Cylinder"]


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder, with top and bottom.

    Attributes:
        centre_m: m, the middle of its axis, (3,).
        radius_m, height_m: m.
    """

    name: str
    centre_m: tuple[float, float, float]
    radius_m: float
    height_m: float

    def __post_init__(self) -> None:
        set_places(self, "centre_m")
        check_positive("Cylinder", radius_m=self.radius_m, height_m=self.height_m)

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments, (..., 3) each, pass through the cylinder; shape (...)."""
        start = starts_m - np.array(self.centre_m)
        return _passes_cylinder(start, ends_m - starts_m, self.radius_m, self.height_m / 2)


@dataclass(frozen=True)
class Capsule:
    """All points nearer than `radius_m` to the segment from `start_m` to `end_m`, in metres."""

    name: str
    start_m: tuple[float, float, float]
    end_m: tuple[float, float, float]
    radius_m: float

    def __post_init__(self) -> None:
        set_places(self, "start_m", "end_m")
        check_positive("Capsule", radius_m=self.radius_m)
        if not self.length_m > 0:
            raise GeometryError(f"Capsule.start_m = end_m = {tuple(self.end_m)}; allowed: two places (or a Sphere)")

    @property
    def length_m(self) -> float:
        """Metres between the centres of its two rounded ends."""
        return math.dist(self.start_m, self.end_m)

    @property
    def frame(self) -> Floats:
        """Orthonormal right-handed rows, (3, 3), of which the last points from `start_m` to `end_m`."""
        along = (np.array(self.end_m) - np.array(self.start_m)) / self.length_m
        # The world axis with the smallest component along the capsule cannot be parallel to it.
        aside = np.cross(np.eye(3)[np.abs(along).argmin()], along)
        aside /= np.linalg.norm(aside)
        return np.array([aside, np.cross(along, aside), along])

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments, (..., 3) each, pass through the capsule; shape (...)."""
        frame, centre = self.frame, (np.array(self.start_m) + np.array(self.end_m)) / 2
        start, way = (starts_m - centre) @ frame.T, (ends_m - starts_m) @ frame.T
        blocked = _passes_cylinder(start, way, self.radius_m, self.length_m / 2)
        for place in (self.start_m, self.end_m):
            blocked = blocked | Sphere(self.name, place, self.radius_m).blocks(starts_m, ends_m)
        return blocked


def _passes_cylinder(start: Floats, way: Floats, radius: float, half_length: float) -> Bools:
    """Whether start + t·way, 0 < t < 1, both (..., 3), enters the cylinder about the z axis between ±half_length."""
    x, y, z = np.moveaxis(start, -1, 0)
    to_x, to_y, to_z = np.moveaxis(way, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # |(x, y) + t (to_x, to_y)|² < radius² holds between the roots of across·t² + 2·towards·t + outside.
        across, towards, outside = to_x**2 + to_y**2, x * to_x + y * to_y, x**2 + y**2 - radius**2
        # Computing the discriminant from the distance to the axis is accurate for a distant start too.
        discriminant = across * radius**2 - (x * to_y - y * to_x) ** 2
        # Add terms of the same sign, and take the other root from the product of both: no cancellation in either.
        q = -(towards + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), towards))
        roots = np.array([q / across, outside / q])
        # Parallel to the axis, a segment is entirely in or out.
        parallel, crosses = across == 0, discriminant > 0
        enter = np.where(parallel, np.where(outside < 0, -np.inf, np.inf), np.where(crosses, roots.min(axis=0), np.inf))
        leave = np.where(parallel, np.inf, np.where(crosses, roots.max(axis=0), -np.inf))
        ends = np.array([(-half_length - z) / to_z, (half_length - z) / to_z])
        level, between = to_z == 0, np.abs(z) < half_length
        enter = np.maximum(enter, np.where(level, np.where(between, -np.inf, np.inf), ends.min(axis=0)))
        leave = np.minimum(leave, np.where(level, np.inf, ends.max(axis=0)))
    return np.asarray(np.maximum(enter, 0.0) < np.minimum(leave, 1.0))
