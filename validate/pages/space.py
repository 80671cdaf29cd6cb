"""What the scene in space holds at each step: room, objects, plates, cameras with their fields of view, ellipsoids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera
from pss.hints import Floats
from render.world.geometry import plate_corners
from render.world.state import SceneState
from validate.pages.bodies import MOST_FACES_DRAWN, object_meshes
from validate.pages.data import KINDS, MM, SweepTable
from validate.pages.figure import Columns, plain
from validate.pages.scene3d import GROUPS, IDLE, Group
from validate.pages.steps import Step
from validate.prediction.frusta import Frustum, frustum, room_corners

__all__ = ["PLATE_MODULES", "scene_columns"]


# Of a marker's plate: the print with its quiet zone, as in the figures of a run.
PLATE_MODULES = 8.0
# Plates stand this far before what they are glued to, and their dots as far again, so that neither hides in the other.
LIFT_M = 0.012
# A body's name stands so far above its highest point.
NAME_ABOVE_M = 0.2
# A camera's name over its sign.
NAME_PX = 13


def scene_columns(
    table: SweepTable,
    steps: Sequence[Step],
    groups: Mapping[str, Group] = GROUPS,
    bodies: Sequence[str] = (),
    most_faces: int = MOST_FACES_DRAWN,
    plate_scale: float = 1.0,
) -> list[Columns]:
    """What the scene of each step holds.

    Args:
        groups, bodies: as in `scene3d.scene_figure`.
        most_faces: of each object.
        plate_scale: plates are drawn so many times as large.
    """
    filled, places = [], _Remembered(bodies, most_faces, plate_scale)
    for step in steps:
        columns = dict(places.of(step.state))
        for group in groups:
            chosen = [camera for camera, own in zip(step.cameras, step.groups, strict=True) if own == group]
            columns |= _cameras(group, chosen, [frustum(camera, step.state.room) for camera in chosen])
        columns |= _cameras("idle", step.idle, [])
        named = [(camera, groups[own].colour) for camera, own in zip(step.cameras, step.groups, strict=True)]
        named += [(camera, IDLE.colour) for camera in step.idle]
        columns["camera_signs"] = [_name_of(camera, colour) for camera, colour in named]
        columns |= _sights(table, step)
        for kind in KINDS:
            for model in table.models:
                covariance = step.covariance_m2[kind.name, model]
                columns[f"root|{kind.name}|{model}"] = _root_columns(covariance)
        filled.append(columns)
    return filled


class _Remembered:
    """The last state's columns: steps of one state follow each other, and a body takes a while to make coarse."""

    def __init__(self, bodies: Sequence[str], most_faces: int, plate_scale: float) -> None:
        self._shown = (bodies, most_faces, plate_scale)
        self._state: SceneState | None = None
        self._columns: Columns = {}

    def of(self, state: SceneState) -> Columns:
        if state is not self._state:
            self._state, self._columns = state, _places(state, *self._shown)
        return self._columns


def _places(state: SceneState, bodies: Sequence[str], most_faces: int, plate_scale: float) -> Columns:
    """Room, objects and plates."""
    low, high = room_corners(state.room)
    corners = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    box = low + corners * (high - low)
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    columns = _polyline("room", [box[list(edge)] for edge in edges])
    columns |= _triangles("floor", box[:4] - (0, 0, 0.005), np.array([[0, 1, 2], [0, 2, 3]]))
    columns |= _triangles("objects", *object_meshes(state, without=bodies, most_faces=most_faces))
    for name in bodies:
        vertices, faces = object_meshes(state, only=[name], most_faces=most_faces)
        columns |= _triangles(f"body|{name}", vertices, faces)
        middle = [*(vertices.min(axis=0) + vertices.max(axis=0))[:2] / 2, vertices[:, 2].max() + NAME_ABOVE_M]
        columns |= {f"name|{name}_{axis}": plain([value]) for axis, value in zip("xyz", middle, strict=True)}
    plates = [
        plate_corners(marker, PLATE_MODULES * plate_scale) + LIFT_M * np.array(marker.normal)
        for marker in state.markers
    ]
    first = 4 * np.arange(len(plates))[:, None]
    faces = np.stack([first + (0, 1, 2), first + (0, 2, 3)], axis=1).reshape(-1, 3)
    columns |= _triangles("plates", np.concatenate(plates) if plates else np.zeros((0, 3)), faces)
    for name, lift_m in (("centres", 0.0), ("dots", 2 * LIFT_M)):
        places = state.points_m + lift_m * state.normals
        columns |= {f"{name}_{axis}": plain(places[:, n]) for n, axis in enumerate("xyz")}
    return columns


