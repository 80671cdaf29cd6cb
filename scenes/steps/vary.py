"""[vary] of a sweep file: settings or selections of cameras, and the configurations of these and of scene steps."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from pss import PTZCamera, RangeError
from scenes.errors import Problems, allowed_in
from scenes.reading.limits import MOST_CAMERAS, MOST_STEPS
from scenes.reading.spec import Name, Number, Spec
from scenes.rules.optics import aperture_allows
from scenes.steps.scene_steps import SceneStepsSpec, scenes_of_steps

if TYPE_CHECKING:
    from scenes.scene import Scene

__all__ = [
    "Configuration",
    "LineSpec",
    "Names",
    "SelectionSpec",
    "SettingSpec",
    "chosen_names",
    "configurations_of",
    "short",
]

SETTINGS = ("zoom", "focus_distance_m", "pan_deg", "tilt_deg", "f_number")

# Steps of a line differ from the same numbers written as a list by rounding only; rounded to this many digits they are
# equal, as they must be, since a view is stored under the hash of its settings.
LINE_DIGITS = 12

Names = Annotated[
    tuple[Name, ...],
    Field(min_length=1, max_length=MOST_CAMERAS, description="a list of one or more names of cameras"),
]


class LineSpec(Spec):
    """Evenly spaced values from `start` to `stop`, both included."""

    start: Number
    stop: Number
    steps: Annotated[int, Field(strict=True, ge=2, le=MOST_STEPS)]


class SettingSpec(Spec):
    """[vary] with a setting of some cameras."""

    parameter: Literal[SETTINGS]
    cameras: Names
    values: Annotated[
        Annotated[tuple[Number, ...], Field(min_length=1, max_length=MOST_STEPS)] | LineSpec,
        Field(
            description="a list of one or more numbers, or { start, stop, steps } with 2 steps or more, "
            f"at most {MOST_STEPS}"
        ),
    ]


class SelectionSpec(Spec):
    """[vary] with the active cameras."""

    parameter: Literal["selection"]
    always: Annotated[
        tuple[Name, ...], Field(alias="with", max_length=MOST_CAMERAS, description="a list of names of cameras")
    ] = ()
    values: Annotated[
        tuple[Name | Annotated[tuple[Name, ...], Field(min_length=1, max_length=MOST_CAMERAS)], ...],
        Field(
            min_length=1,
            max_length=MOST_STEPS,
            description=f"a list of one or more names of cameras, or lists of names, at most {MOST_STEPS}",
        ),
    ]


@dataclass(frozen=True)
class Configuration:
    """One step of a sweep: `label` for tables, the varied `parameter` with its `value`, and the active cameras.

    `scene` is their scene, with sensor, process and noise models: the sweep's own, unless the scene is varied.
    """

    label: str
    parameter: str
    value: float | str
    cameras: tuple[PTZCamera, ...]
    scene: Scene = dataclasses.field(repr=False)


def configurations_of(
    vary: SettingSpec | SelectionSpec | SceneStepsSpec,
    active: tuple[str, ...] | None,
    scene: Scene,
    problems: Problems,
) -> list[Configuration]:
    """The steps of a sweep with the cameras of `scene`, in the scene's order; errors go to `problems`."""
    make = {SettingSpec: _settings, SelectionSpec: _selections, SceneStepsSpec: _scene_steps}[type(vary)]
    return make(vary, active, scene, problems)


def _settings(
    vary: SettingSpec, active: tuple[str, ...] | None, scene: Scene, problems: Problems
) -> list[Configuration]:
    found = []
    for value in _values(vary.values):
        cameras = []
        refused: dict[str, list[str]] = {}
        for camera in scene.cameras:
            if active is not None and camera.name not in active:
                continue
            try:
                varied = camera.name in vary.cameras
                cameras.append(dataclasses.replace(camera, **{vary.parameter: value}) if varied else camera)
                if varied and vary.parameter == "f_number" and value < scene.widest_f_number:
                    refused.setdefault(aperture_allows(scene.widest_f_number), []).append(camera.name)
            except RangeError as error:
                refused.setdefault(_allowed_text(error, vary.parameter), []).append(camera.name)
        for allowed, names in refused.items():
            which = f"camera {names[0]}" if len(names) == 1 else f"cameras {', '.join(names)}"
            problems.add(("vary", "values"), f"{allowed} ({vary.parameter} of {which})", value=value)
        found.append(Configuration(f"{vary.parameter}={short(value)}", vary.parameter, value, tuple(cameras), scene))
    return found


def _allowed_text(error: RangeError, parameter: str) -> str:
    """What is allowed, with the name of the rejected setting if it is not the varied one (zoom changes the focus)."""
    name = str(error).partition(" = ")[0]
    return allowed_in(error) if name == parameter else f"values with {name} {allowed_in(error)}"


def _selections(vary: SelectionSpec, _active: None, scene: Scene, _problems: Problems) -> list[Configuration]:
    found = []
    for value in vary.values:
        chosen = chosen_names(vary.always, value)
        cameras = tuple(camera for camera in scene.cameras if camera.name in chosen)
        label = "+".join(camera.name for camera in cameras)
        found.append(Configuration(label, vary.parameter, label, cameras, scene))
    return found


def _scene_steps(
    vary: SceneStepsSpec, active: tuple[str, ...] | None, scene: Scene, problems: Problems
) -> list[Configuration]:
    found = []
    for number, (value, changed) in enumerate(scenes_of_steps(vary, scene, problems)):
        names = active if vary.active is None else vary.active[number]
        cameras = tuple(camera for camera in changed.cameras if names is None or camera.name in names)
        found.append(Configuration(f"{vary.axis}={short(value)}", vary.axis, value, cameras, changed))
    return found


def chosen_names(always: tuple[str, ...], value: str | tuple[str, ...]) -> tuple[str, ...]:
    """The cameras of one value of a selection."""
    return (*always, value) if isinstance(value, str) else (*always, *value)


def _values(values: tuple[float, ...] | LineSpec) -> list[float]:
    if not isinstance(values, LineSpec):
        return [float(value) for value in values]
    step = (values.stop - values.start) / (values.steps - 1)
    line = [values.start + step * number for number in range(values.steps)]
    return [float(f"{value:.{LINE_DIGITS}g}") for value in line]


def short(value: float) -> str:
    """A value as in labels."""
    return f"{value:g}"
