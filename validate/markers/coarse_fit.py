"""Align a decoded marker's ideal image with the capture to a small part of a pixel, and estimate its blur.

Inverse compositional registration: the capture is drawn onto the marker's own grid, where the ideal image and what
moves it never change, so that the least squares solution of a step is one product with a matrix made once a marker.
Bilinear drawing and equal weights leave a bias of a hundredth of a pixel and twice the noise: a start, not a result.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from pss.hints import AnyFloats, Images
from validate.markers.marker_image import PIXEL_VARIANCE_PX2, sharp_image
from validate.markers.registration import Fit, local_scale, marker_fields, moved

__all__ = ["coarse_fit"]


# Grid points a module, and how far beyond the border the grid reaches.
GRID_PER_MODULE = 5
MARGIN_MODULES = 0.5
# Blurs as σ in modules. The first is wide, to catch corners that are a pixel off; then comes the one that fits best.
FIRST_BLUR = 3
BLURS_MODULES = (0.03, 0.07, 0.12, 0.18, 0.25, 0.33, 0.42)
FIRST_STEPS, STEPS = 4, 2
# px², taken for the blur of an image that is sharper than its pixels let see.
SHARPEST_PX2 = 0.02


@lru_cache(maxsize=64)
def _grid(half: float) -> tuple[Images, Images]:
    """The grid's (u, v) in modules, (G²,) each."""
    count = round(2 * (half + MARGIN_MODULES) * GRID_PER_MODULE)
    along = ((np.arange(count) - (count - 1) / 2) / GRID_PER_MODULE).astype(np.float32)
    v, u = np.meshgrid(along, along, indexing="ij")
    return u.ravel(), v.ravel()


@lru_cache(maxsize=4096)
def _solver(dictionary: str, marker_id: int, blur: int) -> Images:
    """From grey values on the grid to the moves' parameters times gain, gain and offset: (10, G²)."""
    image = sharp_image(dictionary, marker_id, BLURS_MODULES[blur])
    u, v = _grid(image.half)
    seen = image.at(u, v)
    half = np.float32(image.half)
    design = np.empty((10, len(u)), dtype=np.float32)
    marker_fields(seen.by_u * half, seen.by_v * half, u / half, v / half, design)
    design[8], design[9] = seen.value, 1
    return np.linalg.pinv(design.T.astype(float)).astype(np.float32)


@lru_cache(maxsize=1024)
def _normalised(dictionary: str, marker_id: int) -> Images:
    """The ideal images of all blurs as unit vectors about their mean, (B, G²): their products are correlations."""
    images = [sharp_image(dictionary, marker_id, blur) for blur in BLURS_MODULES]
    rows = np.array([image.at(*_grid(image.half)).value for image in images])
    rows -= rows.mean(axis=1, keepdims=True)
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def coarse_fit(capture_dn: NDArray[np.generic], start: AnyFloats, marker_id: int, dictionary: str) -> Fit | None:
    """Homography and blur of a marker near `start` (3, 3), modules about its centre to pixels; None if it gets lost.

    Args:
        capture_dn: digital numbers, (height, width).
    """
    homography = start
    half = sharp_image(dictionary, marker_id, BLURS_MODULES[FIRST_BLUR]).half
    blur = FIRST_BLUR
    for number in range(FIRST_STEPS + STEPS):
        if number == FIRST_STEPS:
            blur = int(np.argmax(_normalised(dictionary, marker_id) @ _drawn(capture_dn, homography, half)))
        step = _solver(dictionary, marker_id, blur) @ _drawn(capture_dn, homography, half)
        if not step[8] > 0:
            return None
        # What moves the ideal image one way moves the capture on its grid the other way.
        homography = moved(homography, step[:8].astype(float) / -float(step[8]), half)
        if not np.isfinite(homography).all():
            return None
    px_per_module = np.sqrt(abs(np.linalg.det(local_scale(homography))))
    variance = (BLURS_MODULES[blur] * px_per_module) ** 2 - PIXEL_VARIANCE_PX2
    return Fit(homography, blur_px2=max(float(variance), SHARPEST_PX2))


def _drawn(capture_dn: NDArray[np.generic], homography: AnyFloats, half: float) -> Images:
    """Grey values of the capture at the grid's points, (G²,)."""
    count = round(2 * (half + MARGIN_MODULES) * GRID_PER_MODULE)
    middle = (count - 1) / 2
    to_modules = np.array([[1, 0, -middle], [0, 1, -middle], [0, 0, GRID_PER_MODULE]]) / GRID_PER_MODULE
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    drawn = cv2.warpPerspective(capture_dn, homography @ to_modules, (count, count), flags=flags)
    return drawn.ravel().astype(np.float32)
