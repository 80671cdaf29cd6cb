"""A run's scene as glTF, for viewers of 3D models: `scene.glb` of the first sweep, `scene_NAME.glb` of each other.

Each part has one colour, which its material holds: linear, as glTF defines it, of a matt surface that is no metal. Its
sRGB value is in the part's `extras`. Lines have no normals, so that viewers draw them without shading.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from render.store.folder import atomic_path
from render.world.geometry import plate_corners
from validate.pages.bodies import object_meshes
from validate.pages.data import KINDS
from validate.pages.section import Section
from validate.pages.shades import plate_colours
from validate.pages.space import PLATE_MODULES
from validate.prediction.frusta import frustum, room_corners
from validate.runs.file_names import model_file

__all__ = ["glb_of", "linear", "model_of", "write_models"]

# glTF's y is up; ours is z.
UP = trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
# Plates stand this far before what they are glued to, so that viewers can separate them.
LIFT_M = 0.004
FLOOR, OBJECTS = (230, 226, 218), (205, 205, 205)
# The key of a part's colour, (3,) sRGB bytes, in its metadata, which glTF calls `extras`.
COLOUR_KEY = "srgb"


def write_models(folder: Path, sections: Sequence[Section]) -> list[Path]:
    """Write the scene of each section at the step that the leading noise model finds best."""
    written = []
    for number, section in enumerate(sections):
        path = folder / model_file(section.table.name, number)
        best = section.table.predicted_pss(section.table.leading_model, KINDS[0]).best or 0
        data = glb_of(model_of(section, best))
        with atomic_path(path, needed_bytes=len(data)) as temporary:
            temporary.write_bytes(data)
        written.append(path)
    return written


def model_of(section: Section, step_number: int) -> trimesh.Scene:
    """Floor, objects, markers coloured by predicted σ (single frame, leading noise model), cameras and frusta."""
    step = section.steps[step_number]
    room, scene = step.state.room, trimesh.Scene()
    low, high = room_corners(room)
    floor = np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])
    scene.add_geometry(_mesh(floor, [[0, 1, 2], [0, 2, 3]], FLOOR), node_name="floor", geom_name="floor")
    vertices, faces = object_meshes(step.state)
    if len(faces):
        scene.add_geometry(_mesh(vertices, faces, OBJECTS), node_name="objects", geom_name="objects")
    colours = plate_colours(section.table, step_number, KINDS[0].name, section.table.leading_model)
    for marker, colour in zip(step.state.markers, colours, strict=True):
        corners = plate_corners(marker, PLATE_MODULES) + LIFT_M * np.array(marker.normal)
        # Corners run clockwise for who looks at the print.
        name = f"marker {marker.id} on {marker.object_name}"
        scene.add_geometry(_mesh(corners, [[2, 1, 0], [3, 2, 0]], colour), node_name=name, geom_name=name)
    for camera, group in zip(step.cameras, step.groups, strict=True):
        field, colour = frustum(camera, room), _rgb(section.groups[group].colour)
        body = trimesh.creation.icosphere(subdivisions=2, radius=0.06)
        body.apply_translation(field.apex)
        body.metadata[COLOUR_KEY] = colour
        scene.add_geometry(body, node_name=f"camera {camera.name}", geom_name=f"camera {camera.name}")
        lines = [[field.apex, end] for end in field.ends]
        lines += [[field.ends[n], field.ends[(n + 1) % 4]] for n in range(4)]
        edges = trimesh.load_path(np.array(lines))
        edges.metadata[COLOUR_KEY] = colour
        scene.add_geometry(edges, node_name=f"field of view {camera.name}", geom_name=f"field of view {camera.name}")
    scene.apply_transform(UP)
    return scene


def glb_of(scene: trimesh.Scene) -> bytes:
    """Binary glTF of `scene`, whose parts have their colours in `metadata`."""
    content = scene.export(file_type="glb", tree_postprocessor=_with_materials)
    assert isinstance(content, bytes)
    return content


def linear(srgb: Sequence[int]) -> list[float]:
    """Linear red, green and blue, 0 to 1, of sRGB bytes, 0 to 255 (IEC 61966-2-1)."""
    share = np.array(srgb, dtype=float) / 255
    return [float(value) for value in np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)]


def _with_materials(tree: dict[str, Any]) -> None:
    """Give the glTF document `tree` one material for each colour.

    trimesh itself would round a linear colour to a byte: of (0.1, 22.6)/255 the first would be 0.
    """
    numbers: dict[tuple[int, ...], int] = {}
    for mesh in tree["meshes"]:
        number = numbers.setdefault(tuple(mesh["extras"][COLOUR_KEY]), len(numbers))
        for part in mesh["primitives"]:
            part["material"] = number
    tree["materials"] = [
        {
            "name": "#" + bytes(colour).hex(),
            # Plates and floor are sheets, which viewers would leave out from behind.
            "doubleSided": True,
            "pbrMetallicRoughness": {
                "baseColorFactor": [*linear(colour), 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
        }
        for colour in numbers
    ]


def _rgb(colour: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(colour.removeprefix("#")))


def _mesh(
    vertices: NDArray[np.float64], faces: Sequence[Sequence[int]] | NDArray[np.int64], colour: Sequence[int]
) -> trimesh.Trimesh:
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.metadata[COLOUR_KEY] = tuple(colour)
    return mesh
