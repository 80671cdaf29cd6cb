"""3D points of the markers that several cameras have found, each in one capture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pss import PTZCamera, ShapeError
from pss.hints import Floats, Integers
from validate.markers.detector import Detections
from validate.markers.view_measurement import EQUAL_SIGMA_PX
from validate.points.triangulate import triangulate as triangulate_trials

__all__ = ["Points", "triangulate"]


@dataclass(frozen=True, eq=False)
class Points:
    """K triangulated markers, in ascending order of their numbers.

    Attributes:
        ids: (K,), numbers in the dictionary.
        points_m: m, (K, 3), centres in the world.
        covariance_m2: m², (K, 3, 3), (Σ HᵀR⁻¹H)⁻¹ of the detections' own covariances.
        views: (K,), number of views used, two or more.
    """

    ids: Integers
    points_m: Floats
    covariance_m2: Floats
    views: Integers

    def __len__(self) -> int:
        return len(self.ids)


def triangulate(cameras: Sequence[PTZCamera], detections: Sequence[Detections]) -> Points:
    """Triangulate the markers that two or more cameras found: maximum likelihood, with the detections' covariances.

    Detections without a covariance all have the same weight, that of `EQUAL_SIGMA_PX`.

    Args:
        cameras: C of them.
        detections: C, of each camera's capture (`detect`), in the same order.

    Returns:
        Markers found by two or more cameras whose views agree (`validate.points.triangulate.triangulate`).

    Raises:
        ShapeError: not as many detections as cameras, or none.
    """
    if len(cameras) != len(detections) or not cameras:
        raise ShapeError(f"{len(cameras)} cameras and {len(detections)} detections; allowed: as many, one or more")
    ids = np.unique(np.concatenate([found.ids for found in detections]))
    pixels = np.full((len(cameras), 1, len(ids), 2), np.nan)
    covariance = np.full((len(cameras), 1, len(ids), 2, 2), np.nan)
    for number, found in enumerate(detections):
        places = np.searchsorted(ids, found.ids)
        pixels[number, 0, places] = found.centres_px
        stated = found.covariance_px2
        covariance[number, 0, places] = EQUAL_SIGMA_PX**2 * np.eye(2) if stated is None else stated
    if not ids.size:
        return Points(ids, np.empty((0, 3)), np.empty((0, 3, 3)), ids)
    made = triangulate_trials(cameras, pixels, covariance)
    known = np.isfinite(made.points_m[0, :, 0])
    return Points(ids[known], made.points_m[0, known], made.covariance_m2[0, known], made.views[0, known])
