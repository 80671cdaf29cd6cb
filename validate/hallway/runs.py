"""The runs of a schedule: each strategy under each zoom limit steers the cameras once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pss.ptz_limits import PTZLimits
from scenes.schedule_file import MotorsSpec, ScheduleFile, TrackingSpec
from validate.hallway.stage import Stage
from validate.hallway.state import Plan
from validate.hallway.steering import Steered, steer
from validate.hallway.strategies import STRATEGIES, Strategy, strategy_named
from validate.hallway.surrogates import avatar_like
from validate.hallway.tracker import Tracking
from validate.hallway.walk import Passing

__all__ = ["Run", "limit_name", "motor_limits", "plan_of", "steered_runs", "strategies_of", "tracking_of"]


@dataclass(frozen=True, eq=False)
class Run:
    """One strategy under one zoom limit (None: none), and the settings that the cameras reached."""

    strategy: str
    zoom_limit: float | None
    steered: Steered

    @property
    def label(self) -> str:
        """Such as "follow x8"."""
        return f"{self.strategy} {limit_name(self.zoom_limit)}"


def limit_name(zoom_limit: float | None) -> str:
    """A zoom limit as tables have it."""
    return "none" if zoom_limit is None else f"x{zoom_limit:g}"


def motor_limits(motors: MotorsSpec, zoom_limit: float | None) -> PTZLimits:
    """The motors' limits, with one of the schedule's for the zoom."""
    return PTZLimits(zoom_range=(1.0, zoom_limit), **motors.model_dump())


def tracking_of(said: TrackingSpec, seed: int) -> Tracking:
    """The tracking that a file describes."""
    return Tracking(
        frame_s=1 / said.frame_rate_hz,
        sigma_m=said.sigma_m,
        latency_s=said.latency_s,
        acceleration_density_m2_s3=said.acceleration_density_m2_s3,
        lost_after_frames=said.lost_after_frames,
        seed=seed,
    )


def plan_of(schedule: ScheduleFile, stage: Stage, zoom_limit: float | None, walk: Passing | None = None) -> Plan:
    """What a run's strategy gets to know, by the surrogates that the schedule asks for.

    Args:
        walk: where decisions are a step of it apart; None for the stage's own.
    """
    start = stage.at(stage.walk.times_s[0])
    avatars = {
        w.name: avatar_like(schedule.said.surrogate, start.state, w.name, w.position_m(stage.walk.times_s[0]))
        for w in stage.walk.walks
    }
    return Plan(
        avatars,
        limits=motor_limits(schedule.said.motors, zoom_limit),
        step_s=(stage.walk if walk is None else walk).step_s,
        radius_m=schedule.said.target.radius_m,
        process=stage.scene.process,
        seed=schedule.said.seed,
    )


def strategies_of(schedule: ScheduleFile, own: Mapping[str, Strategy]) -> dict[str, Strategy]:
    """The schedule's strategies by name: those of `STRATEGIES`, and the user's `own`, which it need not name.

    Raises:
        RangeError: a name that is neither.
    """
    named = {name: own.get(name) or strategy_named(name) for name in schedule.said.strategies}
    return {**named, **{name: strategy for name, strategy in own.items() if name not in STRATEGIES}}


def steered_runs(
    schedule: ScheduleFile,
    stage: Stage,
    own: Mapping[str, Strategy],
    limits: Sequence[float | None] | None = None,
) -> list[Run]:
    """Every strategy under every zoom limit, the limits changing fastest; the same numbers for the same file.

    Args:
        own: strategies of the user's, by name.
        limits: None for the schedule's.

    Raises:
        RangeError: a strategy that does not exist, or what `steer` refuses.
    """
    found = []
    for name, strategy in strategies_of(schedule, own).items():
        for limit in schedule.zoom_limits if limits is None else limits:
            plan = plan_of(schedule, stage, limit)
            tracking = tracking_of(schedule.said.tracking, schedule.said.seed)
            found.append(Run(name, limit, steer(stage.walk, stage.scene.cameras, strategy, plan, tracking)))
    return found
