"""A run in space: room, objects, markers by predicted σ, by measured error or by their ratio, and the cameras."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from pss import Box, Rectangle, Sphere
from pss.surrogates import Mesh
from render.geometry import plate_corners, tile_sphere
from render.state import SceneState
from validate.report.data import KINDS, MM, SweepTable
from validate.report.frusta import Frustum, frustum, room_corners
from validate.report.shades import scales, shades
from validate.report.steps import Step
from validate.report.traces import Choice, Columns, Figure, plain, ref

__all__ = ["PLATE_MODULES", "object_meshes", "scene_columns", "scene_figure"]

Floats = NDArray[np.float64]

# Of a marker's plate: the print with its quiet zone, as in the figures of a run.
PLATE_MODULES = 8.0
# Of a finer mesh every so many faces are drawn.
MOST_FACES_DRAWN = 2000
# 642 vertices: the eye sees a ball.
SPHERE_SUBDIVISIONS = 3
# Plates stand this far before what they are glued to, and their dots as far again, so that neither hides in the other.
LIFT_M = 0.012
GROUPS = {"varied": ("#D55E00", "square", "varied cameras"), "fixed": ("#0072B2", "circle", "other cameras")}
IDLE = ("#8a8a8a", "cross", "cameras that are off")


def scene_figure(table: SweepTable) -> Figure:
    """Plotly's traces of the scene; all that moves is in `scene_columns`."""
    flat = {"ambient": 1.0, "diffuse": 0.0, "specular": 0.0}
    traces: list[dict[str, Any]] = [
        _lines("room", "#9a9a9a", 1.5) | {"name": "room", "showlegend": False, "meta": {"layer": "room"}},
        _mesh("floor", "#f1efe9", 1.0) | {"lighting": flat, "meta": {"layer": "room"}},
        _mesh("objects", "#e9e9e9", 1.0)
        | {
            "flatshading": False,
            "lighting": {"ambient": 0.85, "diffuse": 0.2, "specular": 0.0},
            "meta": {"layer": "objects"},
        },
        {
            "type": "mesh3d",
            **{axis: ref(f"plates_{axis}") for axis in "xyz"},
            **{index: ref(f"plates_{index}") for index in "ijk"},
            "intensity": ref("shade|{colour}|{kind}|{model}"),
            "intensitymode": "cell",
            "cmin": ref("low|{colour}|{kind}|{model}"),
            "cmax": ref("high|{colour}|{kind}|{model}"),
            "colorscale": ref("scale|{colour}"),
            "colorbar": {
                "title": {"text": ref("bar|{colour}|{kind}"), "side": "right"},
                "tickvals": ref("ticks|{colour}|{kind}|{model}"),
                "ticktext": ref("ticktexts|{colour}|{kind}|{model}"),
                "thickness": 14,
                "len": 0.8,
            },
            "lighting": flat,
            "hoverinfo": "skip",
            "meta": {"layer": "markers"},
        },
        {
            "type": "scatter3d",
            "mode": "markers",
            **{axis: ref(f"dots_{axis}") for axis in "xyz"},
            "marker": {
                "size": 3,
                "color": "#222222",
                "opacity": 0.6,
                "symbol": ref("signs|{colour}|{kind}|{model}"),
            },
            "text": ref("said|{kind}|{model}"),
            "hovertemplate": "%{text}<extra></extra>",
            "name": "markers (× not observable)",
            "meta": {"layer": "markers", "pick": True},
        },
    ]
    for group, (colour, symbol, words) in GROUPS.items():
        traces += [
            _lines(f"edges|{group}", colour, 1.5)
            | {"name": "fields of view", "showlegend": False, "meta": {"layer": "frusta"}},
            _mesh(f"planes|{group}", colour, 0.07) | {"lighting": flat, "meta": {"layer": "planes"}},
            _icons(f"cameras|{group}", colour, symbol, words),
            {
                "type": "cone",
                **{axis: ref(f"cameras|{group}_{axis}") for axis in "xyz"},
                **{axis: ref(f"axes|{group}_{axis}") for axis in "uvw"},
                "anchor": "tip",
                "sizemode": "absolute",
                "sizeref": 0.16,
                "showscale": False,
                "hoverinfo": "skip",
                "colorscale": [[0, colour], [1, colour]],
                "meta": {"layer": "frusta"},
            },
        ]
    traces.append(_icons("cameras|idle", *IDLE))
    hidden = {"visible": False}
    return Figure(
        "scene",
        "The scene in space",
        "Markers are coloured by what the prediction says, by what was measured, or by measured over predicted (a ring "
        "in place of a dot: measured below predicted); grey ones are not observable, or were not triangulated. "
        "Pyramids are fields of view up to the plane in focus or the walls, translucent sheets the planes in focus. "
        "Choose a marker (click it, or take it from the list) to see which cameras should see it, which found it, and "
        "its predicted 95 % ellipsoid, enlarged as the text says. A long ellipsoid points along the direction that no "
        "pair of cameras sees from the side.",
        "The room in three dimensions with its objects, markers and cameras. The list of markers under the figure "
        "gives the numbers of each in words.",
        traces,
        {
            "paper_bgcolor": "white",
            "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
            "uirevision": "kept",
            "legend": {"orientation": "h", "y": 0, "x": 0, "font": {"size": 12}, "bgcolor": "rgba(255,255,255,0.7)"},
            "scene": {
                "aspectmode": "data",
                "xaxis": hidden,
                "yaxis": hidden,
                "zaxis": hidden,
                "camera": {"eye": {"x": 0.54, "y": 1.12, "z": 0.66}, "center": {"x": 0, "y": 0, "z": -0.14}},
            },
        },
        (
            Choice(
                "colour",
                "Colour",
                (("predicted", "predicted σ"), ("measured", "measured error"), ("ratio", "measured / predicted")),
            ),
        ),
        scales(table),
        wide=True,
        height_px=620,
    )


