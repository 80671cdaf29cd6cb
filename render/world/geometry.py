"""The scene state as triangles: tessellated surfaces with their light, and the markers' plates."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh

from pss import Box, Rectangle, Sphere
from pss.hints import Floats, Integers
from pss.surrogates import Mesh
from render.world.lit_meshes import lit_mesh
from render.world.state import Marker, Room, SceneState

__all__ = ["Surface", "Tile", "lamps", "plate_corners", "surfaces", "tile_sphere"]


# Vertices have the irradiance; light in a room varies over decimetres, at the edge of a soft shadow over centimetres.
ROOM_MESH_M = 0.2
OBJECT_MESH_M = 0.075
# An icosphere of four subdivisions (2562 vertices) stays within 0.08 % of its radius.
SPHERE_SUBDIVISIONS = 4
# Distance between front and back of a board (or of a marker's plate), so that rays can distinguish them; the front is
# where the scene places it.
THICKNESS_M = 1e-3
# Distance of a lamp from the ceiling, so that the two are not coplanar.
LAMP_DROP_M = 2e-3


@dataclass(frozen=True)
class Tile:
    """A flat parallelogram: `corner_m` and its two edges, (3,) each; the normal is edge_u × edge_v."""

    corner_m: Floats
    edge_u_m: Floats
    edge_v_m: Floats

    @property
    def normal(self) -> Floats:
        """Unit normal, (3,)."""
        normal = np.cross(self.edge_u_m, self.edge_v_m)
        return np.asarray(normal / np.linalg.norm(normal))

    def split(self, largest_m: float) -> tuple[Floats, Integers]:
        """Split into equal cells not larger than `largest_m`: corners (V, 3) and the cells' corner indices (Q, 4)."""
        nu = max(1, math.ceil(np.linalg.norm(self.edge_u_m) / largest_m))
        nv = max(1, math.ceil(np.linalg.norm(self.edge_v_m) / largest_m))
        v, u = np.meshgrid(np.linspace(0, 1, nv + 1), np.linspace(0, 1, nu + 1), indexing="ij")
        corners = self.corner_m + u.reshape(-1, 1) * self.edge_u_m + v.reshape(-1, 1) * self.edge_v_m
        first = (np.arange(nv)[:, None] * (nu + 1) + np.arange(nu)).ravel()
        return corners, np.column_stack([first, first + 1, first + nu + 2, first + nu + 1])


@dataclass(frozen=True)
class Surface:
    """A diffuse surface of one albedo: a list of tiles, a sphere, or a mesh.

    Attributes:
        mesh_m: m, the largest cell of its tessellation.
        radiance: W/(m² sr) of its own emission (lamps).
        object_number: of the object it belongs to, in the scene state's order; −1 for the room and the lamps.
    """

    name: str
    shape: tuple[Tile, ...] | Sphere | Mesh
    albedo: float
    mesh_m: float
    radiance: float = 0.0
    object_number: int = -1

    def triangles(self) -> tuple[Floats, Floats, Integers]:
        """Vertices (V, 3) in metres, their unit normals (V, 3), and faces (F, 3)."""
        if isinstance(self.shape, Sphere):
            vertices, faces = tile_sphere(self.shape, SPHERE_SUBDIVISIONS)
            normals = (vertices - np.array(self.shape.centre_m)) / self.shape.radius_m
            return vertices, normals, faces
        if isinstance(self.shape, Mesh):
            lit = lit_mesh(self.shape, self.mesh_m)
            return lit.vertices_m, lit.normals, lit.faces
        points, normals, triangles, count = [], [], [], 0
        for tile in self.shape:
            corners, quads = tile.split(self.mesh_m)
            points.append(corners)
            normals.append(np.broadcast_to(tile.normal, corners.shape))
            triangles += [quads[:, [0, 1, 2]] + count, quads[:, [0, 2, 3]] + count]
            count += len(corners)
        return np.concatenate(points), np.concatenate(normals), np.concatenate(triangles)

    def lit_by(self, irradiance: Callable[[Floats, Floats], Floats]) -> Floats:
        """W/m² at the vertices, (V,), from a function of points (N, 3) and unit normals (N, 3)."""
        if isinstance(self.shape, Mesh):
            return lit_mesh(self.shape, self.mesh_m).lit_by(irradiance)
        points, normals, _ = self.triangles()
        return irradiance(points, normals)


