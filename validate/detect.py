"""Find and decode the markers in one noisy capture. The image is all that is known here: no pose, no truth, no hint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from render.markers import predefined_dictionary

__all__ = ["Found", "find_markers"]

Floats = NDArray[np.floating]

# The brightest 0.1 % (lamps, glints) may saturate in the detector's 8-bit copy; the markers must not.
BRIGHT_PERCENTILE = 99.9
# A light blur keeps the noise of dim captures from breaking the borders into pieces. It only serves the search: the
# corners are a start, and the localisation reads the capture as it is.
SEARCH_BLUR_PX = 0.8
# The detector's default asks a side of 3 % of the image: 38 px at 1280, too large for a marker at a wide zoom.
SMALLEST_PERIMETER_RATE = 0.012


@dataclass(frozen=True, eq=False)
class Found:
    """Markers found in one capture: `ids` (K,), `corners_px` (K, 4, 2) from top left clockwise as printed."""

    ids: NDArray[np.int64]
    corners_px: Floats


@cache
def _detector(dictionary: str) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    parameters.minMarkerPerimeterRate = SMALLEST_PERIMETER_RATE
    return cv2.aruco.ArucoDetector(predefined_dictionary(dictionary), parameters)


def find_markers(capture_dn: NDArray[np.uint16], dictionary: str) -> Found:
    """Find the markers of `dictionary` in a capture (height, width) of digital numbers.

    A number that is found twice in one capture names at least one wrong place: both are left out.
    """
    dark, bright = np.percentile(capture_dn[::4, ::4], [0.5, BRIGHT_PERCENTILE])
    # The square root gives photon noise the same height in light and shade, and leaves room above for lamps.
    root = cv2.sqrt(cv2.GaussianBlur(np.maximum(capture_dn.astype(np.float32) - dark, 0), (0, 0), SEARCH_BLUR_PX))
    eight_bit = cv2.convertScaleAbs(root, alpha=255.0 / max(np.sqrt(bright - dark), 1.0))
    corners, ids, _ = _detector(dictionary).detectMarkers(eight_bit)
    if ids is None or len(ids) == 0:
        return Found(np.zeros(0, dtype=np.int64), np.zeros((0, 4, 2)))
    numbers = np.ravel(ids).astype(np.int64)
    quads = np.array(corners, dtype=float).reshape(-1, 4, 2)
    values, counts = np.unique(numbers, return_counts=True)
    once = np.isin(numbers, values[counts == 1])
    return Found(numbers[once], quads[once])
