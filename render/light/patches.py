"""Patches of the scene's surfaces for the exchange of light: finer where objects nearly touch.

A patch cannot shade surfaces closer than its size, since it is hidden as a whole or not at all, by its centre. Where
another object is that close, the patch is split, down to a few centimetres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pss import GeometryError, Sphere
from pss.hints import Bools, Floats
from pss.surrogates import Mesh, Shape, any_blocks
from render.world.geometry import Surface, lamps, surfaces, tile_sphere
from render.world.meshes import MOST_MESH_PATCHES, mesh_patches, patches_needed, shares
from render.world.state import SceneState

__all__ = ["Patches", "scene_patches"]


PATCH_M = 0.5
OBJECT_PATCH_M = 0.3
LAMP_PATCH_M = 0.1
FINEST_PATCH_M = 0.05
# The form factors are a dense matrix: a large board close to a wall must not create thousands of small patches.
MOST_SPLIT_PATCHES = 1000
# The matrix for this many takes 2 GB; an empty hall of 40 × 40 m has as many.
MOST_PATCHES = 16_000
SPHERE_PATCH_SUBDIVISIONS = 2
ROOM_SURFACES = ("floor", "ceiling", "walls")
# Occluders are searched from just above a patch, so that its own surface is not found.
LIFT_M = 1e-3
# Sample positions on a patch: its middle and near its corners, in units of its edges.
PLACES = np.array([(0.5, 0.5), (0.05, 0.05), (0.95, 0.05), (0.95, 0.95), (0.05, 0.95)])


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of diffuse surfaces, P of them.

    Attributes:
        corners_m: m, counter-clockwise from the bright side, (P, 4, 3); a triangle repeats its last corner.
        centres_m: m, the points on the true surfaces that represent them, (P, 3).
        albedo: (P,), averaged over a patch; the parts of the ceiling covered by lamps reflect nothing.
        emitted: W/m² of their own emission, (P,).
    """

    corners_m: Floats
    centres_m: Floats
    albedo: Floats
    emitted: Floats

    @property
    def normals(self) -> Floats:
        """Unit normals, (P, 3)."""
        normals = np.cross(self.corners_m[:, 1] - self.corners_m[:, 0], self.corners_m[:, 2] - self.corners_m[:, 0])
        return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def scene_patches(state: SceneState) -> Patches:
    """The patches of all surfaces and lamps: meshes add at most `MOST_MESH_PATCHES`, splits `MOST_SPLIT_PATCHES`.

    Raises:
        GeometryError: there are more than `MOST_PATCHES`.
    """
    found = [*lamps(state), *surfaces(state)]
    meshes = [surface.shape for surface in found if isinstance(surface.shape, Mesh)]
    most = shares([patches_needed(mesh, OBJECT_PATCH_M) for mesh in meshes], MOST_MESH_PATCHES)
    of_meshes = iter([mesh_patches(mesh, OBJECT_PATCH_M, count) for mesh, count in zip(meshes, most, strict=True)])
    of_tiles = iter(_split_where_close(state, [surface for surface in found if isinstance(surface.shape, tuple)]))
    corners, centres, albedo, emitted = [], [], [], []
    for surface in found:
        if isinstance(surface.shape, Mesh):
            these, middles = next(of_meshes)
        elif isinstance(surface.shape, Sphere):
            these, middles = _of_sphere(surface.shape)
        else:
            these = next(of_tiles)
            middles = these.mean(axis=1)
        reflecting = 1 - _covered_by_lamps(these, state) if surface.name == "ceiling" else np.ones(len(these))
        corners.append(these)
        centres.append(middles)
        albedo.append(surface.albedo * reflecting)
        emitted.append(np.full(len(these), np.pi * surface.radiance))
    count = sum(len(these) for these in corners)
    if count > MOST_PATCHES:
        raise GeometryError(f"the scene's surfaces make {count} patches of light; allowed: at most {MOST_PATCHES}")
    return Patches(*(np.concatenate(parts) for parts in (corners, centres, albedo, emitted)))


def _largest(surface: Surface) -> float:
    return LAMP_PATCH_M if surface.radiance else PATCH_M if surface.name in ROOM_SURFACES else OBJECT_PATCH_M


