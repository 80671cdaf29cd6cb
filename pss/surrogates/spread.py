"""Points of interest spread evenly, by area, over a shape (section 3.4).

All but the mesh's follow one pattern, deterministic for every count: equal steps of area in one direction, golden-ratio
steps in the other. Its gaps stay uniform however much a surface is stretched, as no fraction approximates the ratio.
"""

from __future__ import annotations

import heapq
import math
from typing import Literal, get_args

import numpy as np
from numpy.random import Generator

from pss.errors import RangeError
from pss.hints import Floats, Integers
from pss.surrogates._checks import check_count
from pss.surrogates.mesh import Mesh
from pss.surrogates.points import Surrogate
from pss.surrogates.round_solids import Capsule, Cylinder
from pss.surrogates.shapes import GOLDEN_ANGLE, Box, Rectangle, Sphere

__all__ = [
    "SamplingMethod",
    "grid_on_rectangle",
    "on_box",
    "on_capsule",
    "on_cylinder",
    "on_mesh",
    "on_rectangle",
    "on_sphere",
]

SamplingMethod = Literal["area-uniform", "poisson-disc"]

GOLDEN_RATIO = (1 + math.sqrt(5)) / 2
# Poisson-disc points are selected from this many times as many; more improve the gaps hardly any further.
CANDIDATES = 5
# Weight exponent of the closest pairs when dropping points (Yuksel 2015, "Sample Elimination", Eq. 3).
CROWDING_EXPONENT = 8


def on_rectangle(board: Rectangle, count: int) -> Surrogate:
    """`count` points, even by area, on the front of `board`."""
    across, up = _golden_lattice(count, board.width_m, board.height_m)
    points = np.array(board.centre_m) + across[:, None] * board.right + up[:, None] * board.up
    return Surrogate(points, np.tile(board.normal, (count, 1)), np.array(board.name))


def grid_on_rectangle(board: Rectangle, columns: int, rows: int, margin_m: float = 0.0) -> Surrogate:
    """`columns` × `rows` points on the front of `board`, row by row from top left, off its edges by `margin_m`."""
    return Surrogate(*board.grid(columns, rows, margin_m), np.array(board.name))


def on_sphere(sphere: Sphere, count: int) -> Surrogate:
    """`count` points, even by area, in a spiral from the top to the bottom of `sphere`."""
    return Surrogate(*sphere.spiral(count), np.array(sphere.name))


def on_box(box: Box, count: int) -> Surrogate:
    """`count` points, even by area, on the six faces of `box`; a face has its share to within one point."""
    check_count(count=count)
    low, high = np.array(box.lowest_m), np.array(box.highest_m)
    size, centre = high - low, (low + high) / 2
    shares = np.repeat(size.prod() / size, 2)
    points, normals = [], []
    for face, number in enumerate(_apportioned(count, shares)):
        if number == 0:
            continue
        axis, sign = face // 2, 1.0 if face % 2 else -1.0
        normal = np.eye(3)[axis] * sign
        first, second = np.delete(np.eye(3), axis, axis=0)
        along, across = _golden_lattice(int(number), float(size @ first), float(size @ second))
        points.append(centre + normal * size[axis] / 2 + along[:, None] * first + across[:, None] * second)
        normals.append(np.tile(normal, (number, 1)))
    return Surrogate(np.concatenate(points), np.concatenate(normals), np.array(box.name))


def on_cylinder(cylinder: Cylinder, count: int, caps: bool = True) -> Surrogate:
    """`count` points, even by area, in one spiral down `cylinder`: out over the top, down the side, in at the bottom.

    Args:
        caps: whether to include top and bottom, or the side only.
    """
    check_count(count=count)
    radius, height = cylinder.radius_m, cylinder.height_m
    cap, side = (math.pi * radius**2 if caps else 0.0), 2 * math.pi * radius * height
    area = (2 * cap + side) * (np.arange(count) + 0.5) / count
    top, bottom = area < cap, area > cap + side
    # Area grows with the square of the radius on a disc, and with the height on the side.
    from_rim = np.where(top, area, np.where(bottom, 2 * cap + side - area, cap))
    ring = radius * np.sqrt(from_rim / cap) if caps else np.full(count, radius)
    z = height / 2 - np.clip(area - cap, 0.0, side) / (2 * math.pi * radius)
    flat = top | bottom
    x, y = _golden_turns(count)
    points = np.array(cylinder.centre_m) + np.column_stack([ring * x, ring * y, z])
    upright = np.where(top, 1.0, -1.0)
    normals = np.where(
        flat[:, None], upright[:, None] * np.array([0.0, 0.0, 1.0]), np.column_stack([x, y, np.zeros(count)])
    )
    return Surrogate(points, normals, np.array(cylinder.name))


