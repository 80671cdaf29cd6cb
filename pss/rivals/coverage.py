"""Rivals that count views, each weighted by its quality, without regard to their joint geometry."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pss.cameras.views import Views
from pss.hints import Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric
from pss.rivals.shared import directions
from pss.visibility.expected import probability_of_at_least

__all__ = [
    "COVERAGE_METRICS",
    "camera_strength",
]


# A third camera makes a triangulation verifiable; further ones are not counted.
ENOUGH_CAMERAS = 3

# Ramps of Mavrinac's coverage strength: 0 at "acceptable", 1 at "ideal". In the source they depend on the task (its
# defaults pass everything but the ideal blur, 1 px); these are ours, for a room of a few metres.
BOUNDARY_PADDING_PX = 20.0
IDEAL_RESOLUTION_MM_PER_PX = 2.0
ACCEPTABLE_RESOLUTION_MM_PER_PX = 10.0
IDEAL_BLUR_PX = 1.0
ACCEPTABLE_BLUR_PX = 5.0
IDEAL_INCIDENCE_DEG = 30.0
ACCEPTABLE_INCIDENCE_DEG = 80.0

# 1/m², lab-camera-optimizer's default: a view from 8 m counts 0.94.
DISTANCE_WEIGHT_PER_M2 = 0.001
# Views closer than this in azimuth count as one and a fraction.
DUPLICATE_DEG = 20.0
DUPLICATE_COUNTS = 0.3
# Number of distinct views beyond which more do not count; in the source it depends on the task, and this is ours.
TARGET_VIEWS = 4

# m, d₀ of Bodor et al.: nearer than this a view does not improve.
REFERENCE_DISTANCE_M = 2.0


def _counts(evaluation: Evaluation, enough: int = ENOUGH_CAMERAS) -> Floats:
    """min(m, k)/k of each point that m cameras see, (N,), 0 to 1; with `detection` its expectation, m finding it."""
    if evaluation.detection is not None:
        return np.asarray(probability_of_at_least(evaluation.detection, enough).mean(axis=0))
    return np.asarray(np.minimum(evaluation.visible.sum(axis=0), enough) / enough)


def _ramp(value: Floats, zero: Floats | float, one: Floats | float) -> Floats:
    """0 at `zero`, 1 at `one`, linear in between and constant beyond."""
    return np.clip((value - zero) / (np.asarray(one) - zero), 0.0, 1.0)


def camera_strength(evaluation: Evaluation) -> Floats:
    """Mavrinac's coverage strength of each camera alone, (C, N), 0 to 1; 0 where it does not see the point.

    The product of ramps: distance from the image's border; mm per pixel across the axis; focus, linear in depth
    between where the circle of confusion has the ideal and the acceptable diameter; incidence, linear in its cosine.
    """
    views, seen = evaluation.views, evaluation.visible
    safe_depth = np.where(seen, views.depth_m, 1.0)
    resolution = _ramp(
        1000 * safe_depth / views.arrays.focal_px, ACCEPTABLE_RESOLUTION_MM_PER_PX, IDEAL_RESOLUTION_MM_PER_PX
    )
    cosines = (math.cos(math.radians(angle)) for angle in (ACCEPTABLE_INCIDENCE_DEG, IDEAL_INCIDENCE_DEG))
    incidence = _ramp(np.where(seen, views.cos_incidence, 0.0), *cosines)
    strength = _border(views, seen) * resolution * _focus(views, safe_depth) * incidence
    return np.where(seen, strength, 0.0)


def _border(views: Views, seen: NDArray[np.bool_]) -> Floats:
    pixels = np.where(seen[..., None], views.pixels, 0.0)
    u, v, arrays = pixels[..., 0] + 0.5, pixels[..., 1] + 0.5, views.arrays
    inside = np.minimum(np.minimum(u, arrays.width - u), np.minimum(v, arrays.height - v))
    return _ramp(inside, 0.0, BOUNDARY_PADDING_PX)


def _focus(views: Views, depth_m: Floats) -> Floats:
    arrays = views.arrays
    d, f = arrays.focus_distance_m, arrays.focal_length_m
    at_infinity = arrays.aperture_diameter_m / arrays.pixel_pitch_m * f / (d - f)  # px, Eq. 14 for z → ∞

    def near(blur_px: float) -> Floats:
        return np.asarray(d * at_infinity / (at_infinity + blur_px))

    def inverse_far(blur_px: float) -> Floats:
        return np.asarray(np.maximum((at_infinity - blur_px) / (d * at_infinity), 0.0))

    before = _ramp(depth_m, near(ACCEPTABLE_BLUR_PX), near(IDEAL_BLUR_PX))
    ideal, acceptable = inverse_far(IDEAL_BLUR_PX), inverse_far(ACCEPTABLE_BLUR_PX)
    # A limit at infinity is never reached: the ramp towards it has no slope.
    limited = acceptable > 0
    far, last = 1 / np.where(limited, ideal, 1.0), 1 / np.where(limited, acceptable, 0.5)
    return before * np.where(limited, _ramp(depth_m, last, far), 1.0)


def _coverage_strength(evaluation: Evaluation) -> Floats:
    """The best pair's weaker `camera_strength` at each point, (N,), 0 to 1. More is better.

    The best pair is the two strongest cameras. Source: Mavrinac, Adolphus (2-ocular coverage strength); a point that
    fewer than two cameras cover counts zero.
    """
    if len(evaluation.cameras) < 2:
        return np.zeros(len(evaluation.observable))
    return np.asarray(np.sort(camera_strength(evaluation), axis=0)[-2])


def _distance_weighted_views(evaluation: Evaluation) -> Floats:
    """At each point, (N,), min(n, T)/T · Σ_r s_(r)/√r /√T, s = v²/(1 + 0.001 d²) in descending order. More is better.

    n counts distinct views: those less than 20° of azimuth from their neighbour count 0.3. v is 1 for visible points.
    Source: lab-camera-optimizer, its "base" score; its bonus for views all round, its bilateral factor and its rule for
    cameras close to each other are omitted. It counts n from the smallest azimuth and does not close the circle; here
    it is counted from the widest gap, so that the direction of the axes does not matter.
    """
    seen = evaluation.visible
    if len(evaluation.cameras) == 0:
        return np.zeros(len(evaluation.observable))
    score = np.where(seen, 1 / (1 + DISTANCE_WEIGHT_PER_M2 * evaluation.views.range_m**2), 0.0)
    rank = np.arange(1, len(score) + 1)[:, None]
    total = (-np.sort(-score, axis=0) / np.sqrt(rank)).sum(axis=0) / math.sqrt(TARGET_VIEWS)
    return np.asarray(np.minimum(_distinct_views(evaluation), TARGET_VIEWS) / TARGET_VIEWS * total)


def _distinct_views(evaluation: Evaluation) -> Floats:
    """Distinct views by azimuth, (N,): 1 for each gap round the circle, 0.3 for one below 20°.

    The first view, at the far end of the widest gap, counts 1 like that gap, unless 19 views or more are all round,
    which are more than enough by any count.
    """
    seen = evaluation.visible
    towards = directions(evaluation)
    azimuth = np.mod(np.degrees(np.arctan2(towards[..., 1], towards[..., 0])), 360.0)
    ordered = np.sort(np.where(seen, azimuth, np.inf), axis=0)
    count = seen.sum(axis=0)
    ends = np.where(np.isfinite(ordered), ordered, ordered[:1] + 360.0)  # invisible ones close the circle
    ends = np.where(count > 0, np.concatenate([ends, ends[:1] + 360.0]), 0.0)
    gaps = np.diff(ends, axis=0)[: len(seen)]
    is_gap = np.arange(len(seen))[:, None] < count
    return np.asarray(np.where(is_gap, np.where(gaps < DUPLICATE_DEG, DUPLICATE_COUNTS, 1.0), 0.0).sum(axis=0))


def _observability(evaluation: Evaluation, reference_distance_m: float = REFERENCE_DISTANCE_M) -> Floats:
    """At each point, (N,), Σ_i G_i Π_{k<i}(1 − G_k), 0 to 1, G = clip(d₀²/d² · cos θ cos φ, 0, 1). More is better.

    θ is the incidence at the target, φ the angle off the camera's axis. The sum telescopes to 1 − Π(1 − G_i): despite
    the form of the formula, the order of the cameras does not matter. After Bodor et al. 2007, who sum over targets
    where this takes the mean; d₀, and G = 0 where a point is not visible, are our reading.
    """
    views, seen = evaluation.views, evaluation.visible
    nearness = (reference_distance_m / np.where(seen, views.range_m, 1.0)) ** 2
    cosines = np.where(seen, views.cos_incidence, 0.0) * np.where(seen, views.cos_off_axis, 0.0)
    return np.asarray(1 - np.prod(1 - np.clip(nearness * cosines, 0.0, 1.0), axis=0))


COVERAGE_METRICS: tuple[Metric, ...] = (
    Metric.over_points("visibility-count", _counts, True, "mean of min(m, 3)/3", "read", "count what is seen"),
    Metric.over_points(
        "coverage-strength", _coverage_strength, True, "Mavrinac, Adolphus: coverage strength", "read", "count zero"
    ),
    Metric.over_points(
        "distance-weighted-views",
        _distance_weighted_views,
        True,
        "lab-camera-optimizer, base score",
        "read",
        "count what is seen",
    ),
    Metric.over_points("observability", _observability, True, "after Bodor et al. 2007", "after", "count what is seen"),
)
