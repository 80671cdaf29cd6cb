"""A mesh as it is rendered: all its triangles, and the vertices at which its light is looked up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from pss.hints import Floats, Integers
from pss.surrogates import Mesh
from render.world.meshes import NORMAL_WEIGHT, SAME_M, Skin, clustered, skin, split_long

__all__ = ["LitMesh", "lit_mesh"]


# Faces that are split for their light; a mesh with more faces of its own is not split.
MOST_SPLIT_FACES = 20_000
# Vertices of finer meshes interpolate the light at this many: looking up all of them would take minutes.
MOST_RECEIVERS = 4096
NEIGHBOURS = 4
# Distance of both sides of a sheet from it, so that rays can distinguish them; less than the stand-off of a plate.
SHEET_M = 0.2e-3
# Faces that meet at a smaller angle are shaded smoothly.
CREASE_DEG = 25.0
# A vertex with more faces than this is shaded flat, since all pairs of them would have to be compared.
MOST_FACES_AT_VERTEX = 64
# Light is looked up this far inside a face's corner: in a fold the corner itself touches the other face.
INSET_M = 2e-3


@dataclass(frozen=True, eq=False)
class LitMesh:
    """A mesh as it is rendered: vertices (V, 3) in metres with unit normals (V, 3), and faces (F, 3).

    Light is looked up at receivers, `receivers_m` and `receiver_normals` (R, 3); that of a vertex is the mean of those
    `nearest` to it (V, K), weighted by `share` (V, K).
    """

    vertices_m: Floats
    normals: Floats
    faces: Integers
    receivers_m: Floats
    receiver_normals: Floats
    nearest: Integers
    share: Floats

    def lit_by(self, irradiance: Callable[[Floats, Floats], Floats]) -> Floats:
        """W/m² at the vertices, (V,), from a function of points (R, 3) and unit normals (R, 3)."""
        received = irradiance(self.receivers_m, self.receiver_normals)
        return np.asarray((received[self.nearest] * self.share).sum(axis=1))


@lru_cache(maxsize=64)
def lit_mesh(mesh: Mesh, largest_m: float) -> LitMesh:
    """The full mesh, with faces longer than `largest_m` split so that shadows appear on them."""
    sides = skin(mesh)
    corners, normals = sides.corners_m, _corner_normals(sides)
    back = sides.open_faces
    offset = SHEET_M * normals
    corners = np.concatenate([np.where(back[:, None, None], corners + offset, corners), (corners - offset)[back, ::-1]])
    normals = np.concatenate([normals, -normals[back, ::-1]])
    parts = split_long(np.concatenate([corners, normals], axis=2), largest_m, MOST_SPLIT_FACES)
    places, directions = parts[..., :3], parts[..., 3:]
    inwards = places.mean(axis=1, keepdims=True) - places
    inwards *= np.minimum(1.0, INSET_M / np.maximum(np.linalg.norm(inwards, axis=-1, keepdims=True), SAME_M))
    return _shared(places.reshape(-1, 3), directions.reshape(-1, 3), inwards.reshape(-1, 3))


def _shared(points: Floats, directions: Floats, insides: Floats) -> LitMesh:
    """The corners of triangles, (3T, 3), merged where place and direction agree."""
    normals = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    rounded = np.round(np.column_stack([points / SAME_M, normals * 1e6])).astype(np.int64)
    _, first, vertex = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    vertex = vertex.reshape(-1)
    inset = np.zeros((len(first), 3))
    np.add.at(inset, vertex, insides)
    inset /= np.bincount(vertex)[:, None]
    points, normals = points[first], normals[first]
    return LitMesh(points, normals, vertex.reshape(-1, 3), *_receivers(points + inset, normals))


def _receivers(places_m: Floats, normals: Floats) -> tuple[Floats, Floats, Integers, Floats]:
    """At most `MOST_RECEIVERS` of the vertices (V, 3), with normals; for each vertex the nearest and their shares."""
    count = len(places_m)
    if count <= MOST_RECEIVERS:
        return places_m, normals, np.arange(count)[:, None], np.ones((count, 1))
    _, chosen = clustered(places_m, normals, np.ones(count), MOST_RECEIVERS)
    features = np.column_stack([places_m / np.ptp(places_m, axis=0).max(), NORMAL_WEIGHT * normals])
    apart, nearest = cKDTree(features[chosen]).query(features, k=NEIGHBOURS)
    weight = 1 / np.maximum(apart, 1e-9) ** 2
    return places_m[chosen], normals[chosen], nearest, weight / weight.sum(axis=1, keepdims=True)


def _corner_normals(sides: Skin) -> Floats:
    """Unit normals at the faces' corners, (F, 3, 3): the mean of all faces there that meet at less than the crease."""
    area = np.cross(sides.corners_m[:, 1] - sides.corners_m[:, 0], sides.corners_m[:, 2] - sides.corners_m[:, 0])
    flat = area / np.linalg.norm(area, axis=1, keepdims=True)
    at = sides.points.reshape(-1)
    order = np.argsort(at, kind="stable")
    faces_at = np.bincount(at)
    begin = np.concatenate([[0], np.cumsum(faces_at)[:-1]])
    normals = np.repeat(flat, 3, axis=0)
    corner = np.flatnonzero(faces_at[at] <= MOST_FACES_AT_VERTEX)
    number = faces_at[at[corner]]
    pair = np.repeat(corner, number)
    rank = np.arange(len(pair)) - np.repeat(np.cumsum(number) - number, number)
    other = order[begin[at[pair]] + rank] // 3
    near = (flat[other] * flat[pair // 3]).sum(axis=1) > math.cos(math.radians(CREASE_DEG))
    total = np.zeros_like(normals)
    # The face itself is included, so that no sum is empty.
    np.add.at(total, pair[near], area[other[near]])
    normals[corner] = total[corner] / np.linalg.norm(total[corner], axis=1, keepdims=True)
    return normals.reshape(-1, 3, 3)
