"""Small things to render: a window of a real camera's image, and a bright disc in the dark."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor, PTZCamera
from render.certificate import Certificate
from render.lens import thin_lens
from render.lens.sampling import Sampling
from render.renderer import RenderedView, ViewRequest
from render.world.state import Light, MarkerPrint, Room, SceneState

Floats = NDArray[np.float64]

AWKWARD_RESOLUTION = (37, 23)


def window(camera: PTZCamera, target_m: Floats, resolution: tuple[int, int] = (64, 48)) -> PTZCamera:
    """A camera with the lens and pixels of `camera`, `resolution` of them, that looks at `target_m`.

    The same focal length in pixels: what it sees of a marker is as large, as sharp and as noisy.
    """
    fov_deg = math.degrees(2 * math.atan(resolution[0] / 2 / camera.focal_px))
    return dataclasses.replace(camera, widest_fov_deg=fov_deg, zoom=1, resolution=resolution).aimed_at(target_m)


def point_at(camera: PTZCamera, pixel: Floats, depth_m: float) -> Floats:
    """The point (3,) in the world that `camera` sees at `pixel` (2,), written without `PTZCamera.project`.

    A pixel is a direction: (pixel − middle of the sensor) / focal length, with half the sensor's width at half the
    field of view, and the centre of the first pixel half a pixel inside the sensor's edge.
    """
    width, height = camera.resolution
    half_width = math.tan(math.radians(camera.horizontal_fov_deg) / 2)
    right = ((pixel[0] + 0.5) / width * 2 - 1) * half_width
    down = ((pixel[1] + 0.5) / height * 2 - 1) * half_width * height / width
    return np.array(camera.position_m) + camera.rotation.T @ (depth_m * np.array([right, down, 1.0]))


def disc_scene(mi: Any, camera: PTZCamera, centre_m: Floats, diameter_px: float) -> Any:
    """A dark scene but for one disc that faces along the axis of `camera`, `diameter_px` wide in its image."""
    right, down, forward = camera.rotation
    depth_m = forward @ (centre_m - camera.position_m)
    place = np.eye(4)
    place[:3, :3] = np.column_stack([right, -down, -forward]) * (diameter_px / 2 * depth_m / camera.focal_px)
    place[:3, 3] = centre_m
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 1},
            "disc": {"type": "disk", "to_world": mi.ScalarTransform4f(place), "emitter": emitter},
        }
    )


def render_part(
    mi: Any, scene: Any, camera: PTZCamera, middle_px: Floats, size: int, samples: int, seed: int = 0
) -> tuple[Floats, Floats, Floats]:
    """A part of the image, `size` square about `middle_px`: its pixels, and the x and y that OpenCV gives them."""
    left, top = (round(float(middle)) - size // 2 for middle in middle_px)
    sensor = thin_lens.load_sensor(camera, mi)
    parameters = mi.traverse(sensor)
    parameters["film.crop_offset"], parameters["film.crop_size"] = (left, top), (size, size)
    parameters.update()
    pixels = np.array(mi.render(scene, sensor=sensor, spp=samples, seed=seed), dtype=float)[..., 0]
    y, x = np.mgrid[top : top + size, left : left + size].astype(float)
    return pixels, x, y


def centroid(pixels: Floats, x: Floats, y: Floats) -> Floats:
    """Pixels, (2,)."""
    return np.array([(pixels * x).sum(), (pixels * y).sum()]) / pixels.sum()


def variance(pixels: Floats, x: Floats, y: Floats) -> Floats:
    """Pixels², second central moment along x and y, (2,); 1/12 of it is the pixel's own width (Sheppard)."""
    middle = centroid(pixels, x, y)
    return centroid(pixels, (x - middle[0]) ** 2, (y - middle[1]) ** 2)


def an_awkward_view() -> tuple[ViewRequest, RenderedView]:
    """A request and its view, made without rendering, of numbers that are easily lost on the way to a file and back."""
    width, height = AWKWARD_RESOLUTION
    rng = np.random.default_rng(5)
    camera = PTZCamera(
        (0.1, -1 / 3, 2.8), 123.456789012345, -20.1, np.pi, focus_distance_m=3.3, resolution=(width, height), name="4"
    )
    sensor = ImageSensor(550.0, 0.5, 4.0, 10_000.0, 6.0, 16, 64)
    state = SceneState(
        Room(6.0, 6.0, 3.0, 0.5, 0.5, 0.5), Light(0.2, ()), (), (), MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04)
    )
    request = ViewRequest(state, camera, sensor, Sampling(noise_ratio=0.1), "mitsuba-3.9.0-scalar_rgb")
    depth = rng.uniform(0.5, 9, (height, width)).astype(np.float32)
    depth[0, 0] = np.inf
    normal = rng.standard_normal((height, width, 3))
    marker = rng.integers(-1, 1000, (height, width)).astype(np.int32)
    marker[1, 1] = 2**24 - 1
    capture = rng.integers(0, 2**16, (height, width)).astype(np.uint16)
    capture[0, :2] = 0, 2**16 - 1
    view = RenderedView(
        request.key,
        camera,
        sensor,
        rng.lognormal(-5, 4, (height, width)).astype(np.float32),
        depth,
        (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32),
        marker,
        capture,
        Certificate(0.1, 1 / 3, float("nan"), 1e-7, 0.4, 123_456_789, 0.25),
    )
    return request, view