def _lines(name: str, colour: str, width: float) -> dict[str, Any]:
    return {
        "type": "scatter3d",
        "mode": "lines",
        **{axis: ref(f"{name}_{axis}") for axis in "xyz"},
        "line": {"color": colour, "width": width},
        "hoverinfo": "skip",
    }


def _mesh(name: str, colour: str, opacity: float) -> dict[str, Any]:
    return {
        "type": "mesh3d",
        **{axis: ref(f"{name}_{axis}") for axis in "xyzijk"},
        "color": colour,
        "opacity": opacity,
        "hoverinfo": "skip",
    }


def _icons(name: str, colour: str, symbol: str, words: str) -> dict[str, Any]:
    return {
        "type": "scatter3d",
        "mode": "markers+text",
        **{axis: ref(f"{name}_{axis}") for axis in "xyz"},
        "text": ref(f"{name}_names"),
        "textposition": "top center",
        "textfont": {"size": 14, "color": colour},
        "customdata": ref(f"{name}_said"),
        "hovertemplate": "%{customdata}<extra></extra>",
        "marker": {"size": 5, "color": colour, "symbol": symbol},
        "name": words,
        "meta": {"layer": "cameras"},
    }


def scene_columns(table: SweepTable, steps: Sequence[Step]) -> list[Columns]:
    """What the scene of each step holds."""
    filled = []
    for number, step in enumerate(steps):
        columns = _places(step.state)
        for group, wanted in (("varied", True), ("fixed", False)):
            chosen = [camera for camera, varied in zip(step.cameras, step.varied, strict=True) if varied == wanted]
            columns |= _cameras(group, chosen, [frustum(camera, step.state.room) for camera in chosen])
        columns |= _cameras("idle", step.idle, [])
        columns |= _sights(table, step)
        for kind in KINDS:
            for model in table.models:
                columns |= shades(table, number, kind.name, model)
                covariance = step.covariance_m2[kind.name, model]
                columns[f"root|{kind.name}|{model}"] = plain(_roots(covariance) * MM, 3)
        filled.append(columns)
    return filled


