"""The real walk: frames rendered one after the other with motion blur, and every marker tracked through them.

No steady state is reached: cameras turn, markers come and go. What is judged is the covariance of the time-varying
Riccati recursion, the filter's own and the one that the metric predicts without any detection. A camera is held still
while its shutter is open; the people move.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pss import ConstantVelocity, evaluate
from pss.errors import RangeError
from pss.hints import Bools, Floats, Row
from pss.noise import Calibration
from pss.processes.own_process import LinearProcess
from render.keys import state_key
from scenes import Scene
from scenes.markers.suit import ids_on
from scenes.steps.schedule_file import ScheduleFile
from validate.acquire.acquire import Acquired, Acquisition
from validate.prediction.contenders import FULL_MODEL, scene_contenders
from validate.schedule.runs import plan_of, step_views, tracking_of
from validate.schedule.stage import BOTH, Stage
from validate.schedule.steering import Steered, steer
from validate.schedule.strategies import Strategy, strategy_named
from validate.schedule.walk import Passing
from validate.tracked_walk.consistency import consistency
from validate.tracked_walk.filter import WalkTracks, track_walk
from validate.tracked_walk.process_misfit import misfit_rows, motion_misfit
from validate.tracked_walk.riccati import riccati_along

__all__ = [
    "RealWalk",
    "TrackedWalk",
    "body_parts",
    "gait_densities",
    "gait_process",
    "real_walk_of",
    "track_real_walk",
]


# How fast the people of other walks go, from whose gait the filter's process is taken, in parts of this walk's speed.
OTHER_SPEEDS = (0.85, 1.1)
# A step of the walk that is this part of a frame off a whole number of frames is one.
WHOLE_FRAMES = 1e-6


@dataclass(frozen=True, eq=False)
class RealWalk:
    """What is to be rendered: K frames of one strategy without a zoom limit, with C cameras and N markers.

    Attributes:
        walk: whose steps are the frames.
        scenes: one of each frame, with its people walking.
        views: K × C.
        truth_m: m, (K, N, 3).
    """

    strategy: str
    stage: Stage
    walk: Passing
    steered: Steered
    scenes: tuple[Scene, ...]
    views: tuple[tuple[Acquisition, ...], ...]
    truth_m: Floats

    @property
    def requested(self) -> list[Acquisition]:
        """All views."""
        return [item for frame in self.views for item in frame]


@dataclass(frozen=True, eq=False)
class TrackedWalk:
    """The walk as it was tracked in T trials, and what was predicted of it.

    Attributes:
        tracks: of every marker in every trial.
        pixels: px, the detections, (K, C, T, N, 2).
        process: of each marker, by the gait of other walks.
        predicted_m2: m², the metric's recursion before and after each frame's update, (K, N, 3, 3) each.
    """

    real: RealWalk
    tracks: WalkTracks
    pixels: Floats
    process: LinearProcess
    predicted_m2: tuple[Floats, Floats]

    def consistency_rows(self, rng: np.random.Generator) -> list[Row]:
        """NEES, coverage and errors by avatar and by part of the body."""
        return consistency(self.tracks, self.real.truth_m, self._groups, rng, self.predicted_m2)

    def misfit_rows(self, assumed_density_m2_s3: float) -> list[Row]:
        """How far each part of the body is from one constant velocity model for all."""
        process = ConstantVelocity(assumed_density_m2_s3, self.real.walk.step_s)
        return misfit_rows(self.real.truth_m, process, self._groups)

    def frame_rows(self) -> list[Row]:
        """A row for each frame and avatar: found, tracked, and the errors, predicted and measured."""
        tracks, truth = self.tracks, self.real.truth_m
        found = np.isfinite(self.pixels[..., 0]).sum(axis=1)
        kept = np.isfinite(tracks.posterior_m[..., 0]) & ~tracks.lost
        square = ((tracks.posterior_m - truth[:, None]) ** 2).sum(axis=-1)
        claimed = np.trace(tracks.posterior_covariance_m2, axis1=-2, axis2=-1)
        expected = np.trace(self.predicted_m2[1], axis1=-2, axis2=-1)
        rows: list[Row] = []
        for frame, time_s in enumerate(self.real.walk.times_s.tolist()):
            for avatar, worn in self.real.stage.groups.items():
                cells = kept[frame] & worn
                foreseen = expected[frame, worn]
                rows.append(
                    {
                        "step": frame,
                        "time_s": time_s,
                        "strategy": self.real.strategy,
                        "avatar": avatar,
                        "markers": int(worn.sum()),
                        "found_by_two": float((found[frame] >= 2)[:, worn].sum(axis=1).mean()),
                        "found_by_one": float((found[frame] == 1)[:, worn].sum(axis=1).mean()),
                        "tracked": float(cells.sum(axis=1).mean()),
                        "predicted_tracked": int(np.isfinite(foreseen).sum()),
                        "measured_median_m": _median(np.sqrt(square[frame][cells])),
                        "claimed_median_m": _median(np.sqrt(claimed[frame][cells])),
                        "predicted_median_m": _median(np.sqrt(foreseen)),
                    }
                )
        return rows

    @property
    def _groups(self) -> Mapping[str, Bools]:
        return {**self.real.stage.groups, **body_parts(self.real.stage)}


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def body_parts(stage: Stage) -> dict[str, Bools]:
    """Which markers are on the torso, the head, the arms and the legs of either person, (N,) each."""
    ids = np.array([marker.id for marker in stage.scene.state.markers])
    found: dict[str, Bools] = {}
    for part, limbs in {
        "torso": ("torso",),
        "head": ("head",),
        "arms": ("right upper arm", "left upper arm"),
        "legs": ("right thigh", "left thigh", "right shin", "left shin"),
    }.items():
        on_part = [number for first in stage.first_ids for limb in limbs for number in ids_on(limb, first)]
        found[part] = np.isin(ids, on_part)
    return found


def real_walk_of(schedule: ScheduleFile, stage: Stage, own: Mapping[str, Strategy], renderer: str) -> RealWalk | None:
    """The frames of a schedule's real walk; None if it has none.

    Raises:
        RangeError: a strategy that does not exist, or a rate at which the walk or the tracking is no whole number of
            frames.
    """
    real_walk = schedule.spec.real_walk
    if real_walk is None:
        return None
    strategy = own.get(real_walk.strategy) or strategy_named(real_walk.strategy)
    seconds = float(stage.walk.times_s[-1] - stage.walk.times_s[0])
    frames = seconds * real_walk.frames_per_s
    if abs(frames - round(frames)) > WHOLE_FRAMES * frames:
        raise RangeError(
            f"{schedule.path}: real_walk.frames_per_s = {real_walk.frames_per_s:g} makes {frames:.6g} frames "
            f"of a walk of {seconds:.4g} s; allowed: a whole number of frames"
        )
    walk = dataclasses.replace(stage.walk, steps=round(frames) + 1)
    # Decisions are as far apart as in the held study.
    plan = plan_of(schedule, stage, None)
    steered = steer(walk, stage.scene.cameras, strategy, plan, tracking_of(schedule.spec.tracking, schedule.spec.seed))
    scenes = tuple(stage.at(time_s, moving=True) for time_s in walk.times_s.tolist())
    views = tuple(
        step_views(schedule, scene, cameras, renderer, real_walk.trials)
        for scene, cameras in zip(scenes, steered.cameras, strict=True)
    )
    truth = np.array([scene.state.points_m for scene in scenes])
    return RealWalk(real_walk.strategy, stage, walk, steered, scenes, views, truth)


def track_real_walk(real: RealWalk, acquired: Acquired, calibration: Calibration) -> TrackedWalk:
    """Track the markers of a rendered walk, and predict without any detection how well that goes."""
    measured = [[acquired.measured[item] for item in frame] for frame in real.views]
    pixels = np.array([[view.pixels for view in frame] for frame in measured])
    covariance = np.array([[view.covariance for view in frame] for frame in measured])
    process = gait_process(real)
    tracks = track_walk(real.steered.cameras, pixels, covariance, process)
    information = []
    for scene, cameras in zip(real.scenes, real.steered.cameras, strict=True):
        (contender,) = (c for c in scene_contenders(scene, calibration) if c.name == FULL_MODEL)
        evaluation = evaluate(
            cameras,
            scene.state.points_m,
            scene.state.normals,
            noise=contender.noise,
            occluder=scene.state.occluders,
            appearance=acquired.appearances[state_key(scene.state)],
            visibility=contender.visibility,
        )
        information.append(evaluation.information)
    predicted = riccati_along(np.array(information), process)
    return TrackedWalk(real, tracks, pixels, process, predicted)


def gait_process(real: RealWalk) -> LinearProcess:
    """Constant velocity in the frames of a walk, with a density of acceleration for each marker's place on the suit."""
    densities = gait_densities(real.stage, real.walk)
    models = [ConstantVelocity(float(density), real.walk.step_s) for density in densities]
    return LinearProcess(models[0].A, np.array([model.Q for model in models]), real.walk.step_s)


