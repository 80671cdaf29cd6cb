"""A scene as the project's objects: cameras, sensor, scene state, process and noise models."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pss import Appearance, ImageSensor, NoiseModel, PTZCamera, RangeError
from pss.files import check_values, is_inside
from pss.inputs import number
from pss.processes.process import ProcessModel
from pss.toml_text import toml_text
from pss.visibility.points import VisibilityTest
from render.light.exposure import AutoExposure
from render.store.atomic import write_text
from render.world.state import SceneState
from scenes.errors import Location, Problems, SceneError, nearest, shown
from scenes.from_tables import auto_exposure_of, camera_of, noise_models_of, process_of, sensor_of, state_of
from scenes.mesh_file import read_files
from scenes.reading.document import SWEEP_PREFIX, apply_overrides, check_overrides, named_file, read_toml, set_value
from scenes.reading.inside import OUTSIDE, SHIPPED
from scenes.reading.python_tables import document_of
from scenes.reading.sensor_file import start_from_named_sensor
from scenes.reading.spec import validate
from scenes.rules.checks import check_scene
from scenes.rules.marker_checks import check_markers
from scenes.rules.predictions import CALIBRATION_FILE, check_predictions, named_model, named_visibility
from scenes.schema.scene_tables import SceneSpec

__all__ = ["Scene", "load"]


@dataclass(frozen=True, init=False)
class Scene:
    """A scene: everything that a scene file describes.

    Made of the tables of a scene file, by `load` from a file or here from Python:

        Scene(room={"width_m": 10, …}, light={…}, sensor={"name": "machine-vision-global-shutter", …}, lens={…},
              cameras=[{"name": "left", …}, …], markers={…}, objects=[{…}], process={…}, noise={…})

    The keys are those of docs/scenes.md, and the values go through the same checks as those of a file.

    Attributes:
        path: of the file, or where one would be: files that the scene names are relative to its folder.
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
    _replaced: tuple[str, ...] = field(default=(), repr=False)

    def __init__(self, path: str | Path = "scene.toml", *, allow_outside: bool = False, **tables: object) -> None:
        """Check the tables and build the scene.

        Args:
            path: where the scene's file would be; messages begin with it.
            allow_outside: whether files outside its folder may be used; if not, each is a problem.
            tables: room, light, sensor, lens, cameras, markers, objects, process, noise, and if needed backdrop and
                metric: mappings, or lists of mappings. Tuples and numpy arrays are accepted as lists.

        Raises:
            SceneError: with every problem, a line each.
        """
        document = document_of(tables)
        try:
            check_values(document)
        except RangeError as error:
            raise SceneError([f"{path}: {error}"]) from None
        self._set(_read(Path(path), Problems(path, document), allow_outside))

    def _set(self, parts: Mapping[str, object]) -> None:
        vars(self).update({item.name: item.default for item in dataclasses.fields(self)} | dict(parts))

    def replace(self, **parts: Any) -> Scene:
        """The same scene with other objects, such as `cameras=` or `noise_models=`: attributes by name.

        Unlike `with_settings`, it accepts objects without checks; the resulting scene cannot be saved.
        """
        allowed = [item.name for item in dataclasses.fields(self)]
        for name in parts:
            if name not in allowed:
                public = [known for known in allowed if not known.startswith("_")]
                raise SceneError([f"a scene has no {name}; allowed: {', '.join(public)}"])
        replaced = (*self._replaced, *(name for name in parts if not name.startswith("_")))
        return _made(vars(self) | parts | {"_replaced": replaced})

    def camera(self, name: str) -> PTZCamera:
        """The camera with this name.

        Raises:
            SceneError: there is none; the message lists the existing ones.
        """
        names = [camera.name for camera in self.cameras]
        if name not in names:
            hint, _ = nearest(str(name), names)
            raise SceneError([f"{self.path}: there is no camera {shown(name)}{hint}; allowed: {', '.join(names)}"])
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

    def noise_model(self, name: str, *, ccd_noise: float | None = None, px2_per_m2: float | None = None) -> NoiseModel:
        """R_k by name, whether `noise.models` has it or not: with the scene's sensor, switches, weights and scale.

        Args:
            ccd_noise, px2_per_m2: constants in place of the sensor's and the file's.

        Raises:
            RangeError: there is no such model, or the file's switches remove all of its factors.
        """
        noise = self._spec.noise
        if px2_per_m2 is not None:
            noise = noise.model_copy(update={"px2_per_m2": px2_per_m2})
        return named_model(name, noise, self.path.parent, self.sensor, ccd_noise)

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
        """The same scene with this exposure, in ms, as a number in its file.

        Raises:
            RangeError: it is not above 0.
        """
        if not 0 < number(exposure_ms, "exposure_ms") < math.inf:
            raise RangeError(f"exposure_ms = {exposure_ms!r}; allowed: above 0, finite")
        chosen = {"exposure_ms": exposure_ms, "auto_exposure_share": None, "longest_exposure_ms": None}
        spec = self._spec.model_copy(update={"sensor": self._spec.sensor.model_copy(update=chosen)})
        sensor = sensor_of(spec)
        own = {
            "sensor": sensor,
            "noise_models": noise_models_of(spec, self.path.parent, sensor),
            "visibility": named_visibility(spec.metric.visibility, self.path.parent, sensor),
        }
        kept = {name: value for name, value in own.items() if name not in self._replaced}
        return _made(vars(self) | kept | {"_spec": spec, "auto_exposure": None})

    def with_settings(self, settings: Mapping[str, object]) -> Scene:
        """The same scene with these values at these dotted keys of its file ("sensor.exposure_ms": 8.0).

        Raises:
            SceneError: with every problem, a line each; or objects of the scene were replaced.
        """
        self._check_described()
        problems = Problems(self.path, self.resolved())
        for key, value in settings.items():
            set_value(SceneSpec, str(key), value, problems)
        return _made(_read(self.path, problems, self._allow_outside))

    def resolved(self) -> dict[str, Any]:
        """The file's contents with overrides and defaults filled in: plain, JSON-serialisable, a valid scene itself."""
        return self._spec.model_dump(mode="json", by_alias=True, exclude_none=True)

    def to_toml(self) -> str:
        """The text of a scene file of the same scene, with overrides and defaults applied.

        Raises:
            SceneError: objects of the scene were replaced, which no file can express.
        """
        self._check_described()
        return toml_text(self.resolved())

    def save(self, path: str | Path) -> Path:
        """Write the scene as a TOML file, whole or not at all; loaded again, it has the same state and cameras.

        Meshes, a backdrop and calibrations that it names stay where they are: their paths are written anew, from the
        new file's folder.

        Returns:
            The path.

        Raises:
            SceneError: objects of the scene were replaced, or a file that it names is outside the new file's folder
                (unless the scene was loaded with `allow_outside`).
            StoreError: the file cannot be written.
        """
        self._check_described()
        target = Path(path)
        document, problems = self.resolved(), Problems(target, self.resolved())
        for place, table, key in _named_files(document):
            file = os.path.relpath(self.path.parent / table[key], target.parent)
            if not self._allow_outside and not is_inside(target.parent / file, [target.parent]):
                problems.add(place, f"a file in the folder of {target}, or below; this is outside {OUTSIDE}")
            table[key] = Path(file).as_posix()
        problems.raise_if_any()
        write_text(target, toml_text(document))
        return target

    def _check_described(self) -> None:
        if self._replaced:
            changed = ", ".join(dict.fromkeys(self._replaced))
            raise SceneError([f"{self.path}: its {changed} were replaced by objects; allowed: a scene made of tables"])


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
    check_overrides(overrides)
    path = named_file(name_or_path, SHIPPED, "scene")
    problems = Problems(path, read_toml(path))
    apply_overrides(SceneSpec, (o for o in overrides if not o.strip().startswith(SWEEP_PREFIX)), problems)
    return _made(_read(path, problems, allow_outside))


