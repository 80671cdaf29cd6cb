"""A mesh as a reflector of light: its visible sides, and its patches for the exchange of light.

A closed piece of a mesh is visible from outside, whichever way its file winds it; a piece with an edge that does not
join exactly two faces is a sheet, visible from both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pss.hints import Bools, Floats, Integers
from pss.surrogates import Mesh

__all__ = [
    "MOST_MESH_PATCHES",
    "Skin",
    "clustered",
    "mesh_patches",
    "patches_needed",
    "shares",
    "skin",
    "split_long",
]


# Of all meshes of a scene together: the form factors are a dense matrix, patches by patches.
MOST_MESH_PATCHES = 1500
# Finer meshes are merged to as many patches as a ball of the same area has, and never fewer than …
PATCH_AREA_M2 = 0.008
FEWEST_PATCHES = 64
# Largest number of faces that splitting adds to a mesh.
MOST_SPLIT_PATCHES = 150_000
# Vertices within this distance are merged.
SAME_M = 1e-9
# Weight of directions against positions in units of the mesh's size, when faces are clustered to patches.
NORMAL_WEIGHT = 0.5
# A cluster whose faces cancel each other out, to this share of their area, emits no light.
LEAST_AREA_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class Skin:
    """The faces of a mesh, wound so that their outside is the visible side.

    Attributes:
        corners_m: m, (F, 3, 3), without faces of no area.
        points: index of each corner's position, equal where corners coincide, (F, 3).
        open_faces: whether a face belongs to a sheet, which is visible from both sides, (F,).
        turned: number of faces of closed pieces that the file winds inside out.
    """

    corners_m: Floats
    points: Integers
    open_faces: Bools
    turned: int


@lru_cache(maxsize=64)
def skin(mesh: Mesh) -> Skin:
    """Which faces of `mesh` enclose a volume, and their orientation."""
    _, points = np.unique(np.round(mesh.vertices_m / SAME_M).astype(np.int64), axis=0, return_inverse=True)
    kept = mesh.face_areas_m2 > 0
    faces, corners = points.reshape(-1)[mesh.faces[kept]], mesh.corners_m[kept]
    starts, ends = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    edges, edge = np.unique(np.sort(np.column_stack([starts, ends]), axis=1), axis=0, return_inverse=True)
    edge = edge.reshape(-1)
    # Two faces whose common edge runs in the same direction in both have no consistent outside.
    along = np.where(starts < ends, 1, -1)
    joined = (np.bincount(edge, minlength=len(edges)) == 2) & (np.bincount(edge, along, len(edges)) == 0)
    count = len(faces)
    face = np.repeat(np.arange(count), 3)
    graph = coo_array((np.ones(3 * count), (face, count + edge)), shape=(count + len(edges),) * 2)
    _, piece = connected_components(graph, directed=False)
    piece = piece[:count]
    pieces = piece.max() + 1
    open_piece = np.bincount(piece[face], ~joined[edge], pieces) > 0
    centred = corners - corners.reshape(-1, 3).mean(axis=0)
    volume = np.bincount(piece, np.linalg.det(centred), pieces)
    turned = ~open_piece[piece] & (volume[piece] < 0)
    corners = np.where(turned[:, None, None], corners[:, ::-1], corners)
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    return Skin(corners, faces, open_piece[piece], int(turned.sum()))


# ---- splitting -------------------------------------------------------------------------------------------------------


def split_long(faces: Floats, largest_m: float, most: int) -> Floats:
    """Faces (F, 3, 3 or more) halved across their longest edge until none is longer than the diagonal of a square.

    Args:
        faces: the first three numbers at each corner are its position in metres; the others are interpolated.
        largest_m: m, the square's side; it grows until at most `most` faces are added.
    """
    limit, allowed = largest_m * math.sqrt(2) * (1 + 1e-9), len(faces) + most
    while True:
        done, left = [], faces
        while len(left) and sum(map(len, done)) + len(left) <= allowed:
            edges = np.linalg.norm(left[..., :3] - np.roll(left[..., :3], -1, axis=1), axis=2)
            long = edges.max(axis=1) > limit
            done.append(left[~long])
            a, b, c = np.moveaxis(left[long][np.arange(long.sum())[:, None], _from_longest(edges[long])], 1, 0)
            middle = (a + b) / 2
            left = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        if not len(left):
            return np.concatenate(done)
        limit *= 1.2


def _from_longest(edges: Floats) -> Integers:
    """The corners of each face, the ends of its longest edge first, (F, 3); `edges` (F, 3) begin at each corner."""
    return np.asarray((edges.argmax(axis=1)[:, None] + np.arange(3)) % 3)


# ---- what reflects ---------------------------------------------------------------------------------------------------


def patches_needed(mesh: Mesh, largest_m: float) -> int:
    """Number of patches of `mesh` if none is larger than `largest_m`, nor many much smaller."""
    sides = _both_sides(mesh)
    area_m2 = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1).sum() / 2
    enough = max(FEWEST_PATCHES, math.ceil(area_m2 / PATCH_AREA_M2))
    return min(enough, len(split_long(sides, largest_m, MOST_SPLIT_PATCHES)))


def shares(requested: list[int], most: int) -> list[int]:
    """`most` divided fairly: each gets its request, or the same as all others that get less than their request."""
    given, left = [0] * len(requested), most
    for rank, index in enumerate(sorted(range(len(requested)), key=requested.__getitem__)):
        given[index] = min(requested[index], left // (len(requested) - rank))
        left -= given[index]
    return given


def mesh_patches(mesh: Mesh, largest_m: float, most: int) -> tuple[Floats, Floats]:
    """Metres, the patches of `mesh` (P, 4, 3), at most `most`, and the points on it that represent them (P, 3).

    They are its faces, split where they are larger than `largest_m`. If these are too many, a patch is a square that
    represents a cluster of neighbouring faces of similar direction, with their vector area.
    """
    triangles = split_long(_both_sides(mesh), largest_m, MOST_SPLIT_PATCHES)
    if len(triangles) <= most:
        return triangles[:, [0, 1, 2, 2]], triangles.mean(axis=1)
    return _clustered(triangles, most)


def _both_sides(mesh: Mesh) -> Floats:
    sides = skin(mesh)
    return np.concatenate([sides.corners_m, sides.corners_m[sides.open_faces, ::-1]])


def _clustered(triangles: Floats, most: int) -> tuple[Floats, Floats]:
    vectors = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    areas = np.linalg.norm(vectors, axis=1)
    middles = triangles.mean(axis=1)
    label, seen = clustered(middles, vectors / areas[:, None], areas, most)
    area = np.bincount(label, areas)
    vector = np.column_stack([np.bincount(label, column) for column in vectors.T])
    length = np.linalg.norm(vector, axis=1)
    kept = length > LEAST_AREA_SHARE * area
    normal, places, side = vector[kept] / length[kept, None], middles[seen[kept]], np.sqrt(length[kept])[:, None]
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    u, v = side / 2 * across, side / 2 * np.cross(normal, across)
    return np.stack([places - u - v, places + u - v, places + u + v, places - u + v], axis=1), places


def clustered(places_m: Floats, normals: Floats, areas: Floats, most: int) -> tuple[Integers, Integers]:
    """Elements of a surface, (N, 3), (N, 3) and (N,), in at most `most` groups of neighbours of similar direction.

    Returns:
        The group of each, (N,), numbered from 0, and the member of each group that is nearest to its middle.
    """
    size = np.ptp(places_m, axis=0).max()
    features = np.column_stack([places_m / max(size, SAME_M), NORMAL_WEIGHT * normals])
    label = np.zeros(len(places_m), dtype=np.int64)
    for _ in range(int(math.log2(max(1, most)))):
        label = _halved(features, areas, label)
    groups, label = np.unique(label, return_inverse=True)
    centre = np.column_stack([np.bincount(label, areas * column) for column in features.T])
    centre /= np.bincount(label, areas)[:, None]
    order = np.lexsort((np.linalg.norm(features - centre[label], axis=1), label))
    return label, order[np.searchsorted(label[order], np.arange(len(groups)))]


def _halved(features: Floats, areas: Floats, label: Integers) -> Integers:
    """Each cluster of two members or more, split across its longest extent into two of about equal area."""
    new = 2 * label
    order = np.argsort(label, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
        if len(members) > 1:
            ranked = members[features[members, np.ptp(features[members], axis=0).argmax()].argsort(kind="stable")]
            half = np.searchsorted(np.cumsum(areas[ranked]), areas[ranked].sum() / 2)
            new[ranked[min(max(int(half), 1), len(ranked) - 1) :]] += 1
    return new
