"""What is to be rendered of a schedule: its steps and runs, and their views."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from scenes import Scene
from scenes.steps.schedule_file import ScheduleFile
from validate.acquire.acquire import Acquisition
from validate.schedule.runs import Run, step_views
from validate.schedule.stage import Stage

__all__ = ["Design", "design_of"]


@dataclass(frozen=True, eq=False)
class Design:
    """What is to be rendered: the scenes of the K steps, and for each of the R runs and steps the views."""

    schedule: ScheduleFile
    stage: Stage
    runs: tuple[Run, ...]
    scenes: tuple[Scene, ...]
    views: tuple[tuple[tuple[Acquisition, ...], ...], ...]

    @property
    def requested(self) -> list[Acquisition]:
        """All views, those of a step together."""
        return [item for step in zip(*self.views, strict=True) for views in step for item in views]

    def without(self, failed: Collection[str]) -> Design:
        """The runs that need none of these views, given by their hashes.

        Runs and not steps: means over the walk stay means over the whole walk, the same for all runs that are left.
        """
        needed = [{item.request.key for views in of_run for item in views} for of_run in self.views]
        kept = [number for number, keys in enumerate(needed) if keys.isdisjoint(failed)]
        return dataclasses.replace(
            self, runs=tuple(self.runs[r] for r in kept), views=tuple(self.views[r] for r in kept)
        )


def design_of(schedule: ScheduleFile, stage: Stage, runs: Sequence[Run], renderer: str) -> Design:
    """Name the views that the runs need."""
    scenes = tuple(stage.at(time_s) for time_s in stage.walk.times_s.tolist())
    views = tuple(
        tuple(
            step_views(schedule, scene, cameras, renderer)
            for scene, cameras in zip(scenes, run.steered.cameras, strict=True)
        )
        for run in runs
    )
    return Design(schedule, stage, tuple(runs), scenes, views)
