"""The runs of a schedule: each strategy under each zoom limit steers the cameras once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pss import PTZCamera
from pss.cameras.motor_limits import PTZLimits
from render.lens.sampling import Sampling
from scenes import Scene
from scenes.steps.schedule_file import MotorsSpec, ScheduleFile, TrackingSpec
from validate.acquire.acquire import Acquisition, views_of
from validate.schedule.stage import Stage
from validate.schedule.state import Plan
from validate.schedule.steering import Steered, steer
from validate.schedule.strategies import Strategy, strategy_named
from validate.schedule.surrogates import avatar_like
from validate.schedule.tracker import Tracking

__all__ = ["Run", "limit_name", "motor_limits", "plan_of", "steered_runs", "step_views", "strategies_of", "tracking_of"]


# The R of the PSS that strategies steer by. It needs no appearance: nothing is known of how the people look.
STEERED_BY = "corrected"


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


def tracking_of(settings: TrackingSpec, seed: int) -> Tracking:
    """The tracking that a file describes."""
    return Tracking(
        frame_s=1 / settings.frame_rate_hz,
        sigma_m=settings.sigma_m,
        latency_s=settings.latency_s,
        acceleration_density_m2_s3=settings.acceleration_density_m2_s3,
        lost_after_frames=settings.lost_after_frames,
        seed=seed,
    )


def plan_of(schedule: ScheduleFile, stage: Stage, zoom_limit: float | None) -> Plan:
    """The input of a run's strategy, by the surrogates that the schedule names."""
    start = stage.at(stage.walk.times_s[0])
    avatars = {
        w.name: avatar_like(schedule.spec.surrogate, start.state, w.name, w.position_m(stage.walk.times_s[0]))
        for w in stage.walk.walks
    }
    return Plan(
        avatars,
        limits=motor_limits(schedule.spec.motors, zoom_limit),
        step_s=stage.walk.step_s,
        radius_m=schedule.spec.target.radius_m,
        noise=stage.scene.noise_model(STEERED_BY),
        process=stage.scene.process,
        seed=schedule.spec.seed,
    )


def strategies_of(schedule: ScheduleFile, own: Mapping[str, Strategy]) -> dict[str, Strategy]:
    """The schedule's strategies by name, and the user's `own`, which it need not name and which come before ours.

    Raises:
        RangeError: a name that is neither.
    """
    return {name: own.get(name) or strategy_named(name) for name in schedule.spec.strategies} | dict(own)


def step_views(
    schedule: ScheduleFile, scene: Scene, cameras: Iterable[PTZCamera], renderer: str, trials: int | None = None
) -> tuple[Acquisition, ...]:
    """The views of a scene for a schedule; `trials`: None for its own number of trials."""
    settings = schedule.spec
    sampling = Sampling(noise_ratio=settings.render_noise_ratio)
    return views_of(scene, cameras, sampling, renderer, settings.seed, trials or settings.trials)


def steered_runs(schedule: ScheduleFile, stage: Stage, own: Mapping[str, Strategy]) -> list[Run]:
    """Every strategy under every zoom limit, the limits changing fastest; the same numbers for the same file.

    Args:
        own: strategies of the user's, by name.

    Raises:
        RangeError: a strategy that does not exist, or what `steer` refuses.
    """
    plans = {limit: plan_of(schedule, stage, limit) for limit in schedule.zoom_limits}
    tracking = tracking_of(schedule.spec.tracking, schedule.spec.seed)
    return [
        Run(name, limit, steer(stage.walk, stage.scene.cameras, strategy, plan, tracking))
        for name, strategy in strategies_of(schedule, own).items()
        for limit, plan in plans.items()
    ]
