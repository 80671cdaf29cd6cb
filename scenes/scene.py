"""A scene as the project's objects: cameras, sensor, scene state, process and noise models."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pss import (
    Appearance,
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
from pss.visibility.points import VisibilityTest
from render.light.exposure import AutoExposure
from render.world.state import Light, Marker, MarkerPrint, Motion, Panel, Room, SceneObject, SceneState
from scenes.errors import Problems, SceneError, nearest
from scenes.markers.layout import markers_on, placed_marker, plate_side_m
from scenes.markers.suit import avatar_markers
from scenes.mesh_file import read_files
from scenes.people.avatar import walking
from scenes.reading.document import SWEEP_PREFIX, apply_overrides, named_file, read_toml, set_value
from scenes.reading.inside import SHIPPED
from scenes.reading.sensor_file import start_from_named_sensor
from scenes.reading.spec import validate
from scenes.rules.checks import check_scene, shape_of
from scenes.rules.marker_checks import check_markers
from scenes.rules.predictions import check_predictions, named_model, named_visibility
from scenes.schema.avatar import AvatarSpec, stance_of
from scenes.schema.dictionaries import DICTIONARIES
from scenes.schema.meshes import MeshSpec
from scenes.schema.motion import motion_of
from scenes.schema.scene_tables import (
    CameraSpec,
    ConstantAccelerationSpec,
    ConstantVelocitySpec,
    LightSpec,
    RandomWalkSpec,
    SceneSpec,
)

__all__ = ["Scene", "load"]


@dataclass(frozen=True)
class Scene:
    """A scene: everything that a scene file describes.

    Attributes:
        path: of the file.
        state: room, light, objects and markers.
        cameras: with their settings, in the file's order.
        sensor: the image sensor of all cameras; with `auto_exposure`, at the longest allowed exposure.
        process: motion model of the points of interest.
        noise_models: the models of R_k whose predictions a run compares, with the sensor's dark noise.
        visibility: the tests that a marker must pass to count as visible in a prediction.
        warnings: accepted values that may not have the intended effect, a line each.
        auto_exposure: target of the automatic exposure (`with_exposure`); None if the file has a number.
    """

    path: Path
    state: SceneState
    cameras: tuple[PTZCamera, ...]
    sensor: ImageSensor
    process: ProcessModel
    noise_models: tuple[NoiseModel, ...]
    visibility: tuple[VisibilityTest, ...]
    _spec: SceneSpec = field(repr=False)
    warnings: tuple[str, ...] = ()
    auto_exposure: AutoExposure | None = None
    _allow_outside: bool = field(default=False, repr=False)

    def camera(self, name: str) -> PTZCamera:
        """The camera with this name.

        Raises:
            SceneError: there is none; the message lists the existing ones.
        """
        names = [camera.name for camera in self.cameras]
        if name not in names:
            hint, _ = nearest(name, names)
            raise SceneError([f'{self.path}: there is no camera "{name}"{hint}; allowed: {", ".join(names)}'])
        return self.cameras[names.index(name)]

    def select(self, *names: str) -> tuple[PTZCamera, ...]:
        """The cameras of these names, in this order.

        Raises:
            SceneError: no name, a name twice, or an unknown one; the message lists the existing cameras.
        """
        cameras = tuple(self.camera(name) for name in names)
        repeated = next((name for name in names if names.count(name) > 1), None)
        if not names or repeated is not None:
            given = "no camera is selected" if repeated is None else f'camera "{repeated}" is selected twice'
            allowed = ", ".join(camera.name for camera in self.cameras)
            raise SceneError([f"{self.path}: {given}; allowed: one or more of {allowed}, each once"])
        return cameras

    def noise_model(self, name: str) -> NoiseModel:
        """R_k by name, also beyond `noise.models`: with the scene's sensor, switches, weights and scale."""
        return named_model(name, self._spec.noise, self.path.parent, self.sensor)

    @property
    def widest_f_number(self) -> float:
        """The smallest f-number of the lens."""
        return self._spec.lens.widest_f_number

    def appearance(self) -> Appearance:
        """The markers' appearance for `pss.evaluate(…, appearance=…)`, as needed by "physical" and calibrated models.

        The lamps' direct light is exact, including shadows; light reflected by surfaces is estimated, as in `check`, so
        that no light has to be solved. A run predicts with its solved light.
        """
        # Imports the code that draws markers, which scenes do not need otherwise.
        from render.light.estimated_light import estimated_appearance

        return estimated_appearance(self.state)

    def with_exposure(self, exposure_ms: float) -> Scene:
        """The same scene with this exposure, in ms, as a number in its file."""
        chosen = {"exposure_ms": exposure_ms, "auto_exposure_share": None, "longest_exposure_ms": None}
        spec = self._spec.model_copy(update={"sensor": self._spec.sensor.model_copy(update=chosen)})
        sensor = _sensor(spec)
        return dataclasses.replace(
            self,
            sensor=sensor,
            noise_models=_noise_models(spec, self.path.parent, sensor),
            visibility=named_visibility(spec.metric.visibility, self.path.parent, sensor),
            _spec=spec,
            auto_exposure=None,
        )

    def with_settings(self, settings: Mapping[str, object]) -> Scene:
        """The same scene with these values at these dotted keys of its file ("sensor.exposure_ms": 8.0).

        Raises:
            SceneError: with every problem, a line each.
        """
        problems = Problems(self.path, self.resolved())
        for key, value in settings.items():
            set_value(SceneSpec, key, value, problems)
        return _scene(self.path, problems, self._allow_outside)

    def resolved(self) -> dict[str, Any]:
        """The file's contents with overrides and defaults filled in: plain, JSON-serialisable, a valid scene itself."""
        return self._spec.model_dump(mode="json", by_alias=True, exclude_none=True)


