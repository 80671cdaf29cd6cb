"""Point orderings whose every prefix covers the whole set evenly."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pss.cameras.camera import as_points
from pss.errors import RangeError, ShapeError
from pss.hints import Floats, Integers
from pss.surrogates._checks import check_count

__all__ = ["as_cloud", "balanced_order", "farthest_point_order"]


def farthest_point_order(points_m: ArrayLike, count: int | None = None) -> Integers:
    """Indices of `count` of the points, m, (N, 3), each the farthest from those before it: (count,), all N if None.

    Every prefix covers the points' extent evenly in *space*. If the points are denser in some places, the mean over a
    prefix differs from the mean over all: for PSS use `balanced_order`. The first is the point nearest to the centroid,
    with the lowest index among equals. Takes O(N · count).
    """
    points = as_cloud(points_m)
    count = len(points) if count is None else count
    check_count(count=count)
    if count > len(points):
        raise RangeError(f"count = {count!r}; allowed: 1 to {len(points)}, the number of points")
    chosen = np.empty(count, dtype=np.int64)
    chosen[0] = ((points - points.mean(axis=0)) ** 2).sum(axis=1).argmin()
    distance2 = np.full(len(points), np.inf)
    for number in range(1, count):
        last = chosen[number - 1]
        distance2 = np.minimum(distance2, ((points - points[last]) ** 2).sum(axis=1))
        # Below any distance, so that of coincident points each is taken once.
        distance2[last] = -1.0
        chosen[number] = distance2.argmax()
    return chosen


def balanced_order(points_m: ArrayLike) -> Integers:
    """All indices of the points, m, (N, 3), ordered so that every prefix has the density of the whole set: (N,).

    The points are halved recursively, at the median of the longest side, and the halves of each part alternate: any
    part's share of a prefix is accurate to about one point for each halving above it (a few, once fewer than half of
    the points remain). Which half comes first is pseudo-random, so that no prefix is biased to one side, yet
    reproducible. Takes O(N log² N).
    """
    points = as_cloud(points_m)
    part, key = np.zeros(len(points), dtype=np.int64), np.zeros(len(points), dtype=np.int64)
    for level in range((len(points) - 1).bit_length()):
        by_part = np.argsort(part, kind="stable")
        starts: Integers = np.flatnonzero(np.diff(part[by_part], prepend=-1))
        size = np.diff(starts, append=len(points))
        arranged = points[by_part]
        extent = np.maximum.reduceat(arranged, starts) - np.minimum.reduceat(arranged, starts)
        along = np.take_along_axis(arranged, np.repeat(extent.argmax(axis=1), size)[:, None], axis=1)[:, 0]
        sorted_within = by_part[np.lexsort((along, part[by_part]))]
        rank = np.arange(len(points)) - np.repeat(starts, size)
        mirrored = np.repeat(_coin(part[by_part][starts] + 2**level), size)
        half = (rank >= np.repeat((size + 1) // 2, size)).astype(np.int64)
        single = np.repeat(size, size) == 1
        part[sorted_within] = 2 * part[sorted_within] + half
        key[sorted_within] |= np.where(single, 0, half ^ mirrored) << level
    return np.argsort(key, kind="stable")


def _coin(numbers: Integers) -> Integers:
    """0 or 1 for each integer, without a pattern: the highest bit of its hash (as in SplitMix64)."""
    mixed = numbers.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(mixed >> np.uint64(63), dtype=np.int64)


def as_cloud(points_m: ArrayLike) -> Floats:
    """`points_m` as (N, 3).

    Raises:
        ShapeError: another shape, or no points.
        RangeError: not finite numbers.
    """
    points = as_points(points_m)
    if points.ndim != 2 or len(points) == 0:
        raise ShapeError(f"points_m has shape {points.shape}; allowed is (N, 3) with at least one point")
    return points
