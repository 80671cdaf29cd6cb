"""Reference values for the other metrics: an arbitrary choice, and the simplest rules."""

from __future__ import annotations

import dataclasses
import hashlib

import numpy as np

from pss.cameras.camera import PTZCamera
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric

__all__ = ["NULL_METRICS", "arbitrary", "mean_distance_m", "pixels_per_mm"]


def arbitrary(evaluation: Evaluation) -> float:
    """A number from 0 to 1 without information: a hash of the cameras' settings, in any order. More is better.

    It is not random: equal configurations have equal numbers everywhere.
    """
    settings = "\n".join(sorted(map(_settings, evaluation.cameras)))
    return int.from_bytes(hashlib.sha256(settings.encode()).digest()[:8], "big") / 2**64


def _settings(camera: PTZCamera) -> str:
    """All settings, without the name."""
    return repr([getattr(camera, field.name) for field in dataclasses.fields(camera) if field.compare])


def mean_distance_m(evaluation: Evaluation) -> float:
    """Metres, mean distance between cameras and the points they see; ∞ if they see none. Less is better."""
    seen = evaluation.visible
    return float(evaluation.views.range_m[seen].mean()) if seen.any() else np.inf


def pixels_per_mm(evaluation: Evaluation) -> float:
    """px/mm, mean of focal length over depth, of cameras and the points they see; 0 if none. More is better."""
    seen = evaluation.visible
    if not seen.any():
        return 0.0
    focal_px = np.broadcast_to(evaluation.views.arrays.focal_px, seen.shape)[seen]
    return float((focal_px / evaluation.views.depth_m[seen]).mean() / 1000)


NULL_METRICS: tuple[Metric, ...] = (
    Metric("random", arbitrary, True, "hash of the configuration", "ours", "left out"),
    Metric("mean-distance", mean_distance_m, False, "mean distance of views", "ours", "left out"),
    Metric("pixels-per-mm", pixels_per_mm, True, "mean pixel density of views", "ours", "left out"),
)
