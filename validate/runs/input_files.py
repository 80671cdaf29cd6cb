"""The files that a run is made of, read with all their problems together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import scenes
from scenes import Scene, SceneError, SweepFile, load_sweep
from scenes.steps.measurement import measurement_of

__all__ = ["load_measurement_of", "load_sweeps"]


def load_sweeps(
    names: Sequence[str], given: Path | Scene | None, overrides: Sequence[str], allow_outside: bool
) -> list[tuple[SweepFile, Scene]]:
    """Sweeps with their scenes, or all with one: `given`, or the one of the file at that path.

    Raises:
        SceneError: with every problem of all files, a line each.
    """
    loaded, problems = [], []
    for name in names:
        try:
            sweep = load_sweep(name, overrides, allow_outside=allow_outside)
            scene = (
                given
                if isinstance(given, Scene)
                else scenes.load(given or sweep.scene_path, overrides, allow_outside=allow_outside)
            )
            sweep.configurations(scene)  # raises what is wrong with them
            loaded.append((sweep, scene))
        except SceneError as error:
            problems += [problem for problem in error.problems if problem not in problems]
    if problems:
        raise SceneError(problems)
    return loaded


def load_measurement_of(
    path: Path, cameras: Sequence[str], overrides: Sequence[str], allow_outside: bool
) -> tuple[SweepFile, Scene]:
    """A scene that is measured as it is, as a sweep of one step.

    Raises:
        SceneError: with every problem of the file, the overrides or the cameras.
    """
    scene = scenes.load(path, overrides, allow_outside=allow_outside)
    sweep = measurement_of(scene, cameras, overrides)
    sweep.configurations(scene)  # raises what is wrong with the cameras
    return sweep, scene
