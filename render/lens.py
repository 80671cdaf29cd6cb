"""The camera of the metric as Mitsuba's thin lens. The one place where pixel conventions are converted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera

__all__ = ["film_position", "load_sensor", "sensor_dict"]

NEAR_M, FAR_M = 1e-2, 1e3


def film_position(pixels: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Mitsuba's film coordinates of OpenCV's `pixels`: its first pixel's centre is (0.5, 0.5), OpenCV's (0, 0)."""
    return pixels + 0.5


def sensor_dict(camera: PTZCamera, mi: Any) -> dict[str, Any]:
    """Mitsuba's description of `camera`: same field of view, aperture and plane of focus; a box filter as pixel."""
    rotation = camera.rotation
    # Mitsuba looks along +z with x to the left and y up.
    to_world = np.eye(4)
    to_world[:3, :3] = np.column_stack([-rotation[0], -rotation[1], rotation[2]])
    to_world[:3, 3] = camera.position_m
    return {
        "type": "thinlens",
        "fov": camera.horizontal_fov_deg,
        "fov_axis": "x",
        "aperture_radius": camera.aperture_diameter_m / 2,
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


def load_sensor(camera: PTZCamera, mi: Any) -> Any:
    """Mitsuba's sensor object of `camera`."""
    sensor = mi.load_dict(sensor_dict(camera, mi))
    if not mi.variant().startswith("scalar"):
        _make_settings_data(sensor, mi)
    return sensor


def _make_settings_data(sensor: Any, mi: Any) -> None:
    """Turn the settings from constants in the compiled code into data, so that a new setting compiles nothing new.

    As constants they cost a second of compilation for each view (benchmarks/README.md).
    """
    import drjit as dr

    parameters = mi.traverse(sensor)
    for name in ("to_world", "aperture_radius", "focus_distance", "x_fov"):
        value = parameters[name]
        dr.make_opaque(value)
        parameters[name] = value
    parameters.update()