def _made(parts: Mapping[str, object]) -> Scene:
    """A scene of checked parts, by attribute."""
    scene = object.__new__(Scene)
    scene._set(parts)
    return scene


def _named_files(document: dict[str, Any]) -> Iterator[tuple[Location, Any, Any]]:
    """Where a scene's document names files: location, and the table or list with its key."""
    for index, item in enumerate(document["objects"]):
        if "file" in item:
            yield ("objects", index, "file"), item, "file"
    if "backdrop" in document:
        yield ("backdrop", "file"), document["backdrop"], "file"
    for index, name in enumerate(document["noise"]["models"]):
        if name.endswith(CALIBRATION_FILE):
            yield ("noise", "models"), document["noise"]["models"], index
    if document["metric"]["visibility"].endswith(CALIBRATION_FILE):
        yield ("metric", "visibility"), document["metric"], "visibility"


def _read(path: Path, problems: Problems, allow_outside: bool) -> dict[str, object]:
    """The parts of the scene of a document, by attribute, after raising all of its problems."""
    start_from_named_sensor(problems)
    spec, draft = validate(SceneSpec, problems.document, problems)
    read_files(draft, path.parent, problems, allow_outside=allow_outside)
    check_scene(draft, problems)
    check_markers(draft, problems)
    check_predictions(draft, path.parent, problems, allow_outside=allow_outside)
    problems.raise_if_any()
    assert spec is not None  # no problem, so pydantic had none
    sensor = sensor_of(spec)
    return {
        "path": path,
        # Without problems the draft is the same, with the contents of its files.
        "state": state_of(draft),
        "cameras": tuple(camera_of(camera, spec) for camera in spec.cameras),
        "sensor": sensor,
        "process": process_of(spec),
        "noise_models": noise_models_of(spec, path.parent, sensor),
        "visibility": named_visibility(spec.metric.visibility, path.parent, sensor),
        "_spec": spec,
        "warnings": tuple(problems.warnings),
        "auto_exposure": auto_exposure_of(spec),
        "_allow_outside": allow_outside,
    }
