"""Localise a marker's centre by registering its own ideal image to the capture, with the covariance of the result.

The decoded marker determines its ideal image. A coarse registration starts from the detector's corners; then
the pixels on the marker are fitted, each with the weight of its own noise (the sensor's calibration turns grey values
into noise, as in a real camera). The covariance is the inverse of that fit's Fisher matrix, and the fit's residuals
test whether the marker was identified correctly. The true positions are not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from pss.hints import AnyFloats
from render.world.marker_print import pattern
from validate.markers.coarse_fit import coarse_fit
from validate.markers.marker_image import DIAMETERS_PER_SIGMA, MarkerImage
from validate.markers.registration import Fit, Linearised, Pixels, centre_of, local_scale, pixels_on

__all__ = ["Localised", "Refusal", "localise", "register"]


# Pixels count this far beyond the black border: inside the quiet zone, so that nothing beyond the plate counts.
# Where the plate's edge is blurred, its blur does, but never so much that the border's own edge goes with it.
MARGIN_MODULES, SMALLEST_MARGIN_MODULES = 0.75, 0.25
# px from its centre that a pixel reaches, along its diagonal.
PIXEL_REACH_PX = 0.71
# The first step from the coarse registration is taken on a part of the pixels, about so many a module each way.
FIRST_PX_PER_MODULE = 5.0
# One in 37: of fewer, too few would lie on the sharp edges of a large marker, and all of one direction on one line.
MOST_THINNING = 6
# Enough for the parameters many times over; a marker that was decoded has ten times as many.
FEWEST_PIXELS = 60
# Steps until the last one moved the centre by less than this many of its σ: the error left is smaller by another factor
# of five, so that 1 % is added to the variance (benchmarks/README.md).
CONVERGED_SIGMAS = 0.5
# And until it changed the blur by less than so many of its σ: the centre may stand still where the blur is far off, but
# the residuals are those of another marker.
SETTLED_SIGMAS = 3.0
# Two to four are usual. Sharp markers of 40 px a module and more begin too far off for their edges' slope at times.
MOST_STEPS = 12
# The ideal image is drawn anew where the fit's blur is further from it than this share; within, its derivative serves.
# Sharp edges have no such share: with the blur of a lens in focus they change by no straight line.
SAME_BLUR_SHARE = 0.1
# Residual bias of registration, which a covariance from noise does not contain: px (σ per axis) of a marker that stands
# on its corner, times the px of a module across its shorter side. Corners of modules make it, each a smaller part of a
# larger marker, and none of a level one; RMS measured on noise-free drawings (benchmarks/README.md).
CORNER_BIAS_PX2 = 0.005
# A registration below this correlation is not the marker it was decoded as, or nearly all noise.
SMALLEST_CORRELATION = 0.5
# The registration must end near its start: the corners are good to about a pixel, blur and noise may triple that.
LARGEST_MOVE_MODULES = 1.0
# Reduced χ² of the residuals: 1, by chance this many σ more, a little for the sampling noise of renders, and what a
# model that is off by this share of the contrast adds. Registered markers stay within a third of that share; one whose
# border is hidden in part is off by ten times as much.
CHANCE_SIGMAS, LARGEST_EXCESS, MODEL_SHARE = 5.0, 0.05, 0.03


class Refusal(Enum):
    """Why a decoded marker was not localised."""

    CUT = "the image ends on it"
    LOST = "the registration did not settle near the corners"
    UNLIKE = "its pixels are not those of this marker"


@dataclass(frozen=True, eq=False)
class Localised:
    """Where a marker's centre is.

    Attributes:
        centre_px: px, OpenCV's, (2,).
        covariance_px2: px², (2, 2).
        correlation: of the marker's pixels and their model.
        residual_chi2: reduced χ² of the fit's residuals under the sensor's noise.
    """

    centre_px: AnyFloats
    covariance_px2: AnyFloats
    correlation: float
    residual_chi2: float


def localise(
    capture_dn: NDArray[np.uint16], corners_px: AnyFloats, marker_id: int, dictionary: str, sensor: ImageSensor
) -> Localised | None:
    """Register one decoded marker; None where that is refused. Arguments as of `register`."""
    found = register(capture_dn, corners_px, marker_id, dictionary, sensor)
    return found if isinstance(found, Localised) else None


def register(
    capture_dn: NDArray[np.uint16], corners_px: AnyFloats, marker_id: int, dictionary: str, sensor: ImageSensor
) -> Localised | Refusal:
    """Register one decoded marker, or give the reason for failure.

    Args:
        capture_dn: digital numbers, (height, width).
        corners_px: pixels, the corners of its black border as the detector found them, (4, 2), top left first.
    """
    half = len(pattern(dictionary, marker_id)) / 2
    start = _start(corners_px, half)
    if not _inside(start, half + MARGIN_MODULES, capture_dn.shape):
        return Refusal.CUT
    fit = coarse_fit(capture_dn, start, marker_id, dictionary)
    if fit is None or not _near(fit, start):
        return Refusal.LOST

    thinning = min(round(_px_per_module(start) / FIRST_PX_PER_MODULE), MOST_THINNING)
    image: MarkerImage | None = None
    pixels: Pixels | None = None
    move = np.inf
    for number in range(MOST_STEPS):
        if number < 2:
            pixels = _pixels(capture_dn, fit, half, thinning if number == 0 else 0)
        if pixels is None:
            return Refusal.LOST
        if image is None or abs(fit.blur_px2 - image.blur_px2) > SAME_BLUR_SHARE * image.blur_px2:
            image = MarkerImage(dictionary, marker_id, cv2.invert(local_scale(fit.homography))[1], fit.blur_px2)
        before_px2 = fit.blur_px2
        linearised = Linearised(pixels, fit, image, sensor)
        if linearised.covariance is None or not linearised.fit.gain_dn > 0:
            return Refusal.LOST
        fit, chi2, move = linearised.step()
        if not _near(fit, start):
            return Refusal.LOST
        settled = abs(fit.blur_px2 - before_px2) < SETTLED_SIGMAS * np.sqrt(linearised.covariance[-1, -1])
        if move < CONVERGED_SIGMAS and settled and number > 0:
            break
    chance = CHANCE_SIGMAS * np.sqrt(2 / linearised.dof)
    largest = 1 + LARGEST_EXCESS + chance + MODEL_SHARE**2 * linearised.contrast2
    if not chi2 < largest or linearised.correlation < SMALLEST_CORRELATION:
        return Refusal.UNLIKE
    to_px = local_scale(fit.homography) * half
    # Residuals larger than the noise are errors of the model: then the centre is less certain, too.
    covariance = max(chi2, 1.0) * to_px @ linearised.covariance[:2, :2] @ to_px.T
    covariance = (covariance + covariance.T) / 2 + _corner_bias_px(fit.homography) ** 2 * np.eye(2)
    return Localised(centre_of(fit.homography), covariance, linearised.correlation, chi2)


def _start(corners_px: AnyFloats, half: float) -> AnyFloats:
    """Homography from modules about the centre to pixels that takes the border's corners to where they were found."""
    ideal = np.array([[-half, -half], [half, -half], [half, half], [-half, half]], dtype=np.float32)
    return np.asarray(cv2.getPerspectiveTransform(ideal, corners_px.astype(np.float32)), dtype=float)


