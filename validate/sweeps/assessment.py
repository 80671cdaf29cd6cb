"""Prediction and measurement of one configuration side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss import Appearance, Evaluation, PTZCamera
from pss.hints import Floats
from scenes import Scene
from validate.markers.view_measurement import ViewMeasurement
from validate.points.configuration import Measured, measure_configuration
from validate.prediction.predict import predict

__all__ = ["Assessment", "assess"]


@dataclass(frozen=True, eq=False)
class Assessment:
    """A configuration with its prediction by each noise model and its measurement."""

    cameras: tuple[PTZCamera, ...]
    predicted: Mapping[str, Evaluation]
    measured: Measured
    view_detection_rate: Floats
    """(C, N), share of the trials in which each view detected each marker."""


def assess(
    scene: Scene,
    cameras: Sequence[PTZCamera],
    views: Sequence[ViewMeasurement],
    rng: np.random.Generator,
    appearance: Appearance,
) -> Assessment:
    """Predict, from how the markers look in the scene's light, and measure one configuration."""
    return Assessment(
        tuple(cameras),
        predict(scene, cameras, appearance),
        measure_configuration(scene, cameras, views, rng),
        np.array([view.detected.mean(axis=0) for view in views]),
    )
