"""What a step of a run looks like in space: its scene, cameras, lines of sight and covariances, whoever made the step.

A sweep makes its steps of a plan (`steps_of_plan`); any other run can make its own and use the same figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss import Evaluation, PTZCamera
from pss.hints import Bools, Floats
from render.world.state import SceneState
from validate.acquire.acquire import Acquisition
from validate.markers.view_measurement import ViewMeasurement
from validate.sweeps.sweep import Plan

__all__ = ["Sight", "Step", "covariances", "sight_of", "steps_of_plan"]


# A marker counts as found in a view if at least half of the trials found it, as in detection.csv.
FOUND_FROM = 0.5


@dataclass(frozen=True, eq=False)
class Sight:
    """Statistics of one view's detections of N markers, over its trials.

    Attributes:
        view_key: the view's name in the store.
        truth_px: (N, 2), OpenCV's pixels, where the centres project; nan behind the camera. For show only.
        rate: (N,), share of the trials in which the marker was found.
        offset_px: (N, 2), mean of detection − projection; nan where never found.
        spread_px: (N,), root of the larger eigenvalue of the detections' scatter about their mean; nan below two.
        blur_px: (N,), diameter of the circle of confusion.
    """

    view_key: str
    truth_px: Floats
    rate: Floats
    offset_px: Floats
    spread_px: Floats
    blur_px: Floats

    @property
    def found(self) -> Bools:
        """(N,)."""
        return self.rate >= FOUND_FROM


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a run.

    Attributes:
        state: the scene.
        cameras: those that take part, C of them.
        idle: the scene's other cameras.
        groups: (C,), the group that each camera is drawn in: "varied" if its settings change over a sweep, or if it is
            not in all of its steps, else "fixed"; other runs have groups of their own.
        visible: (C, N), predicted: the camera sees the marker.
        covariance_m2: by kind ("single": C, "filter": P∞) and noise model, (N, 3, 3) in m²; nan if not observable.
        sights: one for each camera.
    """

    label: str
    state: SceneState
    cameras: tuple[PTZCamera, ...]
    idle: tuple[PTZCamera, ...]
    groups: tuple[str, ...]
    visible: Bools
    covariance_m2: Mapping[tuple[str, str], Floats]
    sights: tuple[Sight, ...]

    @property
    def blur_px(self) -> Floats:
        """(N,), the mean blur over the cameras that should see the marker; nan where none does."""
        blur = np.array([sight.blur_px for sight in self.sights])
        count = self.visible.sum(axis=0)
        total = np.where(self.visible, blur, 0.0).sum(axis=0)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def steps_of_plan(
    plan: Plan,
    labels: Sequence[str],
    predictions: Sequence[Mapping[str, Evaluation]],
    measured: Mapping[Acquisition, ViewMeasurement],
) -> list[Step]:
    """The steps of a sweep.

    Args:
        labels: of the configurations that were assessed, in the plan's order; others are left out.
        predictions: for each of them, the metric by noise model.
        measured: the detections of every view that they need.
    """
    kept = [pair for pair in zip(plan.configurations, plan.views, strict=True) if pair[0].label in set(labels)]
    changing = _varied_names([configuration.cameras for configuration, _ in kept])
    steps = []
    for (configuration, requested), predicted in zip(kept, predictions, strict=True):
        active = {camera.name for camera in configuration.cameras}
        points = configuration.scene.state.points_m
        steps.append(
            Step(
                configuration.label,
                configuration.scene.state,
                tuple(configuration.cameras),
                tuple(camera for camera in configuration.scene.cameras if camera.name not in active),
                tuple("varied" if camera.name in changing else "fixed" for camera in configuration.cameras),
                next(iter(predicted.values())).visible,
                covariances(predicted),
                tuple(
                    sight_of(camera, points, item.request.key, measured[item])
                    for camera, item in zip(configuration.cameras, requested, strict=True)
                ),
            )
        )
    return steps


def covariances(predicted: Mapping[str, Evaluation]) -> dict[tuple[str, str], Floats]:
    """A step's `covariance_m2`, from the metric by noise model."""
    found = {}
    for model, evaluation in predicted.items():
        found["single", model] = evaluation.single_frame_covariance
        found["filter", model] = evaluation.covariance[:, :3, :3]
    return found


def sight_of(camera: PTZCamera, points_m: Floats, view_key: str, measurement: ViewMeasurement) -> Sight:
    """Set a view's detections beside where the markers' centres project."""
    pixels, depth_m = camera.project(points_m)
    truth = np.where((depth_m > 0)[:, None], pixels, np.nan)
    found, count = measurement.detected, measurement.detected.sum(axis=0)
    difference = np.where(found[..., None], measurement.pixels - pixels, 0.0)
    mean = np.where(count[:, None] > 0, difference.sum(axis=0) / np.maximum(count, 1)[:, None], np.nan)
    about = np.where(found[..., None], difference - np.nan_to_num(mean), 0.0)
    scatter = np.einsum("tni,tnj->nij", about, about) / np.maximum(count - 1, 1)[:, None, None]
    spread = np.where(count > 1, np.sqrt(np.maximum(np.linalg.eigvalsh(scatter)[:, -1], 0)), np.nan)
    blur = np.where(depth_m > 0, camera.circle_of_confusion_px(points_m), np.nan)
    return Sight(view_key, truth, count / len(found), mean, spread, blur)


def _varied_names(steps: Sequence[Sequence[PTZCamera]]) -> set[str]:
    """Names of the cameras that differ between the steps, or are missing in some."""
    settings: dict[str, set[PTZCamera]] = {}
    for cameras in steps:
        for camera in cameras:
            settings.setdefault(camera.name, set()).add(camera)
    always = set.intersection(*({camera.name for camera in cameras} for cameras in steps)) if steps else set()
    return {name for name, seen in settings.items() if len(seen) > 1 or name not in always}
