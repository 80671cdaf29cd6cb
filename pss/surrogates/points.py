"""Points of interest with normals (section 3.4): the paper's models that are given as points.

Those spread over a shape are in `pss.surrogates.spread`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.cameras.camera import as_points
from pss.errors import GeometryError, RangeError, ShapeError
from pss.hints import Bools, Floats, Integers
from pss.inputs import labels, members, place
from pss.surrogates._checks import turn_about_z
from pss.surrogates.shapes import Box

__all__ = ["Surrogate", "box_corners", "convex_hull", "dense_cloud", "single_point"]


# A unit normal read from a file with seven digits is off by less; accepted normals are normalised.
NORMAL_LENGTH_TOLERANCE = 1e-6
# Neighbours with a smaller share of variance across than this are on a line, which has no normal.
LINE_VARIANCE_RATIO = 1e-12


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Points of interest that represent the objects to resolve. Arrays are read-only.

    Attributes:
        points_m: m, (N, 3), N ≥ 1.
        normals: unit outward normals of the surface at the points, (N, 3).
        objects: the name of the object that bears each point, (N,); a single name applies to all.

    Raises:
        ShapeError, RangeError: wrong shapes, no points, values that are not finite, normals that are not of length 1.
    """

    points_m: Floats
    normals: Floats
    objects: NDArray[np.str_]

    def __post_init__(self) -> None:
        points, normals = as_points(self.points_m), as_points(self.normals, "normals")
        if points.ndim != 2 or points.shape != normals.shape or len(points) == 0:
            raise ShapeError(
                f"points_m {points.shape} and normals {normals.shape}; allowed are two alike, (N, 3), N > 0"
            )
        lengths = np.linalg.norm(normals, axis=1)
        if (np.abs(lengths - 1) > NORMAL_LENGTH_TOLERANCE).any():
            worst = float(lengths[np.abs(lengths - 1).argmax()])
            raise RangeError(f"a normal has length {worst:.6g}; allowed is 1 ± {NORMAL_LENGTH_TOLERANCE:g}")
        objects = labels(self.objects, "objects")
        if objects.shape not in ((), (len(points),)):
            raise ShapeError(f"objects has shape {objects.shape}; allowed is ({len(points)},) or one name")
        objects = np.broadcast_to(objects, len(points)).copy()
        for name, array in (("points_m", points), ("normals", normals / lengths[:, None]), ("objects", objects)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.points_m)

    def __add__(self, other: Surrogate) -> Surrogate:
        """The points of both, this one's first."""
        return Surrogate.join([self, other])

    @staticmethod
    def join(parts: Sequence[Surrogate]) -> Surrogate:
        """The points of all `parts`, one or more, in their order."""
        parts = members(parts, "parts", "normals", "surrogates")
        if not parts:
            raise ShapeError("Surrogate.join got no parts; allowed: one or more")
        points, normals, objects = zip(*((part.points_m, part.normals, part.objects) for part in parts), strict=True)
        return Surrogate(np.concatenate(points), np.concatenate(normals), np.concatenate(objects))

    def take(self, chosen: Integers | Bools) -> Surrogate:
        """The points with the indices `chosen`, (M,), or where it is true, (N,)."""
        return Surrogate(self.points_m[chosen], self.normals[chosen], self.objects[chosen])

    def moved(self, translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0), turn_deg: float = 0.0) -> Surrogate:
        """A copy rotated about world z, as cameras pan (90° take +y to +x), then moved by `translation_m` (3,)."""
        offset = place(translation_m, "Surrogate.moved.translation_m")
        points = turn_about_z(self.points_m, turn_deg) + np.array(offset)
        return Surrogate(points, turn_about_z(self.normals, turn_deg), self.objects)


