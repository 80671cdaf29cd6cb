"""The ideal image of a marker: its modules, blurred by lens and pixel, with its derivatives, at any place on it.

Coordinates on the marker are (u, v) in modules about its centre, u to its right and v down; its border ends at ±n/2.
The print is a sum of corners, each the product of a step in u and a step in v. What blurs it in the image (a pixel's
square and the disc of the lens out of focus) is drawn into the marker's plane by the local scale of the homography. A
blurred step is that kernel's projection onto one axis, integrated, which a table along the axis holds exactly; so the
image is exact along all edges, and at corners it is up to what the two axes' projections do not determine. Of that the
kernel's cross-covariance c is in it, by the first two terms of exp(c ∂²/∂u∂v). Nothing is resampled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

from render.markers import pattern

__all__ = ["DIAMETERS_PER_SIGMA", "PIXEL_VARIANCE_PX2", "MarkerImage", "Seen", "sharp_image"]

Floats = NDArray[np.floating]
Image = NDArray[np.float32]
Rows = NDArray[np.int32]

# Table steps a module. Between them the image is continued by its derivatives, so that what is left is of second order:
# at 10 px a module at most 0.005 of the contrast, and as often to one side as to the other.
STEPS = 64
# A step's table reaches this many modules to either side: the blur of a marker that still decodes has a radius of one.
REACH = 3
LENGTH = 2 * REACH * STEPS
# px², variance of a square pixel's own width.
PIXEL_VARIANCE_PX2 = 1 / 12
# A disc of diameter cc has the variance cc²/16 along any axis.
DIAMETERS_PER_SIGMA = 4.0
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

    value: Image
    by_u: Image
    by_v: Image
    by_blur: Image


class MarkerImage:
    """The ideal image of one marker under one blur and local scale.

    Args:
        to_modules: modules per px, the inverse of the homography's Jacobian at the marker's centre, (2, 2).
        blur_px2: px², variance along any axis of the disc that the lens makes of a point.

    Attributes:
        half: modules from the centre to the border's end.
    """

    def __init__(self, dictionary: str, marker_id: int, to_modules: Floats, blur_px2: float) -> None:
        corners = _corners(dictionary, marker_id)
        count = len(corners)
        self.half, self.blur_px2 = (count - 1) / 2, blur_px2
        self._steps = _steps(to_modules, blur_px2)  # (4, 2, LENGTH)
        self._cross = np.float32((blur_px2 + PIXEL_VARIANCE_PX2) * (to_modules[0] @ to_modules[1]))
        # A line along u blurs what is nearer to it than this, in modules: at most so many lines beside the nearest.
        disc = DIAMETERS_PER_SIGMA / 2 * math.sqrt(blur_px2) * math.hypot(*to_modules[1])
        self._beside = max(0, min(math.ceil(disc + np.abs(to_modules[1]).sum() / 2 - 0.5), REACH - 1))
        # Heights of the steps in v, at each step of the table along u; none beyond the marker's own lines.
        heights = np.pad(corners, ((self._beside, self._beside), (0, 0))) @ _at_lines(self._steps[:, 0], count)
        self._heights = np.ascontiguousarray(heights.transpose(0, 2, 1))  # (4, table, lines)
        self._passed = np.zeros((4, heights.shape[2], heights.shape[1] + 1), dtype=np.float32)
        np.cumsum(self._heights, axis=2, out=self._passed[..., 1:])
        self._last = count - 1

    def at(self, u: Image, v: Image) -> Seen:
        """The image at (u, v), in modules, (N,) each."""
        row, rest_u, line, step, rest_v = self._place(u, v)
        heights, passed, down = self._heights.reshape(4, -1), self._passed.reshape(4, -1), self._steps[:, 1]
        lines = self._heights.shape[2]
        before, first = row * (lines + 1) + line, row * lines + line
        value, by_u, by_blur = (passed[kind].take(before) for kind in (0, 1, 3))
        value += 1
        by_v = np.zeros_like(value)
        for beside in range(2 * self._beside + 1):
            at = step + STEPS * (self._beside - beside)
            high, high_u, high_uu, high_blur = (kind.take(first + beside) for kind in heights)
            up, up_v, up_vv, up_blur = (kind.take(at) for kind in down)
            value += high * up
            by_u += high_u * up
            by_v += high * up_v
            by_blur += high_blur * up + high * up_blur
            high_u *= self._cross
            value += high_u * up_v
            by_v += high_u * up_vv
            high_uu *= self._cross
            by_u += high_uu * up_v
        value += rest_u * by_u
        value += rest_v * by_v
        return Seen(value, by_u, by_v, by_blur)

    def _place(self, u: Image, v: Image) -> tuple[Rows, Image, Rows, Rows, Image]:
        """Along u: step and rest in modules. Along v: nearest line, step from it in its table, and rest in modules."""
        row, rest_u = self._step(u)
        down, rest_v = self._step(v)
        line = np.clip((down + STEPS // 2) // STEPS - 1, 0, self._last)
        return row, rest_u, line, down - STEPS * (line + 1) + LENGTH // 2, rest_v

    def _step(self, place: Image) -> tuple[Rows, Image]:
        """The table's step nearest to each place, and how far beyond it the place is, in modules.

        A step of the fit may bring a pixel beyond the table, where all is white: it is taken for the table's end.
        """
        scaled = place * np.float32(STEPS)
        scaled += np.float32((self.half + 1) * STEPS)
        np.clip(scaled, 0, np.float32((2 * self.half + 2) * STEPS), out=scaled)
        nearest = np.rint(scaled)
        scaled -= nearest
        scaled *= np.float32(1 / STEPS)
        return nearest.astype(np.int32), scaled


@lru_cache(maxsize=1024)
def sharp_image(dictionary: str, marker_id: int, blur_modules: float) -> MarkerImage:
    """A marker blurred by a disc of σ = `blur_modules` along any axis of the print, and by no pixel: made once."""
    return MarkerImage(dictionary, marker_id, np.eye(2) / WITHOUT_PIXELS, (blur_modules * WITHOUT_PIXELS) ** 2)


@lru_cache(maxsize=1024)
def _corners(dictionary: str, marker_id: int) -> Image:
    """Height of the step in v of the step in u at each corner of the modules, (n + 1, n + 1), rows along v."""
    below_white = pattern(dictionary, marker_id).astype(np.float32) - 1
    return np.asarray(np.diff(np.diff(np.pad(below_white, 1), axis=0), axis=1))


@cache
def _frequencies() -> Floats:
    """Cycles per module of the tables' transform, (LENGTH/2 + 1,)."""
    return np.fft.rfftfreq(LENGTH, 1 / STEPS)


