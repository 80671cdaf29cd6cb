"""A camera's field of view in a room: its edges up to the plane in focus or the walls, and that plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from trimesh.intersections import slice_faces_plane

from pss import PTZCamera
from pss.hints import Floats
from render.world.state import Room

__all__ = ["Frustum", "frustum", "room_corners"]


@dataclass(frozen=True, eq=False)
class Frustum:
    """In metres: `apex` (3,), `ends` (4, 3) of the edges, `plane` (V, 3) with `faces` (F, 3), unit `axis` (3,).

    The plane in focus has no vertices if it does not cross the room.
    """

    apex: Floats
    ends: Floats
    plane: Floats
    faces: NDArray[np.int64]
    axis: Floats


def room_corners(room: Room) -> tuple[Floats, Floats]:
    """Metres, the lowest and the highest corner, (3,) each."""
    half = np.array([room.width_m / 2, room.length_m / 2])
    return np.array([*-half, 0.0]), np.array([*half, room.height_m])


def frustum(camera: PTZCamera, room: Room) -> Frustum:
    """A camera's field of view, cut off at the plane in focus and at the walls."""
    low, high = room_corners(room)
    apex = np.array(camera.position_m)
    half = np.array(camera.resolution) / 2 / camera.focal_px * camera.focus_distance_m
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    rays = np.column_stack([corners, np.full(4, camera.focus_distance_m)]) @ camera.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        to_walls = (np.where(rays > 0, high, low) - apex) / rays
    exits = np.where(rays == 0, np.inf, to_walls).min(axis=1)
    vertices, faces = apex + rays, np.array([[0, 1, 2], [0, 2, 3]])
    for axis in range(3):
        for corner, side in ((low, 1.0), (high, -1.0)):
            normal = np.zeros(3)
            normal[axis] = side
            vertices, faces, _ = slice_faces_plane(vertices, faces, normal, corner)
    return Frustum(apex, apex + rays * np.minimum(exits, 1.0)[:, None], vertices, faces, camera.rotation[2])
