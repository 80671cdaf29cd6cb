"""A sweep file: a camera setting, a selection of cameras, or a part of the scene, and the values it takes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field

from scenes.errors import Location, Problems, nearest
from scenes.reading.document import check_once, named_file, read_spec
from scenes.reading.inside import scene_of
from scenes.reading.quantities import NoiseRatio, SceneFile, Seed, Title, Trials
from scenes.reading.spec import ONE_SEARCH, Spec, one_of
from scenes.steps.scene_steps import SceneStepsSpec, check_steps
from scenes.steps.vary import (
    Configuration,
    LineSpec,
    Names,
    SelectionSpec,
    SettingSpec,
    chosen_names,
    configurations_of,
    short,
)

if TYPE_CHECKING:
    from scenes.scene import Scene

__all__ = ["Configuration", "SweepFile", "SweepSpec", "check_sweep", "known_sweeps", "load_sweep", "sweep_of"]

SWEEPS = Path(__file__).parents[1] / "sweeps"
"""The folder of the sweeps known by name."""

PAPER_SCENE = Path(__file__).parents[1] / "room.toml"
"""The paper's scene of Figures 1 to 3."""
PAPER_SETTINGS = {"zoom": 1, "focus_distance_m": 2}
PAIRS_FIGURE = 3


class SweepSpec(Spec):
    """A whole sweep file; `scene` is a path relative to it."""

    removed: ClassVar[dict[str, str]] = {"search": ONE_SEARCH}

    scene: SceneFile
    title: Title
    trials: Trials
    seed: Seed
    render_noise_ratio: NoiseRatio = 0.6
    active: Names | None = Field(None, description="a list of one or more names of cameras")
    vary: one_of("parameter", SettingSpec, SelectionSpec, SceneStepsSpec)


@dataclass(frozen=True)
class SweepFile:
    """The contents of a sweep file.

    Attributes:
        name: the file's name without its suffix.
        path: of the file.
        title: for figures.
        scene_path: of the scene file.
        trials: noisy captures of each view.
        render_noise_ratio: bound on a view's sampling noise at the edges of markers, in units of the sensor's noise.
        seed: of the run.
    """

    name: str
    path: Path
    title: str
    scene_path: Path
    trials: int
    render_noise_ratio: float
    seed: int
    _spec: SweepSpec = dataclasses.field(repr=False)
    _document: dict[str, Any] = dataclasses.field(repr=False, compare=False)

    def configurations(self, scene: Scene) -> list[Configuration]:
        """The steps of the sweep with the cameras of `scene`, in the scene's order.

        Raises:
            SceneError: a name that the scene lacks, or a value out of a camera's range; all of them at once.
        """
        problems = Problems(self.path, self._document)
        _check_names_known(self._spec, scene, problems)
        configurations = configurations_of(self._spec.vary, self._spec.active, scene, problems)
        problems.raise_if_any()
        return configurations

    @property
    def varies_scene(self) -> bool:
        """Whether its steps change more than settings and selection of the cameras."""
        return isinstance(self._spec.vary, SceneStepsSpec)

    def paper_figure(self, scene: Scene) -> int | None:
        """The figure of the paper, 1 to 3, that this sweep reproduces: the paper's scene and varied setting.

        None for any other: the paper has no claims on other settings or rooms.
        """
        if scene.path.resolve() != PAPER_SCENE.resolve():
            return None
        match self._spec.vary:
            case SettingSpec(parameter=parameter):
                return PAPER_SETTINGS.get(parameter)
            case SelectionSpec(always=always, values=values):
                pairs = all(len({*chosen_names(always, value)}) == 2 for value in values)
                return PAIRS_FIGURE if pairs else None
        return None

    def resolved(self) -> dict[str, Any]:
        """The file's contents with overrides and defaults applied: plain, JSON-serialisable, a valid sweep itself."""
        return self._spec.model_dump(mode="json", by_alias=True, exclude_none=True)


def load_sweep(path_or_name: str | Path, overrides: Iterable[str] = (), *, allow_outside: bool = False) -> SweepFile:
    """The sweep in the TOML file at a path, or one of the project's by name ("zoom").

    Args:
        overrides: those that begin with "sweep.", such as "sweep.trials=5", are applied.
        allow_outside: whether its scene may be anywhere; if not, see `scenes.reading.inside.scene_of`.

    Raises:
        SceneError: with every problem of the file and the overrides, a line each.
    """
    path = named_file(path_or_name, SWEEPS, "sweep")
    spec, draft, problems = read_spec(SweepSpec, path, overrides)
    check_sweep(draft, problems)
    scene_path = scene_of(path, draft.scene, allow_outside, problems)
    problems.raise_if_any()
    assert spec is not None  # no problem, so pydantic had none
    return sweep_of(spec, path.stem, path, scene_path, problems.document)


def sweep_of(spec: SweepSpec, name: str, path: Path, scene_path: Path, document: dict[str, Any]) -> SweepFile:
    """The sweep of a validated file; `document` is the source of values in messages."""
    return SweepFile(
        name=name,
        path=path,
        title=spec.title,
        scene_path=scene_path,
        trials=spec.trials,
        render_noise_ratio=spec.render_noise_ratio,
        seed=spec.seed,
        _spec=spec,
        _document=document,
    )


def known_sweeps() -> list[str]:
    """Names of the sweeps that come with the project."""
    return sorted(file.stem for file in SWEEPS.glob("*.toml"))


# ---- rules that need several keys at once --------------------------------------------------------------------------


def check_sweep(draft: SweepSpec, problems: Problems) -> None:
    """The checks that do not need the scene."""
    check_once(("active",), draft.active, problems)
    match draft.vary:
        case SettingSpec(cameras=cameras, values=values):
            check_once(("vary", "cameras"), cameras, problems)
            if isinstance(values, LineSpec) and values.start == values.stop:
                problems.add(("vary", "values"), "start and stop that differ")
            elif isinstance(values, tuple):
                check_once(("vary", "values"), [short(value) for value in values], problems)
            for name in cameras or () if draft.active is not None else ():
                if name not in draft.active:
                    problems.add(("vary", "cameras"), f"active cameras: {', '.join(draft.active)}", value=name)
        case SelectionSpec(always=always, values=values):
            check_once(("vary", "with"), always, problems)
            chosen = [chosen_names(always or (), value) for value in values or ()]
            for names in chosen:
                check_once(("vary", "values"), names, problems)
            check_once(("vary", "values"), ["+".join(sorted(names)) for names in chosen], problems)
            if problems.given(("active",)):
                problems.add(("active",), "no active beside parameter = selection, whose values name the cameras")
        case SceneStepsSpec() as steps:
            check_steps(steps, problems)
            check_once(("vary", "values"), [short(value) for value in steps.values or ()], problems)


def _check_names_known(spec: SweepSpec, scene: Scene, problems: Problems) -> None:
    existing = [camera.name for camera in scene.cameras]
    locations: list[tuple[Location, Iterable[str]]] = [(("active",), spec.active or ())]
    match spec.vary:
        case SettingSpec(cameras=cameras):
            locations.append((("vary", "cameras"), cameras))
        case SelectionSpec(always=always, values=values):
            locations += [(("vary", "with"), always)] + [
                (("vary", "values"), chosen_names((), value)) for value in values
            ]
        case SceneStepsSpec(active=active):
            locations += [(("vary", "active"), names) for names in active or ()]
    for location, names in locations:
        for name in names:
            if name not in existing:
                hint, _ = nearest(name, existing)
                problems.add(location, f"{', '.join(existing)} (the cameras of {scene.path}){hint}", value=name)
