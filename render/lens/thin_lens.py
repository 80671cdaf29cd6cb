"""The metric's camera as Mitsuba's thin lens. The only place where pixel conventions are converted."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import norm

from pss import PTZCamera
from pss.hints import Floats

__all__ = ["circumradius", "film_position", "load_sensor", "pixel_response", "sensor_dict", "straight_film"]


NEAR_M, FAR_M = 1e-2, 1e3
# Steps of the table of a pixel's response, and the extent of its tails in σ: 6e-7 of the light is beyond.
RESPONSE_QUANTILES = 2048
RESPONSE_REACH = 5.0


def film_position(pixels: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Mitsuba's film coordinates of OpenCV's `pixels`: its first pixel's centre is (0.5, 0.5), OpenCV's (0, 0)."""
    return pixels + 0.5


def sensor_dict(camera: PTZCamera, mi: Any) -> dict[str, Any]:
    """Mitsuba's description of `camera`: same field of view, aperture and plane of focus; a box filter as pixel."""
    rotation = camera.rotation
    # Mitsuba's camera points along +z with x to the left and y up.
    to_world = np.eye(4)
    to_world[:3, :3] = np.column_stack([-rotation[0], -rotation[1], rotation[2]])
    to_world[:3, 3] = camera.position_m
    return {
        "type": "thinlens",
        "fov": camera.horizontal_fov_deg,
        "fov_axis": "x",
        "aperture_radius": camera.aperture_diameter_m / 2 * circumradius(camera.aperture_blades),
        "focus_distance": camera.focus_distance_m,
        "near_clip": NEAR_M,
        "far_clip": FAR_M,
        "to_world": mi.ScalarTransform4f(to_world),
        "film": {
            "type": "hdrfilm",
            "width": camera.resolution[0],
            "height": camera.resolution[1],
            "pixel_format": "luminance",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
    }


def straight_film(camera: PTZCamera) -> tuple[Floats, Floats]:
    """Mitsuba's film coordinates of the directions of the pixels' centres, each (height · width,).

    Mitsuba's lens has no distortion; a pixel of a distorting lens has the direction of another pixel's.

    Raises:
        RangeError: the lens forms no image at a pixel.
    """
    width, height = camera.resolution
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(float)
    film = film_position(camera.undistorted_px(pixels))
    return film[:, 0], film[:, 1]


def circumradius(blades: int) -> float:
    """Circumradius of an aperture with this many blades, over the radius of the round one of the same area."""
    return math.sqrt(2 * math.pi / (blades * math.sin(2 * math.pi / blades))) if blades else 1.0


def pixel_response(psf_sigma_px: float) -> Floats:
    """Quantiles, in px from the pixel's first edge, of the sharp-image positions of the light that it collects.

    This is the convolution of the pixel's width with the lens's Gaussian: samples drawn from it reproduce the blur and
    need no dimension of their own. Without blur it is the pixel's width.
    """
    levels = np.arange(RESPONSE_QUANTILES + 1) / RESPONSE_QUANTILES
    if psf_sigma_px == 0:
        return levels
    reach = RESPONSE_REACH * psf_sigma_px
    place = np.linspace(-reach, 1 + reach, 64 * RESPONSE_QUANTILES)
    # The integral of Φ is xΦ + φ; the distribution function of the sum is a difference of two.
    below, above = ((z := (place - edge) / psf_sigma_px) * ndtr(z) + norm.pdf(z) for edge in (0.0, 1.0))
    share = psf_sigma_px * (below - above)
    return np.interp(levels, (share - share[0]) / (share[-1] - share[0]), place)


def load_sensor(camera: PTZCamera, mi: Any) -> Any:
    """Mitsuba's sensor object of `camera`.

    Raises:
        RangeError: radial distortion that folds the image within the sensor's area.
    """
    straight_film(camera)  # raises before anything is rendered if the lens does not image a corner
    sensor = mi.load_dict(sensor_dict(camera, mi))
    if not mi.variant().startswith("scalar"):
        _make_settings_data(sensor, mi)
    return sensor


def _make_settings_data(sensor: Any, mi: Any) -> None:
    """Turn the settings from constants in the compiled code into data, so that a new setting needs no compilation.

    As constants they cost a second of compilation per view (benchmarks/README.md).
    """
    import drjit as dr

    parameters = mi.traverse(sensor)
    for name in ("to_world", "aperture_radius", "focus_distance", "x_fov"):
        value = parameters[name]
        dr.make_opaque(value)
        parameters[name] = value
    parameters.update()
