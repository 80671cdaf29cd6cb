"""OpenCV's ArUco corners as detectors: none, SUBPIX, CONTOUR or APRILTAG refinement, as most people use them.

The search and its 8-bit picture are those of the default detector (`validate.markers.detect`); only the localisation
differs. OpenCV's parameters of the refinements are its defaults. OpenCV states no covariance, and these state none.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from pss.hints import AnyFloats, Floats
from validate.markers.detect import find_markers
from validate.markers.detector import SQUARE_TAGS, Detections, Targets

__all__ = ["APRILTAG_OFFSET_PX", "ARUCO", "ArucoCorners", "crossing"]

APRILTAG_OFFSET_PX = 0.45
"""px, in x and in y, by which corners of OpenCV's APRILTAG refinement lie beyond OpenCV's own convention of pixels.

Measured on exactly drawn markers of 6 to 18 px a module at 3,000 electrons of white: 0.41 to 0.44 px where they are in
focus, 0.46 to 0.47 px with a circle of confusion of 3 px. The constant is between; what it leaves is within 0.04 px.
"""


@dataclass(frozen=True)
class ArucoCorners:
    """Centres where the diagonals of OpenCV's corners cross: the image of the square's centre under a homography.

    Attributes:
        name: of the detector.
        refinement: OpenCV's constant, `cv2.aruco.CORNER_REFINE_…`.
        offset_px: px, constant offset of the corners in x and in y, which is subtracted.
    """

    name: str
    refinement: int
    offset_px: float = 0.0
    targets: tuple[str, ...] = (SQUARE_TAGS,)

    def detect(self, image: NDArray[np.uint16], sensor: ImageSensor, targets: Targets) -> Detections:
        """All decoded markers of the dictionary; the sensor is not used."""
        found = find_markers(image, targets.dictionary, self.refinement)
        centres_px = crossing(found.corners_px) - self.offset_px
        finite = np.isfinite(centres_px).all(axis=1)
        return Detections(found.ids[finite], centres_px[finite])


def crossing(corners_px: AnyFloats) -> Floats:
    """px, where the diagonals of quadrilaterals (K, 4, 2) cross, (K, 2); nan or infinite where they are parallel."""
    first, second, third, fourth = np.moveaxis(np.asarray(corners_px, dtype=float), 1, 0)
    along, across = third - first, second - fourth
    between = second - first
    with np.errstate(divide="ignore", invalid="ignore"):
        share = _cross(between, across) / _cross(along, across)
        return np.asarray(first + share[:, None] * along)


def _cross(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


ARUCO = (
    ArucoCorners("aruco", cv2.aruco.CORNER_REFINE_NONE),
    ArucoCorners("aruco-subpix", cv2.aruco.CORNER_REFINE_SUBPIX),
    ArucoCorners("aruco-contour", cv2.aruco.CORNER_REFINE_CONTOUR),
    ArucoCorners("aruco-apriltag", cv2.aruco.CORNER_REFINE_APRILTAG, APRILTAG_OFFSET_PX),
)
"""The built-in detectors of this kind."""
