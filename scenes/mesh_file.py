"""Meshes and backdrops from files: reading, posing in the room, and checks."""

from __future__ import annotations

import dataclasses
import math
import os
from pathlib import Path

import numpy as np

from pss import PSSError
from pss.hints import Floats
from pss.surrogates import Mesh
from render.world.backdrop import read_backdrop
from render.world.meshes import skin
from scenes.errors import Location, Problems, shown
from scenes.reading.inside import may_open
from scenes.schema.meshes import BackdropSpec, MeshSpec
from scenes.schema.scene_tables import SceneSpec

__all__ = ["contains", "posed", "read_files"]


# More faces take minutes to light and a second to hash.
MOST_FACES = 200_000
# Of all meshes of a scene together: each is read, and tested for occlusion.
MOST_FACES_IN_ALL = 1_000_000
# A mesh wider than this, or than the room, is most likely in millimetres.
WIDEST_M = 20.0


def read_files(draft: SceneSpec, folder: Path, problems: Problems, *, allow_outside: bool = False) -> None:
    """Read every file that `draft` references, from `folder`, and store its contents beside its key.

    Files outside `folder` are problems, unless `allow_outside`.
    """
    left = MOST_FACES_IN_ALL
    for index, item in enumerate(draft.objects or ()):
        if not isinstance(item, MeshSpec) or item.file is None:
            continue
        place: Location = ("objects", index)
        if left < 0:
            return
        if may_open(item.file, (*place, "file"), folder, allow_outside, problems):
            left -= _read_mesh(item, place, draft, folder, problems)
            if left < 0:
                problems.add((*place, "file"), f"at most {MOST_FACES_IN_ALL} faces in all meshes of the scene")
    backdrop = draft.backdrop
    if not isinstance(backdrop, BackdropSpec) or backdrop.file is None:
        return
    if may_open(backdrop.file, ("backdrop", "file"), folder, allow_outside, problems):
        _read_backdrop(backdrop, draft, folder, allow_outside, problems)


def posed(
    mesh: Mesh,
    position_m: tuple[float, float, float],
    turn_deg: float = 0.0,
    tilt_deg: float = 0.0,
    roll_deg: float = 0.0,
) -> Mesh:
    """A copy rolled about its own y axis (its top to the right), tilted (its +y upwards), panned and moved."""
    tilt, roll = math.radians(tilt_deg), math.radians(roll_deg)
    tilted = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    rolled = np.array([[math.cos(roll), 0, math.sin(roll)], [0, 1, 0], [-math.sin(roll), 0, math.cos(roll)]])
    turned = dataclasses.replace(mesh, vertices_m=mesh.vertices_m @ (tilted @ rolled).T)
    return turned.moved(position_m, turn_deg)


