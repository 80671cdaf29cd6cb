"""The keys of [room] and [light]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from scenes.reading.limits import BRIGHTEST_RING_W_PER_SR, BRIGHTEST_W_PER_M2_SR, LONGEST_ROOM_M, MOST_PANELS
from scenes.reading.quantities import Albedo
from scenes.reading.spec import Item, Number, Positive, Spec

__all__ = ["LightSpec", "RoomSpec"]


Size = Annotated[Number, Field(gt=0)]
RoomSide = Annotated[
    Positive, Field(le=LONGEST_ROOM_M, description=f"a number above 0, in metres, at most {LONGEST_ROOM_M:g}")
]


class RoomSpec(Spec):
    """[room]: centred on x = y = 0, its floor at z = 0."""

    width_m: RoomSide
    length_m: RoomSide
    height_m: RoomSide
    wall_albedo: Albedo
    floor_albedo: Albedo
    ceiling_albedo: Albedo


class PanelSpec(Spec):
    """A lamp in the ceiling."""

    centre_m: Annotated[tuple[Number, Number], Field(description="[x, y], in metres")]
    size_m: Annotated[tuple[Size, Size], Field(description="[along x, along y], each above 0, in metres")]


class LightSpec(Spec):
    """[light]: "ambient", panels in the ceiling; or "ring", a strobe at each camera, visible to that camera only."""

    kind: Annotated[Literal["ambient", "ring"], Field(description='"ambient" or "ring"')] = "ambient"
    radiance_w_per_m2_sr: Annotated[Positive, Field(le=BRIGHTEST_W_PER_M2_SR)] | None = Field(
        None,
        description=f"a number above 0, at most {BRIGHTEST_W_PER_M2_SR:.0e} (the sun), in W/(m² sr), of the panels",
    )
    panels: Annotated[tuple[Annotated[PanelSpec, Item], ...], Field(min_length=1, max_length=MOST_PANELS)] | None = (
        Field(None, description=f"at least one {{ centre_m, size_m }}, at most {MOST_PANELS}")
    )
    ring_w_per_sr: Annotated[Positive, Field(le=BRIGHTEST_RING_W_PER_SR)] | None = Field(
        None,
        description=f"a number above 0, at most {BRIGHTEST_RING_W_PER_SR:.0e}, in W/sr, of each camera's ring light",
    )
