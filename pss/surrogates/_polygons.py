"""Triangulation of faces with any number of corners. It keeps each corner, so that neighbours still share edges.

Convex faces become a fan. Others are cut ear by ear, the best shaped ear first ("Polygon triangulation by ear
clipping", Meisters 1975: a simple polygon of more than three corners has at least two). Fast libraries for this
drop corners on straight edges, which opens the surface there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pss.errors import RangeError
from pss.hints import Bools, Floats, Integers

__all__ = ["FLATNESS", "MOST_CONCAVE_CORNERS", "Polygons", "triangulated"]


# Largest distance of a corner from the plane of its face, over the face's extent: a fold of about 20 degrees.
FLATNESS = 0.1
# Largest number of corners of a face that is not convex: its edges are compared in pairs.
MOST_CONCAVE_CORNERS = 1_000
# Of all such faces in a file: cutting takes 0.1 ms a corner for small ones, 0.4 ms for the largest.
MOST_CONCAVE_CORNERS_IN_ALL = 100_000
# Sine of the largest turn that counts as straight. Single precision bends a straight edge by about 1e-6.
STRAIGHT = 1e-5
# Distance over extent at which an outline touches itself, far above the rounding of a projection.
TOUCH = 1e-9
# Area over extent², below which a face has no defined plane.
NO_AREA = 1e-12
# Rows of edge pairs compared at once.
ROWS = 256
SIMPLE = f"simple polygons whose corners are within {FLATNESS:.0%} of their extent from one plane"


@dataclass(frozen=True, eq=False)
class Polygons:
    """Faces read from a file.

    Attributes:
        vertices: (V, 3), in the file's units.
        corners: indices of vertices, face after face, (Σ counts,).
        counts: corners of each face, (F,), 3 or more.
        place: function from a face's number to its place in the file, for messages: `line 12`.
    """

    vertices: Floats
    corners: Integers
    counts: Integers
    place: Callable[[int], str]


def triangulated(polygons: Polygons) -> Integers:
    """Triangles (T, 3) of vertices, in the order of the faces and with their winding.

    Raises:
        RangeError: a vertex does not exist or is not finite; a face touches or crosses itself, has no area, is too far
            out of a plane, or has too many corners. The message has its place in the file.
    """
    corners, counts, vertices = polygons.corners, polygons.counts, polygons.vertices
    first = np.concatenate([[0], np.cumsum(counts)])
    wrong = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
    if len(wrong):
        place = polygons.place(int(np.searchsorted(first, wrong[0], side="right")) - 1)
        raise RangeError(f"{place}: vertex number {corners[wrong[0]]} from 0; allowed: 0 to {len(vertices) - 1}")
    parts, owners = [], []
    concave = 0
    for count in np.unique(counts):
        owner = np.flatnonzero(counts == count)
        indices = corners[first[owner][:, None] + np.arange(count)]
        if count == 3:
            parts.append(indices)
            owners.append(owner)
            continue
        convex = _convex(vertices[indices])
        fan = np.stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)], axis=1)
        parts.append(indices[convex][:, fan].reshape(-1, 3))
        owners.append(np.repeat(owner[convex], count - 2))
        concave += int(count * (~convex).sum())
        if concave > MOST_CONCAVE_CORNERS_IN_ALL:
            most = MOST_CONCAVE_CORNERS_IN_ALL
            raise RangeError(f"{concave} corners or more of faces that are not convex; allowed: at most {most}")
        for number, face in zip(owner[~convex], indices[~convex], strict=True):
            try:
                triangles = face[_cut(vertices[face])]
            except RangeError as error:
                raise RangeError(f"{polygons.place(int(number))}: a face of {count} corners {error}") from None
            parts.append(triangles)
            owners.append(np.full(len(triangles), number))
    if not parts:
        return np.zeros((0, 3), dtype=np.int64)
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.asarray(np.concatenate(parts)[order], dtype=np.int64)


# ---- convex faces, all of one number of corners at once --------------------------------------------------------------


def _convex(points: Floats) -> Bools:
    """Which faces (G, n, 3) are flat enough and strictly convex, winding once; (G,)."""
    with np.errstate(all="ignore"):  # degenerate faces fail the comparisons
        flat, height, area, extent = _in_their_planes(points)
        edge = np.roll(flat, -1, axis=1) - flat
        before = np.roll(edge, 1, axis=1)
        sine, cosine = _cross(before, edge), (before * edge).sum(axis=-1)
        lengths = np.linalg.norm(before, axis=-1) * np.linalg.norm(edge, axis=-1)
        turns = np.arctan2(sine, cosine).sum(axis=-1) / (2 * np.pi)
        return np.asarray(
            (area > NO_AREA * extent**2)
            & (height <= FLATNESS * extent)
            & (sine > STRAIGHT * lengths).all(axis=-1)
            & (np.abs(turns - 1) < 0.5)
        )


def _in_their_planes(points: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Faces (G, n, 3) in the plane of their vector area: (G, n, 2) counterclockwise, and three numbers of each, (G,).

    The numbers are the largest height above the plane, the area and the largest distance from the middle.
    """
    local = points - points.mean(axis=1, keepdims=True)
    extent = np.linalg.norm(local, axis=-1).max(axis=-1)
    vector = np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1) / 2
    area = np.linalg.norm(vector, axis=-1)
    normal = vector / area[:, None]
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=-1)])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    frame = np.stack([across, np.cross(normal, across), normal], axis=-1)
    seen = local @ frame
    return seen[..., :2], np.abs(seen[..., 2]).max(axis=-1), area, extent


