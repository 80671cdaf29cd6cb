"""The figure of a run in space: room, objects, cameras, and markers by predicted σ, measured error or their ratio."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from render.world.state import Room
from validate.pages.data import SweepTable
from validate.pages.figure import Choice, Figure, ref
from validate.pages.shades import scales
from validate.runs.palette import BLUE, DARK_INK, FLOOR, GREY, INK, OBJECTS, ROOM_EDGES, VERMILION

__all__ = ["GROUPS", "IDLE", "Group", "fitted_camera", "scene_figure"]


@dataclass(frozen=True)
class Group:
    """How cameras of a group are drawn: colour, plotly's symbol, and the legend's text."""

    colour: str
    symbol: str
    words: str


GROUPS = {"varied": Group(VERMILION, "square", "varied cameras"), "fixed": Group(BLUE, "circle", "other cameras")}
"""Of a sweep's cameras, by their name in `Step.groups`."""
EYE = (0.54, 1.12, 0.66)
"""Where a scene is seen from at first: a direction from its middle."""
# Plotly's field of view is 45° high. Width over height of the drawing on a wide page, and on a narrow one.
HALF_HEIGHT, WIDE, NARROW = math.tan(math.radians(22.5)), 1.75, 0.9
# Heights that it may look at, in plotly's unit from the room's middle: what is near and low takes the most room.
CENTRES = np.linspace(-1.0, 0.5, 151)
IDLE = Group(GREY, "cross", "cameras that are off")


def scene_figure(
    table: SweepTable,
    room: Room,
    groups: Mapping[str, Group] = GROUPS,
    bodies: Mapping[str, str] | None = None,
    plates: str = "",
    eye: tuple[float, float, float] = EYE,
) -> Figure:
    """Plotly's traces of the scene; all that moves is in `space.scene_columns`.

    Args:
        room: fits into the drawing, as it is seen at first.
        groups: of the cameras.
        bodies: colours of objects that are drawn each for itself and named, by name.
        plates: a sentence on how large plates are drawn, for the caption.
        eye: the direction that it is seen from at first.
    """
    flat = {"ambient": 1.0, "diffuse": 0.0, "specular": 0.0}
    traces: list[dict[str, Any]] = [
        _lines("room", ROOM_EDGES, 1.5) | {"name": "room", "showlegend": False, "meta": {"layer": "room"}},
        _mesh("floor", FLOOR, 1.0) | {"lighting": flat, "meta": {"layer": "room"}},
        _mesh("objects", OBJECTS, 1.0)
        | {
            "flatshading": False,
            "lighting": {"ambient": 0.85, "diffuse": 0.2, "specular": 0.0},
            "meta": {"layer": "objects"},
        },
        *(trace for name, colour in (bodies or {}).items() for trace in _body(name, colour)),
        {
            "type": "mesh3d",
            **{axis: ref(f"plates_{axis}") for axis in "xyz"},
            **{index: ref(f"plates_{index}") for index in "ijk"},
            # The page shades plates and describes dots by what was predicted and measured.
            "intensity": [],
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
            "meta": {"layer": "markers", "shaded": True},
        },
        {
            "type": "scatter3d",
            "mode": "markers",
            **{axis: ref(f"dots_{axis}") for axis in "xyz"},
            "marker": {"size": 3, "color": DARK_INK, "opacity": 0.6},
            "text": [],
            "hovertemplate": "%{text}<extra></extra>",
            "name": "markers (× not observable)",
            "meta": {"layer": "markers", "pick": True},
        },
    ]
    for group, style in groups.items():
        traces += [
            _lines(f"edges|{group}", style.colour, 1.5)
            | {"name": "fields of view", "showlegend": False, "meta": {"layer": "frusta"}},
            _mesh(f"planes|{group}", style.colour, 0.07) | {"lighting": flat, "meta": {"layer": "planes"}},
            _icons(f"cameras|{group}", style),
            {
                "type": "cone",
                **{axis: ref(f"cameras|{group}_{axis}") for axis in "xyz"},
                **{axis: ref(f"axes|{group}_{axis}") for axis in "uvw"},
                "anchor": "tip",
                "sizemode": "absolute",
                "sizeref": 0.16,
                "showscale": False,
                "hoverinfo": "skip",
                "colorscale": [[0, style.colour], [1, style.colour]],
                "meta": {"layer": "frusta"},
            },
        ]
    traces.append(_icons("cameras|idle", IDLE))
    hidden = {"visible": False}
    return Figure(
        "scene",
        "The scene in space",
        "Markers are coloured by the prediction, by the measurement, or by measured over predicted (a ring "
        "in place of a dot: measured below predicted); grey ones are not observable, or were not triangulated. "
        + plates
        + "Pyramids are fields of view up to the plane in focus or the walls, translucent sheets the planes in focus. "
        "Choose a marker (click it, or take it from the list) to see which cameras should see it, which found it, and "
        "its predicted 95 % ellipsoid, enlarged as stated in the text. A long ellipsoid points along the direction "
        "that no pair of cameras sees from the side.",
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
                "camera": fitted_camera(room, eye, WIDE),
                "annotations": ref("camera_signs"),
            },
            "meta": {"narrow_camera": fitted_camera(room, eye, NARROW)},
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


def fitted_camera(room: Room, direction: tuple[float, float, float], aspect: float) -> dict[str, dict[str, float]]:
    """Plotly's camera that looks in a direction, as near as lets all of the room into the drawing.

    Args:
        direction: from the point that it looks at, above or below the room's middle, to the eye.
        aspect: width over height of the drawing.
    """
    # Plotly's unit: the geometric mean of the room's sides.
    sides = np.array([room.width_m, room.length_m, room.height_m])
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    towards = np.array(direction) / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    centres = np.array([(0.0, 0.0, z) for z in CENTRES])
    corners = signs * sides / 2 / np.prod(sides) ** (1 / 3) - centres[:, None]
    out = np.maximum(np.abs(corners @ right) / aspect, np.abs(corners @ np.cross(towards, right)))
    distances = (corners @ towards + out / HALF_HEIGHT).max(axis=1)
    nearest = int(distances.argmin())
    places = {"eye": centres[nearest] + towards * distances[nearest], "center": centres[nearest]}
    return {name: {axis: round(float(v), 4) for axis, v in zip("xyz", at, strict=True)} for name, at in places.items()}


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


def _body(name: str, colour: str) -> list[dict[str, Any]]:
    """An object of its own colour, with its name above it."""
    return [
        _mesh(f"body|{name}", colour, 1.0)
        | {
            "flatshading": False,
            "lighting": {"ambient": 0.7, "diffuse": 0.45, "specular": 0.0},
            "meta": {"layer": "objects"},
        },
        {
            "type": "scatter3d",
            "mode": "text",
            **{axis: ref(f"name|{name}_{axis}") for axis in "xyz"},
            "text": [name],
            "textfont": {"size": 16, "color": INK, "weight": "bold"},
            "hoverinfo": "skip",
            "showlegend": False,
            "meta": {"layer": "objects"},
        },
    ]


def _icons(name: str, style: Group) -> dict[str, Any]:
    return {
        "type": "scatter3d",
        "mode": "markers",
        **{axis: ref(f"{name}_{axis}") for axis in "xyz"},
        "customdata": ref(f"{name}_text"),
        "hovertemplate": "%{customdata}<extra></extra>",
        "marker": {"size": 5, "color": style.colour, "symbol": style.symbol},
        "name": style.words,
        "meta": {"layer": "cameras"},
    }
