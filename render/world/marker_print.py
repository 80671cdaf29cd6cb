"""The print of the markers: the black and white modules of an OpenCV dictionary, and one texture for all plates."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats
from render.world.state import MarkerPrint

__all__ = ["pattern", "plate_texture", "predefined_dictionary"]


# Texels per module: enough for a shading gradient of 10 % across a plate in steps of 0.2 % of the light.
TEXELS_PER_MODULE = 8


@cache
def predefined_dictionary(name: str) -> cv2.aruco.Dictionary:
    """OpenCV's predefined dictionary called `name`, such as "DICT_4X4_100"."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


@cache
def _pattern(dictionary: str, marker_id: int) -> NDArray[np.bool_]:
    modules = predefined_dictionary(dictionary).markerSize + 2
    image = cv2.aruco.generateImageMarker(predefined_dictionary(dictionary), marker_id, modules, borderBits=1)
    white = np.asarray(image) > 127
    white.setflags(write=False)
    return white


def pattern(dictionary: str, marker_id: int) -> NDArray[np.bool_]:
    """Whether each module of a marker is white, the black border included; square, first row at the top."""
    return _pattern(dictionary, int(marker_id))


def plate_texture(style: MarkerPrint, marker_id: int, corner_irradiance: Floats) -> NDArray[np.float32]:
    """W/(m² sr) of a plate, print times light, first row at the top; square.

    Args:
        corner_irradiance: W/m² at the plate's corners, (4,): top left, top right, bottom right, bottom left.
    """
    black_and_white = pattern(style.dictionary, marker_id)
    texels = len(black_and_white) * TEXELS_PER_MODULE
    margin = round(style.quiet_zone_modules * TEXELS_PER_MODULE)
    fine = np.kron(black_and_white, np.ones((TEXELS_PER_MODULE, TEXELS_PER_MODULE)))
    albedo = np.where(np.pad(fine, margin, constant_values=1.0) > 0, style.white_albedo, style.black_albedo)
    across = (np.arange(texels + 2 * margin) + 0.5) / (texels + 2 * margin)
    top_left, top_right, bottom_right, bottom_left = corner_irradiance
    top = top_left + (top_right - top_left) * across
    bottom = bottom_left + (bottom_right - bottom_left) * across
    irradiance = top + (bottom - top) * across[:, None]
    return (albedo * irradiance / np.pi).astype(np.float32)