def contains(mesh: Mesh, point_m: Floats) -> bool:
    """Whether a point (3,) is inside the closed pieces of `mesh`: their faces cover more than half of its view.

    Solid angles of the faces by van Oosterom and Strackee; those of a closed surface sum to 4π inside and 0 outside.
    """
    sides = skin(mesh)
    a, b, c = np.moveaxis(sides.corners_m[~sides.open_faces] - point_m, 1, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    spread = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return bool(2 * np.arctan2(volume, spread).sum() > 2 * math.pi)


def _read_mesh(item: MeshSpec, place: Location, draft: SceneSpec, folder: Path, problems: Problems) -> int:
    """Number of faces in the file, 0 if it cannot be read."""
    path = folder / str(item.file)
    if not os.path.isfile(path):
        problems.add((*place, "file"), "the path of a mesh (GLB, OBJ, PLY, STL, OFF), from this file; there is none")
        return 0
    try:
        mesh = Mesh.from_file(path, name=item.name or "", scale=item.scale or 1.0)
    except PSSError as error:
        # The message has the path already.
        reason = str(error).replace(f"{str(path)!r} ", "")
        problems.add((*place, "file"), f"a mesh with triangles (GLB, OBJ, PLY, STL, OFF); this {reason}")
        return 0
    faces = len(mesh.faces)
    if faces > MOST_FACES:
        problems.add((*place, "file"), f"at most {MOST_FACES} faces; this mesh has {faces}")
        return faces
    if not _fits(mesh.vertices_m, place, draft, problems) or item.scale is None:
        return faces
    _warn_of_sides(mesh, place, problems)
    if None not in (item.name, item.position_m, item.turn_deg, item.tilt_deg, item.roll_deg):
        item._mesh = posed(mesh, item.position_m, item.turn_deg, item.tilt_deg, item.roll_deg)
    return faces


def _fits(vertices_m: Floats, place: Location, draft: SceneSpec, problems: Problems) -> bool:
    """Whether a mesh is small enough, which one in millimetres read as metres is not."""
    room = draft.room
    sides = [] if room is None else [room.width_m, room.length_m, room.height_m]
    widest = WIDEST_M if None in sides or not sides else min(WIDEST_M, max(sides))
    width = float(np.ptp(vertices_m, axis=0).max())
    if width <= widest:
        return True
    given = problems.given((*place, "scale"))
    hint = ": in millimetres? scale = 0.001" if not given and width * 1e-3 <= widest else ""
    what = f"a size that fits the room, at most {widest:g} m; this is {width:.4g} m wide{hint}"
    problems.add((*place, "scale" if given else "file"), what)
    return False


def _warn_of_sides(mesh: Mesh, place: Location, problems: Problems) -> None:
    sides = skin(mesh)
    count = len(sides.open_faces)
    if sides.open_faces.any():
        open_faces = sides.open_faces.sum()
        problems.warn((*place, "file"), f"not watertight: {open_faces} of {count} faces are seen from both sides")
    if sides.turned:
        problems.warn((*place, "file"), f"{sides.turned} of {count} faces are wound inside out, and were turned")


def _read_backdrop(item: BackdropSpec, draft: SceneSpec, folder: Path, allow_outside: bool, problems: Problems) -> None:
    place: Location = ("backdrop",)
    if None in (item.file, item.position_m, item.turn_deg, item.scale, item.up):
        return
    try:
        backdrop = read_backdrop(folder / str(item.file), within=None if allow_outside else folder)
    except PSSError as error:
        problems.add((*place, "file"), f"a Mitsuba scene (XML) with shapes; {error}")
        return
    for warning in backdrop.warnings:
        problems.warn((*place, "file"), warning)
    scaled = [dataclasses.replace(part.shape, vertices_m=item.scale * part.shape.vertices_m) for part in backdrop.parts]
    faces = sum(len(mesh.faces) for mesh in scaled)
    if faces > MOST_FACES:
        problems.add((*place, "file"), f"at most {MOST_FACES} faces; its shapes have {faces}")
        return
    if not _fits(np.concatenate([mesh.vertices_m for mesh in scaled]), place, draft, problems):
        return
    tilt_deg = 90.0 if item.up == "y" else 0.0
    item._parts = tuple(
        dataclasses.replace(part, shape=posed(mesh, item.position_m, item.turn_deg, tilt_deg))
        for part, mesh in zip(backdrop.parts, scaled, strict=True)
    )
    _warn_of_hidden(item, draft, problems)


def _warn_of_hidden(item: BackdropSpec, draft: SceneSpec, problems: Problems) -> None:
    room = draft.room
    if room is None or None in (room.width_m, room.length_m, room.height_m):
        return
    low, high = np.array([(-room.width_m / 2, -room.length_m / 2, 0), (room.width_m / 2, room.length_m / 2, 0)])
    high[2] = room.height_m
    hidden = [
        part.shape.name.removeprefix("backdrop ")
        for part in item._parts
        if (part.shape.vertices_m.max(axis=0) <= low).any() or (part.shape.vertices_m.min(axis=0) >= high).any()
    ]
    if hidden:
        names = shown(", ".join(hidden)).strip('"')
        problems.warn(("backdrop", "file"), f"outside the room, and hidden by its walls: {names}")
