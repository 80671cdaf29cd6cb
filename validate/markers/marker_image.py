"""The ideal image of a marker: its modules, blurred by lens and pixel, with its derivatives, at any place on it.

Coordinates on the marker are (u, v) in modules about its centre, u to its right and v down; its border ends at ±n/2.
The print is a sum of corners, each the product of a step in u and a step in v. What blurs it in the image (a pixel's
square and the disc of the lens out of focus) is drawn into the marker's plane by the local scale of the homography. A
blurred step is that kernel's projection onto one axis, integrated, which `validate.markers.blurred_step` has in closed
form; so the image is exact along all edges, and at corners it is up to what the two axes' projections do not determine.
Of that the kernel's cross-covariance c is in it, by the first two terms of exp(c ∂²/∂u∂v). Nothing is resampled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pss.hints import AnyFloats, Images
from render.world.marker_print import pattern
from validate.markers.blurred_step import DIAMETERS_PER_SIGMA, blurred_steps, reach

__all__ = ["DIAMETERS_PER_SIGMA", "PIXEL_VARIANCE_PX2", "MarkerImage", "Seen", "sharp_image"]

Rows = NDArray[np.int32]

# Cells of the table of a step: over all of the kernel, or over a module where the kernel is wider. Within a cell the
# step is continued by its slope: a seventieth of a pixel from the cell's middle at most, where the image is sharp.
CELLS = 64
# Fewer than so many cells over the pixel's own width need not end where the pixel does: the lens's disc is far wider.
FEWEST_CELLS_OF_A_PIXEL = 8
# Lines that blur one place; more than that are of a marker that cannot be decoded.
MOST_LINES = 6
# px², variance of a square pixel's own width.
PIXEL_VARIANCE_PX2 = 1 / 12
# The blur's derivative is a difference over this share of its variance and as much in px².
BLUR_STEP_SHARE, BLUR_STEP_PX2 = 0.2, 0.03
# px per module of a marker that is seen without pixels: so many that their own width blurs nothing.
WITHOUT_PIXELS = 1e3


@dataclass(frozen=True, eq=False)
class Seen:
    """The ideal image at N places, black 0 and white 1, all (N,).

    Attributes:
        value: no unit.
        by_u, by_v: per module.
        by_blur: per px² of the blur's variance.
    """

    value: Images
    by_u: Images
    by_v: Images
    by_blur: Images


class MarkerImage:
    """The ideal image of one marker under one blur and local scale.

    Args:
        to_modules: modules per px, the inverse of the homography's Jacobian at the marker's centre, (2, 2).
        blur_px2: px², variance along any axis of the disc that the lens makes of a point.

    Attributes:
        half: modules from the centre to the border's end.
    """

    def __init__(self, dictionary: str, marker_id: int, to_modules: AnyFloats, blur_px2: float) -> None:
        count = len(_corners(dictionary, marker_id))
        self.half, self.blur_px2 = (count - 1) / 2, blur_px2
        self._cross = np.float32((blur_px2 + PIXEL_VARIANCE_PX2) * (to_modules[0] @ to_modules[1]))
        self._grid = _Grid(to_modules, blur_px2, count)
        tables = _tables(self._grid, to_modules, blur_px2)
        across, self._down = tables[0], np.moveaxis(tables[1], 0, 1).copy()
        # The steps along u, and in the end what is the same in all cells: what earlier steps have added up to.
        constant = np.zeros((1, 4 * self._grid.cells), dtype=np.float32)
        constant[:, : self._grid.cells] = 1
        across = np.concatenate([across.reshape(self._grid.lines, -1), constant])
        heights, passed = _windows(dictionary, marker_id, self._grid.lines)
        self._heights, self._passed = (heights @ across).ravel(), (passed @ across).ravel()

    def at(self, u: Images, v: Images) -> Seen:
        """The image at (u, v), in modules, (N,) each."""
        grid, half = self._grid, np.float32(self.half)
        first, across, rest_u = grid.place(u + half, 0)
        line, down, rest_v = grid.place(v + half, 1)
        # Tables lie one behind another: for each line along v those of each line along u, and of these the four kinds.
        first += line * np.int32(grid.firsts)
        first *= np.int32(4 * grid.cells)
        first += across
        value, by_u, by_blur = (self._passed[kind * grid.cells :].take(first) for kind in (0, 1, 3))
        value += 1
        by_v = np.zeros_like(value)
        for beside in range(grid.lines):
            begin = beside * grid.firsts * 4 * grid.cells
            high, high_u, high_uu, high_blur = (
                self._heights[begin + kind * grid.cells :].take(first) for kind in range(4)
            )
            up, up_v, up_vv, up_blur = (kind.take(down) for kind in self._down[:, beside])
            value += high * up
            by_u += high_u * up
            by_v += high * up_v
            high_blur *= up
            by_blur += high_blur
            high *= up_blur
            by_blur += high
            if self._cross:
                high_u *= self._cross
                value += high_u * up_v
                by_v += high_u * up_vv
                high_uu *= self._cross
                by_u += high_uu * up_v
        rest_u *= by_u
        value += rest_u
        rest_v *= by_v
        value += rest_v
        return Seen(value, by_u, by_v, by_blur)


class _Grid:
    """Cells along both axes: over the marker's module about a place, or over the kernel where that is narrower.

    Args:
        count: lines of the marker along an axis, a module apart.

    Attributes:
        lines: that blur one place at most, neighbours of each other.
        firsts: of the first of these lines, how many there may be; all from before the marker to beyond it.
        cells: of each table, one beyond either end included.
        per_module: cells a module, along each axis.
        shift: modules from the first of the lines to their middle.
    """

    def __init__(self, to_modules: AnyFloats, blur_px2: float, count: int) -> None:
        widths = [2 * reach(row, _softer(blur_px2)) for row in to_modules]
        self.lines = min(max(math.ceil(max(widths)), 1), MOST_LINES)
        self.firsts = count + self.lines + 1
        self.shift = (self.lines - 1) / 2
        self.cells, self.per_module = CELLS + 2, (float(CELLS), float(CELLS))
        if self.lines > 1:
            return
        cells, sizes = zip(*(_cells(row, width) for row, width in zip(to_modules, widths, strict=True)), strict=True)
        self.cells, self.per_module = max(cells) + 2, (1 / sizes[0], 1 / sizes[1])

    def middles(self, axis: int) -> AnyFloats:
        """Modules of the cells' middles from the middle of the lines, (cells,)."""
        return np.asarray((np.arange(self.cells) + 0.5 - self.cells / 2) / self.per_module[axis])

    def place(self, along: Images, axis: int) -> tuple[Rows, Rows, Images]:
        """Number of the first line that blurs a place, its cell, and the rest to the cell's middle in modules.

        A step of the fit may bring a pixel beyond the tables, where all is white: it is taken for their end.

        Args:
            along: modules from the marker's first line, (N,); overwritten.
        """
        along += np.float32(self.lines - self.shift)
        first = np.rint(along)
        np.clip(first, 0, self.firsts - 1, out=first)
        along -= first
        along *= np.float32(self.per_module[axis])
        along += np.float32(self.cells / 2)
        cell = np.floor(along)
        np.clip(cell, 0, self.cells - 1, out=cell)
        along -= cell
        along -= np.float32(0.5)
        along *= np.float32(1 / self.per_module[axis])
        return first.astype(np.int32), cell.astype(np.int32), along


