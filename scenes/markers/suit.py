"""The marker suit of an avatar: flat markers on head, torso, upper arms, thighs and shins, as for motion capture.

A marker is placed on its part alone, in the part's own frame, so that it moves rigidly with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pss import RangeError
from pss.hints import Floats
from pss.surrogates import Mesh
from render.world.state import Marker
from scenes.markers.layout import marker_at, upwards
from scenes.markers.plates import Seat, seat
from scenes.people.avatar import Stance, avatar_frames
from scenes.people.body import Frame, part
from scenes.reading.spec import known
from scenes.schema.avatar import AvatarSpec, stance_of

__all__ = ["SUIT_KEYS", "SUIT_SIZE", "avatar_markers", "ids_on", "suit_markers"]


FRONT, BACK, RIGHT, LEFT, TOP = (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0), (0, 0, 1)


@dataclass(frozen=True)
class _Place:
    """Place of a marker: part, height in the part's frame in body heights, direction, and the key of its size."""

    part: str
    height: float
    facing: tuple[int, int, int]
    key: str


# Limbs have theirs in front, behind and outside: inside, the other leg and the trunk are in the way.
PLACES = (
    *(_Place("head", 0.075, facing, "head_module_mm") for facing in (FRONT, BACK, RIGHT, LEFT, TOP)),
    *(_Place("torso", height, facing, "torso_module_mm") for height in (0.218, 0.050) for facing in (FRONT, BACK)),
    *(_Place("torso", 0.105, facing, "flank_module_mm") for facing in (RIGHT, LEFT)),
    *(
        _Place(f"{side} {limb}", height, facing, key)
        for limb, height, key in (
            ("upper arm", -0.095, "arm_module_mm"),
            ("thigh", -0.135, "thigh_module_mm"),
            ("shin", -0.100, "shin_module_mm"),
        )
        for side in ("right", "left")
        for facing in (FRONT, BACK, RIGHT)
    ),
)
SUIT_SIZE = len(PLACES)
"""The number of markers of a suit."""
SUIT_KEYS = tuple(place.key for place in PLACES)
"""The key of the module size of each marker of a suit, in the order of their ids."""


def suit_markers(
    stance: Stance, first_id: int, modules_mm: Mapping[str, float], side_modules: float
) -> tuple[Marker | None, ...]:
    """The markers of a suit, numbered from `first_id`; None for one whose plate extends over the edge of its part.

    Args:
        modules_mm: mm, by key.
        side_modules: side of a plate in modules.
    """
    frames = avatar_frames(stance)
    markers: list[Marker | None] = []
    for number, place in enumerate(PLACES):
        module_mm, frame = modules_mm[place.key], frames[place.part]
        seated = _seated(place, stance.height_m, module_mm * 1e-3 * side_modules)
        markers.append(
            None if seated is None else _suit_marker(first_id + number, stance.name, seated, frame, module_mm)
        )
    return tuple(markers)


def ids_on(part_name: str, first_id: int) -> tuple[int, ...]:
    """The ids of a suit's markers on one part of the body, such as "torso", if it is numbered from `first_id`.

    Markers on one part keep their relative positions in every phase of the walk. One whose plate extends over the edge
    of its part has a number, but no marker (`suit_markers`).

    Raises:
        RangeError: no marker is on a part of that name.
    """
    ids = tuple(first_id + number for number, place in enumerate(PLACES) if place.part == part_name)
    if not ids:
        bearing = ", ".join(dict.fromkeys(place.part for place in PLACES))
        raise RangeError(f"part_name = {part_name!r} bears no markers; allowed: {bearing}")
    return ids


def avatar_markers(item: AvatarSpec, side_modules: float) -> tuple[Marker | None, ...]:
    """The markers of an avatar's table, as by `suit_markers`; none without a suit or with invalid parts."""
    stance, suit = stance_of(item), item.markers
    if stance is None or suit is None:
        return ()
    modules_mm = {key: getattr(suit, key) for key in SUIT_KEYS}
    if not known(suit.first_id, *modules_mm.values()):
        return ()
    return suit_markers(stance, suit.first_id, modules_mm, side_modules)


def _suit_marker(number: int, owner: str, seated: Seat, frame: Frame, module_mm: float) -> Marker:
    normal, up = frame.turn(seated.normal), frame.turn(upwards(seated.normal))
    return marker_at(number, owner, frame.place(seated.base_m), normal, up, module_mm)


@lru_cache(maxsize=1024)
def _seated(place: _Place, height_m: float, side_m: float) -> Seat | None:
    """Position of a plate on its part, in the part's frame."""
    surface = part(place.part, height_m)
    facing = np.array(place.facing, dtype=float)
    level = np.array([0.0, 0.0, place.height * height_m])
    # The outermost vertices that the plate may touch: those at its own height, or the top.
    near = np.abs(surface.vertices_m[:, 2] - level[2]) <= side_m / 2
    reach = _reach(surface, facing, level, near if facing[2] == 0 else np.ones_like(near))
    return seat(surface, reach, facing, side_m)


def _reach(surface: Mesh, facing: Floats, level: Floats, near: NDArray[np.bool_]) -> Floats:
    """Metres, (3,): from the middle of the part along `facing`, as far as the `near` vertices extend."""
    if not near.any():
        near = np.ones_like(near)
    at = np.where(facing == 0, np.where(np.arange(3) == 2, level, 0.0), 0.0)
    return at + facing * (surface.vertices_m[near] @ facing).max()
