"""Rectangles, boxes and spheres: occlusion of lines of sight, and points of interest on their surfaces.

Prediction and rendering use the same objects. A shape defines whether it is closed (so that only its outside is
visible), whether it blocks a segment, and points with normals spread evenly over it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from pss.errors import RangeError
from pss.hints import Bools, Floats
from pss.surrogates._checks import check_count, check_positive, set_places

__all__ = ["GOLDEN_ANGLE", "Box", "Rectangle", "Shape", "Sphere", "any_blocks"]


GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


class Shape(Protocol):
    """Interface of an object in the scene, as the metric uses it."""

    name: str

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments from `starts_m` to `ends_m`, both (..., 3), meet the shape; shape (...)."""
        ...


@dataclass(frozen=True)
class Rectangle:
    """A thin board with its front along its normal.

    Attributes:
        centre_m: m, (3,).
        width_m, height_m: m, its extent along `right` and `up`.
        facing_deg: degrees about world z of the front's normal: 0 points along +y, positive towards +x.
        elevation_deg: degrees above the horizon of that normal.
    """

    name: str
    centre_m: tuple[float, float, float]
    width_m: float
    height_m: float
    facing_deg: float = 0.0
    elevation_deg: float = 0.0

    def __post_init__(self) -> None:
        set_places(self, "centre_m")
        check_positive("Rectangle", width_m=self.width_m, height_m=self.height_m)

    @cached_property
    def normal(self) -> Floats:
        """Unit normal of the front, (3,)."""
        facing, elevation = math.radians(self.facing_deg), math.radians(self.elevation_deg)
        return np.array(
            [
                math.sin(facing) * math.cos(elevation),
                math.cos(facing) * math.cos(elevation),
                math.sin(elevation),
            ]
        )

    @cached_property
    def right(self) -> Floats:
        """Unit vector along the width, horizontal, to the right as seen from the front, (3,)."""
        facing = math.radians(self.facing_deg)
        return np.array([-math.cos(facing), math.sin(facing), 0.0])

    @cached_property
    def up(self) -> Floats:
        """Unit vector along the height, (3,)."""
        (a, b, c), (x, y, z) = self.normal, self.right
        return np.array([b * z - c * y, c * x - a * z, a * y - b * x])

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments, (..., 3) each, cross the board; shape (...)."""
        centre, normal = np.array(self.centre_m), self.normal
        height_of_start = (starts_m - centre) @ normal
        height_of_end = (ends_m - centre) @ normal
        crosses = np.asarray(height_of_start * height_of_end < 0)
        # Most segments stay on one side; only the others are intersected with the board.
        starts = np.broadcast_to(starts_m, (*crosses.shape, 3))[crosses]
        ends = np.broadcast_to(ends_m, (*crosses.shape, 3))[crosses]
        above = np.broadcast_to(height_of_start, crosses.shape)[crosses]
        share = above / (above - np.broadcast_to(height_of_end, crosses.shape)[crosses])
        hit = starts + share[:, None] * (ends - starts) - centre
        inside = (np.abs(hit @ self.right) <= self.width_m / 2) & (np.abs(hit @ self.up) <= self.height_m / 2)
        crosses[crosses] = inside
        return crosses

    def grid(self, columns: int, rows: int, margin_m: float = 0.0) -> tuple[Floats, Floats]:
        """`columns` × `rows` points spread evenly over the front, row by row from top left: points, normals (N, 3)."""
        check_count(columns=columns, rows=rows)
        if not 0 <= margin_m < min(self.width_m, self.height_m) / 2:
            raise RangeError(
                f"margin_m = {margin_m!r}; allowed: 0 to less than half of {self.width_m} × {self.height_m} m"
            )
        across = _cell_centres(columns, self.width_m - 2 * margin_m)
        down = -_cell_centres(rows, self.height_m - 2 * margin_m)
        v, u = np.meshgrid(down, across, indexing="ij")
        points = np.array(self.centre_m) + u.reshape(-1, 1) * self.right + v.reshape(-1, 1) * self.up
        return points, np.broadcast_to(self.normal, points.shape).copy()


@dataclass(frozen=True)
class Sphere:
    """A ball: `centre_m` (3,) and `radius_m`, both in metres."""

    name: str
    centre_m: tuple[float, float, float]
    radius_m: float

    def __post_init__(self) -> None:
        set_places(self, "centre_m")
        check_positive("Sphere", radius_m=self.radius_m)

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments, (..., 3) each, pass through the ball; shape (...)."""
        start = starts_m - np.array(self.centre_m)
        way = ends_m - starts_m
        along = np.clip(-(start * way).sum(axis=-1) / np.maximum((way * way).sum(axis=-1), 1e-300), 0.0, 1.0)
        nearest = start + along[..., None] * way
        return np.asarray((nearest * nearest).sum(axis=-1) < self.radius_m**2)

    def spiral(self, count: int, highest_z: float = 1.0, lowest_z: float = -1.0) -> tuple[Floats, Floats]:
        """`count` points spread evenly on a Fibonacci spiral between two heights (in radii): points, normals (N, 3).

        Equal steps in height are equal areas on a sphere (Archimedes), so the spread is even by area.
        """
        check_count(count=count)
        if not -1 <= lowest_z < highest_z <= 1:
            raise RangeError(f"lowest_z = {lowest_z!r}, highest_z = {highest_z!r}; allowed: -1 to 1, the lowest below")
        z = highest_z - (highest_z - lowest_z) * (np.arange(count) + 0.5) / count
        turn = GOLDEN_ANGLE * np.arange(count)
        ring = np.sqrt(1 - z**2)
        normals = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), z])
        return np.array(self.centre_m) + self.radius_m * normals, normals


@dataclass(frozen=True)
class Box:
    """An axis-parallel box between two corners, in metres."""

    name: str
    lowest_m: tuple[float, float, float]
    highest_m: tuple[float, float, float]

    def __post_init__(self) -> None:
        set_places(self, "lowest_m", "highest_m")
        if not all(low < high for low, high in zip(self.lowest_m, self.highest_m, strict=True)):
            raise RangeError(f"Box {self.lowest_m} to {self.highest_m}; allowed: each of the first below the second")

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments, (..., 3) each, pass through the box (slab test); shape (...)."""
        enter, leave = np.asarray(-np.inf), np.asarray(np.inf)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for axis, (low, high) in enumerate(zip(self.lowest_m, self.highest_m, strict=True)):
                start = starts_m[..., axis]
                way = ends_m[..., axis] - start
                near, far = (low - start) / way, (high - start) / way
                # A segment parallel to a slab has 0/0 only on its face: nan propagates, and counts as outside.
                enter, leave = np.maximum(enter, np.minimum(near, far)), np.minimum(leave, np.maximum(near, far))
            return np.asarray((enter < leave) & (leave > 0) & (enter < 1))


def _cell_centres(count: int, length: float) -> Floats:
    """The centres of `count` equal cells on a length, about 0."""
    return np.asarray(length * ((np.arange(count) + 0.5) / count - 0.5))


def any_blocks(shapes: Sequence[Shape], starts_m: Floats, ends_m: Floats) -> Bools:
    """Whether any of `shapes` blocks the open segments, (..., 3) each; shape (...)."""
    blocked = np.zeros(np.broadcast_shapes(starts_m.shape, ends_m.shape)[:-1], dtype=bool)
    for shape in shapes:
        blocked |= shape.blocks(starts_m, ends_m)
    return blocked
