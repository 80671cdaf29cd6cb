"""The objects of a scene, from its validated tables: scene state, cameras, sensor, process and noise models."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from pss import (
    Box,
    ConstantAcceleration,
    ConstantVelocity,
    ImageSensor,
    NoiseModel,
    PTZCamera,
    RandomWalk,
    Rectangle,
    Sphere,
)
from pss.processes.process import ProcessModel
from pss.surrogates import Mesh
from render.light.exposure import AutoExposure
from render.world.state import Light, Marker, MarkerPrint, Motion, Panel, Room, SceneObject, SceneState
from scenes.markers.layout import markers_on, placed_marker, plate_side_m
from scenes.markers.suit import avatar_markers
from scenes.people.avatar import walking
from scenes.rules.checks import shape_of
from scenes.rules.predictions import named_model
from scenes.schema.avatar import AvatarSpec, stance_of
from scenes.schema.camera_tables import CameraSpec
from scenes.schema.dictionaries import DICTIONARIES
from scenes.schema.meshes import MeshSpec
from scenes.schema.motion import motion_of
from scenes.schema.prediction_tables import ConstantAccelerationSpec, ConstantVelocitySpec, RandomWalkSpec
from scenes.schema.room_tables import LightSpec
from scenes.schema.scene_tables import SceneSpec

__all__ = ["auto_exposure_of", "camera_of", "noise_models_of", "process_of", "sensor_of", "state_of"]


def state_of(spec: SceneSpec) -> SceneState:
    """Room, light, objects and markers; of the draft, which has the contents of its files."""
    shapes = [shape_of(item) for item in spec.objects]
    markers: list[Marker] = []
    side_modules = plate_side_m(1.0, DICTIONARIES[spec.markers.dictionary], spec.markers.quiet_zone_modules)
    for item, shape in zip(spec.objects, shapes, strict=True):
        layout = getattr(item, "markers", None)
        if isinstance(item, MeshSpec):
            markers += item._spread
        elif isinstance(item, AvatarSpec):
            markers += [marker for marker in avatar_markers(item, side_modules) if marker is not None]
        elif layout is not None:
            markers += markers_on(shape, layout)
    markers += [marker for placed in spec.markers.placed if (marker := placed_marker(placed)) is not None]
    return SceneState(
        room=Room(**spec.room.model_dump()),
        light=_light(spec.light),
        objects=(
            *(
                SceneObject(shape, item.albedo, _motion(item, shape))
                for item, shape in zip(spec.objects, shapes, strict=True)
            ),
            *(spec.backdrop._parts if spec.backdrop is not None else ()),
        ),
        markers=tuple(markers),
        print=MarkerPrint(**spec.markers.model_dump(exclude={"placed"})),
    )


def _motion(item: Any, shape: Rectangle | Sphere | Box | Mesh) -> Motion | None:
    if isinstance(item, AvatarSpec):
        stance = stance_of(item)
        assert stance is not None  # it has a shape
        return walking(stance, item.speed_m_per_s)
    return motion_of(item, shape, getattr(item, "position_m", None))


def _light(spec: LightSpec) -> Light:
    if spec.kind == "ring":
        return Light(0.0, (), spec.ring_w_per_sr or 0.0)
    panels = tuple(Panel(panel.centre_m, panel.size_m) for panel in spec.panels or ())
    return Light(spec.radiance_w_per_m2_sr or 0.0, panels)


def sensor_of(spec: SceneSpec) -> ImageSensor:
    """The sensor, with the longest allowed exposure if that is "auto"."""
    # Resolution and pitch of the pixels are geometry, and belong to the cameras.
    values = spec.sensor.model_dump(include={item.name for item in dataclasses.fields(ImageSensor)})
    auto = auto_exposure_of(spec)
    return ImageSensor(**(values if auto is None else values | {"exposure_ms": auto.longest_ms}))


def auto_exposure_of(spec: SceneSpec) -> AutoExposure | None:
    """What an exposure of "auto" is chosen for; None where it is a number."""
    if spec.sensor.exposure_ms != "auto":
        return None
    values = {"share": spec.sensor.auto_exposure_share, "longest_ms": spec.sensor.longest_exposure_ms}
    return AutoExposure(**{name: value for name, value in values.items() if value is not None})


def noise_models_of(spec: SceneSpec, folder: Path, sensor: ImageSensor) -> tuple[NoiseModel, ...]:
    """The R_k of `noise.models`; paths of calibrations are relative to `folder`."""
    return tuple(named_model(name, spec.noise, folder, sensor) for name in spec.noise.models)


def camera_of(spec: CameraSpec, scene: SceneSpec) -> PTZCamera:
    """A camera, with the lens and the pixels of the scene."""
    camera = PTZCamera(
        position_m=spec.position_m,
        pan_deg=spec.pan_deg or 0.0,
        tilt_deg=spec.tilt_deg or 0.0,
        zoom=spec.zoom,
        focus_distance_m=spec.focus_distance_m,
        f_number=scene.lens.f_number if spec.f_number is None else spec.f_number,
        resolution=scene.sensor.resolution_px,
        pixel_pitch_m=scene.sensor.pixel_pitch_um * 1e-6,
        max_zoom=scene.lens.max_zoom,
        widest_fov_deg=scene.lens.widest_fov_deg,
        radial_distortion=scene.lens.radial_distortion,
        psf_sigma_um=scene.lens.psf_sigma_um,
        aperture_blades=scene.lens.aperture_blades,
        name=spec.name,
    )
    return camera if spec.aim_m is None else camera.aimed_at(spec.aim_m)


def process_of(spec: SceneSpec) -> ProcessModel:
    """The model of how the points of interest move."""
    match spec.process:
        case RandomWalkSpec(step_std_mm=step_std_mm):
            return RandomWalk(step_std_m=step_std_mm * 1e-3)
        case ConstantVelocitySpec(acceleration_density_m2_s3=density, time_step_s=time_step_s):
            return ConstantVelocity(density, time_step_s=time_step_s)
        case ConstantAccelerationSpec(jerk_density_m2_s5=density, time_step_s=time_step_s):
            return ConstantAcceleration(density, time_step_s=time_step_s)
