"""The markers found in one capture, for whoever has an image: from this project's renders or from a camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss import RangeError, ShapeError
from pss.hints import Floats, Integers
from pss.inputs import having
from scenes import Scene
from validate.markers.view_measurement import measure_capture

__all__ = ["Detections", "detect"]


@dataclass(frozen=True, eq=False)
class Detections:
    """K markers found in one capture, in the order of the scene's markers.

    Attributes:
        ids: (K,), their numbers in the dictionary.
        centres_px: px, (K, 2), centres x and y; the centre of the top left pixel is (0, 0).
        covariance_px2: px², (K, 2, 2), of each centre, from its own pixels and the sensor's noise.
        unexpected_ids: number of further detections, of markers that the scene does not have.
    """

    ids: Integers
    centres_px: Floats
    covariance_px2: Floats
    unexpected_ids: int = 0

    def __len__(self) -> int:
        return len(self.ids)


def detect(image: ArrayLike, scene: Scene) -> Detections:
    """Find the scene's markers in a capture, and localise their centres.

    Of the scene, only the dictionary, the markers' numbers and the sensor are used: where cameras and markers are is
    not known to the detector. It is the one that runs measure with: OpenCV's search on a picture with even
    contrast, then registration of each marker's ideal image to the capture.

    Args:
        image: digital numbers, (height, width), whole numbers from 0 to 65535 with the sensor's black level and bits,
            such as `render.View.capture()` returns.
        scene: whose markers are searched for.

    Raises:
        ShapeError: the image has other than two dimensions, or no pixel.
        RangeError: it holds other than whole numbers from 0 to 65535.
    """
    having(scene, "state", "scene", "a scene, such as scenes.load returns")
    state = scene.state
    ids = np.array([marker.id for marker in state.markers], dtype=np.int64)
    pixels, covariance, unexpected_ids = measure_capture(
        _as_capture(image), state.print.dictionary, tuple(ids.tolist()), scene.sensor
    )
    found = np.isfinite(pixels[:, 0])
    return Detections(ids[found], pixels[found], covariance[found], unexpected_ids)


def _as_capture(image: ArrayLike) -> NDArray[np.uint16]:
    given = np.asarray(image)
    if given.ndim != 2 or given.size == 0:
        raise ShapeError(f"image {given.shape}; allowed: (height, width), at least one pixel")
    if given.dtype.kind not in "iu":
        raise RangeError(f"image of {given.dtype}; allowed: whole numbers from 0 to 65535, such as uint16")
    if given.min() < 0 or given.max() > np.iinfo(np.uint16).max:
        raise RangeError(f"image from {given.min()} to {given.max()}; allowed: 0 to 65535")
    return given.astype(np.uint16, copy=False)
