"""A schedule file: two people who walk past each other, and the strategies that steer the cameras."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from scenes.errors import Location, Problems
from scenes.reading.document import check_once, named_file, read_spec
from scenes.reading.inside import scene_of
from scenes.reading.limits import MOST_FRAMES, MOST_RUNS, MOST_STEPS
from scenes.reading.quantities import Metres, NoiseRatio, SceneFile, Seed, Title, Trials
from scenes.reading.spec import ONE_SEARCH, Name, Number, Positive, Spec, known

__all__ = [
    "SURROGATES",
    "MotorsSpec",
    "ProcessRateSpec",
    "RealWalkSpec",
    "ScheduleFile",
    "ScheduleSpec",
    "TargetSpec",
    "TrackingSpec",
    "WalkSpec",
    "load_schedule",
]

SCHEDULES = Path(__file__).parents[1] / "schedules"
"""The folder of the schedules known by name."""

SURROGATES = ("cylinder", "box", "mesh", "markers")
UNLIMITED = "none"

Range = Annotated[tuple[Number, Number], Field(description="[lowest, highest], in degrees")]
PerSecond = Annotated[Positive, Field(description="a number above 0, each second")]
Rate = Annotated[Positive, Field(description="a number above 0, in frames a second")]
Density = Annotated[Positive, Field(description="a number above 0, in m²/s³")]


class WalkSpec(Spec):
    """[walk]: two straight lanes along y, walked in opposite directions."""

    steps: Annotated[
        int, Field(strict=True, ge=3, le=MOST_STEPS, description=f"a whole number, 3 or more, at most {MOST_STEPS}")
    ] = 21
    reach_m: Metres = 4.0
    lane_m: Metres = 0.6
    speed_m_per_s: Annotated[Positive, Field(description="a number above 0, in metres per second")] = 1.2


class TargetSpec(Spec):
    """[target]: the sphere that a camera is zoomed to."""

    radius_m: Metres = 0.95
    height_m: Metres = 0.9


class MotorsSpec(Spec):
    """[motors]: `pss.cameras.motor_limits.PTZLimits`, except for the zoom's range; a missing key means no limit."""

    pan_range_deg: Range | None = Field(None, description="[lowest, highest], in degrees")
    tilt_range_deg: Range | None = Field(None, description="[lowest, highest], in degrees")
    pan_speed_deg_per_s: PerSecond | None = Field(None, description="a number above 0, each second")
    tilt_speed_deg_per_s: PerSecond | None = Field(None, description="a number above 0, each second")
    zoom_factor_per_s: Annotated[Number, Field(gt=1)] | None = Field(None, description="a number above 1, each second")
    focus_speed_dioptre_per_s: PerSecond | None = Field(None, description="a number above 0, each second")
    pan_step_deg: Positive = 0.01
    tilt_step_deg: Positive = 0.01
    zoom_step: Positive = 0.001
    focus_step_dioptre: Positive = 0.001


class TrackingSpec(Spec):
    """[tracking]: the tracker by which the cameras are steered."""

    frame_rate_hz: Rate = 30.0
    sigma_m: Metres = 0.03
    latency_s: Annotated[Number, Field(ge=0, description="a number, 0 or more, in seconds")] = 0.1
    acceleration_density_m2_s3: Density = 0.5
    lost_after_frames: Annotated[int, Field(strict=True, ge=1, description="a whole number, 1 or more")] = 15


class ProcessRateSpec(Spec):
    """[process]: constant velocity, for the metric and for the filters."""

    acceleration_density_m2_s3: Density = 0.1
    frame_rate_hz: Rate = 30.0


class RealWalkSpec(Spec):
    """[real_walk]: rendered frame by frame under one strategy."""

    strategy: Name
    frames_per_s: Rate = 7.5
    trials: Trials = 5


