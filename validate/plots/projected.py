"""A room drawn on paper: where its points come to lie, and its surfaces from the farthest to the nearest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from pss import Box, Rectangle, Sphere
from pss.hints import Floats
from pss.surrogates import Mesh
from render.world.state import Room

__all__ = ["CELL_M", "Eye", "Patches", "patches_of", "room_edges", "wall_patches"]


CELL_M = 0.15
"""Metres: surfaces are cut into patches no larger, so that sorting them by depth puts the nearer one on top."""
# Along a side; of large objects patches are larger.
MOST_CELLS = 40
# Of a sphere around and from pole to pole.
AROUND, UP = 32, 16
# A finer mesh is drawn with its vertices drawn together on a grid of so many cells along its longest side.
MESH_CELLS, FEWEST_FACES_MERGED = 48, 4000
# The eye's distance in diagonals of the room: near enough for perspective, far enough for walls to look straight.
EYE_DIAGONALS = 2.2
# Where light comes from, for shades alone.
LIGHT = np.array([0.35, 0.5, 0.79])
DARK, BRIGHT = 0.68, 0.92
DARK_WALL, BRIGHT_WALL = 0.90, 0.975


@dataclass(frozen=True, eq=False)
class Eye:
    """Who looks at the middle of a room, from outside: `elevation_deg` above the floor, `azimuth_deg` from x to y."""

    room: Room
    elevation_deg: float
    azimuth_deg: float

    @property
    def towards(self) -> Floats:
        """Unit vector from the room's middle to the eye, (3,)."""
        up, around = math.radians(self.elevation_deg), math.radians(self.azimuth_deg)
        return np.array([math.cos(up) * math.cos(around), math.cos(up) * math.sin(around), math.sin(up)])

    @property
    def place_m(self) -> Floats:
        """Metres, (3,)."""
        room = self.room
        return self._middle_m + EYE_DIAGONALS * math.hypot(room.width_m, room.length_m, room.height_m) * self.towards

    @property
    def _middle_m(self) -> Floats:
        return np.array([0.0, 0.0, self.room.height_m / 2])

    def depth_m(self, points_m: Floats) -> Floats:
        """Metres from the eye along its axis, (...), of points (..., 3)."""
        return np.asarray((self.place_m - points_m) @ self.towards)

    def flat(self, points_m: Floats) -> Floats:
        """Where points (..., 3) lie on paper, (..., 2): right and up, in metres at the room's middle."""
        around = math.radians(self.azimuth_deg)
        right = np.array([-math.sin(around), math.cos(around), 0.0])
        axes = np.stack([right, np.cross(self.towards, right)], axis=1)
        distance = float(np.linalg.norm(self.place_m - self._middle_m))
        shift = np.asarray(points_m, dtype=np.float64) - self._middle_m
        return np.asarray((shift @ axes) * (distance / self.depth_m(points_m))[..., None])

    def faces(self, points_m: Floats, normals: Floats) -> NDArray[np.bool_]:
        """Whether surfaces at (..., 3) with outward `normals` (..., 3) show their outside to the eye, (...)."""
        return np.asarray(((self.place_m - points_m) * normals).sum(axis=-1) > 0)


@dataclass(frozen=True, eq=False)
class Patches:
    """Small flat pieces of surfaces.

    Attributes:
        corners_m: m, (3,) by corner, an array (V, 3) for each; two corners are an edge.
        greys: from 0 to 1, (P,).
        edges: whether a piece is a line, (P,).
    """

    corners_m: tuple[Floats, ...]
    greys: Floats
    edges: NDArray[np.bool_]

    @staticmethod
    def joined(parts: Sequence[Patches]) -> Patches:
        """All pieces of several."""
        return Patches(
            tuple(corners for part in parts for corners in part.corners_m),
            np.concatenate([part.greys for part in parts]) if parts else np.zeros(0),
            np.concatenate([part.edges for part in parts]) if parts else np.zeros(0, dtype=bool),
        )


@singledispatch
def patches_of(shape: object) -> Patches:
    """The surface of a Rectangle, Box, Sphere or Mesh; of the first two with their outlines."""
    raise TypeError(f"{type(shape).__name__} has no patches; allowed: Rectangle, Box, Sphere, Mesh")


def wall_patches(eye: Eye) -> Patches:
    """Floor, ceiling and walls, of those that show their inside to the eye."""
    (low, high), found = _ends(eye.room), []
    for axis in range(3):
        for end, sign in ((low, 1.0), (high, -1.0)):
            inward = np.zeros(3)
            inward[axis] = sign
            if eye.faces(end, inward):
                found.append(_quads(*_side(low, high, axis, end[axis]), lines=False))
    walls = Patches.joined(found)
    paler = DARK_WALL + (walls.greys - DARK) / (BRIGHT - DARK) * (BRIGHT_WALL - DARK_WALL)
    return Patches(walls.corners_m, paler, walls.edges)


