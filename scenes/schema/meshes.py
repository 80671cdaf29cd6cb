"""The keys of meshes with markers spread over them, and of a backdrop, both from files."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PrivateAttr

from pss.surrogates import Mesh
from render.world.state import Marker, SceneObject
from scenes.reading.quantities import Albedo, Degrees, FilePath, MarkerId, Metres, Millimetres, Point, Seed
from scenes.reading.spec import Count, Name, Positive, Spec
from scenes.schema.motion import MovingSpec

__all__ = ["BackdropSpec", "MeshSpec", "SpreadSpec"]

Scale = Annotated[Positive, Field(description="a number above 0, in metres for one unit of the file (0.001: mm)")]


class SpreadSpec(Spec):
    """Markers spread over a mesh where it is flat enough for their plates."""

    count: Count
    module_mm: Millimetres
    min_distance_m: Metres
    flatness_mm: Millimetres
    first_id: MarkerId
    seed: Seed = 0


class MeshSpec(MovingSpec):
    """A mesh from a file: rolled, tilted, panned, and then moved so that its own origin is at `position_m`."""

    name: Name
    kind: Literal["mesh"]
    file: FilePath
    position_m: Point
    turn_deg: Degrees = 0.0
    tilt_deg: Degrees = 0.0
    roll_deg: Degrees = 0.0
    scale: Scale = 1.0
    albedo: Albedo
    markers: SpreadSpec | None = None

    # The contents of the file, as posed, and the places of the markers.
    _mesh: Mesh | None = PrivateAttr(None)
    _spread: tuple[Marker, ...] = PrivateAttr(())


class BackdropSpec(Spec):
    """[backdrop]: a Mitsuba scene whose shapes are part of the room."""

    file: FilePath
    position_m: Point = (0.0, 0.0, 0.0)
    turn_deg: Degrees = 0.0
    scale: Scale = 1.0
    up: Annotated[Literal["z", "y"], Field(description="z, y (the file's axis that points up)")] = "z"

    # The contents of the file, as posed.
    _parts: tuple[SceneObject, ...] = PrivateAttr(())
