"""Blur of a target's edges: isotropic at rest, and along the direction of motion.

Uniform motion by L px during the exposure is a convolution with a box of length |L|, with the second moment L Lᵀ/12. It
adds to that of lens, defocus and pixel, s² I, and the sum is treated as a Gaussian. An edge with the unit normal n has
the blur s² + (n·L)²/12 across it. At its ends the blur along it counts, given the position across it: the conditional
variance s²(s² + L²/12) / (s² + (n·L)²/12). At rest both are s².
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pss.cameras.sensor import ImageSensor
from pss.cameras.views import Views
from pss.hints import Floats
from pss.noise.factors import of_camera

__all__ = ["EdgeBlur", "edge_blur", "sensors_of", "still_variance_px2", "way_across_px", "way_px"]


# px², variance of a square pixel's width.
PIXEL_VARIANCE_PX2 = 1 / 12
# A uniform disc of diameter cc has the standard deviation cc/4 along any axis.
DIAMETERS_PER_SIGMA = 4.0
# A uniform line of length L has the variance L²/12 along itself.
SQUARED_LENGTHS_PER_VARIANCE = 12.0


@dataclass(frozen=True, eq=False)
class EdgeBlur:
    """px (σ), the blur of edges with one direction, (C, N) each.

    Attributes:
        across: along the edges' normal.
        along: along the edges, given the position across them.
    """

    across: Floats
    along: Floats


def sensors_of(sensor: ImageSensor | Mapping[str, ImageSensor], views: Views) -> list[ImageSensor]:
    """The sensor of each of the C cameras, from one for all or one for each by the camera's name.

    Raises:
        RangeError: a camera without one.
    """
    if isinstance(sensor, ImageSensor):
        return [sensor] * len(views.cameras)
    return [of_camera(sensor, camera.name, "sensor") for camera in views.cameras]


def still_variance_px2(views: Views) -> Floats:
    """px², (C, N), blur of an edge at rest: of the lens in focus, of defocus, and of the pixel's width."""
    defocus_px = views.circle_of_confusion_px / DIAMETERS_PER_SIGMA
    return np.asarray(views.arrays.psf_sigma_px**2 + PIXEL_VARIANCE_PX2 + defocus_px**2)


def way_px(views: Views, sensor: ImageSensor | Mapping[str, ImageSensor]) -> Floats | None:
    """px, L, motion of each point in the image during the exposure, (C, 2, N); None if all are at rest.

    H_k times velocity times exposure: over the centimetres of an exposure, the path is straight and uniform.
    """
    if views.appearance is None or views.appearance.velocity_m_per_s is None:
        return None
    exposure_s = np.array([each.exposure_ms for each in sensors_of(sensor, views)]).reshape(-1, 1, 1) * 1e-3
    return np.asarray(views.image_of(np.asarray(views.appearance.velocity_m_per_s)) * exposure_s)


def way_across_px(side: Floats, way: Floats) -> Floats:
    """px, n·L, (C, N): component of the motion `way` (C, 2, N) across edges along `side` (C, 2, N)."""
    return np.asarray((side[:, 0] * way[:, 1] - side[:, 1] * way[:, 0]) / np.hypot(side[:, 0], side[:, 1]))


def edge_blur(still_px: Floats, side: Floats, way: Floats | None) -> EdgeBlur:
    """The blur of edges along `side`.

    Args:
        still_px: px (σ), the blur at rest, (C, N).
        side: px, (C, 2, N), of any length.
        way: px, (C, 2, N), from `way_px`.
    """
    if way is None:
        return EdgeBlur(still_px, still_px)
    across = np.sqrt(still_px**2 + way_across_px(side, way) ** 2 / SQUARED_LENGTHS_PER_VARIANCE)
    longest = np.sqrt(still_px**2 + (way[:, 0] ** 2 + way[:, 1] ** 2) / SQUARED_LENGTHS_PER_VARIANCE)
    # The root of the determinant is the product of the two, and also of the longest and the shortest.
    return EdgeBlur(across, still_px * (longest / across))
