"""OpenEXR's standard attributes for a camera; `render.files.exr` writes this project's (`pss:…`) beside them.

They follow OpenEXR's "Standard Attributes": matrices multiply row vectors from the right; the camera space is
left-handed, x right, y **up**, z forward (ours: y down); normalised device coordinates (NDC) run from (0, 0) at the
upper left corner of the image to (1, 1) at its lower right one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import OpenImageIO as oiio

from pss import ImageSensor, PTZCamera
from pss.hints import Floats

__all__ = ["standard_attributes", "world_to_camera", "world_to_ndc"]


FLOAT, MATRIX = oiio.TypeDesc("float"), oiio.TypeDesc("matrix")
PAIR = oiio.TypeDesc(oiio.BASETYPE.FLOAT, oiio.AGGREGATE.VEC2)


def standard_attributes(camera: PTZCamera, sensor: ImageSensor) -> dict[str, tuple[Any, Any]]:
    """The type and value of each attribute, by OpenImageIO's name for it.

    OpenImageIO writes `FNumber` as `aperture` and `ExposureTime` as `expTime`. For an ideal thin lens, the focal length
    f is in `effectiveFocalLength` and `nominalFocalLength`, and the image distance v, which determines the field of
    view, in `pinholeFocalLength`. Radial distortion has no standard attribute.
    """
    width, height = camera.resolution
    pitch_mm = camera.pixel_pitch_m * 1e3
    focal_length_mm = camera.focal_length_m * 1e3
    attributes: dict[str, tuple[Any, Any]] = {
        "focus": (FLOAT, camera.focus_distance_m),  # m
        "FNumber": (FLOAT, camera.f_number),
        "ExposureTime": (FLOAT, sensor.exposure_ms * 1e-3),  # s
        "nominalFocalLength": (FLOAT, focal_length_mm),  # mm
        "effectiveFocalLength": (FLOAT, focal_length_mm),  # mm
        "pinholeFocalLength": (FLOAT, camera.image_distance_m * 1e3),  # mm
        "sensorOverallDimensions": (PAIR, (width * pitch_mm, height * pitch_mm)),  # mm
        "sensorPhotositePitch": (FLOAT, pitch_mm * 1e3),  # µm
        "sensorCenterOffset": (PAIR, (0.0, 0.0)),  # µm
        # The image plane at a distance of 1, which every OpenEXR file has to state.
        "screenWindowWidth": (FLOAT, width / camera.focal_px),
        "screenWindowCenter": (PAIR, (0.0, 0.0)),
        "worldToCamera": (MATRIX, _flat(world_to_camera(camera))),
        "worldToNDC": (MATRIX, _flat(world_to_ndc(camera))),
    }
    if camera.name:
        attributes["cameraLabel"] = (oiio.TypeDesc("string"), camera.name)
    return attributes


def world_to_camera(camera: PTZCamera) -> Floats:
    """(4, 4), for row vectors: [X Y Z 1] @ M is [right, up, forward, 1] in metres."""
    upwards = np.diag([1.0, -1.0, 1.0])
    matrix = np.eye(4)
    matrix[:3, :3] = (upwards @ camera.rotation).T
    matrix[3, :3] = upwards @ camera.translation_m
    return matrix


def world_to_ndc(camera: PTZCamera) -> Floats:
    """(4, 4), for row vectors: [X Y Z 1] @ M, divided by its last number, is [x, y, …] in NDC.

    The third number, which OpenEXR does not define, is 1 − 1/depth: 0 at 1 m, 1 at infinity.
    """
    width, height = camera.resolution
    fx, fy = camera.focal_px / width, camera.focal_px / height
    from_camera = np.array([[fx, 0.0, 0.0, 0.0], [0.0, -fy, 0.0, 0.0], [0.5, 0.5, 1.0, 1.0], [0.0, 0.0, -1.0, 0.0]])
    return np.asarray(world_to_camera(camera) @ from_camera)


def _flat(matrix: Floats) -> tuple[float, ...]:
    return tuple(float(value) for value in matrix.reshape(-1))
