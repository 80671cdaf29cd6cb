"""The keys of [markers] and [[objects]]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from scenes.reading.limits import MOST_PLACED
from scenes.reading.quantities import Albedo, Degrees, Direction, MarkerId, Metres, Millimetres, Point
from scenes.reading.spec import Count, Item, Name, Number, Spec, one_of
from scenes.schema.avatar import AvatarSpec
from scenes.schema.dictionaries import DICTIONARIES
from scenes.schema.meshes import MeshSpec
from scenes.schema.motion import MovingSpec

__all__ = [
    "BoxSpec",
    "GridSpec",
    "MarkersSpec",
    "ObjectSpec",
    "PlacedSpec",
    "RectangleSpec",
    "SphereSpec",
    "SpiralSpec",
]


class PlacedSpec(Spec):
    """[[markers.placed]]: a single marker, with `centre_m` on the surface of the object."""

    id: MarkerId
    object: Name
    centre_m: Point
    normal: Direction
    up: Direction | None = Field(None, description="[x, y, z], a direction of any length above 0 (without it, upwards)")
    module_mm: Millimetres


class MarkersSpec(Spec):
    """[markers]: the print of all markers."""

    dictionary: Annotated[Literal[tuple(DICTIONARIES)], Field(description=", ".join(DICTIONARIES))]
    quiet_zone_modules: Annotated[Number, Field(ge=0, description="a number, 0 or more, in modules")]
    white_albedo: Albedo
    black_albedo: Albedo
    placed: Annotated[tuple[Annotated[PlacedSpec, Item], ...], Field(max_length=MOST_PLACED)] = ()


class GridSpec(Spec):
    """Markers in the equal cells of a grid on a rectangle's front, row by row from top left."""

    columns: Count
    rows: Count
    module_mm: Millimetres
    first_id: MarkerId


class SpiralSpec(Spec):
    """Markers spread evenly over a sphere."""

    count: Count
    module_mm: Millimetres
    first_id: MarkerId


class RectangleSpec(MovingSpec):
    """A thin board."""

    name: Name
    kind: Literal["rectangle"]
    centre_m: Point
    width_m: Metres
    height_m: Metres
    facing_deg: Degrees = 0.0
    elevation_deg: Annotated[Number, Field(ge=-90, le=90, description="a number from -90 to 90, in degrees")] = 0.0
    albedo: Albedo
    markers: GridSpec | None = None


class SphereSpec(MovingSpec):
    """A ball."""

    name: Name
    kind: Literal["sphere"]
    centre_m: Point
    radius_m: Metres
    albedo: Albedo
    markers: SpiralSpec | None = None


class BoxSpec(MovingSpec):
    """An axis-parallel box between two corners."""

    name: Name
    kind: Literal["box"]
    lowest_m: Point
    highest_m: Point
    albedo: Albedo


ObjectSpec = one_of("kind", RectangleSpec, SphereSpec, BoxSpec, MeshSpec, AvatarSpec)
