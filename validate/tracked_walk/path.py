"""The one way from a schedule file to held steps that are predicted and measured: steer, plan, acquire, assess."""

from __future__ import annotations

from collections.abc import Mapping

from pss.noise import Calibration
from scenes.steps.schedule_file import ScheduleFile
from validate.acquire.request import Acquired
from validate.acquire.source import ViewSource
from validate.schedule.design import design_of
from validate.schedule.held import Held, assess_held, training_levels
from validate.schedule.runs import steered_runs
from validate.schedule.stage import Stage
from validate.schedule.strategies import Strategy
from validate.schedule.training import calibrate_hallway, training_views
from validate.tracked_walk.frames import real_walk_of
from validate.tracked_walk.requested_views import RequestedViews

__all__ = ["assessed", "planned"]


def planned(
    file: ScheduleFile, stage: Stage, own: Mapping[str, Strategy], source: ViewSource, *, real_walk: bool
) -> RequestedViews:
    """Steer the cameras by every strategy, and name the views that the schedule needs.

    Args:
        own: strategies of the user by name, beside the schedule's.
        real_walk: whether to track the walk frame by frame as well, if the schedule requests it.
    """
    source.messages.note("steering the cameras")
    runs = steered_runs(file, stage, own)
    return RequestedViews(
        training_views(file, stage, source.renderer),
        design_of(file, stage, runs, source.renderer),
        real_walk_of(file, stage, own, source.renderer) if real_walk else None,
    )


def assessed(requested: RequestedViews, acquired: Acquired) -> tuple[Calibration, Held]:
    """The calibration on the training views, and the held steps predicted with it and measured.

    Args:
        requested: what is left without the views that failed.
    """
    calibration = calibrate_hallway(requested.training, acquired)
    levels = training_levels(requested.design.stage, requested.training, acquired)
    return calibration, assess_held(requested.design, acquired, calibration, levels)
