"""The hallway's calibration: noise weights and limits of detection, fitted on views that are not evaluated.

The people stand elsewhere (between the steps, in other lanes), and the cameras look at them less exactly, at other
zooms and focused beside them, so that blur and size vary as much as they do where cameras are late.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from pss import PTZCamera, RangeError
from pss.cameras.motors import fitting_zoom
from pss.cameras.views import Views
from pss.noise import CALIBRATION_FACTORS, SCALED_MODELS, Calibration
from render.keys import state_key
from render.random_streams import random_stream
from scenes import Scene
from scenes.steps.schedule_file import ScheduleFile
from validate.acquire.acquire import Acquired, Acquisition
from validate.prediction.detection import DetectionTrials, detection_trials, fit_detection
from validate.prediction.limits import limits_of_targets, whole_targets
from validate.prediction.weights import (
    PixelMoments,
    factor_covariances,
    fit_best_form,
    fit_scale,
    model_covariance,
    pixel_moments,
)
from validate.schedule.runs import step_views
from validate.schedule.stage import Stage

__all__ = ["Training", "calibrate_hallway", "training_views"]


# Times of the walk, as shares of it, between steps of the shipped schedule; and how much wider the lanes are.
TIMES = (0.07, 0.22, 0.38, 0.62, 0.83)
WIDER_LANES = 1.4
# Spreads of what a camera is set to about the exact aim, zoom and focus.
AIM_M, ZOOM_LOG, FOCUS_LOG = 0.2, 0.25, 0.15
# Of each training view.
RENDERS = 1


@dataclass(frozen=True, eq=False)
class Training:
    """One held place of the walk with the cameras' training views of it."""

    scene: Scene
    cameras: tuple[PTZCamera, ...]
    requested: tuple[Acquisition, ...]


def training_views(schedule: ScheduleFile, stage: Stage, renderer: str) -> list[Training]:
    """The views to calibrate on: at each of five places a view of each camera."""
    schedule_spec, walk = schedule.spec, stage.walk
    lanes = [(w.start_m[0] * WIDER_LANES, *w.start_m[1:]) for w in walk.walks]
    ends = [(w.end_m[0] * WIDER_LANES, *w.end_m[1:]) for w in walk.walks]
    moved = [
        dataclasses.replace(w, start_m=start, end_m=end) for w, start, end in zip(walk.walks, lanes, ends, strict=True)
    ]
    beside = Stage(stage.scene, dataclasses.replace(walk, first=moved[0], second=moved[1]))
    rng = random_stream(schedule_spec.seed, schedule.name, "training cameras")
    found = []
    for share in TIMES:
        time_s = walk.times_s[0] + share * (walk.times_s[-1] - walk.times_s[0])
        scene = beside.at(time_s)
        cameras = []
        for number, camera in enumerate(scene.cameras):
            target = moved[number % 2].position_m(time_s) + AIM_M * rng.standard_normal(3)
            aimed = camera.aimed_at(tuple(target.tolist()))
            zoom = fitting_zoom(aimed, target, schedule_spec.target.radius_m) * np.exp(ZOOM_LOG * rng.standard_normal())
            focus = np.linalg.norm(target - camera.position_m) * np.exp(FOCUS_LOG * rng.standard_normal())
            settings = {"zoom": max(1.0, float(zoom)), "focus_distance_m": float(focus)}
            cameras.append(dataclasses.replace(aimed, **settings))
        requested = step_views(schedule, scene, cameras, renderer)
        found.append(Training(scene, tuple(cameras), requested))
    return found


def calibrate_hallway(training: list[Training], acquired: Acquired) -> Calibration:
    """The weights, scales, limits and the probability of detection that fit the training views.

    Raises:
        RangeError: no marker was found often enough in any of them.
    """
    moments, covariances, of_models, targets, trials = [], [], [], [], []
    for place in training:
        state, sensor = place.scene.state, place.scene.sensor
        appearance = acquired.appearances[state_key(state)]
        measured = [acquired.measured[item] for item in place.requested]
        projected = np.array([camera.project(state.points_m)[0] for camera in place.cameras])
        residuals = np.array([view.pixels for view in measured]) - projected[:, None]
        of_place = pixel_moments(residuals)
        views = Views(list(place.cameras), state.points_m, state.normals, appearance)
        if len(of_place.trials):
            moments.append(of_place)
            geometry = (list(place.cameras), state.points_m, state.normals)
            covariances.append(factor_covariances(*geometry, appearance, sensor, of_place, CALIBRATION_FACTORS))
            of_models.append(
                [model_covariance(place.scene.noise_model(name), views, of_place) for name in SCALED_MODELS]
            )
        rate = np.array([view.detected.mean(axis=0) for view in measured])
        targets.append(whole_targets(views, state.occluders, rate, sensor))
        trials.append(detection_trials(views, state.occluders, rate, RENDERS, sensor))
    if not moments:
        raise RangeError("no marker was found often enough in any training view; allowed: at least one in one of them")
    together = PixelMoments(
        *(np.concatenate([getattr(m, field.name) for m in moments]) for field in dataclasses.fields(PixelMoments))
    )
    fitted = fit_best_form(CALIBRATION_FACTORS, np.concatenate(covariances, axis=1), together)
    kept = fitted.kept
    scales = {
        name: fit_scale(whole[kept], together[kept])
        for name, whole in zip(SCALED_MODELS, np.concatenate(of_models, axis=1), strict=True)
    }
    limits = limits_of_targets(*(np.concatenate(parts) for parts in zip(*targets, strict=True)))
    ramp = fit_detection(DetectionTrials.together(trials))
    provenance: dict[str, str | int | float] = {
        "places": len(training),
        "views": sum(len(place.requested) for place in training),
        "moments": fitted.moments,
        "left_out_as_blunders": fitted.left_out,
        "deviance_per_moment": fitted.deviance / fitted.moments,
        **limits.provenance,
        **ramp.provenance,
        "fitted_by": "python validate/run_sweep.py schedule",
    }
    return Calibration("calibrated", fitted.weights, provenance, limits.limits, scales, ramp.coefficients)
