"""The rules of a scene file that involve several keys. Each is applied to the valid parts of the draft."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pss import Box, GeometryError, PTZCamera, Rectangle, Sphere
from pss.surrogates import Mesh, Shape
from scenes.errors import Location, Problems
from scenes.mesh_file import contains
from scenes.people.avatar import avatar_mesh
from scenes.reading.spec import known, present
from scenes.rules.avatar_checks import check_avatars
from scenes.rules.optics import FAR_M, check_optics
from scenes.schema.avatar import AvatarSpec, stance_of
from scenes.schema.camera_tables import CameraSpec
from scenes.schema.meshes import MeshSpec
from scenes.schema.object_tables import BoxSpec, RectangleSpec, SphereSpec
from scenes.schema.room_tables import LightSpec, RoomSpec
from scenes.schema.scene_tables import SceneSpec

__all__ = ["check_names", "check_scene", "extent_m", "inside_room", "room_allows", "room_size", "shape_of"]

# Walls, floor and boxes may touch; sums of decimal fractions are off by less than this.
TOUCHING_M = 1e-9
# Mesh files have single precision.
MESH_TOUCHING_M = 1e-5
# A board closer to a wall than this cannot be distinguished from it in depth.
OFF_THE_WALL_M = 1e-3


def check_scene(draft: SceneSpec, problems: Problems) -> None:
    """All rules except those of the markers."""
    check_names(("cameras",), draft.cameras, "camera", problems)
    check_names(("objects",), draft.objects, "object", problems)
    _check_panels(draft, problems)
    check_optics(draft, problems)
    _check_light(draft, problems)
    for index, camera in present(draft.cameras):
        _check_pose(("cameras", index), camera, draft, problems)
    for index, item in present(draft.objects):
        _check_object(("objects", index), item, draft.room, problems)
    check_avatars(draft, problems)


def check_names(location: Location, items: Iterable | None, noun: str, problems: Problems) -> None:
    """Report names that occur twice."""
    seen: set[str] = set()
    for index, item in present(items):
        if item.name in seen:
            problems.add((*location, index, "name"), f"a name that no other {noun} has")
        elif item.name is not None:
            seen.add(item.name)


# ---- the room ------------------------------------------------------------------------------------------------------


def room_size(room: RoomSpec | None) -> tuple[float, float, float] | None:
    """Metres, (width, length, height) of a draft's room, if it is valid."""
    size = (room.width_m, room.length_m, room.height_m) if room is not None else (None,)
    return size if known(*size) else None


def inside_room(points_m: np.ndarray, size_m: tuple[float, float, float], gap_m: float = 0.0) -> bool:
    """Whether all `points_m` (..., 3) are in the room, at least `gap_m` off its walls."""
    half = np.array([size_m[0] / 2, size_m[1] / 2, size_m[2] / 2])
    return bool((np.abs(points_m - [0, 0, half[2]]) <= half - gap_m + TOUCHING_M).all())


def room_allows(size_m: tuple[float, float, float]) -> str:
    """What is allowed for a point in the room."""
    width, length, height = size_m
    return f"inside the room: x ±{width / 2:g}, y ±{length / 2:g}, z 0 to {height:g} m"


def _check_panels(draft: SceneSpec, problems: Problems) -> None:
    size = room_size(draft.room)
    for index, panel in present(draft.light.panels if draft.light is not None else None):
        if size is None or not known(panel.centre_m, panel.size_m):
            continue
        edges = np.abs(panel.centre_m) + np.array(panel.size_m) / 2
        if (edges > np.array(size[:2]) / 2 + TOUCHING_M).any():
            ceiling = f"x ±{size[0] / 2:g}, y ±{size[1] / 2:g} m"
            place = ("light", "panels", index)
            problems.add(
                (*place, "centre_m"), f"the whole panel of {_pair(panel.size_m)} m within the ceiling: {ceiling}"
            )


def _pair(numbers: tuple[float, float]) -> str:
    return f"{numbers[0]:g} × {numbers[1]:g}"


# ---- cameras -------------------------------------------------------------------------------------------------------


def _check_pose(place: Location, camera: CameraSpec, draft: SceneSpec, problems: Problems) -> None:
    aimed, panned, tilted = (problems.given((*place, key)) for key in ("aim_m", "pan_deg", "tilt_deg"))
    if aimed and (panned or tilted):
        problems.add((*place, "aim_m"), "aim_m, or pan_deg and tilt_deg, but not both")
    elif not aimed and not panned and not tilted:
        problems.add((*place, "aim_m"), "aim_m, or pan_deg and tilt_deg")
    elif not aimed and not (panned and tilted):
        problems.add((*place, "tilt_deg" if panned else "pan_deg"), "pan_deg and tilt_deg, or aim_m alone")
    if camera.position_m is None:
        return
    size = room_size(draft.room)
    position = np.array(camera.position_m)
    if size is not None and not inside_room(position, size, gap_m=2 * TOUCHING_M):
        problems.add((*place, "position_m"), room_allows(size))
    for item in draft.objects or ():
        shape = shape_of(item)
        if shape is not None and _contains(shape, position):
            problems.add((*place, "position_m"), f'outside the object "{shape.name}"')
    if camera.aim_m is not None:
        try:
            PTZCamera(position, 0, 0, focus_distance_m=FAR_M).aimed_at(camera.aim_m)
        except GeometryError:
            problems.add((*place, "aim_m"), "a point away from the camera itself")