def room_edges(eye: Eye) -> tuple[list[Floats], list[Floats]]:
    """The room's edges as segments (2, 3) in metres: those behind all that is in it, and those before it."""
    low, high = _ends(eye.room)
    behind, before = [], []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        for ends in ((a, b) for a in (low, high) for b in (low, high)):
            start = low.copy()
            start[others[0]], start[others[1]] = ends[0][others[0]], ends[1][others[1]]
            stop = start.copy()
            stop[axis] = high[axis]
            inward = []
            for other in others:
                normal = np.zeros(3)
                normal[other] = 1.0 if start[other] == low[other] else -1.0
                inward.append(bool(eye.faces(start, normal)))
            (behind if any(inward) else before).append(np.array([start, stop]))
    return behind, before


def _ends(room: Room) -> tuple[Floats, Floats]:
    half = np.array([room.width_m / 2, room.length_m / 2])
    return np.array([*-half, 0.0]), np.array([*half, room.height_m])


def _side(low: Floats, high: Floats, axis: int, at: float) -> tuple[Floats, Floats, Floats]:
    """A box's side that `axis` goes through: a corner and the two edges from it, (3,) each."""
    corner, edges = low.copy(), []
    corner[axis] = at
    for other in range(3):
        if other != axis:
            edge = np.zeros(3)
            edge[other] = high[other] - low[other]
            edges.append(edge)
    return corner, edges[0], edges[1]


def _grey(normals: Floats) -> Floats:
    return np.asarray(DARK + (BRIGHT - DARK) * np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT))))


def _steps(edge: Floats) -> Floats:
    count = min(max(1, math.ceil(float(np.linalg.norm(edge)) / CELL_M)), MOST_CELLS)
    return np.linspace(0, 1, count + 1)


def _quads(corner: Floats, one: Floats, other: Floats, lines: bool = True) -> Patches:
    """A parallelogram as a grid, and its outline if `lines`."""
    u, v = _steps(one), _steps(other)
    grid = corner + u[:, None, None] * one + v[None, :, None] * other
    cells = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    normal = np.cross(one, other)
    grey = float(_grey(normal / np.linalg.norm(normal)))
    pieces = list(cells)
    if lines:
        for border in (grid[0], grid[-1], grid[:, 0], grid[:, -1]):
            pieces += list(np.stack([border[:-1], border[1:]], axis=1))
    edges = np.arange(len(pieces)) >= len(cells)
    return Patches(tuple(pieces), np.where(edges, 0.45, grey), edges)


@patches_of.register
def _rectangle(shape: Rectangle) -> Patches:
    right, up = shape.right * shape.width_m, shape.up * shape.height_m
    return _quads(np.array(shape.centre_m) - right / 2 - up / 2, right, up)


@patches_of.register
def _box(shape: Box) -> Patches:
    low, high = np.array(shape.lowest_m, dtype=np.float64), np.array(shape.highest_m, dtype=np.float64)
    sides = [_side(low, high, axis, end[axis]) for axis in range(3) for end in (low, high)]
    return Patches.joined([_quads(*side) for side in sides])


@patches_of.register
def _sphere(shape: Sphere) -> Patches:
    polar, around = np.linspace(0, np.pi, UP + 1), np.linspace(0, 2 * np.pi, AROUND + 1)
    p, a = np.meshgrid(polar, around, indexing="ij")
    grid = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1)
    cells = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    middle = cells.mean(axis=1)
    greys = _grey(middle / np.linalg.norm(middle, axis=1, keepdims=True))
    # Shades of the whole ball, not of a surface that light comes to from both sides.
    greys = DARK + (greys - DARK) * (middle @ LIGHT > 0)
    return Patches(tuple(np.array(shape.centre_m) + shape.radius_m * cells), greys, np.zeros(len(cells), dtype=bool))


@patches_of.register
def _mesh(shape: Mesh) -> Patches:
    vertices, faces = shape.vertices_m, shape.faces
    if len(faces) > FEWEST_FACES_MERGED:
        vertices, faces = _merged(vertices, faces)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    corners, normals = corners[length[:, 0] > 0], (normals / np.where(length > 0, length, 1))[length[:, 0] > 0]
    return Patches(tuple(corners), _grey(normals), np.zeros(len(corners), dtype=bool))


def _merged(vertices: Floats, faces: NDArray[np.int64]) -> tuple[Floats, NDArray[np.int64]]:
    """A coarser mesh, whose surface stays whole: vertices in one cell of a grid become their mean."""
    low = vertices.min(axis=0)
    cell = float((vertices.max(axis=0) - low).max()) / MESH_CELLS
    _, place, counts = np.unique(
        np.floor((vertices - low) / cell).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    place = place.reshape(-1)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, place, vertices)
    merged = place[faces]
    kept = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    unique = np.unique(np.sort(merged[kept], axis=1), axis=0, return_index=True)[1]
    return sums / counts[:, None], merged[kept][unique]
