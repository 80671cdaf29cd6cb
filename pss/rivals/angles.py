"""Rivals from viewing angles alone, without pixels: triangulability, pairs of bearings."""

from __future__ import annotations

import math

import numpy as np

from pss.hints import Bools, Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric
from pss.processes.steady_state import SMALLEST_INFORMATION_RATIO
from pss.rivals.shared import Pairs, both_conventions, view_pairs

__all__ = [
    "ANGLE_METRICS",
    "SMALLEST_ANGLE_DEG",
    "best_pair_m2",
    "triangulable",
]


# Rays that meet at less than 40° or more than 140° do not count as triangulation.
SMALLEST_ANGLE_DEG = 40.0
# Tolerance, so that rounding does not decide for points seen under exactly 40°.
COS_ROUNDING = 1e-12


def triangulable(pairs: Pairs) -> Bools:
    """Whether both cameras of a pair see the point, 40° to 140° apart, (P, N)."""
    return np.asarray(pairs.seen & (np.abs(pairs.cos) <= math.cos(math.radians(SMALLEST_ANGLE_DEG)) + COS_ROUNDING))


def _triangulable(evaluation: Evaluation) -> Floats:
    """Whether some pair of cameras sees a point 40° to 140° apart, (N,), 0 or 1. More is better.

    Source: Rahimian and Kearney 2017. A point without such a pair counts zero.
    """
    return triangulable(view_pairs(evaluation)).any(axis=0).astype(float)


def _largest_sine(evaluation: Evaluation) -> Floats:
    """Soft form of `_triangulable`: the largest sin θ of two views of each point, (N,), 0 to 1. More is better.

    A point that fewer than two cameras see counts zero.
    """
    pairs = view_pairs(evaluation)
    return np.asarray(np.where(pairs.seen, pairs.sin, 0.0).max(axis=0, initial=0.0))


def best_pair_m2(evaluation: Evaluation) -> Floats:
    """m², min over visible pairs of d₁·d₂/|sin θ|, (N,); ∞ without a pair that is not in line with the point.

    In the plane, two bearings of 1 rad have the covariance (Σ n nᵀ/d²)⁻¹, whose root determinant this is.
    Source: Tekdas and Isler 2010.
    """
    pairs, range_m = view_pairs(evaluation), evaluation.views.range_m
    usable = pairs.seen & (pairs.sin**2 > SMALLEST_INFORMATION_RATIO)
    product = range_m[pairs.first] * range_m[pairs.second] / np.where(usable, pairs.sin, 1.0)
    return np.asarray(np.where(usable, product, np.inf).min(axis=0, initial=np.inf))


ANGLE_METRICS: tuple[Metric, ...] = (
    Metric.over_points(
        "triangulable-share", _triangulable, True, "Rahimian and Kearney 2017, 40° to 140°", "read", "count zero"
    ),
    Metric.over_points(
        "triangulation-angle", _largest_sine, True, "Rahimian and Kearney 2017, soft: sin θ", "read", "count zero"
    ),
    *both_conventions("pairwise-bearing", best_pair_m2, np.sqrt, "Tekdas and Isler 2010, d₁d₂/|sin θ|", "checked"),
)
