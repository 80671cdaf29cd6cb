"""A detector of one's own: OpenCV's ArUco search with its stock parameters."""

from dataclasses import dataclass

import cv2
import numpy as np

from validate import Detections


@dataclass(frozen=True)
class StockAruco:
    """Centres where the diagonals of OpenCV's unrefined corners cross; it estimates no covariance."""

    name: str = "stock-aruco"
    targets: tuple[str, ...] = ("square-tags",)

    def detect(self, image, sensor, targets):
        """All markers of the dictionary in a capture (height, width), in digital numbers."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, targets.dictionary))
        light = image.astype(float) - sensor.black_level_dn
        picture = np.clip(light * (255 / max(light.max(), 1)), 0, 255).astype(np.uint8)
        corners, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)
        centres = []
        for quad in corners:
            a, b, c, d = quad.reshape(4, 2).astype(float)
            along, _ = np.linalg.solve(np.column_stack([c - a, b - d]), b - a)
            centres.append(a + along * (c - a))
        return Detections(
            np.array([] if ids is None else ids, dtype=int).ravel(),
            np.array(centres).reshape(-1, 2),
        )


stock_aruco = StockAruco()
