"""The markers found in one capture, for whoever has an image: from this project's renders or from a camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss import RangeError, ShapeError
from pss.inputs import having
from scenes import Scene
from validate.markers.detector import Detections, Targets
from validate.markers.detector_table import DEFAULT_DETECTOR
from validate.markers.view_measurement import detections_in

__all__ = ["detect"]


def detect(image: ArrayLike, scene: Scene, detector: str = DEFAULT_DETECTOR) -> Detections:
    """Find the scene's markers in a capture, and localise their centres.

    Of the scene, only the dictionary, the markers' numbers and the sensor are used: where cameras and markers are is
    not known to the detector. The default is the one that runs measure with: OpenCV's search on a picture with even
    contrast, then registration of each marker's ideal image to the capture.

    Args:
        image: digital numbers, (height, width), whole numbers from 0 to 65535 with the sensor's black level and bits,
            such as `render.View.capture()` returns.
        scene: whose markers are searched for.
        detector: name of a built-in detector, or of one that an installed package adds (docs/own-detector.md).

    Returns:
        The markers found, in the order of the scene's.

    Raises:
        ShapeError: the image has other than two dimensions, or no pixel.
        RangeError: it holds other than whole numbers from 0 to 65535, or there is no such detector.
    """
    having(scene, "state", "scene", "a scene, such as scenes.load returns")
    state = scene.state
    targets = Targets(state.print.dictionary, tuple(int(marker.id) for marker in state.markers))
    return detections_in(_as_capture(image), targets, scene.sensor, detector)


def _as_capture(image: ArrayLike) -> NDArray[np.uint16]:
    given = np.asarray(image)
    if given.ndim != 2 or given.size == 0:
        raise ShapeError(f"image {given.shape}; allowed: (height, width), at least one pixel")
    if given.dtype.kind not in "iu":
        raise RangeError(f"image of {given.dtype}; allowed: whole numbers from 0 to 65535, such as uint16")
    if given.min() < 0 or given.max() > np.iinfo(np.uint16).max:
        raise RangeError(f"image from {given.min()} to {given.max()}; allowed: 0 to 65535")
    return given.astype(np.uint16, copy=False)