def _name_of(camera: PTZCamera, colour: str) -> Columns:
    """Plotly's annotation of a camera: over all that is drawn, where a text in space would lie behind objects."""
    place = dict(zip("xyz", plain(np.array(camera.position_m)), strict=True))
    sign = {"text": camera.name, "showarrow": False, "yshift": NAME_PX, "font": {"size": 14, "color": colour}}
    return place | sign | {"bgcolor": "rgba(255,255,255,0.6)", "borderpad": 0}


def _cameras(group: str, cameras: Sequence[Any], frusta: Sequence[Frustum]) -> Columns:
    name = f"cameras|{group}"
    position = np.array([camera.position_m for camera in cameras]).reshape(-1, 3)
    columns: Columns = {f"{name}_{axis}": plain(position[:, n]) for n, axis in enumerate("xyz")}
    columns[f"{name}_text"] = [
        f"camera {c.name}: zoom {c.zoom:g}, focus {c.focus_distance_m:g} m, pan {c.pan_deg:.1f}°, tilt "
        f"{c.tilt_deg:.1f}°"
        for c in cameras
    ]
    if group == "idle":
        return columns
    columns |= _polyline(f"edges|{group}", [line for f in frusta for line in _edges(f)])
    # An icon is a cone with its tip at the lens and its base ahead: it points backwards.
    axes = np.array([f.axis for f in frusta]).reshape(-1, 3)
    columns |= {f"axes|{group}_{axis}": plain(-axes[:, n]) for n, axis in enumerate("uvw")}
    planes, count, faces = [np.zeros((0, 3))], 0, [np.zeros((0, 3), dtype=np.int64)]
    for f in frusta:
        planes.append(f.plane)
        faces.append(f.faces + count)
        count += len(f.plane)
    return columns | _triangles(f"planes|{group}", np.concatenate(planes), np.concatenate(faces))


def _edges(f: Frustum) -> list[Floats]:
    return [np.array([f.apex, end]) for end in f.ends] + [f.ends[[0, 1, 2, 3, 0]]]


def _sights(table: SweepTable, step: Step) -> Columns:
    """Which camera should see which marker, and how often it found it."""
    return {
        "camera_names": [camera.name for camera in step.cameras],
        "camera_places": plain(np.array([camera.position_m for camera in step.cameras])),
        "should_see": ["".join("1" if seen else "0" for seen in row) for row in step.visible],
        "found_rate": plain(np.array([sight.rate for sight in step.sights]), 3),
        "point_names": [f"{p} on {name}" for p, name in zip(table.point_ids, table.objects, strict=True)],
    }


def _root_columns(covariance_m2: Floats) -> list[list[float] | None]:
    """mm, of each point the lower Cholesky factor's xx, yx, yy, zx, zy, zz; None where there is no covariance."""
    known = np.isfinite(covariance_m2).all(axis=(1, 2))
    roots = np.full((len(covariance_m2), 6), np.nan)
    if known.any():
        roots[known] = np.linalg.cholesky(covariance_m2[known])[:, *np.tril_indices(3)] * MM
    return [row if there else None for row, there in zip(plain(roots, 3), known, strict=True)]


def _polyline(name: str, lines: Sequence[Floats]) -> Columns:
    """Lines one after the other, with gaps between them."""
    gap = np.full((1, 3), np.nan)
    joined = np.concatenate([part for line in lines for part in (line, gap)]) if lines else np.zeros((0, 3))
    return {f"{name}_{axis}": plain(joined[:, n]) for n, axis in enumerate("xyz")}


def _triangles(name: str, vertices: Floats, faces: NDArray[np.int64]) -> Columns:
    columns: Columns = {f"{name}_{axis}": plain(vertices[:, n]) for n, axis in enumerate("xyz")}
    return columns | {f"{name}_{axis}": faces[:, n].tolist() for n, axis in enumerate("ijk")}