def on_capsule(capsule: Capsule, count: int) -> Surrogate:
    """`count` points, even by area, in one spiral along `capsule` from its end to its start.

    Equal steps along the axis are equal areas on the rounded ends (Archimedes) and on the side alike.
    """
    check_count(count=count)
    radius, half = capsule.radius_m, capsule.length_m / 2
    along = (half + radius) * (1 - (2 * np.arange(count) + 1) / count)
    beyond = (along - np.clip(along, -half, half)) / radius
    ring = np.sqrt(1 - beyond**2)
    x, y = _golden_turns(count)
    normals = np.column_stack([ring * x, ring * y, beyond]) @ capsule.frame
    middle = (np.array(capsule.start_m) + np.array(capsule.end_m)) / 2
    on_axis = middle + np.clip(along, -half, half)[:, None] * capsule.frame[2]
    return Surrogate(on_axis + radius * normals, normals, np.array(capsule.name))


def on_mesh(mesh: Mesh, count: int, method: SamplingMethod = "area-uniform", *, rng: Generator) -> Surrogate:
    """`count` points on the faces of `mesh`, with the faces' normals.

    Args:
        method: "area-uniform", independent and uniform by area; or "poisson-disc", with no two points close together:
            more such points, of which the most crowded are dropped one by one.
        rng: random generator.
    """
    check_count(count=count)
    if method not in get_args(SamplingMethod):
        raise RangeError(f"method = {method!r}; allowed: {', '.join(get_args(SamplingMethod))}")
    drawn = count if method == "area-uniform" else CANDIDATES * count
    share = np.cumsum(mesh.face_areas_m2)
    # From the right, so that a face without area, which repeats the previous sum, is never selected.
    face = np.searchsorted(share, share[-1] * rng.uniform(size=drawn), side="right")
    # A uniform point of a parallelogram, with its far half folded back onto the triangle.
    weights = rng.uniform(size=(drawn, 2))
    weights = np.where(weights.sum(axis=1, keepdims=True) > 1, 1 - weights, weights)
    first, second, third = np.moveaxis(mesh.corners_m[face], 1, 0)
    points = first + weights[:, :1] * (second - first) + weights[:, 1:] * (third - first)
    surrogate = Surrogate(points, mesh.face_normals[face], np.array(mesh.name))
    return surrogate if drawn == count else surrogate.take(_uncrowded(surrogate, count, float(share[-1])))


def _golden_lattice(count: int, length: float, width: float) -> tuple[Floats, Floats]:
    """`count` points spread evenly over a rectangle about 0: along its length and its width, (count,) each."""
    check_count(count=count)
    step = np.arange(count) + 0.5
    return np.asarray(length * (step / count - 0.5)), np.asarray(width * (step / GOLDEN_RATIO % 1 - 0.5))


def _golden_turns(count: int) -> tuple[Floats, Floats]:
    """Cosines and sines of golden-angle steps, (count,) each."""
    turn = GOLDEN_ANGLE * np.arange(count)
    return np.cos(turn), np.sin(turn)


def _apportioned(count: int, shares: Floats) -> Integers:
    """`count` apportioned to `shares`, (S,), by largest remainder."""
    quota = count * shares / shares.sum()
    whole = np.floor(quota).astype(np.int64)
    whole[np.argsort(whole - quota, kind="stable")[: count - whole.sum()]] += 1
    return np.asarray(whole)


def _uncrowded(candidates: Surrogate, count: int, area_m2: float) -> Integers:
    """Indices of the `count` candidates left after repeatedly dropping the most crowded, (count,)."""
    from scipy.spatial import cKDTree

    # Twice the largest possible minimum distance between `count` points on this area.
    reach = 2 * math.sqrt(area_m2 / (2 * math.sqrt(3) * count))
    pairs = cKDTree(candidates.points_m).query_pairs(reach, output_type="ndarray")
    # Points on the two sides of a thin sheet are not neighbours.
    one, other = pairs[(candidates.normals[pairs[:, 0]] * candidates.normals[pairs[:, 1]]).sum(axis=1) > 0].T
    apart = np.linalg.norm(candidates.points_m[one] - candidates.points_m[other], axis=1)
    weight = (1 - apart / reach) ** CROWDING_EXPONENT
    crowding = np.zeros(len(candidates))
    neighbours: list[list[tuple[int, float]]] = [[] for _ in range(len(candidates))]
    for a, b, w in zip(one.tolist(), other.tolist(), weight.tolist(), strict=True):
        neighbours[a].append((b, w))
        neighbours[b].append((a, w))
        crowding[a] += w
        crowding[b] += w
    kept = np.ones(len(candidates), dtype=bool)
    heap = [(-value, index) for index, value in enumerate(crowding.tolist())]
    heapq.heapify(heap)
    left = len(candidates)
    while left > count:
        value, index = heapq.heappop(heap)
        # An entry older than a neighbour's removal is outdated; a newer one follows.
        if not kept[index] or -value != crowding[index]:
            continue
        kept[index] = False
        left -= 1
        for neighbour, w in neighbours[index]:
            if kept[neighbour]:
                crowding[neighbour] -= w
                heapq.heappush(heap, (-crowding[neighbour], neighbour))
    return np.flatnonzero(kept)
