"""Measurement of a scene as it is: a sweep of one step, built from the scene file alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenes.errors import Problems
from scenes.reading.document import SWEEP_PREFIX, apply_overrides
from scenes.reading.spec import validate
from scenes.steps.sweep_file import SweepFile, SweepSpec, check_sweep, sweep_of

if TYPE_CHECKING:
    from scenes.scene import Scene

__all__ = ["SEED", "TRIALS", "measurement_of"]

TRIALS, SEED = 20, 2011
"""The project's own defaults, so that views and measurements are shared with its sweeps."""


def measurement_of(scene: Scene, cameras: Sequence[str] = (), overrides: Iterable[str] = ()) -> SweepFile:
    """A sweep of one step, with the scene file's name.

    Args:
        scene: the loaded scene.
        cameras: names of the cameras to use; all if empty.
        overrides: those that begin with "sweep.", such as "sweep.trials=5", are applied.

    Raises:
        SceneError: a camera that the scene lacks, or an override that is not allowed.
    """
    chosen = list(cameras) or [camera.name for camera in scene.cameras]
    document: dict[str, Any] = {
        "scene": scene.path.name,
        "title": f"{scene.path.stem}, as it is",
        "trials": TRIALS,
        "seed": SEED,
        "vary": {"parameter": "selection", "values": [chosen]},
    }
    problems = Problems(scene.path, document)
    own = [each.strip().removeprefix(SWEEP_PREFIX) for each in overrides if each.strip().startswith(SWEEP_PREFIX)]
    apply_overrides(SweepSpec, own, problems)
    spec, draft = validate(SweepSpec, problems.document, problems)
    check_sweep(draft, problems)
    problems.raise_if_any()
    assert spec is not None  # no problem, so pydantic had none
    return sweep_of(spec, scene.path.stem, scene.path, Path(scene.path), problems.document)