def _of_sphere(sphere: Sphere) -> tuple[Floats, Floats]:
    vertices, faces = tile_sphere(sphere, SPHERE_PATCH_SUBDIVISIONS)
    # A triangle's middle is inside the ball, which would occlude it.
    centre = np.array(sphere.centre_m)
    outwards = vertices[faces].mean(axis=1) - centre
    outwards *= sphere.radius_m / np.linalg.norm(outwards, axis=-1, keepdims=True)
    return np.asarray(vertices[faces[:, [0, 1, 2, 2]]]), centre + outwards


def _split_where_close(state: SceneState, flat: list[Surface]) -> list[Floats]:
    """The patches of each of `flat`, (P, 4, 3), quartered repeatedly while another object is closer than their size.

    Coarse ones are split first, and no level is started that would exceed `MOST_SPLIT_PATCHES`.
    """
    shapes = [item.shape for item in state.objects]
    others = [tuple(shape for n, shape in enumerate(shapes) if n != s.object_number) for s in flat]
    patches = [np.concatenate([c[q] for c, q in (tile.split(_largest(s)) for tile in s.shape)]) for s in flat]
    left = MOST_SPLIT_PATCHES
    while True:
        close = [_faces_closely(quads, around) for quads, around in zip(patches, others, strict=True)]
        left -= 3 * sum(int(mask.sum()) for mask in close)
        if left < 0 or not any(mask.any() for mask in close):
            return patches
        patches = [
            np.concatenate([quads[~mask], _quarters(quads[mask])]) for quads, mask in zip(patches, close, strict=True)
        ]


def _size(quads: Floats) -> Floats:
    """Metres, the longer edge of parallelograms (P, 4, 3)."""
    edges = quads[:, [1, 3]] - quads[:, [0]]
    return np.asarray(np.linalg.norm(edges, axis=-1).max(axis=-1))


def _faces_closely(quads: Floats, others: tuple[Shape, ...]) -> Bools:
    """(P,), whether one of `others` is in front of a part, not all, of a patch and closer than its size.

    Patches of `FINEST_PATCH_M` or less are never split.
    """
    u, v = (quads[:, [1]] - quads[:, [0]]), (quads[:, [3]] - quads[:, [0]])
    places = quads[:, [0]] + PLACES[:, :1] * u + PLACES[:, 1:] * v
    normals = np.cross(u[:, 0], v[:, 0])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    starts = places + LIFT_M * normals[:, None]

    def blocked(distance_m: Floats) -> Bools:
        ends = starts + (distance_m[:, None] * normals)[:, None]
        return any_blocks(others, starts.reshape(-1, 3), ends.reshape(-1, 3)).reshape(len(quads), len(PLACES))

    size = _size(quads)
    close, covered = blocked(size).any(axis=1), blocked(np.full(len(quads), LIFT_M)).all(axis=1)
    return np.asarray((size > FINEST_PATCH_M) & close & ~covered)


def _quarters(quads: Floats) -> Floats:
    """Parallelograms (P, 4, 3) in four each, (4 P, 4, 3)."""
    middle = quads.mean(axis=1, keepdims=True)
    following = (quads + np.roll(quads, -1, axis=1)) / 2
    before = np.roll(following, 1, axis=1)
    return np.stack([quads, following, np.broadcast_to(middle, quads.shape), before], axis=2).reshape(-1, 4, 3)


def _covered_by_lamps(quads: Floats, state: SceneState) -> Floats:
    """Share of each of the ceiling's patches (P, 4, 3), rectangles along x and y, covered by lamps; (P,)."""
    low, high = quads[..., :2].min(axis=1), quads[..., :2].max(axis=1)
    covered = np.zeros(len(quads))
    for panel in state.light.panels:
        centre, half = np.array(panel.centre_m), np.array(panel.size_m) / 2
        overlap = np.clip(np.minimum(high, centre + half) - np.maximum(low, centre - half), 0, None)
        covered += overlap.prod(axis=1)
    return np.minimum(covered / (high - low).prod(axis=1), 1.0)
