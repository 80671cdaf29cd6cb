"""Fit the limits of detection to who was found on training views: the smallest module and the largest blur.

Only targets count that are in view as a whole with nothing before them: the rest is geometry and needs no fit. The
limits are those that classify most detections and misses correctly. The result is evaluated on other views.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pss import ImageSensor, RangeError
from pss.cameras.views import Views
from pss.hints import Floats
from pss.surrogates import Shape
from pss.visibility.points import visible_in
from pss.visibility.targets import TARGET_VISIBILITY, blur_modules, narrow_side_px

__all__ = ["FittedLimits", "fit_limits", "limits_of_targets", "whole_targets"]


# Steps finer than what some hundred markers near a limit can resolve.
SMALLEST_MODULES_PX = np.arange(10, 61) / 10
LARGEST_BLURS = np.arange(4, 61) / 20


@dataclass(frozen=True)
class FittedLimits:
    """The limits, and how they classify the pairs of view and marker that they were fitted to.

    Attributes:
        found_within, found_beyond: share of the trials in which markers within and beyond the limits were found.
        pairs: how many, within and beyond.
    """

    smallest_module_px: float
    largest_blur_modules: float
    found_within: float
    found_beyond: float
    pairs: tuple[int, int]

    @property
    def limits(self) -> dict[str, float]:
        """As a calibration has them."""
        return {
            "smallest_module_px": self.smallest_module_px,
            "largest_blur_modules": self.largest_blur_modules,
        }

    @property
    def provenance(self) -> dict[str, int | float]:
        """The record of the fit in a calibration's file."""
        return {
            "markers_within_limits": self.pairs[0],
            "found_within_limits": self.found_within,
            "markers_beyond_limits": self.pairs[1],
            "found_beyond_limits": self.found_beyond,
        }


def fit_limits(
    views: Views, occluders: tuple[Shape, ...], detection_rate: Floats, sensor: ImageSensor | None = None
) -> FittedLimits:
    """The limits that classify most of the trials correctly.

    Args:
        views: of the training cameras, with normals and appearance.
        detection_rate: share of the trials in which each view found each marker, (V, N).
        sensor: whose exposure blurs what moves; None leaves motion out.

    Raises:
        RangeError: no target is seen as a whole.
    """
    return limits_of_targets(*whole_targets(views, occluders, detection_rate, sensor))


def whole_targets(
    views: Views,
    occluders: tuple[Shape, ...],
    detection_rate: Floats,
    sensor: ImageSensor | None = None,
) -> tuple[Floats, Floats, Floats]:
    """The targets that are in view as a whole: their modules' narrow sides in px, blurs in modules and rates, (M,)."""
    whole = visible_in(views, occluders, TARGET_VISIBILITY)
    return narrow_side_px(views)[whole], blur_modules(views, sensor)[whole], detection_rate[whole]


def limits_of_targets(module: Floats, blur: Floats, rate: Floats) -> FittedLimits:
    """`fit_limits` of targets that are known to be in view as a whole: what `whole_targets` gives, or several of it.

    Raises:
        RangeError: there is none.
    """
    if not len(module):
        raise RangeError("no view has a whole marker in it; allowed: at least one to fit limits of detection to")
    # Classified correctly: found within the limits, missed beyond them.
    large, sharp = module >= SMALLEST_MODULES_PX[:, None], blur <= LARGEST_BLURS[:, None]
    gain = (large * (2 * rate - 1)) @ sharp.T.astype(float)
    # Several are alike where no marker lies between them: the middle one, first of the modules, then of the blurs.
    rows, columns = np.nonzero(gain >= gain.max() - 1e-9)
    row = int(np.median(np.unique(rows)))
    row = int(rows[np.abs(rows - row).argmin()])
    column = int(np.sort(columns[rows == row])[(rows == row).sum() // 2])
    within = large[row] & sharp[column]
    return FittedLimits(
        float(SMALLEST_MODULES_PX[row]),
        float(LARGEST_BLURS[column]),
        float(rate[within].mean()) if within.any() else float("nan"),
        float(rate[~within].mean()) if (~within).any() else float("nan"),
        (int(within.sum()), int((~within).sum())),
    )
