"""The rules of avatars: possible strides, distance between avatars, and suits whose plates fit the body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from render.world.state import Marker
from scenes.errors import Location, Problems
from scenes.markers.layout import overlapping
from scenes.markers.plates import Solid, crosses, stand_off_problem
from scenes.markers.suit import SUIT_KEYS, avatar_markers, suit_markers
from scenes.people.avatar import Stance, avatar_mesh, cylinder_radius_m
from scenes.people.gait import stride_of_speed
from scenes.reading.spec import known, present
from scenes.schema.avatar import AvatarSpec, longest_stride_m, stance_of
from scenes.schema.scene_tables import SceneSpec

__all__ = ["check_avatars", "check_suit"]

# The largest module in a message is rounded down to this.
MODULE_STEP_MM = 0.1
# No module of this size fits on any body.
LARGEST_MODULE_MM = 1000.0


def check_avatars(draft: SceneSpec, problems: Problems) -> None:
    """All rules except those of the markers."""
    before: list[Stance] = []
    for index, item in present(draft.objects):
        if not isinstance(item, AvatarSpec):
            continue
        place: Location = ("objects", index)
        _check_stride(place, item, problems)
        stance = stance_of(item)
        if stance is None:
            continue
        for other in before:
            apart = math.dist(stance.position_m, other.position_m)
            least = cylinder_radius_m(stance) + cylinder_radius_m(other)
            if apart < least:
                reason = "so that the upright cylinders about the two stay apart"
                far = math.ceil(least * 100) / 100
                problems.add(
                    (*place, "position_m"), f'at least {far:g} m from "{other.name}", {reason}; this is {apart:.3g} m'
                )
        before.append(stance)


def _check_stride(place: Location, item: AvatarSpec, problems: Problems) -> None:
    if not known(item.height_m, item.speed_m_per_s):
        return
    most = longest_stride_m(item.height_m)
    of_speed = stride_of_speed(item.speed_m_per_s, item.height_m)
    if problems.given((*place, "stride_m")):
        if item.stride_m is not None and item.stride_m > most:
            problems.add((*place, "stride_m"), f"0 to {most:g}, that of a walk at this height, in metres")
    elif of_speed > most:
        # The stride grows with the root of the speed.
        fastest = math.floor(item.speed_m_per_s * (most / of_speed) ** 2 * 100) / 100
        problems.add((*place, "speed_m_per_s"), f"0 to {fastest:g}, a walk at this height (or a stride_m of its own)")


def check_suit(
    place: Location, item: AvatarSpec, others: Sequence[Solid], side_modules: float | None, problems: Problems
) -> tuple[Marker, ...]:
    """The markers of an avatar's suit, with each plate on the body and cutting through none of `others`."""
    markers = avatar_markers(item, side_modules) if side_modules is not None else ()
    stance = stance_of(item)
    if side_modules is None or stance is None or not markers:
        return ()
    for key in dict.fromkeys(SUIT_KEYS):
        module_mm = getattr(item.markers, key)
        if not _fit(stance, key, module_mm, side_modules):
            reason = f"every plate of {side_modules:g} modules lies on the body, clear of all else of it"
            largest = _largest_mm(stance, key, module_mm, side_modules)
            # A default size counts too.
            shown = {} if problems.given((*place, "markers", key)) else {"value": module_mm}
            problems.add((*place, "markers", key), f"at most {largest:g} so that {reason}", **shown)
    on_body = tuple(marker for marker in markers if marker is not None)
    # Whole avatars are kept apart.
    for other in others:
        if any(_cut(marker, other, side_modules) for marker in on_body):
            problems.add((*place, "position_m"), f'a place where no plate of the suit sticks through "{other.name}"')
    return on_body


def _cut(marker: Marker, other: Solid, side_modules: float) -> bool:
    centre, normal, up = (np.array(vector) for vector in (marker.centre_m, marker.normal, marker.up))
    return crosses([other], centre, normal, up, side_modules * marker.module_m)


@lru_cache(maxsize=1024)
def _fit(stance: Stance, key: str, module_mm: float, side_modules: float) -> bool:
    """Whether all markers sized by `key` lie on their parts of the body, clear of the others."""
    suit = suit_markers(stance, 0, dict.fromkeys(SUIT_KEYS, module_mm), side_modules)
    markers = [marker for marker, own in zip(suit, SUIT_KEYS, strict=True) if own == key]
    if None in markers:
        return False
    mesh, sides = avatar_mesh(stance), [module_mm * 1e-3 * side_modules] * len(markers)
    if next(overlapping(markers, sides, mesh), None) is not None:
        return False
    return all(stand_off_problem(marker, sides[0], mesh, ()) is None for marker in markers)


def _largest_mm(stance: Stance, key: str, module_mm: float, side_modules: float) -> float:
    """Millimetres, the largest module below `module_mm` that fits; 0 if none does."""
    low, high = 0, math.ceil(min(module_mm, LARGEST_MODULE_MM) / MODULE_STEP_MM)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if _fit(stance, key, middle * MODULE_STEP_MM, side_modules) else (low, middle)
    return round(low * MODULE_STEP_MM, 1)
