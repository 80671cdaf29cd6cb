"""A scene file as the project's own objects: cameras, sensor, scene state, process and noise models."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pss import ConstantAcceleration, ConstantVelocity, NoiseModel, PTZCamera, RandomWalk, noise_model
from pss.process import ProcessModel
from render.sensor import Sensor
from render.state import Light, Marker, MarkerPrint, Panel, Room, SceneObject, SceneState
from scenes.checks import check_scene, shape_of
from scenes.document import SWEEP_PREFIX, apply_overrides, read_toml
from scenes.errors import Problems, SceneError, nearest
from scenes.layout import markers_on, placed_marker
from scenes.marker_checks import check_markers
from scenes.schema import (
    CameraSpec,
    ConstantAccelerationSpec,
    ConstantVelocitySpec,
    RandomWalkSpec,
    SceneSpec,
)
from scenes.spec import validate

__all__ = ["Scene", "load_scene"]


@dataclass(frozen=True)
class Scene:
    """What a scene file describes.

    Attributes:
        path: of the file.
        state: room, light, objects and markers.
        cameras: with their settings, in the file's order.
        sensor: the one that all cameras have.
        process: how the points of interest move.
        noise_models: the R_k whose predictions a run compares, with the sensor's own dark noise.
    """

    path: Path
    state: SceneState
    cameras: tuple[PTZCamera, ...]
    sensor: Sensor
    process: ProcessModel
    noise_models: tuple[NoiseModel, ...]
    _spec: SceneSpec = field(repr=False)

    def camera(self, name: str) -> PTZCamera:
        """The camera called `name`.

        Raises:
            SceneError: there is none; the message lists those there are.
        """
        names = [camera.name for camera in self.cameras]
        if name not in names:
            hint, _ = nearest(name, names)
            raise SceneError([f'{self.path}: there is no camera "{name}"{hint}; allowed: {", ".join(names)}'])
        return self.cameras[names.index(name)]

    def resolved(self) -> dict[str, Any]:
        """The file's contents with overrides and defaults filled in: plain, JSON-serialisable, a valid scene itself."""
        return self._spec.model_dump(mode="json", by_alias=True, exclude_none=True)


def load_scene(path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """The scene in the TOML file at `path`, after `overrides` such as "cameras.2.zoom=4".

    Items of a list are addressed by name, or by number from "#1" if they have none. Overrides that begin with "sweep."
    belong to the sweep file and are passed over, so that one list of them can be given to both.

    Raises:
        SceneError: with every problem of the file and the overrides, a line each.
    """
    path = Path(path)
    problems = Problems(path, read_toml(path))
    apply_overrides(SceneSpec, (o for o in overrides if not o.strip().startswith(SWEEP_PREFIX)), problems)
    spec, draft = validate(SceneSpec, problems.document, problems)
    check_scene(draft, problems)
    check_markers(draft, problems)
    problems.raise_if_any()
    assert spec is not None  # no problem, so pydantic had none
    sensor = _sensor(spec)
    return Scene(
        path=path,
        state=_state(spec),
        cameras=tuple(_camera(camera, spec) for camera in spec.cameras),
        sensor=sensor,
        process=_process(spec),
        noise_models=tuple(
            noise_model(
                name,
                switched_off=spec.noise.switched_off,
                ccd_noise=sensor.ccd_noise,
                px2_per_m2=spec.noise.px2_per_m2,
            )
            for name in spec.noise.models
        ),
        _spec=spec,
    )


def _state(spec: SceneSpec) -> SceneState:
    shapes = [shape_of(item) for item in spec.objects]
    markers: list[Marker] = []
    for item, shape in zip(spec.objects, shapes, strict=True):
        layout = getattr(item, "markers", None)
        markers += [] if layout is None else markers_on(shape, layout)
    markers += [marker for placed in spec.markers.placed if (marker := placed_marker(placed)) is not None]
    return SceneState(
        room=Room(**spec.room.model_dump()),
        light=Light(
            spec.light.radiance_w_per_m2_sr, tuple(Panel(panel.centre_m, panel.size_m) for panel in spec.light.panels)
        ),
        objects=tuple(SceneObject(shape, item.albedo) for item, shape in zip(spec.objects, shapes, strict=True)),
        markers=tuple(markers),
        print=MarkerPrint(**spec.markers.model_dump(exclude={"placed"})),
    )


def _sensor(spec: SceneSpec) -> Sensor:
    # Resolution and pitch of the pixels are geometry: the cameras carry them.
    return Sensor(**spec.sensor.model_dump(exclude={"resolution_px", "pixel_pitch_um"}))


def _camera(spec: CameraSpec, scene: SceneSpec) -> PTZCamera:
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
        name=spec.name,
    )
    return camera if spec.aim_m is None else camera.aimed_at(spec.aim_m)


def _process(spec: SceneSpec) -> ProcessModel:
    match spec.process:
        case RandomWalkSpec(step_std_mm=step_std_mm):
            return RandomWalk(step_std_m=step_std_mm * 1e-3)
        case ConstantVelocitySpec(acceleration_density_m2_s3=density, time_step_s=time_step_s):
            return ConstantVelocity(density, time_step_s=time_step_s)
        case ConstantAccelerationSpec(jerk_density_m2_s5=density, time_step_s=time_step_s):
            return ConstantAcceleration(density, time_step_s=time_step_s)
