"""From detections to 3D points: `cv2.triangulatePoints` as the start, then maximum likelihood over all views.

One estimator measures for all metrics and noise models alike: each detection has the weight of its own covariance, as
estimated from its image, and never that of a noise model under test. Neither the truth nor a prediction is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.stats
from numpy.typing import ArrayLike

from pss.cameras.camera import PTZCamera
from pss.errors import RangeError, ShapeError
from pss.hints import Bools, Floats, Integers
from validate.points.bundle import Bundle

__all__ = ["SMALLEST_INFORMATION_RATIO", "Triangulated", "detection_weights", "triangulate", "triangulated_points"]


VIEWS_TO_TRIANGULATE = 2
# The reprojection χ² that detections with exactly their stated covariance exceed once in a million points …
BLUNDER_TAIL = 1e-6
# … is raised to residuals five times as large. The detector's bias is frozen into the image: no covariance estimated
# from that image contains it, and rejecting detections for it would make the measured error too small. What this leaves
# to be found, a wrong id or a corner taken for another, is off by tens of standard deviations.
BLUNDER_INFLATION = 25.0
SMALLEST_INFORMATION_RATIO = 1e-13
"""Smallest over largest eigenvalue: rays closer to parallel than double precision resolves carry no depth."""


@dataclass(frozen=True, eq=False)
class Triangulated:
    """Points triangulated from C views in T trials of N points. What was not triangulated is nan, and has `views` 0.

    Attributes:
        points_m: m, (T, N, 3), maximum likelihood over the views used.
        covariance_m2: m², (T, N, 3, 3), (Σ HᵀR⁻¹H)⁻¹ of the detections' own covariances. Too small by the frozen bias.
        linear_m: m, (T, N, 3), `cv2.triangulatePoints` over the two of the views used whose rays cross most squarely.
        views: (T, N), number of views used.
        rejected: (T, N), number of detections that the reprojection test threw out; both, if the last two disagree.
        used: (C, T, N), the views used.
    """

    points_m: Floats
    covariance_m2: Floats
    linear_m: Floats
    views: Integers
    rejected: Integers
    used: Bools


def triangulate(cameras: Sequence[PTZCamera], pixels: ArrayLike, covariance: ArrayLike) -> Triangulated:
    """Triangulate every point of every trial from the views that detected it.

    A point whose reprojection χ² has a tail below `BLUNDER_TAIL` (χ² first divided by `BLUNDER_INFLATION`) loses the
    detection whose removal leaves the smallest χ², again and again; if two views are left and still disagree, it is
    not triangulated. One blunder among three views is identifiable only by its distance from the epipolar lines.

    Args:
        cameras: the C views.
        pixels: px, (C, T, N, 2), nan where a marker was not detected.
        covariance: px², (C, T, N, 2, 2), of each detection, from its own image; anything where not detected.

    Raises:
        ShapeError: the arrays do not fit each other or the cameras.
        RangeError: the covariance of a detection is not positive definite.
    """
    detected, weight = detection_weights(cameras, pixels, covariance)
    bundle, found = _located(cameras, np.asarray(pixels, dtype=float), detected, weight)
    shape = detected.shape[1:]
    covariance_m2, linear_m = np.full((*found.points_m.shape, 3), np.nan), np.full_like(found.points_m, np.nan)
    covariance_m2[found.item] = np.linalg.inv(found.information)
    linear_m[found.item] = bundle.linear(found.item, found.used[:, found.item])
    return Triangulated(
        points_m=found.points_m.reshape(*shape, 3),
        covariance_m2=covariance_m2.reshape(*shape, 3, 3),
        linear_m=linear_m.reshape(*shape, 3),
        views=found.used.sum(axis=0).reshape(shape),
        rejected=found.rejected.sum(axis=0).reshape(shape),
        used=found.used.reshape(detected.shape),
    )


def triangulated_points(
    cameras: Sequence[PTZCamera], pixels: Floats, detected: Bools, weight: Floats
) -> tuple[Floats, Bools, Integers]:
    """`points_m`, `used` and `rejected` of `triangulate`, for many configurations of the same views.

    Args:
        cameras: the C views.
        pixels: px, (C, T, N, 2).
        detected, weight: (C, T, N) and (C, T, N, 2, 2), from `detection_weights`; those of a view do not depend on
            the other views.
    """
    _, found = _located(cameras, pixels, detected, weight)
    shape = detected.shape[1:]
    return (
        found.points_m.reshape(*shape, 3),
        found.used.reshape(detected.shape),
        found.rejected.sum(axis=0).reshape(shape),
    )


@dataclass(frozen=True, eq=False)
class _Located:
    """M points of all trials: m, (M, 3); which of them are known, and 1/m² their information; views (C, M)."""

    points_m: Floats
    item: Integers
    information: Floats
    used: Bools
    rejected: Bools


def _located(cameras: Sequence[PTZCamera], pixels: Floats, detected: Bools, weight: Floats) -> tuple[Bundle, _Located]:
    views = len(detected)
    measured = np.where(detected[..., None], pixels, np.nan)
    bundle = Bundle(cameras, measured.reshape(views, -1, 2), weight.reshape(views, -1, 2, 2))
    used = detected.reshape(views, -1).copy()
    rejected = np.zeros_like(used)
    estimate = np.full((used.shape[1], 3), np.nan)
    known_information = np.zeros((used.shape[1], 3, 3))

    item = np.flatnonzero(used.sum(axis=0) >= VIEWS_TO_TRIANGULATE)
    estimate[item], chi2, known_information[item] = bundle.fit(item, used[:, item])
    item = item[chi2 > _largest_chi2(used[:, item])]
    disputed = item
    while item.size:
        given_up = item[used[:, item].sum(axis=0) <= VIEWS_TO_TRIANGULATE]
        rejected[:, given_up] |= used[:, given_up]
        used[:, given_up] = False
        item = np.setdiff1d(item, given_up, assume_unique=True)
        worst, without, chi2 = bundle.leave_one_out(item, used[:, item])
        rejected[worst, item] = True
        used[worst, item] = False
        estimate[item] = without
        item = item[chi2 > _largest_chi2(used[:, item])]

    disputed = disputed[used[:, disputed].sum(axis=0) >= VIEWS_TO_TRIANGULATE]
    _, known_information[disputed], _ = bundle.normal_equations(estimate[disputed], disputed, used[:, disputed])
    item = np.flatnonzero(used.sum(axis=0) >= VIEWS_TO_TRIANGULATE)
    information = known_information[item]
    eigenvalues = np.linalg.eigvalsh(information)
    solid = eigenvalues[:, 0] > SMALLEST_INFORMATION_RATIO * eigenvalues[:, -1]
    item, information = item[solid], information[solid]

    known = np.zeros(used.shape[1], dtype=bool)
    known[item] = True
    used &= known
    estimate[~known] = np.nan
    return bundle, _Located(estimate, item, information, used, rejected)


def detection_weights(cameras: Sequence[PTZCamera], pixels: ArrayLike, covariance: ArrayLike) -> tuple[Bools, Floats]:
    """Which views detected, (C, T, N), and 1/px² the inverse covariances R⁻¹, (C, T, N, 2, 2), 0 where they did not.

    Raises:
        ShapeError, RangeError: as in `triangulate`.
    """
    measured, noise = np.asarray(pixels, dtype=float), np.asarray(covariance, dtype=float)
    if measured.ndim != 4 or measured.shape[-1] != 2 or len(measured) != len(cameras):
        raise ShapeError(f"pixels has shape {measured.shape}; allowed is ({len(cameras)}, T, N, 2), one row a camera")
    if noise.shape != (*measured.shape, 2):
        raise ShapeError(f"covariance has shape {noise.shape}; allowed beside these pixels is {(*measured.shape, 2)}")
    detected = np.asarray(np.isfinite(measured).all(axis=-1))
    noise = np.where(detected[..., None, None], noise, np.eye(2))
    # Written so that nan counts as not positive definite.
    definite = (noise[..., 0, 0] > 0) & (noise[..., 0, 0] * noise[..., 1, 1] > noise[..., 0, 1] * noise[..., 1, 0])
    if not definite.all():
        first = tuple(int(i) for i in np.argwhere(~definite)[0])
        raise RangeError(f"covariance{list(first)} = {noise[first].tolist()}; allowed: positive definite px²")
    weight = np.zeros_like(noise)
    weight[detected] = np.linalg.inv(noise[detected])
    return detected, weight


def _largest_chi2(used: Bools) -> Floats:
    """Reprojection χ² that a point may have with the views `used` (C, S); (S,). 2 pixels a view less 3 coordinates."""
    return _chi2_limits(len(used))[used.sum(axis=0)]


@cache
def _chi2_limits(most: int) -> Floats:
    """By the number of views, from 0 to `most`."""
    views = np.arange(most + 1)
    return np.asarray(BLUNDER_INFLATION * scipy.stats.chi2.isf(BLUNDER_TAIL, np.maximum(2 * views - 3, 1)))
