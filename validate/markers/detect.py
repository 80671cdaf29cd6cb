"""Find and decode the markers in one noisy capture. The image is the only input: no pose and no true position.

The search is OpenCV's; what is prepared is the 8-bit picture that it gets. There each pixel is scaled by the white of
its neighbourhood, so that a marker in the shade has the contrast of one in the light, as far as the noise allows.
Within a marker the scale hardly changes and the picture stays linear in the light: edges stay where they are, while a
square root moves them into the black. Noise breaks borders into pieces and crowds the search with outlines: a noisy
capture is blurred a little and searched with wider windows. `benchmarks/marker_search.py` counts what is found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from pss.hints import AnyFloats, Images
from render.world.marker_print import predefined_dictionary

__all__ = ["Found", "find_markers"]


# px, side of the cells whose means are compared for the neighbourhood's white.
CELL_PX = 8
# Cells, of the brightest of which a neighbourhood's white is taken; and σ of its blur.
NEIGHBOURHOOD_CELLS, SMOOTH_CELLS = 7, 3.0
# Grey level of the neighbourhood's white where its noise is small: what is brighter than its cell has room above.
WHITE_LEVEL = 153.0
# Noise of white as a share of it. From here on white gets darker as its noise grows, so that noise keeps nearly its
# height: by this power of the light.
NOISY_SHARE, SHADE_POWER = 0.05, 0.4
# No neighbourhood counts as darker than so many σ of the dark's noise.
DARKEST_SIGMAS = 8.0
# Up to this noise of white as a share of it, the capture is searched as it is, with OpenCV's smallest windows.
QUIET_SHARE = 0.029
# Percentile of the neighbourhoods' white that decides whether a capture is noisy.
TYPICAL_PERCENTILE = 75
# px (σ); more would merge the modules of small markers.
NOISY_BLUR_PX = 0.45
# From this noise of a capture as a share of its range (of means of four pixels, between these percentiles) on, large
# markers are lost, and the capture is searched once more with a blur that finds those (px, σ), light and shade as they
# are. With twice the share, captures of the room at 40 electrons of white lost a third of what stock parameters find.
DARK_SHARE, DARK_RANGE_PERCENTILES, DARK_BLUR_PX = 0.06, (0.5, 99.9), 1.0
# A marker that both searches find has its corners within this; farther apart they are two things.
SAME_MARKER_PX = 4.0
# Noise is estimated in every so many rows.
NOISE_ROWS = 16
# The median of the absolute difference of two equal normal variables, over their σ.
MEDIAN_DIFFERENCE = 0.954
# px, of the two windows for the local mean.
QUIET_WINDOWS_PX, NOISY_WINDOWS_PX = (3, 13), (5, 15)
# Grey levels that black is below the local mean.
QUIET_THRESHOLD, NOISY_THRESHOLD = 8.0, 10.0
# px, perimeter of the smallest marker. OpenCV's default is 3 % of the image's longer side each.
SMALLEST_PERIMETER_PX = 24.0
# A module is decoded from the inner 3 × 3 of 5 × 5 samples.
SAMPLES_PER_MODULE, IGNORED_MARGIN = 5, 0.2
# px between the outermost black pixels, a module: what is narrower is decoded wrong too often.
QUIET_NARROWEST_PX, NOISY_NARROWEST_PX = 0.8, 1.0
# px: OpenCV follows no outline that touches the image's edge, and takes what surrounds a plate for its border.
RIM_PX = 32


@dataclass(frozen=True, eq=False)
class Found:
    """Markers found in one capture: `ids` (K,), `corners_px` (K, 4, 2) from top left clockwise as printed."""

    ids: NDArray[np.int64]
    corners_px: AnyFloats


@cache
def _detector(dictionary: str, longer_side_px: int, quiet: bool, refinement: int) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = refinement
    parameters.minMarkerPerimeterRate = SMALLEST_PERIMETER_PX / longer_side_px
    smallest, largest = QUIET_WINDOWS_PX if quiet else NOISY_WINDOWS_PX
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax = smallest, largest
    parameters.adaptiveThreshWinSizeStep = largest - smallest
    parameters.adaptiveThreshConstant = QUIET_THRESHOLD if quiet else NOISY_THRESHOLD
    parameters.perspectiveRemovePixelPerCell = SAMPLES_PER_MODULE
    parameters.perspectiveRemoveIgnoredMarginPerCell = IGNORED_MARGIN
    return cv2.aruco.ArucoDetector(predefined_dictionary(dictionary), parameters)


def find_markers(
    capture_dn: NDArray[np.uint16], dictionary: str, refinement: int = cv2.aruco.CORNER_REFINE_NONE
) -> Found:
    """Find the markers of `dictionary` in a capture (height, width) of digital numbers.

    `refinement` is OpenCV's, of the corners (`cv2.aruco.CORNER_REFINE_…`).

    A number that is found at two places in one capture names at least one wrong place: both are left out.
    """
    found: dict[int, AnyFloats] = {}
    twice: set[int] = set()
    for picture, quiet in _pictures(capture_dn):
        numbers, corners = _searched(picture, dictionary, quiet, refinement)
        twice |= {number for number in numbers if numbers.count(number) > 1}
        for number, quad in zip(numbers, corners, strict=True):
            if np.abs(found.setdefault(number, quad) - quad).max() > SAME_MARKER_PX:
                twice.add(number)
    kept = [number for number in found if number not in twice]
    return Found(np.array(kept, dtype=np.int64), np.array([found[n] for n in kept], dtype=float).reshape(-1, 4, 2))


def _searched(picture: NDArray[np.uint8], dictionary: str, quiet: bool, refinement: int) -> tuple[list[int], AnyFloats]:
    """Numbers of K markers in a picture, and their corners, (K, 4, 2)."""
    rimmed = cv2.copyMakeBorder(picture, *[RIM_PX] * 4, borderType=cv2.BORDER_REPLICATE)
    quads, ids, _ = _detector(dictionary, max(rimmed.shape), quiet, refinement).detectMarkers(rimmed)
    numbers = np.array([] if ids is None else ids, dtype=np.int64).ravel()
    corners = np.array(quads, dtype=float).reshape(-1, 4, 2) - RIM_PX
    modules = predefined_dictionary(dictionary).markerSize + 2
    inside = ((corners >= 0) & (corners < picture.shape[::-1])).all(axis=(1, 2))
    narrowest_px = modules * (QUIET_NARROWEST_PX if quiet else NOISY_NARROWEST_PX)
    kept = inside & (_narrowest_px(corners) >= narrowest_px)
    return numbers[kept].tolist(), corners[kept]


def _pictures(capture_dn: NDArray[np.uint16]) -> Iterator[tuple[NDArray[np.uint8], bool]]:
    """The 8-bit picture to search, and whether its noise is small; of a dark capture another one."""
    lit = capture_dn.astype(np.float32)
    height, width = lit.shape
    halved = cv2.resize(lit, (max(width // 2, 1), max(height // 2, 1)), interpolation=cv2.INTER_AREA)
    # The darkest four pixels: a share of the image would take all of a few small markers on white for light.
    dark = halved.min()
    lit, halved = lit - dark, halved - dark
    photon_dn, dark_noise_dn, noise_dn = _noise(lit)
    white = np.maximum(_neighbourhood_white(halved, (width, height)), DARKEST_SIGMAS * dark_noise_dn)
    quiet = bool(photon_dn <= QUIET_SHARE**2 * np.percentile(white, TYPICAL_PERCENTILE))
    blurred = lit if quiet else cv2.GaussianBlur(lit, (0, 0), NOISY_BLUR_PX)
    # Where the noise of white is the share of it that counts as noisy.
    noisy_dn = photon_dn / NOISY_SHARE**2
    scale = (WHITE_LEVEL / np.maximum(white, white * (noisy_dn / white) ** SHADE_POWER)).astype(np.float32)
    scaled = cv2.multiply(blurred, cv2.resize(scale, (width, height), interpolation=cv2.INTER_LINEAR))
    yield cv2.convertScaleAbs(np.maximum(scaled, 0, out=scaled)), quiet

    lowest, highest = np.percentile(halved[::4, ::4], DARK_RANGE_PERCENTILES)
    if noise_dn > DARK_SHARE * (highest - lowest):
        soft = cv2.GaussianBlur(lit, (0, 0), DARK_BLUR_PX)
        lowest, highest = np.percentile(soft[::8, ::8], DARK_RANGE_PERCENTILES)
        soft = np.maximum(soft - np.float32(lowest), 0)
        yield cv2.convertScaleAbs(soft, alpha=255 / max(highest - lowest, 1.0)), False


def _noise(lit: Images) -> tuple[float, float, float]:
    """DN, the noise's variance per light, its σ in the dark and in the light, from neighbours in some rows.

    The read noise is counted with the light's: in dim captures the first is larger than the gain.
    """
    rows = lit[::NOISE_ROWS]
    light, difference = rows[:, 1:].ravel(), np.abs(rows[:, 1:] - rows[:, :-1]).ravel()
    if not light.size:
        return 1.0, 1.0, 1.0
    darker, middle = np.percentile(light[::4], (15, 50))
    bright = light >= middle
    of_bright, of_dark = (float(np.median(difference[part])) / MEDIAN_DIFFERENCE for part in (bright, light <= darker))
    # A capture without noise, or all of it saturated, has steps of a whole number at least.
    return max(of_bright**2 / max(float(np.median(light[bright])), 1.0), 1e-3), max(of_dark, 0.3), of_bright


def _neighbourhood_white(halved: Images, size_px: tuple[int, int]) -> Images:
    """DN, the brightest cell about each cell, (rows, columns) of cells of `CELL_PX`."""
    columns, rows = (max(length // CELL_PX, 1) for length in size_px)
    means = cv2.resize(halved, (columns, rows), interpolation=cv2.INTER_AREA)
    brightest = cv2.dilate(means, np.ones((NEIGHBOURHOOD_CELLS, NEIGHBOURHOOD_CELLS), np.uint8))
    return np.asarray(cv2.GaussianBlur(brightest, (0, 0), SMOOTH_CELLS))


def _narrowest_px(corners_px: AnyFloats) -> AnyFloats:
    """px, area over the longest side of quadrilaterals (K, 4, 2): their width, slanted or not."""
    first, second = corners_px[:, 2] - corners_px[:, 0], corners_px[:, 3] - corners_px[:, 1]
    area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    sides = np.linalg.norm(np.roll(corners_px, -1, axis=1) - corners_px, axis=2)
    return np.asarray(area / np.maximum(sides.max(axis=1), 1e-9))