def single_point(point_m: ArrayLike, normal: ArrayLike, name: str = "point") -> Surrogate:
    """One point, m, (3,), with its normal, (3,), of any length but zero."""
    point, direction = as_points(point_m, "point_m"), as_points(normal, "normal")
    if point.shape != (3,) or direction.shape != (3,):
        raise ShapeError(f"point_m {point.shape} and normal {direction.shape}; allowed are two of (3,)")
    return Surrogate(point[None], _unit(direction[None]), np.array(name))


def box_corners(box: Box) -> Surrogate:
    """The eight corners of `box`; each normal has equal angles to the three faces that meet there."""
    signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    corners = np.where(signs > 0, np.array(box.highest_m), np.array(box.lowest_m))
    return Surrogate(corners, _unit(signs), np.array(box.name))


def dense_cloud(
    points_m: ArrayLike, normals: ArrayLike | None = None, *, name: str = "cloud", neighbours: int = 12
) -> Surrogate:
    """User-defined points, such as a scan's.

    Normals that are not given are estimated: the direction of least variance among each point and its nearest
    neighbours, oriented away from the centroid of all. This is correct for a convex body sampled finely enough. It
    fails in folds that face the centroid, and on sheets thinner than the spacing of the points.

    Args:
        points_m: m, (N, 3).
        normals: outward, (N, 3), of any length but zero; estimated if None.
        neighbours: number of nearest points, including itself, from which a normal is estimated; 3 or more.

    Raises:
        ShapeError, RangeError: wrong shapes, values that are not finite, or too few neighbours.
        GeometryError: fewer than three points, or neighbours along a line, to estimate a normal from.
    """
    points = as_points(points_m)
    if points.ndim != 2:
        raise ShapeError(f"points_m has shape {points.shape}; allowed is (N, 3)")
    if normals is not None:
        return Surrogate(points, _unit(as_points(normals, "normals")), np.array(name))
    if neighbours < 3:
        raise RangeError(f"neighbours = {neighbours!r}; allowed: 3 or more")
    if len(points) < 3:
        raise GeometryError(
            f"{len(points)} points have no surface to guess normals from; allowed: 3 or more, or normals"
        )
    from scipy.spatial import cKDTree

    _, nearest = cKDTree(points).query(points, k=min(neighbours, len(points)))
    around = points[nearest] - points[nearest].mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(around.mT @ around)
    lines = variances[:, 1] <= LINE_VARIANCE_RATIO * variances[:, 2]
    if lines.any():
        place = tuple(points[lines.argmax()].tolist())
        raise GeometryError(f"the {nearest.shape[1]} points nearest to {place} lie on a line; allowed: more neighbours")
    guessed = axes[:, :, 0]
    inwards = ((points - points.mean(axis=0)) * guessed).sum(axis=1) < 0
    return Surrogate(points, np.where(inwards[:, None], -guessed, guessed), np.array(name))


def convex_hull(points_m: ArrayLike, name: str = "hull") -> Surrogate:
    """The corners of the convex hull of `points_m`, m, (P, 3); normals are the faces' means, weighted by area.

    Raises:
        GeometryError: the points span no volume.
    """
    points = as_points(points_m)
    if points.ndim != 2:
        raise ShapeError(f"points_m has shape {points.shape}; allowed is (P, 3)")
    if len(points) < 4:
        raise GeometryError(f"{len(points)} points span no volume; allowed: four or more, not all in one plane")
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError as error:
        raise GeometryError(f"{len(points)} points span no volume; allowed: not all in one plane") from error
    first, second, third = np.moveaxis(points[hull.simplices], 1, 0)
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    sums = np.zeros_like(points)
    for corner in range(3):
        np.add.at(sums, hull.simplices[:, corner], areas[:, None] * hull.equations[:, :3])
    return Surrogate(points[hull.vertices], _unit(sums[hull.vertices]), np.array(name))


def _unit(directions: Floats) -> Floats:
    """`directions`, (N, 3), normalised."""
    lengths = np.linalg.norm(directions, axis=-1, keepdims=True)
    if not lengths.all():
        raise RangeError("a normal has length 0; allowed: any other")
    return np.asarray(directions / lengths)
