"""Localise a marker's centre by registering its own ideal image to the capture, with the covariance of the result.

The decoded marker tells what its image should look like; `cv2.findTransformECC` aligns that image to the capture by a
homography, to a few thousandths of a pixel. The covariance comes from the same image: the gradients of the fitted
template under the noise of the capture (the sensor's calibration turns grey values into noise, as in a real camera).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from render.markers import pattern

__all__ = ["Localised", "localise"]

Floats = NDArray[np.floating]

# The template reaches this far beyond the black border: inside the quiet zone, so that what lies beyond the plate stays
# out even where the plate's edge is blurred.
MARGIN_MODULES = 0.75
# Template pixels a module: about as many as the image has, in a few steps, so that templates are drawn once. Small
# modules are drawn finer than they appear, which lowers the frozen bias of linear interpolation; large ones coarser,
# which costs time but no accuracy.
PX_PER_MODULE = (8, 10, 12, 14)
# The first alignment only brings the template to where it can be compared: it may be coarse.
COARSE_PX_PER_MODULE = 6
# Patches of markers with smaller modules are enlarged twice before they are registered.
ENLARGE_BELOW_PX_PER_MODULE = 8.0
TEMPLATE_TEXELS_PER_MODULE = 16
# Gaussian blurs (σ in modules) that the template is tried with: from a sharp print to a marker that just decodes.
BLURS_MODULES = (0.045, 0.08, 0.13, 0.2, 0.3, 0.42, 0.6)
COARSE_BLUR_MODULES = 0.2
COARSE_ITERATIONS, ITERATIONS = 8, 5
PRECISION = 1e-5
# What registration leaves as a bias that no covariance from noise can know of (px, σ per axis); RMS measured on
# noise-free renders (benchmarks/README.md).
BIAS_FLOOR_PX = 0.008
# A registration below this correlation is not the marker it was decoded as, or nearly all noise.
SMALLEST_CORRELATION = 0.5
# The registration must end near its start: the corners are good to about a pixel, blur and noise may triple that.
LARGEST_MOVE_MODULES = 1.0


@dataclass(frozen=True, eq=False)
class Localised:
    """A centre in OpenCV's pixels (2,), its covariance in px² (2, 2), and the correlation of the registration."""

    centre_px: Floats
    covariance_px2: Floats
    correlation: float


@lru_cache(maxsize=4096)
def _template(dictionary: str, marker_id: int, size: int, blur_modules: float) -> NDArray[np.float32]:
    """The ideal image (size, size) of a marker with its margin, black 0 and white 1, blurred."""
    cut = round((1 - MARGIN_MODULES) * TEMPLATE_TEXELS_PER_MODULE)
    fine = _drawn(dictionary, marker_id, blur_modules)[cut:-cut, cut:-cut]
    return np.asarray(cv2.resize(fine, (size, size), interpolation=cv2.INTER_AREA))


@lru_cache(maxsize=1024)
def _drawn(dictionary: str, marker_id: int, blur_modules: float) -> NDArray[np.float32]:
    """A marker with a whole module of quiet zone, finely drawn, then blurred: the blur meets white at the cut."""
    black_and_white = pattern(dictionary, marker_id).astype(np.float32)
    texels = TEMPLATE_TEXELS_PER_MODULE
    fine = np.kron(np.pad(black_and_white, 1, constant_values=1.0), np.ones((texels, texels), dtype=np.float32))
    return np.asarray(cv2.GaussianBlur(fine, (0, 0), blur_modules * texels, borderType=cv2.BORDER_REPLICATE))


@lru_cache(maxsize=1024)
def _normalised(dictionary: str, marker_id: int, size: int) -> NDArray[np.float32]:
    """The templates of all blurs as unit vectors about their mean, (B, size²): their products are correlations."""
    rows = np.array([_template(dictionary, marker_id, size, blur).ravel() for blur in BLURS_MODULES])
    rows -= rows.mean(axis=1, keepdims=True)
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