def _cells(per_px: AnyFloats, width: float) -> tuple[int, float]:
    """How many cells a kernel `width` modules wide has, and their size in modules.

    A level pixel's kernel has an edge of its own: no cell may hold it, or all pixels along a line err alike.
    """
    pixel = float(np.abs(per_px).sum())
    of_pixel = round(CELLS * pixel / width)
    if of_pixel < FEWEST_CELLS_OF_A_PIXEL:
        return CELLS, width / CELLS
    size = pixel / of_pixel
    return of_pixel + 2 * math.ceil((width - pixel) / 2 / size), size


def _softer(blur_px2: float) -> float:
    return blur_px2 + BLUR_STEP_SHARE * blur_px2 + BLUR_STEP_PX2


def _tables(grid: _Grid, to_modules: AnyFloats, blur_px2: float) -> Images:
    """The blurred steps of a place's lines, their slope, second derivative and derivative by the blur, in each cell.

    Along u and v, (2, lines, 4, cells).
    """
    places = np.stack([grid.middles(axis) for axis in (0, 1)])[:, None] + grid.shift - np.arange(grid.lines)[:, None]
    softer = _softer(blur_px2)
    sharp, soft = blurred_steps(places, to_modules, np.array([blur_px2, softer]))
    tables = np.empty((2, grid.lines, 4, grid.cells), dtype=np.float32)
    tables[:, :, :3] = np.moveaxis(sharp, 0, 2)
    tables[:, :, 3] = (soft[0] - sharp[0]) / (softer - blur_px2)
    return tables


@lru_cache(maxsize=1024)
def _windows(dictionary: str, marker_id: int, lines: int) -> tuple[Images, Images]:
    """Heights along v of the `lines` steps in u at a place, and sums of all lines along v before.

    Rows are the place's first line along v and, faster, along u; `lines` columns and one for the sum of all steps in u
    before. There are `lines` of height 0 beyond the marker on either side, and so many firsts that all is white there.
    """
    corners = np.pad(_corners(dictionary, marker_id), lines)
    before = np.cumsum(corners, axis=1) - corners
    windows = np.lib.stride_tricks.sliding_window_view(corners, lines, axis=1)
    rows = np.concatenate([windows, before[:, : windows.shape[1], None]], axis=2)
    passed = np.cumsum(rows, axis=0) - rows
    return rows.reshape(-1, lines + 1), passed.reshape(-1, lines + 1)


@lru_cache(maxsize=1024)
def sharp_image(dictionary: str, marker_id: int, blur_modules: float) -> MarkerImage:
    """A marker blurred by a disc of σ = `blur_modules` along any axis of the print, and by no pixel: made once."""
    return MarkerImage(dictionary, marker_id, np.eye(2) / WITHOUT_PIXELS, (blur_modules * WITHOUT_PIXELS) ** 2)


@lru_cache(maxsize=1024)
def _corners(dictionary: str, marker_id: int) -> Images:
    """Height of the step in v of the step in u at each corner of the modules, (n + 1, n + 1), rows along v."""
    below_white = pattern(dictionary, marker_id).astype(np.float32) - 1
    return np.asarray(np.diff(np.diff(np.pad(below_white, 1), axis=0), axis=1))
