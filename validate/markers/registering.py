"""The default detector: the project's search, then registration of each marker's ideal image to the capture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from validate.markers.detect import find_markers
from validate.markers.detector import SQUARE_TAGS, Detections, Targets
from validate.markers.localise import localise

__all__ = ["Registering"]


@dataclass(frozen=True)
class Registering:
    """Registration of square tags, with the covariance of each centre (`validate.markers.localise`)."""

    name: str = "registration"
    targets: tuple[str, ...] = (SQUARE_TAGS,)

    def detect(self, image: NDArray[np.uint16], sensor: ImageSensor, targets: Targets) -> Detections:
        """The markers of `targets` that are found and localised; the others count as unexpected."""
        found = find_markers(image, targets.dictionary)
        expected = set(targets.ids)
        ids, centres, covariances, unexpected_ids = [], [], [], 0
        for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
            if marker not in expected:
                unexpected_ids += 1
                continue
            localised = localise(image, corners, marker, targets.dictionary, sensor)
            if localised is not None:
                ids.append(marker)
                centres.append(localised.centre_px)
                covariances.append(localised.covariance_px2)
        return Detections(
            np.array(ids, dtype=np.int64),
            np.array(centres, dtype=float).reshape(-1, 2),
            np.array(covariances, dtype=float).reshape(-1, 2, 2),
            unexpected_ids,
        )