def load(name_or_path: str | Path, overrides: Iterable[str] = (), *, allow_outside: bool = False) -> Scene:
    """The scene in a TOML file, after `overrides` such as "cameras.2.zoom=4".

    Items of a list are addressed by name, or by number from "#1" without one. Overrides that begin with "sweep." belong
    to the sweep file and are ignored here, so that the same list can be passed to both.

    Args:
        name_or_path: the path of a file that ends in .toml, or the name of a scene that comes with the project, such as
            "room".
        overrides: "key=value", with a dotted key and the value in TOML; text needs no quotes.
        allow_outside: whether the file, and a backdrop in it, may reference files outside its folder, symbolic links
            resolved; if not, each is a problem.

    Raises:
        SceneError: with every problem of the file and the overrides, a line each.
    """
    path = named_file(name_or_path, SHIPPED, "scene")
    problems = Problems(path, read_toml(path))
    apply_overrides(SceneSpec, (o for o in overrides if not o.strip().startswith(SWEEP_PREFIX)), problems)
    return _scene(path, problems, allow_outside)


def _scene(path: Path, problems: Problems, allow_outside: bool) -> Scene:
    """The scene of a document, after raising all of its problems."""
    start_from_named_sensor(problems)
    spec, draft = validate(SceneSpec, problems.document, problems)
    read_files(draft, path.parent, problems, allow_outside=allow_outside)
    check_scene(draft, problems)
    check_markers(draft, problems)
    check_predictions(draft, path.parent, problems, allow_outside=allow_outside)
    problems.raise_if_any()
    assert spec is not None  # no problem, so pydantic had none
    sensor = _sensor(spec)
    return Scene(
        path=path,
        # Without problems the draft is the same, with the contents of its files.
        state=_state(draft),
        cameras=tuple(_camera(camera, spec) for camera in spec.cameras),
        sensor=sensor,
        process=_process(spec),
        noise_models=_noise_models(spec, path.parent, sensor),
        visibility=named_visibility(spec.metric.visibility, path.parent, sensor),
        _spec=spec,
        warnings=tuple(problems.warnings),
        auto_exposure=_auto_exposure(spec),
        _allow_outside=allow_outside,
    )


def _state(spec: SceneSpec) -> SceneState:
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


def _sensor(spec: SceneSpec) -> ImageSensor:
    # Resolution and pitch of the pixels are geometry, and belong to the cameras.
    values = spec.sensor.model_dump(include={item.name for item in dataclasses.fields(ImageSensor)})
    auto = _auto_exposure(spec)
    return ImageSensor(**(values if auto is None else values | {"exposure_ms": auto.longest_ms}))


def _auto_exposure(spec: SceneSpec) -> AutoExposure | None:
    if spec.sensor.exposure_ms != "auto":
        return None
    values = {"share": spec.sensor.auto_exposure_share, "longest_ms": spec.sensor.longest_exposure_ms}
    return AutoExposure(**{name: value for name, value in values.items() if value is not None})


def _noise_models(spec: SceneSpec, folder: Path, sensor: ImageSensor) -> tuple[NoiseModel, ...]:
    return tuple(named_model(name, spec.noise, folder, sensor) for name in spec.noise.models)


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
        radial_distortion=scene.lens.radial_distortion,
        psf_sigma_um=scene.lens.psf_sigma_um,
        aperture_blades=scene.lens.aperture_blades,
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