def gait_densities(stage: Stage, walk: Passing) -> Floats:
    """m²/s³, (N,), `motion_misfit` of each marker in other walks, slower and faster than the evaluated one.

    A marker has the mean over both people's markers at its place on the suit: how limbs swing is known of gait, and not
    of these two on this walk.
    """
    unit_process = ConstantVelocity(1.0, walk.step_s)
    found = []
    for speed in OTHER_SPEEDS:
        walks = [dataclasses.replace(w, speed_m_per_s=w.speed_m_per_s * speed) for w in walk.walks]
        other = Stage(stage.scene, dataclasses.replace(walk, first=walks[0], second=walks[1]))
        # The same frame rate, from when they start.
        times = walk.step_s * np.arange(int(walks[0].length_m / walks[0].speed_m_per_s / walk.step_s))
        found.append(motion_misfit(np.array([other.at(t).state.points_m for t in times.tolist()]), unit_process))
    density = np.mean(found, axis=0)
    places = np.array([marker.id for marker in stage.scene.state.markers])
    for first, groups in zip(stage.first_ids, stage.names, strict=True):
        places = np.where(stage.groups[groups], places - first, places)
    worn = stage.groups[BOTH]
    for place in np.unique(places[worn]):
        alike = worn & (places == place)
        density[alike] = density[alike].mean()
    return np.asarray(density)
