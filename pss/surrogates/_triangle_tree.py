"""Which segments cross which triangles: a hierarchy of boxes, then a watertight test of the remaining triangles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pss.hints import Bools, Floats, Integers

__all__ = ["TriangleTree"]


# Small leaves need more boxes, large ones more triangles. For bodies of 300 to 20,000 triangles, 8 is the fastest.
LEAF_TRIANGLES = 8
# Factor between the numbers of boxes of successive levels, as a power of two.
BRANCHING_BITS = 2
# Boxes are enlarged by this share of the mesh's size, far above the slab test's rounding, or flat ones would leak.
BOX_MARGIN = 1e-9
# Bounds on memory: pairs of segment and box open at once (about 100 bytes each) …
MOST_BOX_PAIRS = 2**20
# … and pairs of segment and triangle (about 200 bytes each), few enough for a processor's cache.
MOST_TRIANGLE_PAIRS = 2**15
# Replaces a component of 0 as a divisor; its inverse is still finite.
SMALLEST_STEP = 1e-300


class TriangleTree:
    """A balanced tree over the triangles `corners_m`, m, (F, 3, 3), for tests of which segments cross any of them."""

    def __init__(self, corners_m: Floats) -> None:
        bits = max(0, int(np.ceil(np.log2(len(corners_m) / LEAF_TRIANGLES))))
        bounds = np.arange(2**bits + 1) * len(corners_m) // 2**bits
        order = _sorted_in_space(corners_m.mean(axis=1), bounds)
        low, high = (
            extreme.reduceat(reduced, bounds[:-1])
            for extreme, reduced in (
                (np.minimum, corners_m.min(axis=1)[order]),
                (np.maximum, corners_m.max(axis=1)[order]),
            )
        )
        margin = BOX_MARGIN * np.abs(corners_m).max()
        self._levels = list(_levels(low - margin, high + margin))[::-1]

        first, second, third = np.moveaxis(corners_m[order], 1, 0)
        normal = np.cross(second - first, third - first)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), SMALLEST_STEP)
        # Leaves differ by one triangle: a row of zeros, which no segment crosses, pads the smaller ones.
        sizes = np.diff(bounds)
        slot = bounds[:-1, None] + np.arange(sizes.max())
        slot = np.where(np.arange(sizes.max()) < sizes[:, None], slot, len(order))
        table = np.concatenate([first, second, third, normal, (normal * first).sum(axis=1, keepdims=True)], axis=1)
        table = np.concatenate([table, np.zeros((1, table.shape[1]))])
        self._planes = np.ascontiguousarray(np.moveaxis(table[slot, 9:], -1, 0))  # normal and offset, (4, leaves, size)
        self._corners = np.ascontiguousarray(np.moveaxis(table[slot, :9], -1, 0))  # (9, leaves, size)

    def crossed(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether each open segment, (S, 3) and (S, 3), crosses a triangle or an edge between two; (S,)."""
        blocked = np.zeros(len(starts_m), dtype=bool)
        leaves, size = self._planes.shape[1:]
        at_once = max(1, MOST_BOX_PAIRS // leaves)
        pairs_at_once = max(1, MOST_TRIANGLE_PAIRS // size)
        for begin in range(0, len(starts_m), at_once):
            part = slice(begin, begin + at_once)
            segment, leaf = self._leaves_met(starts_m[part], ends_m[part] - starts_m[part])
            # Most segments miss: the following is for the others.
            near = np.unique(segment)
            segment = np.searchsorted(near, segment)
            starts, ends, hit = starts_m[part][near], ends_m[part][near], np.zeros(len(near), dtype=bool)
            axes = _across(starts, ends - starts)
            while len(segment):
                hit[self._hits(segment[:pairs_at_once], leaf[:pairs_at_once], starts, ends, axes)] = True
                segment, leaf = segment[pairs_at_once:], leaf[pairs_at_once:]
                unknown = ~hit[segment]
                segment, leaf = segment[unknown], leaf[unknown]
            blocked[begin + near[hit]] = True
        return blocked

    def _leaves_met(self, starts: Floats, way: Floats) -> tuple[Integers, Integers]:
        """The pairs of segment and leaf whose box the segment passes: two arrays of indices, (P,)."""
        inverse = 1 / np.where(np.abs(way) < SMALLEST_STEP, SMALLEST_STEP, way)
        segment, box = np.arange(len(starts)), np.zeros(len(starts), dtype=np.int64)
        above = 1
        for low, high in self._levels:
            branches = len(low) // above
            segment = np.repeat(segment, branches)
            box = (box[:, None] * branches + np.arange(branches)).reshape(-1)
            enter, leave = np.zeros(len(box)), np.ones(len(box))
            for axis in range(3):
                origin, speed = starts[segment, axis], inverse[segment, axis]
                with np.errstate(over="ignore"):
                    near, far = (low[box, axis] - origin) * speed, (high[box, axis] - origin) * speed
                enter = np.maximum(enter, np.minimum(near, far))
                leave = np.minimum(leave, np.maximum(near, far))
            met = enter <= leave
            segment, box, above = segment[met], box[met], len(low)
        return segment, box

    def _hits(self, segment: Integers, leaf: Integers, starts: Floats, ends: Floats, axes: Floats) -> Integers:
        """The segments, of the pairs (P,) with a leaf, that cross one of its triangles: indices, perhaps repeated."""
        x, y, z, offset = self._planes[:, leaf]
        before, after = (
            x * place[:, 0, None] + y * place[:, 1, None] + z * place[:, 2, None] - offset
            for place in (starts[segment], ends[segment])
        )
        pair, slot = np.nonzero(((before < 0) & (after > 0)) | ((before > 0) & (after < 0)))
        segment = segment[pair]
        corners = self._corners[:, leaf[pair], slot].reshape(3, 3, -1)
        # Viewed along the segment, which is then the point (0, 0). A corner shared by several triangles is always
        # projected by the same operations, so that each edge has exactly the opposite sign in the adjacent triangle: no
        # segment passes between two. (The test of Möller and Trumbore lacks this guarantee.)
        u, v = (
            [x * axis[0] + y * axis[1] + z * axis[2] - axis[3] for x, y, z in corners] for axis in axes[:, :, segment]
        )
        sides = [u[i] * v[j] - u[j] * v[i] for i, j in ((0, 1), (1, 2), (2, 0))]
        inside = np.minimum(np.minimum(*sides[:2]), sides[2]) >= 0
        inside |= np.maximum(np.maximum(*sides[:2]), sides[2]) <= 0
        return np.asarray(segment[inside])


def _sorted_in_space(centres: Floats, bounds: Integers) -> Integers:
    """An order of `centres`, (F, 3), in which each range between two of `bounds` is compact in space."""
    order = np.arange(len(centres))
    ranges = [(0, len(bounds) - 1)]
    while ranges:
        first, last = ranges.pop()
        if last - first == 1:
            continue
        part, middle = order[bounds[first] : bounds[last]], (first + last) // 2
        longest = np.ptp(centres[part], axis=0).argmax()
        split = np.argpartition(centres[part, longest], bounds[middle] - bounds[first])
        order[bounds[first] : bounds[last]] = part[split]
        ranges += [(first, middle), (middle, last)]
    return order


def _levels(low: Floats, high: Floats) -> Iterator[tuple[Floats, Floats]]:
    """The boxes of each level, (boxes, 3) twice, from the leaves to the root."""
    yield low, high
    while len(low) > 1:
        boxes = max(1, len(low) >> BRANCHING_BITS)
        low, high = low.reshape(boxes, -1, 3).min(axis=1), high.reshape(boxes, -1, 3).max(axis=1)
        yield low, high


def _across(starts: Floats, way: Floats) -> Floats:
    """Two unit vectors orthogonal to each way, (S, 3), and coordinates of the starts, (S, 3), along them: (2, 4, S).

    For a way of zero, which crosses nothing, they are arbitrary.
    """
    least = np.eye(3)[np.abs(way).argmin(axis=1)]
    first = np.cross(way, least)
    second = np.cross(way, first)
    axes = np.stack([first, second])
    # Scaled, so that products of very large or small ways stay in the range of doubles.
    axes /= np.maximum(np.abs(axes).max(axis=-1, keepdims=True), SMALLEST_STEP)
    axes /= np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), SMALLEST_STEP)
    return np.concatenate([np.moveaxis(axes, -1, 1), (axes * starts).sum(axis=-1)[:, None]], axis=1)
