"""Draw a marker exactly: what share of each pixel's square is white, to double precision, by no sampling at all.

The outline between black and white modules is cut where it crosses the lines between pixels; a piece within one pixel
covers of it a trapezoid, and all of each pixel to its right (Green's theorem). A homography keeps straight lines
straight, so this holds in any view. A lens out of focus averages such images over shifts within its disc.
Nothing of the registration is used here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from render.world.marker_print import pattern

__all__ = ["draw_exactly"]

Floats = NDArray[np.float64]

# Shifts over the lens's disc: rings whose radii follow Gauss's rule in the squared radius, and points on each of them.
RINGS, POINTS_ON_A_RING = 12, 40


def draw_exactly(
    dictionary: str, marker_id: int, homography: Floats, shape: tuple[int, int], disc_px: float = 0.0
) -> Floats:
    """Share of white in each pixel of an image of `shape` (height, width): a marker on endless white.

    Args:
        homography: modules about the marker's centre to pixels, (3, 3).
        disc_px: px, diameter of the circle of confusion.
    """
    starts, ends = (_mapped(homography, points) for points in _outline(dictionary, marker_id))
    shifts = _disc_shifts(disc_px) if disc_px > 0 else [(1.0, np.zeros(2))]
    black = sum(weight * _covered(starts + shift, ends + shift, shape) for weight, shift in shifts)
    # Turned the other way round, the outline encloses −1.
    return np.asarray(1 - black * math.copysign(1, np.linalg.det(homography)))


def _outline(dictionary: str, marker_id: int) -> tuple[Floats, Floats]:
    """Ends of the sides between black and white modules, black to their right as u goes right and v down; (S, 2)."""
    black = np.pad(~pattern(dictionary, marker_id), 1).astype(int)
    half = black.shape[0] / 2
    sides = []
    for row, column in np.argwhere(np.diff(black, axis=0)):
        # Black below: to the right, black above: to the left.
        side = np.array([[column, row + 1], [column + 1, row + 1]], dtype=float)
        sides.append(side if black[row + 1, column] else side[::-1])
    for row, column in np.argwhere(np.diff(black, axis=1)):
        # Black to the left: down, black to the right: up.
        side = np.array([[column + 1, row], [column + 1, row + 1]], dtype=float)
        sides.append(side if black[row, column] else side[::-1])
    ends = np.array(sides) - half
    return ends[:, 0], ends[:, 1]


def _mapped(homography: Floats, points: Floats) -> Floats:
    x, y, w = homography @ np.column_stack([points, np.ones(len(points))]).T
    # From pixels with their centre at (0, 0) to pixels with their corner there.
    return np.column_stack([x / w, y / w]) + 0.5


def _disc_shifts(disc_px: float) -> list[tuple[float, Floats]]:
    nodes, weights = np.polynomial.legendre.leggauss(RINGS)
    shifts = []
    for number, (node, weight) in enumerate(zip(nodes, weights, strict=True)):
        radius = disc_px / 2 * math.sqrt((node + 1) / 2)
        for angle in 2 * math.pi * (np.arange(POINTS_ON_A_RING) + number / RINGS) / POINTS_ON_A_RING:
            shifts.append((weight / 2 / POINTS_ON_A_RING, radius * np.array([math.cos(angle), math.sin(angle)])))
    return shifts


def _covered(starts: Floats, ends: Floats, shape: tuple[int, int]) -> Floats:
    """Area of each pixel that closed outlines enclose, given as sides (S, 2) in pixels from the image's corner."""
    height, width = shape
    ways = ends - starts
    pieces = []
    for start, way in zip(starts, ways, strict=True):
        cuts = [np.array([0.0, 1.0])]
        for axis in range(2):
            low, high = sorted((start[axis], start[axis] + way[axis]))
            lines = np.arange(math.ceil(low), math.floor(high) + 1)
            if way[axis]:
                cuts.append((lines - start[axis]) / way[axis])
        at = np.unique(np.clip(np.concatenate(cuts), 0, 1))[:, None]
        points = start + at * way
        pieces.append(np.concatenate([points[:-1], points[1:]], axis=1))
    x0, y0, x1, y1 = np.concatenate(pieces).T
    column, row = np.floor((x0 + x1) / 2).astype(int), np.floor((y0 + y1) / 2).astype(int)
    if ((column < 0) | (column >= width) | (row < 0) | (row >= height)).any():
        raise ValueError(f"the marker reaches beyond the image of {width} × {height} px")
    # Going up has the inside to the right here (rows count downwards): a side covers what is right of it.
    rise = y0 - y1
    inside = rise * (column + 1 - (x0 + x1) / 2)
    area, beyond = np.zeros(shape), np.zeros((height, width + 1))
    np.add.at(area, (row, column), inside)
    np.add.at(beyond, (row, column + 1), rise)
    return np.asarray(area + np.cumsum(beyond[:, :-1], axis=1))
