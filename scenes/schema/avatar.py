"""The keys of an avatar: a walking person in a suit of markers."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from scenes.people.avatar import Stance
from scenes.people.gait import phase_at, stride_of_speed
from scenes.reading.quantities import Albedo, Degrees, MarkerId, Millimetres
from scenes.reading.spec import Name, Number, Spec, known

__all__ = ["AvatarSpec", "SuitSpec", "longest_stride_m", "stance_of"]

LOWEST_M, HIGHEST_M = 1.2, 2.1


class SuitSpec(Spec):
    """The markers of an avatar's suit; the sizes fit plates of eight modules on bodies of 1.6 m and more."""

    first_id: MarkerId
    head_module_mm: Millimetres = 10.0
    torso_module_mm: Millimetres = 20.0
    flank_module_mm: Millimetres = 10.0
    arm_module_mm: Millimetres = 10.0
    thigh_module_mm: Millimetres = 12.5
    shin_module_mm: Millimetres = 10.0


class AvatarSpec(Spec):
    """A walking person."""

    name: Name
    kind: Literal["avatar"]
    position_m: Annotated[tuple[Number, Number], Field(description="[x, y], in metres")]
    heading_deg: Degrees = 0.0
    height_m: Annotated[
        Number,
        Field(ge=LOWEST_M, le=HIGHEST_M, description=f"a number from {LOWEST_M} to {HIGHEST_M}, in metres"),
    ]
    speed_m_per_s: Annotated[Number, Field(ge=0, description="a number, 0 or more, in metres per second")] = 0.0
    stride_m: Annotated[Number, Field(ge=0)] | None = Field(
        None, description="a number, 0 or more, in metres (without it, that of the speed)"
    )
    phase: Annotated[Number, Field(ge=0, le=1)] | None = Field(
        None, description="a number from 0 to 1 (without it, that of a walk through x = y = 0 at phase 0)"
    )
    albedo: Albedo
    markers: SuitSpec | None = None


def longest_stride_m(height_m: float) -> float:
    """Metres, the longest stride (two steps) of a person of this height: beyond the height a walk is a run."""
    return height_m


def stance_of(item: AvatarSpec) -> Stance | None:
    """The stance of a table, with defaults for stride and phase; None if parts are invalid."""
    if not known(item.name, item.position_m, item.heading_deg, item.height_m, item.speed_m_per_s):
        return None
    stride_m = stride_of_speed(item.speed_m_per_s, item.height_m) if item.stride_m is None else item.stride_m
    if stride_m > longest_stride_m(item.height_m):
        return None
    heading = math.radians(item.heading_deg)
    along_m = item.position_m[0] * math.sin(heading) + item.position_m[1] * math.cos(heading)
    phase = phase_at(along_m, stride_m) if item.phase is None else item.phase
    return Stance(item.name, item.height_m, stride_m, phase, item.position_m, item.heading_deg)