@cache
def _disc_table() -> tuple[Floats, Floats]:
    """Transform of a disc of diameter 1 by cycles per diameter. Beyond, a disc lets less than 1e-4 through."""
    cycles = np.linspace(0, 200, 20001)
    table = np.ones_like(cycles)
    table[1:] = 2 * j1(np.pi * cycles[1:]) / (np.pi * cycles[1:])
    return cycles, table


def pixel_transform(cycles: Floats, to_modules: Floats) -> Floats:
    """Transform of a pixel's square, projected onto u and v, at `cycles` (F,) per module; (2, F)."""
    return np.asarray(np.sinc(cycles * to_modules[:, :1]) * np.sinc(cycles * to_modules[:, 1:]))


def lens_transform(cycles: Floats, to_modules: Floats, blur_px2: float) -> Floats:
    """The same of the lens's disc, of the variance `blur_px2` along any axis."""
    scale = DIAMETERS_PER_SIGMA * math.sqrt(blur_px2) * np.hypot(to_modules[:, 0], to_modules[:, 1])
    return np.interp(scale[:, None] * cycles, *_disc_table())


def _steps(to_modules: Floats, blur_px2: float) -> Image:
    """A blurred step at 0, its slope, its second derivative, and its derivative by the blur; along u and v.

    (4, 2, LENGTH), from −REACH to REACH modules.
    """
    difference = BLUR_STEP_SHARE * blur_px2 + BLUR_STEP_PX2
    pixel = pixel_transform(_frequencies(), to_modules)
    sharper, softer = (
        pixel * lens_transform(_frequencies(), to_modules, blur) for blur in (blur_px2, blur_px2 + difference)
    )
    spectra = np.concatenate([sharper, (softer - sharper) / difference])
    # Mass of the kernel in each step of the table, the kernel's centre in the middle; (4, LENGTH).
    turned = np.fft.irfft(spectra, LENGTH)
    mass = np.concatenate([turned[:, LENGTH // 2 :], turned[:, : LENGTH // 2]], axis=1)
    steps = np.cumsum(mass, axis=1)
    steps -= mass / 2
    tables = np.empty((4, 2, LENGTH), dtype=np.float32)
    tables[0], tables[3] = steps[:2], steps[2:]
    tables[1] = mass[:2] * STEPS
    tables[2, :, 1:-1] = (mass[:2, 2:] - mass[:2, :-2]) * (STEPS**2 / 2)
    tables[2, :, [0, -1]] = 0
    return tables


def _at_lines(steps: Image, count: int) -> Image:
    """The tables (4, LENGTH) at each of the marker's `count` lines, from a module before the first to one beyond.

    (4, count, table).
    """
    table = (count + 1) * STEPS + 1
    padding = max(count - REACH, 0) * STEPS + 1
    padded = np.zeros((4, LENGTH + 2 * padding), dtype=np.float32)
    padded[:, padding:-padding] = steps
    padded[0, -padding:] = 1
    first = padding + LENGTH // 2 - STEPS * (1 + np.arange(count))
    windows = np.lib.stride_tricks.sliding_window_view(padded, table, axis=1)
    return np.asarray(windows[:, first])