def _inside(homography: AnyFloats, reach: float, shape: tuple[int, ...]) -> bool:
    """Whether the image of `shape` (height, width) holds the marker up to ±`reach` modules."""
    ends = np.array([[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]])
    outline = cv2.perspectiveTransform(ends[None], homography)[0]
    return bool((outline >= 0).all() and (outline <= (shape[1] - 1, shape[0] - 1)).all())


def _px_per_module(homography: AnyFloats) -> float:
    return float(np.sqrt(abs(np.linalg.det(local_scale(homography)))))


def _corner_bias_px(homography: AnyFloats) -> float:
    """px (σ per axis), by a kernel at the modules' corners that is no product of its two projections.

    A level pixel is one; turned by 45° it is furthest from it.
    """
    scale = local_scale(homography)
    u, v = cv2.invert(scale)[1]
    share = float(np.abs(u * v).sum() / (np.hypot(*u) * np.hypot(*v)))
    half_sum, area = float((scale**2).sum()) / 2, abs(float(np.linalg.det(scale)))
    # A circle of a module's radius becomes an ellipse: the sum of its half axes' squares, and their product.
    shorter = area / float(np.sqrt(half_sum + np.sqrt(max(half_sum**2 - area**2, 0.0))))
    return CORNER_BIAS_PX2 * share / shorter


def _near(fit: Fit, start: AnyFloats) -> bool:
    """Whether a fit is finite and its centre near that of the start."""
    if not np.isfinite(fit.homography).all():
        return False
    moved = np.linalg.norm(centre_of(fit.homography) - centre_of(start))
    return bool(moved < LARGEST_MOVE_MODULES * _px_per_module(start))


def _pixels(capture_dn: NDArray[np.uint16], fit: Fit, half: float, thinning: int) -> Pixels | None:
    """The pixels that the blur of the plate's edge leaves to the marker; None if too few."""
    to_modules = cv2.invert(local_scale(fit.homography))[1]
    blur_px = DIAMETERS_PER_SIGMA / 2 * np.sqrt(fit.blur_px2) + PIXEL_REACH_PX
    margin = np.clip(1 - blur_px * np.hypot(*to_modules.T), SMALLEST_MARGIN_MODULES, MARGIN_MODULES)
    pixels = pixels_on(capture_dn, fit.homography, half + margin, thinning)
    return pixels if len(pixels.x) >= FEWEST_PIXELS else None
