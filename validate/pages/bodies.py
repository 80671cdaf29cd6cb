"""The objects of a scene as triangles, few enough to be embedded in a page."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import trimesh

from pss import Box, Rectangle, Sphere
from pss.hints import Floats, Integers
from pss.surrogates import Mesh
from render.world.geometry import tile_sphere
from render.world.state import SceneState

__all__ = ["coarse", "object_meshes"]


# A finer mesh is drawn with about so many faces.
MOST_FACES_DRAWN = 2000
# 642 vertices: the eye sees a ball.
SPHERE_SUBDIVISIONS = 3
# Of a mesh's diagonal, the side of the cells that its vertices are gathered in at first, and how it grows.
FIRST_CELL, GROWTH = 0.004, 1.25


def object_meshes(
    state: SceneState,
    without: Collection[str] = (),
    only: Sequence[str] | None = None,
    most_faces: int = MOST_FACES_DRAWN,
) -> tuple[Floats, Integers]:
    """Vertices (V, 3) in metres and faces (F, 3) of objects together; fine meshes are made coarser.

    Args:
        without: names of objects that are left out.
        only: names of those that are taken; None for all.
        most_faces: of each object.
    """
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for item in state.objects:
        if item.shape.name in without or (only is not None and item.shape.name not in only):
            continue
        own, triangles = _object(item.shape, most_faces)
        vertices.append(own)
        faces.append(triangles + count)
        count += len(own)
    return np.concatenate(vertices), np.concatenate(faces)


def coarse(vertices: Floats, faces: Integers, most_faces: int) -> tuple[Floats, Integers]:
    """A mesh of at most so many faces: vertices in one cell of a grid become one, their mean.

    Leaving faces out instead would tear holes.
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    cell_m = FIRST_CELL * diagonal
    while True:
        _, member = np.unique(np.floor(vertices / cell_m).astype(np.int64), axis=0, return_inverse=True)
        member = member.ravel()
        joined = member[faces]
        apart = (joined != np.roll(joined, 1, axis=1)).all(axis=1)
        kept = np.unique(joined[apart], axis=0)
        if len(kept) <= most_faces:
            break
        cell_m *= GROWTH
    count = np.bincount(member).astype(float)
    means = np.column_stack([np.bincount(member, weights=vertices[:, axis]) / count for axis in range(3)])
    used, renumbered = np.unique(kept, return_inverse=True)
    return means[used], renumbered.reshape(-1, 3)


def _object(shape: Rectangle | Sphere | Box | Mesh, most_faces: int) -> tuple[Floats, Integers]:
    if isinstance(shape, Sphere):
        return tile_sphere(shape, SPHERE_SUBDIVISIONS)
    if isinstance(shape, Mesh):
        if len(shape.faces) <= most_faces:
            return shape.vertices_m, shape.faces
        return coarse(shape.vertices_m, shape.faces, most_faces)
    if isinstance(shape, Rectangle):
        right, up = shape.right * shape.width_m / 2, shape.up * shape.height_m / 2
        centre = np.array(shape.centre_m)
        corners = np.array([centre - right - up, centre + right - up, centre + right + up, centre - right + up])
        return corners, np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
    box = trimesh.creation.box(bounds=[shape.lowest_m, shape.highest_m])
    return np.asarray(box.vertices), np.asarray(box.faces)