@lru_cache(maxsize=64)
def _fields(size: int) -> NDArray[np.float32]:
    """How the parameters of a homography about the centre move a template pixel: (8, 2, size²) for (x, y).

    Coordinates are in units of half the template's size; the first two parameters move everything alike.
    """
    across = ((np.arange(size) - (size - 1) / 2) / (size / 2)).astype(np.float32)
    y, x = (axis.ravel() for axis in np.meshgrid(across, across, indexing="ij"))
    one, none = np.ones_like(x), np.zeros_like(x)
    moves = [(one, none), (none, one), (x, none), (y, none), (none, x), (none, y), (x * x, x * y), (x * y, y * y)]
    return np.array(moves)


def localise(
    capture_dn: NDArray[np.uint16], corners_px: Floats, marker_id: int, dictionary: str, sensor: ImageSensor
) -> Localised | None:
    """Register one decoded marker; None where the registration fails.

    Args:
        capture_dn: digital numbers, (height, width).
        corners_px: pixels, the corners of its black border as the detector found them, (4, 2), top left first.
    """
    modules = len(pattern(dictionary, marker_id))
    sides = np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1)
    px_per_module = float(sides.mean()) / modules
    span = modules + 2 * MARGIN_MODULES
    finest = next((px for px in PX_PER_MODULE if px >= px_per_module), PX_PER_MODULE[-1])
    size, coarse_size = round(span * finest), round(span * COARSE_PX_PER_MODULE)
    warp = _start(corners_px, modules, size)

    patch, left, top = _crop(capture_dn, warp, size, px_per_module)
    if patch is None:
        return None
    scale = 2 if px_per_module < ENLARGE_BELOW_PX_PER_MODULE else 1
    if scale > 1:
        patch = cv2.resize(patch, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    # Pixel centres at (0, 0) on both sides: enlarged = scale · pixel + (scale − 1)/2.
    to_patch = np.array(
        [[scale, 0, (scale - 1) / 2 - scale * left], [0, scale, (scale - 1) / 2 - scale * top], [0, 0, 1.0]]
    )
    registered = _register(patch, to_patch @ warp, dictionary, marker_id, size, coarse_size)
    if registered is None:
        return None
    patch_warp, template, correlation = registered
    final = np.linalg.inv(to_patch) @ patch_warp
    centre, start = _apply(final, size), _apply(warp, size)
    if correlation < SMALLEST_CORRELATION or np.linalg.norm(centre - start) > LARGEST_MOVE_MODULES * px_per_module:
        return None
    seen = cv2.warpPerspective(patch, patch_warp, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    covariance = _covariance(seen, template, final, sensor)
    return None if covariance is None else Localised(centre, covariance, correlation)


def _start(corners_px: Floats, modules: int, size: int) -> Floats:
    """Homography from template pixels to image pixels that takes the border's corners to where they were found."""
    px = size / (modules + 2 * MARGIN_MODULES)
    low, high = MARGIN_MODULES * px - 0.5, (MARGIN_MODULES + modules) * px - 0.5
    ideal = np.array([[low, low], [high, low], [high, high], [low, high]], dtype=np.float32)
    return np.asarray(cv2.getPerspectiveTransform(ideal, corners_px.astype(np.float32)), dtype=float)


def _crop(
    capture_dn: NDArray[np.uint16], warp: Floats, size: int, px_per_module: float
) -> tuple[NDArray[np.float32] | None, int, int]:
    """The part of the capture that the template covers, as floats, and where it begins; None if it leaves the image."""
    frame = np.array([[[0, 0], [size - 1, 0], [size - 1, size - 1], [0, size - 1]]], dtype=np.float32)
    outline = cv2.perspectiveTransform(frame, warp)[0]
    room = 2 + px_per_module
    left, top = np.floor(outline.min(axis=0) - room).astype(int)
    right, bottom = np.ceil(outline.max(axis=0) + room).astype(int) + 1
    height, width = capture_dn.shape
    left, top, right, bottom = max(left, 0), max(top, 0), min(right, width), min(bottom, height)
    if (outline < 0).any() or (outline > (width - 1, height - 1)).any():
        return None, 0, 0
    return capture_dn[top:bottom, left:right].astype(np.float32), left, top


def _register(
    patch: NDArray[np.float32], warp: Floats, dictionary: str, marker_id: int, size: int, coarse_size: int
) -> tuple[Floats, NDArray[np.float32], float] | None:
    """Align a coarse template, then a fine one with the blur that fits the image best."""
    ratio = size / coarse_size
    to_fine = np.array([[ratio, 0, (ratio - 1) / 2], [0, ratio, (ratio - 1) / 2], [0, 0, 1.0]])
    template = _template(dictionary, marker_id, coarse_size, COARSE_BLUR_MODULES)
    found = _align(template, patch, warp @ to_fine, COARSE_ITERATIONS)
    if found is None:
        return None
    warp = found[0] @ np.linalg.inv(to_fine)
    seen = cv2.warpPerspective(patch, warp, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    # A template's mean is taken out of it already, so that of the image does not matter.
    best = int(np.argmax(_normalised(dictionary, marker_id, size) @ seen.ravel()))
    template = _template(dictionary, marker_id, size, BLURS_MODULES[best])
    found = _align(template, patch, warp, ITERATIONS)
    return None if found is None else (found[0], template, found[1])


def _align(
    template: NDArray[np.float32], patch: NDArray[np.float32], warp: Floats, iterations: int
) -> tuple[Floats, float] | None:
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, iterations, PRECISION)
    try:
        correlation, aligned = cv2.findTransformECC(
            template, patch, warp.astype(np.float32), cv2.MOTION_HOMOGRAPHY, criteria, None, 1
        )
    except cv2.error:  # "did not converge": a result like another, not a mistake
        return None
    return np.asarray(aligned, dtype=float), float(correlation)


def _apply(warp: Floats, size: int) -> Floats:
    """Image pixels (2,) of the template's centre."""
    x, y, w = warp @ ((size - 1) / 2, (size - 1) / 2, 1.0)
    return np.array([x / w, y / w])


def _covariance(seen: Floats, template: Floats, warp: Floats, sensor: ImageSensor) -> Floats | None:
    """px², covariance (2, 2) of the centre, by the sandwich of an equally weighted fit under the capture's noise.

    Parameters of the fit: the eight of a homography about the template's centre, of which the first two move the
    centre, then gain and offset.
    """
    size = template.shape[0]
    flat, image = template.ravel(), seen.ravel()
    mean, image_mean = flat.mean(), image.mean()
    gain = float(((flat - mean) @ (image - image_mean)) / ((flat - mean) @ (flat - mean)))
    if gain <= 0:
        return None
    gy, gx = (gain * slope.ravel() for slope in np.gradient(template))
    moves = _fields(size)
    design = np.concatenate([moves[:, 0] * gx + moves[:, 1] * gy, [flat, np.ones_like(flat)]])
    to_image = _local_scale(warp, size)
    # One template pixel stands for this many image pixels, each with a noise of its own.
    area = abs(np.linalg.det(to_image))
    fitted = gain * (flat - mean) + image_mean
    electrons = np.maximum((fitted - sensor.black_level_dn) * sensor.gain_e_per_dn, 0.0)
    noise = (electrons + sensor.read_noise_e**2) / sensor.gain_e_per_dn**2 + 1 / 12
    normal = (design @ design.T).astype(float)
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        return None
    spread = inverse @ ((design * noise) @ design.T).astype(float) @ inverse / area
    covariance = to_image @ spread[:2, :2] @ to_image.T
    # Single precision sums leave the two halves different in the seventh digit.
    return np.asarray((covariance + covariance.T) / 2 + BIAS_FLOOR_PX**2 * np.eye(2))


def _local_scale(warp: Floats, size: int) -> Floats:
    """Image pixels per template pixel at the template's centre: the Jacobian of the homography, (2, 2)."""
    u, v, w = warp @ ((size - 1) / 2, (size - 1) / 2, 1.0)
    return np.asarray((warp[:2, :2] - np.outer([u / w, v / w], warp[2, :2])) / w)