class ScheduleSpec(Spec):
    """A whole schedule file; `scene` is a path relative to it."""

    removed: ClassVar[dict[str, str]] = {"search": ONE_SEARCH}

    scene: SceneFile
    title: Title
    strategies: Annotated[
        tuple[Name, ...],
        Field(min_length=1, max_length=MOST_RUNS, description=f"a list of one to {MOST_RUNS} names of strategies"),
    ]
    zoom_limits: Annotated[
        tuple[Annotated[Number, Field(ge=1)] | Literal[UNLIMITED], ...],
        Field(min_length=1, max_length=MOST_RUNS, description=f'a list of numbers, 1 or more, or "{UNLIMITED}"'),
    ] = (UNLIMITED,)
    surrogate: Annotated[Literal[SURROGATES], Field(description=f"one of {', '.join(SURROGATES)}")] = "cylinder"
    trials: Trials = 20
    seed: Seed = 0
    render_noise_ratio: NoiseRatio = 0.6
    walk: WalkSpec = WalkSpec()
    target: TargetSpec = TargetSpec()
    motors: MotorsSpec = MotorsSpec()
    tracking: TrackingSpec = TrackingSpec()
    process: ProcessRateSpec = ProcessRateSpec()
    real_walk: RealWalkSpec | None = None


@dataclass(frozen=True)
class ScheduleFile:
    """The contents of a schedule file.

    Attributes:
        name: the file's name without its suffix.
        path: of the file.
        scene_path: of the scene file.
        spec: its tables.
    """

    name: str
    path: Path
    scene_path: Path
    spec: ScheduleSpec = field(repr=False)

    @property
    def zoom_limits(self) -> tuple[float | None, ...]:
        """The upper zoom limits of the runs, None for no limit."""
        return tuple(None if limit == UNLIMITED else float(limit) for limit in self.spec.zoom_limits)

    def resolved(self) -> dict[str, Any]:
        """The file's contents with overrides and defaults applied: plain, JSON-serialisable, a valid file itself."""
        return self.spec.model_dump(mode="json", by_alias=True, exclude_none=True)


def load_schedule(
    path_or_name: str | Path, overrides: Iterable[str] = (), *, allow_outside: bool = False
) -> ScheduleFile:
    """The schedule in the TOML file at a path, or one of the project's by name ("hallway").

    Args:
        overrides: those that begin with "sweep.", such as "sweep.walk.steps=11", are applied.
        allow_outside: whether its scene may be anywhere; if not, see `scenes.reading.inside.scene_of`.

    Raises:
        SceneError: with every problem of the file and the overrides, a line each.
    """
    path = named_file(path_or_name, SCHEDULES, "schedule")
    spec, draft, problems = read_spec(ScheduleSpec, path, overrides)
    check_once(("strategies",), draft.strategies, problems)
    check_once(("zoom_limits",), draft.zoom_limits, problems)
    _check_frames(draft, problems)
    scene_path = scene_of(path, draft.scene, allow_outside, problems)
    problems.raise_if_any()
    assert spec is not None  # no problem, so pydantic had none
    return ScheduleFile(path.stem, path, scene_path, spec)


def _check_frames(draft: ScheduleSpec, problems: Problems) -> None:
    """Report walks with more frames than a run allows."""
    walk = draft.walk
    if walk is None or not known(walk.reach_m, walk.speed_m_per_s):
        return
    rates: list[tuple[Location, float | None]] = [
        (("tracking", "frame_rate_hz"), draft.tracking and draft.tracking.frame_rate_hz),
        (("process", "frame_rate_hz"), draft.process and draft.process.frame_rate_hz),
        (("real_walk", "frames_per_s"), draft.real_walk and draft.real_walk.frames_per_s),
    ]
    # Not divided by the speed, which may be close to zero.
    fastest = MOST_FRAMES * walk.speed_m_per_s / 2
    for place, rate in rates:
        if rate is not None and rate * walk.reach_m > fastest:
            reason = f"at most {MOST_FRAMES} frames on the way of the walk, at its reach_m and speed_m_per_s"
            problems.add(place, reason, value=rate)
