"""All tables of a scene file; their keys are in the modules beside this one, rules of several keys in `scenes.rules`.

Units end the names: _m metres, _mm millimetres, _um micrometres, _nm nanometres, _ms milliseconds, _deg degrees,
_e electrons, _dn digital numbers, _per_ the divisor. A description is the text after "allowed:" in messages.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from scenes.reading.limits import MOST_CAMERAS, MOST_OBJECTS
from scenes.reading.spec import Item, Spec
from scenes.schema.camera_tables import CameraSpec, LensSpec, SensorSpec
from scenes.schema.meshes import BackdropSpec
from scenes.schema.object_tables import MarkersSpec, ObjectSpec
from scenes.schema.prediction_tables import MetricSpec, NoiseSpec, ProcessSpec
from scenes.schema.room_tables import LightSpec, RoomSpec

__all__ = ["SceneSpec"]


class SceneSpec(Spec):
    """A whole scene file."""

    room: RoomSpec
    light: LightSpec
    sensor: SensorSpec
    lens: LensSpec
    cameras: Annotated[tuple[Annotated[CameraSpec, Item], ...], Field(min_length=1, max_length=MOST_CAMERAS)]
    markers: MarkersSpec
    objects: Annotated[tuple[Annotated[ObjectSpec, Item], ...], Field(min_length=1, max_length=MOST_OBJECTS)]
    backdrop: BackdropSpec | None = None
    process: ProcessSpec
    noise: NoiseSpec
    metric: MetricSpec = MetricSpec()
