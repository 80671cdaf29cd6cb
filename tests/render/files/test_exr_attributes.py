"""OpenEXR's standard attributes in a view's header, read from the file's bytes by the format's own layout."""

from __future__ import annotations

import dataclasses
import math
import struct

import cv2
import numpy as np
import pytest

from render.files.exr import read_view, write_view
from tests.helpers.views import an_awkward_view

# The attributes are single precision: 24 bits, of metres and of numbers below 1000.
SINGLE = 1e-6
# Pixels: single precision of a projection 37 pixels wide.
PIXELS = 1e-4


def attributes(content: bytes) -> dict[str, tuple[str, bytes]]:
    """Type and bytes of each attribute of a single-part OpenEXR file: name\\0 type\\0 size (int32) value, until \\0."""
    assert struct.unpack_from("<i", content)[0] == 20000630
    place, found = 8, {}
    while content[place]:
        name, kind, rest = content[place:].split(b"\0", 2)
        start = place + len(name) + len(kind) + 6
        (size,) = struct.unpack("<i", rest[:4])
        found[name.decode()] = (kind.decode(), content[start : start + size])
        place = start + size
    return found


def numbers(found: dict[str, tuple[str, bytes]], name: str, kind: str) -> np.ndarray:
    stated, content = found[name]
    assert stated == kind
    return np.frombuffer(content, "<f4").astype(float)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The file's attributes and the view that was written."""
    path = tmp_path_factory.mktemp("exr") / "view.exr"
    request, view = an_awkward_view()
    camera = dataclasses.replace(view.camera, f_number=2.8, zoom=1.7, tilt_deg=-31.0)
    view = dataclasses.replace(view, camera=camera)
    write_view(path, view, request)
    assert read_view(path).camera == camera
    return attributes(path.read_bytes()), view


def test_lens_and_exposure_have_openexrs_names_and_units(stored):
    """focus in m, aperture an f-number, expTime in s, focal lengths in mm, the sensor in mm and µm."""
    found, view = stored
    camera, pitch_um = view.camera, view.camera.pixel_pitch_m * 1e6
    width, height = camera.resolution
    image_mm = pitch_um / 1e3 * width / 2 / math.tan(math.radians(90 / camera.zoom) / 2)
    thin_lens_mm = 1 / (1 / image_mm + 1 / (camera.focus_distance_m * 1e3))
    for name, value in {
        "focus": camera.focus_distance_m,
        "aperture": 2.8,
        "expTime": view.sensor.exposure_ms / 1e3,
        "nominalFocalLength": thin_lens_mm,
        "effectiveFocalLength": thin_lens_mm,
        "pinholeFocalLength": image_mm,
        "sensorPhotositePitch": pitch_um,
        "screenWindowWidth": 2 * math.tan(math.radians(90 / camera.zoom) / 2),
    }.items():
        assert numbers(found, name, "float") == pytest.approx([value], rel=SINGLE), name
    size_mm = [width * pitch_um / 1e3, height * pitch_um / 1e3]
    assert numbers(found, "sensorOverallDimensions", "v2f") == pytest.approx(size_mm, rel=SINGLE)
    assert not numbers(found, "sensorCenterOffset", "v2f").any()
    assert not numbers(found, "screenWindowCenter", "v2f").any()
    assert found["cameraLabel"] == ("string", camera.name.encode())


def test_world_to_camera_is_for_row_vectors_and_left_handed_with_y_up(stored):
    """OpenEXR's camera space: x right, y up, z forward; a mirror image of the right-handed world."""
    found, view = stored
    matrix = numbers(found, "worldToCamera", "m44f").reshape(4, 4)
    pan, tilt = math.radians(view.camera.pan_deg), math.radians(view.camera.tilt_deg)
    forward = np.array([math.sin(pan) * math.cos(tilt), math.cos(pan) * math.cos(tilt), math.sin(tilt)])
    right = np.array([math.cos(pan), -math.sin(pan), 0.0])
    up = np.cross(right, forward)
    for offset, there in ((0 * up, [0, 0, 0]), (right, [1, 0, 0]), (up, [0, 1, 0]), (forward, [0, 0, 1])):
        point = np.append(view.camera.position_m + offset, 1.0)
        np.testing.assert_allclose(point @ matrix, [*there, 1], atol=SINGLE * 10)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(-1, abs=SINGLE * 10)


def test_world_to_ndc_is_the_projection(stored):
    """(0, 0) is the upper left corner of the upper left pixel, (1, 1) the lower right corner of the last."""
    found, view = stored
    camera = view.camera
    assert not any(camera.radial_distortion)
    matrix = numbers(found, "worldToNDC", "m44f").reshape(4, 4)
    rng = np.random.default_rng(3)
    local = rng.uniform([-1, -1, 1], [1, 1, 6], (50, 3))
    points = camera.position_m + local @ camera.rotation
    x, y, z, w = (np.column_stack([points, np.ones(50)]) @ matrix).T
    pixels, depth = camera.project(points)
    ours = np.column_stack([x / w, y / w]) * camera.resolution - 0.5
    np.testing.assert_allclose(ours, pixels, atol=PIXELS)
    np.testing.assert_allclose(z / w, 1 - 1 / depth, atol=SINGLE * 10)


def test_the_installed_opencv_has_no_openexr_as_the_page_states():
    """docs/scenes.md sends readers to OpenImageIO; an OpenCV that can read them would need other advice."""
    (line,) = (line for line in cv2.getBuildInformation().splitlines() if "OpenEXR" in line)
    assert line.split() == ["OpenEXR:", "NO"]
