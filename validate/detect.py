"""Find and decode the markers in one noisy capture. The image is all that is known here: no pose, no truth, no hint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from render.markers import predefined_dictionary

__all__ = ["SEARCHES", "Found", "Search", "find_markers"]

Floats = NDArray[np.floating]

# The brightest 0.1 % (lamps, glints) may saturate in the detector's 8-bit copy; the markers must not.
BRIGHT_PERCENTILE = 99.9
# The detector's default asks a side of 3 % of the image: 38 px at 1280, too large for a marker at a wide zoom.
SMALLEST_PERIMETER_RATE = 0.012
# The same marker found at two blurs has its corners within this; farther apart they are two things.
SAME_MARKER_PX = 3.0


@dataclass(frozen=True)
class Search:
    """How markers are looked for. It only serves the search: localisation reads the capture as it is.

    Attributes:
        blurs_px: σ of the blurs at which the capture is searched, the first that finds a marker gives its corners.
            A light blur keeps the noise of dim captures from breaking the borders into pieces; small markers need less.
        pixels_per_cell: across a module, of the picture that a candidate is decoded from.
        ignored_margin: part of a module at each of its sides that is left out there.
    """

    blurs_px: tuple[float, ...] = (0.8,)
    pixels_per_cell: int = 4
    ignored_margin: float = 0.13


SEARCHES = {"plain": Search(), "thorough": Search((0.8, 0.4), pixels_per_cell=8, ignored_margin=0.25)}
"""By the name that sweep files give them: "thorough" finds more small and slanted markers, in twice the time."""


@dataclass(frozen=True, eq=False)
class Found:
    """Markers found in one capture: `ids` (K,), `corners_px` (K, 4, 2) from top left clockwise as printed."""

    ids: NDArray[np.int64]
    corners_px: Floats


@cache
def _detector(dictionary: str, search: Search) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    parameters.minMarkerPerimeterRate = SMALLEST_PERIMETER_RATE
    parameters.perspectiveRemovePixelPerCell = search.pixels_per_cell
    parameters.perspectiveRemoveIgnoredMarginPerCell = search.ignored_margin
    return cv2.aruco.ArucoDetector(predefined_dictionary(dictionary), parameters)


def find_markers(capture_dn: NDArray[np.uint16], dictionary: str, search: Search = SEARCHES["plain"]) -> Found:
    """Find the markers of `dictionary` in a capture (height, width) of digital numbers.

    A number that is found at two places in one capture names at least one wrong place: both are left out.
    """
    dark, bright = np.percentile(capture_dn[::4, ::4], [0.5, BRIGHT_PERCENTILE])
    lit = np.maximum(capture_dn.astype(np.float32) - dark, 0)
    found: dict[int, Floats] = {}
    twice: set[int] = set()
    for blur_px in search.blurs_px:
        # The square root gives photon noise the same height in light and shade, and leaves room above for lamps.
        root = cv2.sqrt(cv2.GaussianBlur(lit, (0, 0), blur_px))
        eight_bit = cv2.convertScaleAbs(root, alpha=255.0 / max(np.sqrt(bright - dark), 1.0))
        corners, ids, _ = _detector(dictionary, search).detectMarkers(eight_bit)
        numbers = [] if ids is None else np.ravel(ids).tolist()
        twice |= {number for number in numbers if numbers.count(number) > 1}
        for number, quad in zip(numbers, np.array(corners, dtype=float).reshape(-1, 4, 2), strict=True):
            before = found.setdefault(number, quad)
            if np.abs(before - quad).max() > SAME_MARKER_PX:
                twice.add(number)
    kept = [number for number in found if number not in twice]
    return Found(np.array(kept, dtype=np.int64), np.array([found[n] for n in kept], dtype=float).reshape(-1, 4, 2))