def _check_light(draft: SceneSpec, problems: Problems) -> None:
    """The keys of one kind of light are required, those of the other kind refused."""
    light = draft.light
    if light is None or light.kind is None:
        return
    ambient, ring = ("radiance_w_per_m2_sr", "panels"), ("ring_w_per_sr",)
    required, other = (ring, ambient) if light.kind == "ring" else (ambient, ring)
    given = problems.document.get("light", {})
    for key in required:
        if key not in given:
            description = LightSpec.model_fields[key].description
            problems.add(("light", key), f'{description} (the light is "{light.kind}")')
    for key in other:
        if key in given:
            problems.add(("light", key), f'not beside kind = "{light.kind}"')


# ---- objects -------------------------------------------------------------------------------------------------------


def shape_of(
    item: RectangleSpec | SphereSpec | BoxSpec | MeshSpec | AvatarSpec | None,
) -> Rectangle | Sphere | Box | Mesh | None:
    """The shape of a table of [[objects]]; None if a part of it is missing or invalid."""
    match item:
        case RectangleSpec():
            values = (item.name, item.centre_m, item.width_m, item.height_m, item.facing_deg, item.elevation_deg)
            return Rectangle(*values) if known(*values) else None
        case SphereSpec():
            values = (item.name, item.centre_m, item.radius_m)
            return Sphere(*values) if known(*values) else None
        case BoxSpec():
            values = (item.name, item.lowest_m, item.highest_m)
            return Box(*values) if known(*values) and _is_box(item) else None
        case MeshSpec():
            return item._mesh
        case AvatarSpec():
            stance = stance_of(item)
            return avatar_mesh(stance) if stance is not None else None
    return None


def _is_box(item: BoxSpec) -> bool:
    return all(low < high for low, high in zip(item.lowest_m, item.highest_m, strict=True))


def _check_object(place: Location, item: object, room: RoomSpec | None, problems: Problems) -> None:
    if isinstance(item, BoxSpec) and known(item.lowest_m, item.highest_m) and not _is_box(item):
        problems.add((*place, "highest_m"), f"each number above that of lowest_m = {list(item.lowest_m)}")
    shape, size = shape_of(item), room_size(room)
    if shape is None or size is None:
        return
    if not inside_room(extent_m(shape), size, -MESH_TOUCHING_M if isinstance(shape, Mesh) else 0.0):
        noun, key = {
            Rectangle: ("board", "centre_m"),
            Sphere: ("ball", "centre_m"),
            Box: ("box", "highest_m"),
            Mesh: ("avatar" if isinstance(item, AvatarSpec) else "mesh", "position_m"),
        }[type(shape)]
        if isinstance(shape, Box) and not inside_room(np.array(shape.lowest_m), size):
            key = "lowest_m"
        problems.add((*place, key), f"the whole {noun} {room_allows(size)}")
    elif isinstance(shape, Rectangle) and not inside_room(np.array(shape.centre_m), size, OFF_THE_WALL_M):
        problems.add((*place, "centre_m"), f"at least {OFF_THE_WALL_M * 1e3:g} mm off the wall")


def extent_m(shape: Rectangle | Sphere | Box | Mesh) -> np.ndarray:
    """Metres, points of a shape that are all in the room if and only if the shape is, (N, 3)."""
    match shape:
        case Rectangle():
            across, along = shape.width_m / 2 * shape.right, shape.height_m / 2 * shape.up
            return np.array(shape.centre_m) + [across + along, across - along, along - across, -across - along]
        case Sphere():
            return np.array(shape.centre_m) + shape.radius_m * np.vstack([np.eye(3), -np.eye(3)])
        case Box():
            return np.array([shape.lowest_m, shape.highest_m])
        case Mesh():
            return np.array([shape.vertices_m.min(axis=0), shape.vertices_m.max(axis=0)])


def _contains(shape: Shape, point_m: np.ndarray) -> bool:
    match shape:
        case Sphere():
            return bool(np.linalg.norm(point_m - shape.centre_m) <= shape.radius_m)
        case Box():
            return bool((point_m >= shape.lowest_m).all() and (point_m <= shape.highest_m).all())
        case Mesh():
            return contains(shape, point_m)
    return False  # a board has no inside
