"""Pictures of many markers, drawn without the renderer: what a search finds in every light, size, turn and tilt."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from render.world.marker_print import pattern

__all__ = ["DICTIONARY", "IDS", "PICTURE_PX", "Drawing", "edge_pictures", "homography", "paste", "pictures"]

Floats = NDArray[np.floating]

DICTIONARY = "DICT_4X4_100"
IDS = 100
# px, (width, height): the room's cameras have as many.
PICTURE_PX = (1280, 960)
# Of the light from white paper.
BLACK, SURROUND, DARK_SURROUND = 0.05, 0.5, 0.2
# Distance of the lens from the marker's centre, in sides of the marker: near enough for a perspective that shows.
DISTANCE_SIDES = 12.0
# Samples along a pixel's side; of markers larger than this, fewer, as their edges pass more pixels at random.
SAMPLES, LARGE_PX, LARGE_SAMPLES = 8, 100, 3


@dataclass(frozen=True, eq=False)
class Drawing:
    """A picture of markers, each of another number.

    Attributes:
        light: share of white paper's light, (height, width).
        ids: (K,).
        corners_px: corners of the black border, from top left clockwise as printed, (K, 4, 2).
    """

    light: NDArray[np.float32]
    ids: NDArray[np.int64]
    corners_px: Floats


def homography(side_px: float, centre_px: Sequence[float], turn_deg: float, tilt_deg: float) -> Floats:
    """Sides of a marker about its centre to pixels, (3, 3): tilted about the image's x axis after a turn in its plane.

    Args:
        side_px: px, of the black border, at a tilt of 0.
    """
    turn, tilt = math.radians(turn_deg), math.radians(tilt_deg)
    x, y = centre_px
    turned = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    tilted = np.array([[1, 0, 0], [0, math.cos(tilt), 0], [0, math.sin(tilt), DISTANCE_SIDES]])
    focal = side_px * DISTANCE_SIDES
    return np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]]) @ tilted @ turned


def paste(
    light: NDArray[np.float32], marker_id: int, to_px: Floats, blur_px: float = 0.0, dictionary: str = DICTIONARY
) -> Floats:
    """Draw a marker with one white module around it into a picture; return its corners (4, 2).

    Args:
        to_px: sides of the marker about its centre to pixels, (3, 3).
        blur_px: px (σ), a Gaussian blur of the marker and its plate.
    """
    white = pattern(dictionary, marker_id)
    modules = len(white)
    reach = 0.5 + 1 / modules
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    outline = cv2.perspectiveTransform(reach * square[None], to_px)[0]
    room = 2 + math.ceil(4 * blur_px)
    height, width = light.shape
    # Beyond the picture's edge nothing is drawn, and so nothing has to be kept.
    left, top = np.maximum(np.floor(outline.min(axis=0)).astype(int) - room, 0)
    right, bottom = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + room + 1, (width, height))
    size = np.linalg.norm(outline[1] - outline[0])
    samples = SAMPLES if size < LARGE_PX else LARGE_SAMPLES
    x = (np.arange((right - left) * samples) + 0.5) / samples - 0.5 + left
    y = ((np.arange((bottom - top) * samples) + 0.5) / samples - 0.5 + top)[:, None]
    u, v, w = (row[0] * x + row[1] * y + row[2] for row in np.linalg.inv(to_px))
    bits = np.pad(white, 1, constant_values=True)
    column, row = (np.floor((place / w + reach) * modules).astype(int) for place in (u, v))
    inside = (column >= 0) & (row >= 0) & (column < len(bits)) & (row < len(bits))
    part = light[top:bottom, left:right]
    fine = np.kron(part, np.ones((samples, samples), np.float32))
    fine[inside] = np.where(bits[row[inside], column[inside]], 1.0, BLACK)
    pixels = fine.reshape(bottom - top, samples, right - left, samples).mean(axis=(1, 3))
    light[top:bottom, left:right] = cv2.GaussianBlur(pixels, (0, 0), blur_px) if blur_px > 0 else pixels
    return np.asarray(cv2.perspectiveTransform(square[None] / 2, to_px)[0])


def pictures(
    side_px: float,
    poses_deg: Sequence[tuple[float, float]],
    blur_px: float,
    rng: np.random.Generator,
    size_px: tuple[int, int] = PICTURE_PX,
) -> Iterator[Drawing]:
    """Pictures that show every (turn, tilt) once, each marker somewhere else in the pixels."""
    cell = 1.5 * side_px * (1 + 2 / 6) + 8
    columns, rows = (max(int(length // cell), 1) for length in size_px)
    cells = list(itertools.product(range(rows), range(columns)))
    at_once = min(len(cells), IDS)
    for begin in range(0, len(poses_deg), at_once):
        light = np.full(size_px[::-1], SURROUND, dtype=np.float32)
        part = poses_deg[begin : begin + at_once]
        ids = rng.permutation(IDS)[: len(part)]
        corners = []
        for (row, column), (turn, tilt), marker in zip(cells, part, ids, strict=False):
            pitch = (size_px[0] / columns, size_px[1] / rows)
            centre = (np.array([column, row]) + 0.5) * pitch + rng.uniform(-0.5, 0.5, 2)
            corners.append(paste(light, int(marker), homography(side_px, centre, turn, tilt), blur_px))
        yield Drawing(light, ids, np.array(corners))


def edge_pictures(
    side_px: float, gaps_px: Sequence[float], rng: np.random.Generator, size_px: tuple[int, int] = PICTURE_PX
) -> Iterator[Drawing]:
    """Pictures with four whole plates each, one at each of their edges, so many px from it, on a dark surround."""
    width, height = size_px
    for gap in gaps_px:
        light = np.full((height, width), DARK_SURROUND, dtype=np.float32)
        # To the plate's outer edge, of pixels whose centres are whole numbers.
        near = gap + side_px * (0.5 + 1 / 6) - 0.5
        x, y = rng.uniform(0.4, 0.6, 2) * size_px
        ids = rng.permutation(IDS)[:4]
        centres = ((near, y), (width - 1 - near, y), (x, near), (x, height - 1 - near))
        corners = [
            paste(light, int(marker), homography(side_px, centre, 0.0, 0.0))
            for marker, centre in zip(ids, centres, strict=True)
        ]
        yield Drawing(light, ids, np.array(corners))