def tile_sphere(sphere: Sphere, subdivisions: int) -> tuple[Floats, Integers]:
    """An icosphere whose vertices lie on `sphere`: vertices (V, 3) in metres and faces (F, 3), seen from outside."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=sphere.radius_m)
    return np.asarray(ball.vertices) + np.array(sphere.centre_m), np.asarray(ball.faces)


def surfaces(state: SceneState) -> list[Surface]:
    """All surfaces of the scene except lamps and markers."""
    found = _room(state.room)
    for number, item in enumerate(state.objects):
        shape: Sphere | Mesh | tuple[Tile, ...]
        if isinstance(item.shape, Sphere | Mesh):
            shape = item.shape
        else:
            shape = _board(item.shape) if isinstance(item.shape, Rectangle) else _box(item.shape)
        found.append(Surface(item.shape.name, shape, item.albedo, OBJECT_MESH_M, object_number=number))
    return found


def lamps(state: SceneState) -> list[Surface]:
    """The lamps of the ceiling, which emit downwards and reflect nothing."""
    found = []
    for number, panel in enumerate(state.light.panels):
        (x, y), (width, length) = panel.centre_m, panel.size_m
        corner = np.array([x - width / 2, y - length / 2, state.room.height_m - LAMP_DROP_M])
        tile = Tile(corner, np.array([0.0, length, 0.0]), np.array([width, 0.0, 0.0]))
        found.append(Surface(f"lamp {number}", (tile,), 0.0, ROOM_MESH_M, state.light.radiance_w_per_m2_sr))
    return found


def _room(room: Room) -> list[Surface]:
    x, y, height = room.width_m / 2, room.length_m / 2, room.height_m
    east, north, up = np.eye(3) * (room.width_m, room.length_m, height)
    low = np.array([-x, -y, 0.0])
    walls = (
        Tile(low, up, east),  # y = −, facing +y
        Tile(low + north, east, up),
        Tile(low, north, up),
        Tile(low + east, up, north),
    )
    floor, ceiling = Tile(low, east, north), Tile(low + up, north, east)
    return [
        Surface("floor", (floor,), room.floor_albedo, ROOM_MESH_M),
        Surface("ceiling", (ceiling,), room.ceiling_albedo, ROOM_MESH_M),
        Surface("walls", walls, room.wall_albedo, ROOM_MESH_M),
    ]


def _board(board: Rectangle) -> tuple[Tile, ...]:
    right, up = board.right * board.width_m, board.up * board.height_m
    corner = np.array(board.centre_m) - right / 2 - up / 2
    return Tile(corner, right, up), Tile(corner - THICKNESS_M * board.normal, up, right)


def _box(box: Box) -> tuple[Tile, ...]:
    low, high = np.array(box.lowest_m), np.array(box.highest_m)
    east, north, up = np.diag(high - low)
    return (
        Tile(low, north, east),
        Tile(low + up, east, north),
        Tile(low, east, up),
        Tile(low + north, up, east),
        Tile(low, up, north),
        Tile(low + east, north, up),
    )


def plate_corners(marker: Marker, modules: float) -> Floats:
    """Metres, (4, 3), corners of a plate of `modules` × `modules`: top left, top right, bottom right, bottom left."""
    half = marker.module_m * modules / 2
    right, up, centre = marker.right * half, np.array(marker.up) * half, np.array(marker.centre_m)
    return np.array([centre - right + up, centre + right + up, centre + right - up, centre - right - up])