def _cross(a: Floats, b: Floats) -> Floats:
    """z of the cross product of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


# ---- one face --------------------------------------------------------------------------------------------------------


def _cut(points: Floats) -> Integers:
    """Corners (T, 3) of the triangles of one face (n, 3).

    Raises:
        RangeError: it cannot be triangulated; the message has no place.
    """
    # Some programs write triangles as quads with two equal corners.
    kept = np.flatnonzero((points != np.roll(points, 1, axis=0)).any(axis=1))
    if len(kept) < 3:
        raise RangeError(f"has {len(kept)} different ones; allowed: 3 or more")
    if len(kept) > MOST_CONCAVE_CORNERS:
        raise RangeError(f"is not convex; allowed: at most {MOST_CONCAVE_CORNERS} corners of a face that is not")
    if not np.isfinite(points).all():
        raise RangeError("has one that is not finite; allowed: finite numbers")
    if len(kept) == 3:
        return kept[None, :]
    with np.errstate(all="ignore"):
        (flat,), (height,), (area,), (extent,) = _in_their_planes(points[kept][None])
    if not area > NO_AREA * extent**2:
        raise RangeError(f"has no area; allowed: {SIMPLE}")
    if not height <= FLATNESS * extent:
        raise RangeError(f"is bent by {height / extent:.0%} of its extent; allowed: {SIMPLE}")
    flat = flat / extent
    if _touches_itself(flat):
        raise RangeError(f"has an outline that touches or crosses itself; allowed: {SIMPLE}")
    return kept[_without_ears(flat)]


def _touches_itself(outline: Floats) -> bool:
    """Whether edges of the outline (n, 2), of extent 1, meet anywhere except in the corner that neighbours share."""
    count = len(outline)
    ends = np.roll(outline, -1, axis=0)
    edge = ends - outline
    length = np.linalg.norm(edge, axis=1)
    before = np.roll(edge, 1, axis=0)
    folded = (np.abs(_cross(before, edge)) <= TOUCH * np.roll(length, 1)) & ((before * edge).sum(axis=1) < 0)
    if folded.any():
        return True
    low, high = np.minimum(outline, ends) - TOUCH, np.maximum(outline, ends) + TOUCH
    for start in range(0, count, ROWS):
        rows = np.arange(start, min(start + ROWS, count))

        def aside(points: Floats, rows: Integers = rows) -> Floats:
            """The side of each edge of `rows` on which the points are, (R, n): −1, 0 or 1."""
            distance = _cross(edge[rows, None], points[None] - outline[rows, None]) / length[rows, None]
            return np.where(np.abs(distance) <= TOUCH, 0.0, np.sign(distance))

        def aside_of_all(points: Floats) -> Floats:
            distance = _cross(edge[None], points[:, None] - outline[None]) / length[None]
            return np.where(np.abs(distance) <= TOUCH, 0.0, np.sign(distance))

        meet = (aside(outline) * aside(ends) <= 0) & (aside_of_all(outline[rows]) * aside_of_all(ends[rows]) <= 0)
        meet &= (low[rows, None] <= high[None]).all(axis=-1) & (low[None] <= high[rows, None]).all(axis=-1)
        apart = (rows[:, None] - np.arange(count)) % count
        if (meet & (apart > 1) & (apart < count - 1)).any():
            return True
    return False


def _without_ears(outline: Floats) -> Integers:
    """Corners (n − 2, 3) of a triangulation of the simple counterclockwise outline (n, 2), of extent 1."""
    left = np.arange(len(outline))
    triangles = []
    while len(left) > 3:
        ear = _best_ear(outline[left])
        triangles.append(left[[ear - 1, ear, (ear + 1) % len(left)]])
        left = np.delete(left, ear)
    return np.array([*triangles, left])


def _best_ear(outline: Floats) -> int:
    """The corner of (m, 2) that can be cut off with the triangle least like a sliver.

    Raises:
        RangeError: there is none, which only rounding can cause.
    """
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    sides = [outline - before, after - outline, before - after]
    area = _cross(sides[0], sides[1])
    shape = area / np.max([(side**2).sum(axis=1) for side in sides], axis=0)
    ears = np.argsort(-shape, kind="stable")
    ears = ears[area[ears] > 0]
    # Corners on a triangle's side rule it out, unless rounding then leaves no ear.
    for limit in (-TOUCH, 0.0):
        for ear in ears:
            others = np.delete(outline, [ear - 1, ear, (ear + 1) % len(outline)], axis=0)
            inside = np.ones(len(others), dtype=np.bool_)
            for start, side in zip((before[ear], outline[ear], after[ear]), (s[ear] for s in sides), strict=True):
                inside &= _cross(side, others - start) > limit * np.linalg.norm(side)
            if not inside.any():
                return int(ear)
    raise RangeError(f"has an outline that touches itself; allowed: {SIMPLE}")
