"""The rules of markers: ids of the dictionary, each used once, and plates that fit their objects without overlap."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pss import Rectangle, Sphere
from render.world.state import Marker
from scenes.errors import Location, Problems, nearest
from scenes.markers.layout import (
    largest_spiral_module_m,
    markers_on,
    overlapping,
    placed_marker,
    plate_corners_m,
    plate_side_m,
)
from scenes.markers.plates import Solid, stand_off_problem
from scenes.markers.spread import spread_over
from scenes.markers.suit import SUIT_SIZE
from scenes.reading.spec import known
from scenes.rules.avatar_checks import check_suit
from scenes.rules.checks import extent_m, inside_room, room_allows, room_size, shape_of
from scenes.schema.avatar import AvatarSpec
from scenes.schema.dictionaries import DICTIONARIES, Dictionary
from scenes.schema.meshes import MeshSpec, SpreadSpec
from scenes.schema.object_tables import GridSpec, PlacedSpec, SpiralSpec
from scenes.schema.scene_tables import SceneSpec

__all__ = ["check_markers"]

MOST_IDS = max(dictionary.ids for dictionary in DICTIONARIES.values())


@dataclass(frozen=True)
class _Group:
    """The ids of one table of the file, and its markers if their places are valid.

    `cause` is the key that moves its plates, if that is not the module's size or a marker's own place.
    """

    place: Location
    id_key: str
    number_key: str
    ids: range
    owner: str
    markers: tuple[Marker, ...] = ()
    cause: Location | None = None


def check_markers(draft: SceneSpec, problems: Problems) -> None:
    """All rules of markers."""
    prints = draft.markers
    dictionary = DICTIONARIES.get(prints.dictionary) if prints is not None else None
    side_modules = None
    if dictionary is not None and prints.quiet_zone_modules is not None:
        side_modules = plate_side_m(1.0, dictionary, prints.quiet_zone_modules)
    groups = list(_groups_on_objects(draft, side_modules, problems))
    if prints is not None:
        groups += _placed(draft, prints.placed or (), side_modules, problems)
        if known(prints.white_albedo, prints.black_albedo) and prints.black_albedo >= prints.white_albedo:
            problems.add(("markers", "black_albedo"), f"below white_albedo = {prints.white_albedo:g}")
    if dictionary is not None:
        _check_dictionary(groups, dictionary, prints.dictionary, problems)
    _check_each_once(groups, problems)
    if side_modules is not None:
        _check_room(draft, groups, side_modules, problems)
        _check_stand_off(draft, groups, side_modules, problems)
        _check_placed_apart(draft, groups, side_modules, problems)
    locations = [("markers", "placed"), *(("objects", index, "markers") for index in range(len(draft.objects or ())))]
    if draft.objects is not None and not any(problems.given(place) for place in locations):
        problems.report("objects have no markers; allowed: at least one marker, as markers are the points of interest")


def _groups_on_objects(draft: SceneSpec, side_modules: float | None, problems: Problems) -> Iterator[_Group]:
    for index, item in enumerate(draft.objects or ()):
        spec = getattr(item, "markers", None)
        if spec is None:
            continue
        place: Location = ("objects", index, "markers")
        if isinstance(item, AvatarSpec):
            if known(spec.first_id):
                ids = range(spec.first_id, spec.first_id + SUIT_SIZE)
                avatars = [other.name for other in draft.objects if isinstance(other, AvatarSpec)]
                others = [shape for name, shape in _shapes(draft).items() if name not in avatars]
                markers = check_suit(("objects", index), item, others, side_modules, problems)
                moved_by = ("objects", index, "position_m")
                yield _Group(place, "first_id", "first_id", ids, item.name or "", markers, moved_by)
            continue
        counts = (spec.columns, spec.rows) if isinstance(spec, GridSpec) else (spec.count,)
        if not known(spec.first_id, *counts):
            continue
        number_key = "rows" if isinstance(spec, GridSpec) else "count"
        # One too many is enough for the message; a range cannot have as many as two integers can multiply to.
        number = min(counts[0] * (counts[1] if len(counts) > 1 else 1), MOST_IDS + 1)
        shape, markers = shape_of(item), ()
        # No dictionary has more: a slip of a zero is reported by the check of ids, without running out of memory.
        if isinstance(item, MeshSpec):
            if known(shape, spec.module_mm, side_modules) and number <= MOST_IDS:
                markers = item._spread = _spread(place, item, draft, side_modules, problems)
        elif known(shape, spec.module_mm) and number <= MOST_IDS:
            if side_modules is not None:
                _check_plates(place, shape, spec, side_modules, problems)
            markers = tuple(markers_on(shape, spec))
        yield _Group(
            place, "first_id", number_key, range(spec.first_id, spec.first_id + number), item.name or "", markers
        )


def _check_plates(
    place: Location, shape: Rectangle | Sphere, spec: GridSpec | SpiralSpec, side_modules: float, problems: Problems
) -> None:
    if isinstance(shape, Rectangle):
        width, height = shape.width_m / spec.columns, shape.height_m / spec.rows
        largest = min(width, height) / side_modules
        reason = f"each plate of {side_modules:g} modules fits its cell of {width:.4g} × {height:.4g} m"
    else:
        largest = largest_spiral_module_m(shape, spec, side_modules)
        reason = f"{spec.count} plates of {side_modules:g} modules fit a ball of {shape.radius_m:g} m and stay apart"
    # 1e-9: a module that fills its cell is allowed, whatever the rounding of its decimal fraction.
    if spec.module_mm * 1e-3 > largest * (1 + 1e-9):
        problems.add((*place, "module_mm"), f"at most {_floor(largest * 1e3)} so that {reason}")


def _spread(
    place: Location, item: MeshSpec, draft: SceneSpec, side_modules: float, problems: Problems
) -> tuple[Marker, ...]:
    """The markers spread over a mesh; a problem if not all of them fit."""
    spec: SpreadSpec = item.markers
    size = room_size(draft.room)
    if not known(size, spec.min_distance_m, spec.flatness_mm, spec.seed):
        return ()
    side_m = spec.module_mm * 1e-3 * side_modules
    diagonal_m = math.sqrt(2) * side_m
    if spec.min_distance_m < diagonal_m:
        reason = f"the diagonal of a plate of {side_modules:g} modules, so that plates stay apart"
        problems.add((*place, "min_distance_m"), f"at least {math.ceil(diagonal_m * 1e4) / 1e4:g}, {reason}")
        return ()
    found = spread_over(
        item._mesh,
        tuple(shape for name, shape in _shapes(draft).items() if name != item.name),
        size,
        count=spec.count,
        module_mm=spec.module_mm,
        side_m=side_m,
        min_distance_m=spec.min_distance_m,
        flatness_m=spec.flatness_mm * 1e-3,
        first_id=spec.first_id,
        seed=spec.seed,
    )
    if not found.flat:
        where = f"on a part of the mesh that is flat within {spec.flatness_mm:g} mm, and free; there is none"
        problems.add((*place, "module_mm"), f"plates of {side_m * 1e3:.4g} mm {where}")
    elif len(found.markers) < spec.count:
        reason = f"{spec.min_distance_m:g} m apart where the mesh is flat within {spec.flatness_mm:g} mm"
        room = f"{found.flat} of {found.tried} places tried bear a plate of {side_m * 1e3:.4g} mm"
        problems.add((*place, "count"), f"at most {len(found.markers)}, as no more fit {reason} ({room})")
    return found.markers


def _shapes(draft: SceneSpec) -> dict[str, Solid]:
    """The shapes in the room, by name."""
    shapes = [shape for item in draft.objects or () if (shape := shape_of(item)) is not None]
    shapes += [part.shape for part in draft.backdrop._parts] if draft.backdrop is not None else []
    return {shape.name: shape for shape in shapes}


def _floor(millimetres: float) -> str:
    # Rounded down, so that the value in the message is allowed.
    return f"{int(millimetres * 1000) / 1000:g}"


def _placed(
    draft: SceneSpec, placed: tuple[PlacedSpec | None, ...], side_modules: float | None, problems: Problems
) -> list[_Group]:
    names = [item.name for item in draft.objects or () if item is not None and item.name is not None]
    groups = []
    for index, spec in enumerate(placed):
        if spec is None:
            continue
        place: Location = ("markers", "placed", index)
        if spec.object is not None and spec.object not in names:
            problems.add(
                (*place, "object"), f"an object of the file: {', '.join(names)}{nearest(spec.object, names)[0]}"
            )
        marker = None
        if known(spec.id, spec.object, spec.centre_m, spec.normal, spec.module_mm):
            marker = placed_marker(spec)
            if marker is None:
                problems.add((*place, "normal"), "a direction of any length above 0, and not that of up")
        if spec.id is not None:
            markers = (marker,) if marker is not None else ()
            groups.append(_Group(place, "id", "id", range(spec.id, spec.id + 1), spec.object or "", markers))
    return groups


def _check_dictionary(groups: list[_Group], dictionary: Dictionary, name: str, problems: Problems) -> None:
    for group in groups:
        highest = dictionary.ids - len(group.ids)
        if highest < 0:
            problems.add(
                (*group.place, group.number_key), f"at most {dictionary.ids} markers in all, the ids of {name}"
            )
        elif group.ids.start > highest:
            reason = name if len(group.ids) == 1 else f"{len(group.ids)} ids within {name}"
            problems.add((*group.place, group.id_key), f"0 to {highest} ({reason})")


def _check_each_once(groups: list[_Group], problems: Problems) -> None:
    # If a table requests more ids than there are, that is the mistake, not the resulting collisions.
    groups = [group for group in groups if len(group.ids) <= MOST_IDS]
    for second, group in enumerate(groups):
        for other in groups[:second]:
            shared = range(max(group.ids.start, other.ids.start), min(group.ids.stop, other.ids.stop))
            if shared:
                which = f"{shared[0]}" if len(shared) == 1 else f"{shared[0]} to {shared[-1]}"
                problems.add((*group.place, group.id_key), f'each id once; {which} already on "{other.owner}"')


def _check_room(draft: SceneSpec, groups: list[_Group], side_modules: float, problems: Problems) -> None:
    size = room_size(draft.room)
    if size is None:
        return
    # If an object is outside, that is the mistake, not its plates.
    shapes = [shape_of(item) for item in draft.objects or ()]
    outside = {shape.name for shape in shapes if shape is not None and not inside_room(extent_m(shape), size)}
    for group in groups:
        corners = [plate_corners_m(marker, side_modules * marker.module_m) for marker in group.markers]
        if corners and group.owner not in outside and not inside_room(np.array(corners), size):
            key = "module_mm" if group.id_key == "first_id" else "centre_m"
            problems.add(group.cause or (*group.place, key), f"every plate {room_allows(size)}")


def _check_stand_off(draft: SceneSpec, groups: list[_Group], side_modules: float, problems: Problems) -> None:
    """Markers placed by hand must lie on their object, and cut through nothing."""
    shapes, size = _shapes(draft), room_size(draft.room)
    for group in groups:
        for marker in group.markers if group.id_key == "id" and group.owner in shapes else ():
            others = [shape for name, shape in shapes.items() if name != group.owner]
            side_m = side_modules * marker.module_m
            # If a plate is outside the room, that is the mistake, not what else it cuts.
            if size is None or not inside_room(plate_corners_m(marker, side_m), size):
                continue
            problem = stand_off_problem(marker, side_m, shapes[group.owner], others)
            if problem is not None:
                problems.add((*group.place, "centre_m"), problem)


def _check_placed_apart(draft: SceneSpec, groups: list[_Group], side_modules: float, problems: Problems) -> None:
    shapes = _shapes(draft)
    on: dict[str, list[tuple[_Group, Marker]]] = defaultdict(list)
    for group in groups:
        on[group.owner] += [(group, marker) for marker in group.markers]
    for owner, pairs in on.items():
        if owner not in shapes or not any(group.id_key == "id" for group, _ in pairs):
            continue
        markers = [marker for _, marker in pairs]
        sides = [side_modules * marker.module_m for marker in markers]
        covered: dict[int, list[int]] = defaultdict(list)
        for first, second in overlapping(markers, sides, shapes[owner]):
            covered[second].append(markers[first].id)  # markers placed by hand come last
        for second, ids in covered.items():
            group = pairs[second][0]
            if group.id_key == "id":
                problems.add((*group.place, "centre_m"), f"a place clear of the plates of {', '.join(map(str, ids))}")
