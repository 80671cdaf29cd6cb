"""Views as OpenEXR files: layers for viewers, and a header from which camera and sensor are restored exactly.

A channel's name before its last dot is its layer, as OpenEXR viewers group them:

| layer | channels | type | content |
|---|---|---|---|
| (first) | `Y` | float | radiance in W/(m² sr) |
| `capture` | `capture.Y` | float | one noisy exposure, whole digital numbers (DN) |
| `depth` | `depth.Z` | float | m along the optical axis, at the pixel's centre; inf: nothing |
| `normal` | `normal.X`, `.Y`, `.Z` | half | unit vector in the world |
| `marker` | `marker.id` | float | id of the marker whose plate is hit, a whole number; −1: none |

Viewers display `Y` as luminance, and so the captures. The header also has OpenEXR's standard attributes
(`render.files.exr_attributes`).
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.metadata
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from pss import ImageSensor, PSSError, PTZCamera, RangeError
from pss.json_text import json_text
from render.certificate import Certificate
from render.files.exr_attributes import standard_attributes
from render.images import one_line, open_image
from render.keys import view_code
from render.renderer import RenderedView, ViewRequest

__all__ = ["ImageFileError", "ViewPlanes", "read_planes", "read_view", "write_view"]

# OpenEXR's channels, in the order in which they are written.
CHANNELS = ("Y", "capture.Y", "depth.Z", "normal.X", "normal.Y", "normal.Z", "marker.id")
UNITS = {
    "Y": "W/(m2 sr)",
    "capture.Y": "digital numbers",
    "depth.Z": "m along the optical axis",
    "normal": "unit vector in the world",
    "marker.id": "number of the marker, -1 where there is none",
}
# float32 for measured quantities; half would truncate a 12-bit capture and the third digit of depth.
TYPES = ("float", "float", "float", "half", "half", "half", "float")
# zlib at its fastest level: 0.5 s and 9.6 MB a view of 1280 × 960; higher levels save 1 %.
COMPRESSION = "zip:1"


class ImageFileError(PSSError, OSError):
    """An image file cannot be written or read, or was not written by this project."""


@dataclass(frozen=True, eq=False)
class ViewPlanes:
    """Some channels of a view, (height, width) each, by their names in the file."""

    key: str
    camera: PTZCamera
    sensor: ImageSensor
    planes: Mapping[str, NDArray[np.float32]]


def write_view(path: Path, view: RenderedView, request: ViewRequest) -> None:
    """Write `view` to `path`. The caller chooses a temporary name and renames it (see `render.store.folder`)."""
    height, width = view.radiance.shape
    spec = oiio.ImageSpec(width, height, len(CHANNELS), "float")
    spec.channelnames = CHANNELS
    spec.channelformats = tuple(oiio.TypeDesc(name) for name in TYPES)
    spec["compression"] = COMPRESSION
    for name, (kind, value) in standard_attributes(view.camera, view.sensor).items():
        spec.attribute(name, kind, value)
    for name, value in header(view, request).items():
        spec.attribute(name, value)
    layers = [view.radiance, view.capture_dn, view.depth_m, view.normal, view.marker_id]
    pixels = np.ascontiguousarray(np.dstack(layers), dtype=np.float32)
    output = oiio.ImageOutput.create("exr")
    if output is None:
        raise ImageFileError(f"OpenImageIO has no OpenEXR writer: {oiio.geterror()}")
    if not output.open(str(path), spec) or not output.write_image(pixels) or not output.close():
        raise ImageFileError(f"{path}: {output.geterror() or oiio.geterror()}")


def header(view: RenderedView, request: ViewRequest) -> dict[str, str]:
    """The attributes of a view's file: everything that determines it, and OpenCV's K, R, t for other tools."""
    camera = view.camera
    versions = {name: importlib.metadata.version(name) for name in ("mitsuba", "drjit", "OpenImageIO", "numpy")}
    content = {
        "key": view.key,
        "camera": {**dataclasses.asdict(camera)},
        "lens": {
            "focal_length_m": camera.focal_length_m,
            "aperture_diameter_m": camera.aperture_diameter_m,
            "image_distance_m": camera.image_distance_m,
        },
        "sensor": dataclasses.asdict(view.sensor),
        "sampling": dataclasses.asdict(request.sampling),
        "certificate": dataclasses.asdict(view.certificate),
        "seed": {"run_seed": 0, "streams": ["render", "sample capture"], "trial": 0},
        "versions": {"render": view_code().digest, "renderer": request.renderer, **versions},
        "K": camera.intrinsic_matrix.tolist(),
        "R": camera.rotation.tolist(),
        "t_m": camera.translation_m.tolist(),
        "units": UNITS,
    }
    return {f"pss:{name}": value if isinstance(value, str) else json_text(value) for name, value in content.items()}


def read_view(path: Path) -> RenderedView:
    """Read a view: the same camera, sensor and images that were written.

    Raises:
        ImageFileError: the file is missing, damaged, larger than `render.images` allows, or lacks a header attribute.
    """
    with _opened(path) as image:
        spec = image.spec()
        camera = PTZCamera(**_attribute(path, spec, "camera"))
        pixels = image.read_image(0, 0, 0, spec.nchannels, "float")
        if pixels is None:
            raise ImageFileError(f"{path}: {one_line(image.geterror())}")
        planes = {name: pixels[..., number] for number, name in enumerate(spec.channelnames)}
        _check_planes(path, planes, camera, (spec.width, spec.height))
        return RenderedView(
            spec.get_string_attribute("pss:key"),
            camera,
            ImageSensor(**_attribute(path, spec, "sensor")),
            np.ascontiguousarray(planes["Y"]),
            np.ascontiguousarray(planes["depth.Z"]),
            np.dstack([planes[f"normal.{axis}"] for axis in "XYZ"]),
            planes["marker.id"].astype(np.int32),
            planes["capture.Y"].astype(np.uint16),
            _certificate(path, spec),
        )


def read_planes(path: Path, names: Sequence[str]) -> ViewPlanes:
    """Some of a view's channels; a third of the time of reading all.

    Raises:
        ImageFileError: as `read_view`.
    """
    with _opened(path) as image:
        spec = image.spec()
        camera = PTZCamera(**_attribute(path, spec, "camera"))
        at = [list(spec.channelnames).index(name) for name in names]
        first = min(at)
        pixels = image.read_image(0, 0, first, max(at) + 1, "float")
        if pixels is None:
            raise ImageFileError(f"{path}: {one_line(image.geterror())}")
        planes = {name: np.ascontiguousarray(pixels[..., n - first]) for name, n in zip(names, at, strict=True)}
        _check_planes(path, planes, camera, (spec.width, spec.height))
        sensor = ImageSensor(**_attribute(path, spec, "sensor"))
        return ViewPlanes(spec.get_string_attribute("pss:key"), camera, sensor, planes)


def _check_planes(path: Path, planes: dict[str, Any], camera: PTZCamera, size: tuple[int, int]) -> None:
    """Check that the image has the camera's size, and that integer channels have integers."""
    if tuple(camera.resolution) != size:
        raise ImageFileError(
            f"{path}: {size[0]} × {size[1]} pixels of a camera of {camera.resolution[0]} × {camera.resolution[1]}; "
            "allowed are views that this project wrote"
        )
    for name, lowest, highest in (("marker.id", -1, 2**24), ("capture.Y", 0, 2**16 - 1)):
        plane = planes.get(name)
        # Written so that nan fails.
        if plane is not None and not ((plane >= lowest) & (plane <= highest) & (plane == np.round(plane))).all():
            raise ImageFileError(f"{path}: {name} has a value that is not a whole number from {lowest} to {highest}")


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """OpenImageIO's reader of a view; a missing channel or a wrong header raises `ImageFileError`.

    A stored view of older code is thus rendered again on request, instead of failing when it is measured.
    """
    try:
        image = open_image(path)
    except RangeError as error:
        raise ImageFileError(f"{path}: {error}") from error
    try:
        if missing := set(CHANNELS) - set(image.spec().channelnames):
            raise ImageFileError(f"{path}: no channel {', '.join(sorted(missing))}; allowed are views of this version")
        yield image
    except (KeyError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
        raise ImageFileError(f"{path}: {one_line(str(error))}; allowed are views that this project wrote") from error
    finally:
        image.close()


def _certificate(path: Path, spec: Any) -> Certificate:
    content = _attribute(path, spec, "certificate")
    try:
        return Certificate.from_json(content)
    except RangeError as error:
        raise ImageFileError(f"{path}: {error}") from error


def _attribute(path: Path, spec: Any, name: str) -> dict[str, Any]:
    text = spec.get_string_attribute(f"pss:{name}")
    if not text:
        raise ImageFileError(f"{path}: the header lacks pss:{name}; allowed are views that this project wrote")
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ImageFileError(f"{path}: pss:{name} is {text[:60]!r}; allowed are views that this project wrote")
    return content
