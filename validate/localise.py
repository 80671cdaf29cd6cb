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

from render.markers import pattern
from render.sensor import Sensor

__all__ = ["Localised", "localise"]

Floats = NDArray[np.floating]

# The template reaches this far beyond the black border: inside the quiet zone, so that what lies beyond the plate stays
# out even where the plate's edge is blurred.
MARGIN_MODULES = 0.75
# Template pixels a module: as many as the image has, within bounds. Small modules are drawn finer than they appear,
# which lowers the frozen bias of linear interpolation; large ones coarser, which costs time but no accuracy.
FEWEST_PX_PER_MODULE = 8
MOST_PX_PER_MODULE = 14
# Patches of markers with smaller modules are enlarged twice before they are registered.
ENLARGE_BELOW_PX_PER_MODULE = 8.0
TEMPLATE_TEXELS_PER_MODULE = 32
# Gaussian blurs (σ in modules) that the template is tried with: from a sharp print to a marker that just decodes.
BLURS_MODULES = (0.045, 0.08, 0.13, 0.2, 0.3, 0.42, 0.6)
ITERATIONS = 20
PRECISION = 1e-6
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
    black_and_white = pattern(dictionary, marker_id).astype(np.float32)
    texels = TEMPLATE_TEXELS_PER_MODULE
    # A full module of quiet zone is drawn, blurred, then cut, so that the blur meets white beyond the cut.
    fine = np.kron(np.pad(black_and_white, 1, constant_values=1.0), np.ones((texels, texels), dtype=np.float32))
    fine = cv2.GaussianBlur(fine, (0, 0), blur_modules * texels, borderType=cv2.BORDER_REPLICATE)
    cut = round((1 - MARGIN_MODULES) * texels)
    return np.asarray(cv2.resize(fine[cut:-cut, cut:-cut], (size, size), interpolation=cv2.INTER_AREA))


@lru_cache(maxsize=64)
def _grid(size: int) -> tuple[Floats, Floats]:
    """Template coordinates about its centre in units of half its size, (size²,) each."""
    across = (np.arange(size) - (size - 1) / 2) / (size / 2)
    y, x = np.meshgrid(across, across, indexing="ij")
    return x.ravel(), y.ravel()


def localise(
    capture_dn: NDArray[np.uint16], corners_px: Floats, marker_id: int, dictionary: str, sensor: Sensor
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
    size = round(span * min(max(px_per_module, FEWEST_PX_PER_MODULE), MOST_PX_PER_MODULE))
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
    registered = _register(patch, to_patch @ warp, dictionary, marker_id, size)
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
    patch: NDArray[np.float32], warp: Floats, dictionary: str, marker_id: int, size: int
) -> tuple[Floats, NDArray[np.float32], float] | None:
    """Align the template, sharp at first, then with the blur that fits the image best."""
    coarse, template = BLURS_MODULES[2], None
    found = _align(_template(dictionary, marker_id, size, coarse), patch, warp, ITERATIONS // 4)
    if found is None:
        return None
    warp, _ = found
    seen = cv2.warpPerspective(patch, warp, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    fits = [_correlation(seen, _template(dictionary, marker_id, size, blur)) for blur in BLURS_MODULES]
    template = _template(dictionary, marker_id, size, BLURS_MODULES[int(np.argmax(fits))])
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


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum() + 1e-30))


def _apply(warp: Floats, size: int) -> Floats:
    """Image pixels (2,) of the template's centre."""
    x, y, w = warp @ ((size - 1) / 2, (size - 1) / 2, 1.0)
    return np.array([x / w, y / w])


def _covariance(seen: Floats, template: Floats, warp: Floats, sensor: Sensor) -> Floats | None:
    """px², covariance (2, 2) of the centre, by the sandwich of an equally weighted fit under the capture's noise.

    Parameters of the fit: the eight of a homography about the template's centre, of which the first two move the
    centre, then gain and offset.
    """
    size = template.shape[0]
    x, y = _grid(size)
    model = np.column_stack([template.ravel(), np.ones(size * size)])
    (gain, offset), *_ = np.linalg.lstsq(model, seen.ravel(), rcond=None)
    if gain <= 0:
        return None
    gy, gx = (gain * slope.ravel() for slope in np.gradient(template))
    design = np.column_stack(
        [gx, gy, gx * x, gx * y, gy * x, gy * y, gx * x * x + gy * x * y, gx * x * y + gy * y * y, model]
    )
    to_image = _local_scale(warp, size)
    # One template pixel stands for this many image pixels, each with a noise of its own.
    area = abs(np.linalg.det(to_image))
    fitted = gain * template.ravel() + offset
    electrons = np.maximum((fitted - sensor.black_level_dn) * sensor.gain_e_per_dn, 0.0)
    noise = (electrons + sensor.read_noise_e**2) / sensor.gain_e_per_dn**2 + 1 / 12
    normal = design.T @ design
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        return None
    spread = inverse @ ((design * noise[:, None]).T @ design) @ inverse / area
    covariance = to_image @ spread[:2, :2] @ to_image.T
    return np.asarray(covariance + BIAS_FLOOR_PX**2 * np.eye(2))


def _local_scale(warp: Floats, size: int) -> Floats:
    """Image pixels per template pixel at the template's centre: the Jacobian of the homography, (2, 2)."""
    u, v, w = warp @ ((size - 1) / 2, (size - 1) / 2, 1.0)
    return np.asarray((warp[:2, :2] - np.outer([u / w, v / w], warp[2, :2])) / w)