def _places(state: SceneState) -> Columns:
    """Room, objects and plates."""
    low, high = room_corners(state.room)
    corners = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    box = low + corners * (high - low)
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    columns = _polyline("room", [box[list(edge)] for edge in edges])
    columns |= _triangles("floor", box[:4] - (0, 0, 0.005), np.array([[0, 1, 2], [0, 2, 3]]))
    columns |= _triangles("objects", *object_meshes(state))
    plates = [plate_corners(marker, PLATE_MODULES) + LIFT_M * np.array(marker.normal) for marker in state.markers]
    first = 4 * np.arange(len(plates))[:, None]
    faces = np.stack([first + (0, 1, 2), first + (0, 2, 3)], axis=1).reshape(-1, 3)
    columns |= _triangles("plates", np.concatenate(plates) if plates else np.zeros((0, 3)), faces)
    for name, lift_m in (("centres", 0.0), ("dots", 2 * LIFT_M)):
        places = state.points_m + lift_m * state.normals
        columns |= {f"{name}_{axis}": plain(places[:, n]) for n, axis in enumerate("xyz")}
    return columns


def object_meshes(state: SceneState) -> tuple[Floats, NDArray[np.int64]]:
    """Vertices (V, 3) in metres and faces (F, 3) of all objects together; of fine meshes, a part of the faces."""
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for item in state.objects:
        own, triangles = _object(item.shape)
        vertices.append(own)
        faces.append(triangles + count)
        count += len(own)
    return np.concatenate(vertices), np.concatenate(faces)


def _object(shape: Rectangle | Sphere | Box | Mesh) -> tuple[Floats, NDArray[np.int64]]:
    if isinstance(shape, Sphere):
        return tile_sphere(shape, SPHERE_SUBDIVISIONS)
    if isinstance(shape, Mesh):
        corners = shape.corners_m[:: -(-len(shape.faces) // MOST_FACES_DRAWN)]
        return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    if isinstance(shape, Rectangle):
        right, up = shape.right * shape.width_m / 2, shape.up * shape.height_m / 2
        centre = np.array(shape.centre_m)
        corners = np.array([centre - right - up, centre + right - up, centre + right + up, centre - right + up])
        return corners, np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
    box = trimesh.creation.box(bounds=[shape.lowest_m, shape.highest_m])
    return np.asarray(box.vertices), np.asarray(box.faces)


def _cameras(group: str, cameras: Sequence[Any], frusta: Sequence[Frustum]) -> Columns:
    name = f"cameras|{group}"
    position = np.array([camera.position_m for camera in cameras]).reshape(-1, 3)
    columns: Columns = {f"{name}_{axis}": plain(position[:, n]) for n, axis in enumerate("xyz")}
    columns[f"{name}_names"] = [camera.name for camera in cameras]
    columns[f"{name}_said"] = [
        f"camera {c.name}: zoom {c.zoom:g}, focus {c.focus_distance_m:g} m, pan {c.pan_deg:.1f}°, tilt "
        f"{c.tilt_deg:.1f}°"
        for c in cameras
    ]
    if group == "idle":
        return columns
    columns |= _polyline(f"edges|{group}", [line for f in frusta for line in _edges(f)])
    # An icon is a cone whose tip is the lens and whose base lies ahead: it points backwards.
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


def _roots(covariance_m2: Floats) -> Floats:
    """m, (N, 6), the lower Cholesky factor's xx, yx, yy, zx, zy, zz; nan where there is no covariance."""
    roots = np.full((len(covariance_m2), 6), np.nan)
    known = np.isfinite(covariance_m2).all(axis=(1, 2))
    if known.any():
        roots[known] = np.linalg.cholesky(covariance_m2[known])[:, *np.tril_indices(3)]
    return roots


def _polyline(name: str, lines: Sequence[Floats]) -> Columns:
    """Lines one after the other, with gaps between them."""
    gap = np.full((1, 3), np.nan)
    joined = np.concatenate([part for line in lines for part in (line, gap)]) if lines else np.zeros((0, 3))
    return {f"{name}_{axis}": plain(joined[:, n]) for n, axis in enumerate("xyz")}


def _triangles(name: str, vertices: Floats, faces: NDArray[np.int64]) -> Columns:
    columns: Columns = {f"{name}_{axis}": plain(vertices[:, n]) for n, axis in enumerate("xyz")}
    return columns | {f"{name}_{axis}": faces[:, n].tolist() for n, axis in enumerate("ijk")}
