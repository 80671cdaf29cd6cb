"""What the cameras saw, small enough for a page: clean, noisy, depth and blur of each view, and crops of markers.

Where markers truly project is drawn over the pictures for the reader alone: it was never shown to the detector.
"""

from __future__ import annotations

import base64
import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera
from pss.hints import Pixels
from render.files.exr import ViewPlanes
from render.sensor import expected_electrons
from render.store.folder import Store
from render.store.views import stored_planes
from render.world.state import Marker, SceneState
from validate.pages.causes import causes
from validate.pages.figure import plain
from validate.pages.space import PLATE_MODULES
from validate.pages.steps import Step

__all__ = ["BUDGET_BYTES", "LAYERS", "MOST_BLUR_PX", "Crop", "Pictures", "chosen_crops", "overlay", "pictures_of"]


# Of all pictures of a report, as text in the page (base64 is a third longer than the files).
BUDGET_BYTES = 4_000_000
SHARE_OF_CROPS = 0.1
# px, widths that are tried from the largest on; more than the first is not seen on a page.
WIDTHS_PX = (640, 560, 480, 400, 320, 240, 160, 96)
QUALITY = 55
LAYERS = {
    "clean": "clean image",
    "noisy": "noisy capture",
    "depth": "depth",
    "blur": "blur",
}
# The channels of a stored view that each is made of.
CHANNELS = {"clean": "Y", "noisy": "capture.Y", "depth": "depth.Z", "blur": "depth.Z"}
# px, diameter of the circle of confusion that the scale ends at; a marker as blurred as that is never found.
MOST_BLUR_PX = 12.0
# Crops of each kind in a sweep.
CROPS = 6
CROP_PX = 168
# A crop's side over the marker's, and its least side in the capture's pixels.
CROP_MARGIN, LEAST_CROP_PX = 1.7, 28


@dataclass(frozen=True)
class Crop:
    """A marker in a view: `kind` is "best", "worst" or "missed"; `side_px` of the square that is cut out.

    Attributes:
        causes: of a missed one, what stands against its being found (`validate.pages.causes`).
    """

    kind: str
    view_key: str
    step: str
    camera: str
    point: int
    centre_px: tuple[float, float]
    side_px: int
    marker_px: float
    blur_px: float
    rate: float
    error_px: float
    causes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Pictures:
    """Data URIs: `views` by view and layer, `crops` in the order of the requests."""

    width_px: int
    views: Mapping[str, Mapping[str, str]]
    crops: Sequence[str]
    farthest_m: float


def chosen_crops(steps: Sequence[Step]) -> list[Crop]:
    """The markers worst and best localised of all steps, and the largest that should be seen and never were."""
    seen: dict[tuple[str, int], Crop] = {}
    places: dict[tuple[str, int], tuple[Marker, PTZCamera, SceneState]] = {}
    for step in steps:
        for number, (camera, sight) in enumerate(zip(step.cameras, step.sights, strict=True)):
            error = np.hypot(np.linalg.norm(sight.offset_px, axis=1), sight.spread_px)
            for point in np.flatnonzero(step.visible[number]):
                rate = float(sight.rate[point])
                if (sight.view_key, int(point)) in seen or (rate > 0 and not np.isfinite(error[point])):
                    continue
                marker = step.state.markers[point]
                places[sight.view_key, marker.id] = (marker, camera, step.state)
                depth = float(camera.to_camera_frame(np.array(marker.centre_m))[2])
                size = marker.module_m * PLATE_MODULES * camera.focal_px / depth
                x, y = (float(v) for v in sight.truth_px[point])
                kind = "missed" if rate == 0 else "found" if sight.found[point] else "seldom"
                side = max(LEAST_CROP_PX, math.ceil(CROP_MARGIN * size))
                seen[sight.view_key, int(point)] = Crop(
                    kind,
                    sight.view_key,
                    step.label,
                    camera.name,
                    marker.id,
                    (x, y),
                    side,
                    size,
                    float(sight.blur_px[point]),
                    rate,
                    float(error[point]) if rate > 0 else math.nan,
                )
    found = sorted((c for c in seen.values() if c.kind == "found"), key=lambda c: c.error_px)
    missed = sorted((c for c in seen.values() if c.kind == "missed"), key=lambda c: -c.marker_px)
    best = _of_different_markers(found)
    worst = _of_different_markers(c for c in reversed(found) if c not in best)
    return (
        [_named(c, "best") for c in best]
        + [_named(c, "worst") for c in worst]
        + [dataclasses.replace(c, causes=causes(*places[c.view_key, c.point])) for c in _of_different_markers(missed)]
    )


def _of_different_markers(crops: Iterable[Crop]) -> list[Crop]:
    kept: dict[int, Crop] = {}
    for crop in crops:
        if len(kept) < CROPS:
            kept.setdefault(crop.point, crop)
    return list(kept.values())


def _named(crop: Crop, kind: str) -> Crop:
    return dataclasses.replace(crop, kind=kind)


def overlay(step: Step, camera: int) -> list[list[Any]]:
    """Markers in a view, a row each: number, x, y, should be seen, rate, and mean error x, y and scatter in px."""
    sight, (width, height) = step.sights[camera], step.cameras[camera].resolution
    rows = []
    for point, (x, y) in enumerate(sight.truth_px):
        inside = -0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5
        if inside and (step.visible[camera, point] or sight.rate[point] > 0):
            numbers = plain(
                np.array(
                    [
                        *sight.truth_px[point],
                        step.visible[camera, point],
                        sight.rate[point],
                        *sight.offset_px[point],
                        sight.spread_px[point],
                    ]
                )
            )
            rows.append([step.state.markers[point].id, *numbers])
    return rows


def pictures_of(
    steps: Sequence[Step],
    crops: Sequence[Crop],
    store: Store,
    budget_bytes: float | None = None,
    widest_px: int = WIDTHS_PX[0],
) -> Pictures:
    """The pictures of all views of all steps, as wide as the budget allows.

    Args:
        budget_bytes: None for `BUDGET_BYTES`.
        widest_px: one of `WIDTHS_PX`; larger ones are not tried.

    Raises:
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    keys = list(dict.fromkeys(sight.view_key for step in steps for sight in step.sights))
    farthest = max((_diagonal_m(step) for step in steps), default=1.0)

    def seen(key: str) -> tuple[dict[str, Pixels], list[Pixels]]:
        view = stored_planes(store, key, list(dict.fromkeys(CHANNELS.values())))
        own = [_cut(view, crop) for crop in crops if crop.view_key == key]
        return {name: _layer(view, name, farthest, widest_px) for name in LAYERS}, own

    # Unpacking the images is most of the work, and releases Python's lock.
    with ThreadPoolExecutor(2) as pool:
        every = dict(zip(keys, pool.map(seen, keys), strict=True))
    waiting = {key: iter(own) for key, (_, own) in every.items()}
    cut = [_uri(next(waiting[crop.view_key]), 85) for crop in crops]
    layers = {key: pictures for key, (pictures, _) in every.items()}
    budget = BUDGET_BYTES if budget_bytes is None else budget_bytes
    room = budget - min(sum(map(len, cut)), SHARE_OF_CROPS * budget)
    for width in (width for width in WIDTHS_PX if width <= widest_px):
        encoded = _encoded(layers, width, room)
        if encoded is not None:
            return Pictures(width, encoded, cut, farthest)
    return Pictures(0, {}, cut, farthest)


def _diagonal_m(step: Step) -> float:
    room = step.state.room
    return float(math.ceil(math.hypot(room.width_m, room.length_m, room.height_m)))


def _layer(view: ViewPlanes, name: str, farthest_m: float, width_px: int) -> Pixels:
    """A layer at the largest width: light is reduced before it is turned into grey, depth is picked."""
    camera, plane = view.camera, view.planes[CHANNELS[name]]
    if name == "clean":
        return _grey(_reduced(expected_electrons(plane, camera, view.sensor).astype(np.float32), width_px))
    if name == "noisy":
        return _grey(np.maximum(_reduced(plane, width_px) - view.sensor.black_level_dn, 0))
    depth_m = _reduced(plane, width_px, cv2.INTER_NEAREST)
    if name == "depth":
        return _shaded(depth_m / farthest_m)
    with np.errstate(invalid="ignore"):
        away = np.abs(1 - camera.focus_distance_m / depth_m)
    return _shaded(camera.aperture_diameter_m * camera.focal_px / camera.focus_distance_m * away / MOST_BLUR_PX)


def _grey(light: NDArray[np.float32]) -> Pixels:
    """Light as grey, black level off: bright end at the 99.7th percentile, gamma 2.2, as on contact sheets."""
    share = np.clip(light / max(float(np.percentile(light, 99.7)), 1), 0, 1)
    return np.asarray(255 * share ** (1 / 2.2), dtype=np.uint8)


def _shaded(share: NDArray[np.floating]) -> Pixels:
    """Shares from 0 (light) to 1 (dark) in colours that remain distinct without colour vision."""
    level = 255 * (1 - np.clip(np.nan_to_num(share, nan=1.0, posinf=1.0), 0, 1))
    return np.asarray(cv2.applyColorMap(level.astype(np.uint8), cv2.COLORMAP_VIRIDIS), dtype=np.uint8)


def _reduced(picture: NDArray[Any], width_px: int, how: int = cv2.INTER_AREA) -> NDArray[Any]:
    """A picture at most so wide."""
    scale = width_px / picture.shape[1]
    if scale >= 1:
        return picture
    return np.asarray(cv2.resize(picture, None, fx=scale, fy=scale, interpolation=how), dtype=picture.dtype)


def _encoded(
    layers: Mapping[str, Mapping[str, Pixels]], width_px: int, budget_bytes: float
) -> dict[str, dict[str, str]] | None:
    """All pictures at one width; None as soon as they are too many bytes."""

    def encoded(key: str) -> dict[str, str]:
        return {name: _uri(_reduced(picture, width_px), QUALITY) for name, picture in layers[key].items()}

    total, found = 0, {}
    with ThreadPoolExecutor(2) as pool:
        # What still waits is called off where this returns early.
        for number, (key, uris) in enumerate(zip(layers, pool.map(encoded, layers), strict=True), start=1):
            found[key] = uris
            total += sum(map(len, uris.values()))
            # After a few views it is plain where this leads.
            if total > budget_bytes or (number >= 4 and total / number * len(layers) > 1.3 * budget_bytes):
                return None
    return found


def _uri(picture: Pixels, quality: int) -> str:
    _, data = cv2.imencode(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, quality])
    return "data:image/webp;base64," + base64.b64encode(data.tobytes()).decode()


def _cut(view: ViewPlanes, crop: Crop) -> Pixels:
    """A square of the noisy capture, its pixels as squares, stretched to its own range of grey."""
    half = crop.side_px // 2
    x, y = (round(value) for value in crop.centre_px)
    capture_dn = view.planes[CHANNELS["noisy"]]
    height, width = capture_dn.shape
    top, left = max(y - half, 0), max(x - half, 0)
    inside = capture_dn[top : min(y + half, height), left : min(x + half, width)].astype(float)
    low, high = np.percentile(inside, (0.5, 99.5))
    stretched = np.full((2 * half, 2 * half), 255, dtype=np.uint8)
    grey = 255 * np.clip((inside - low) / max(high - low, 1), 0, 1) ** (1 / 2.2)
    from_top, from_left = top - (y - half), left - (x - half)
    stretched[from_top : from_top + len(inside), from_left : from_left + inside.shape[1]] = grey
    grown = cv2.resize(stretched, (CROP_PX, CROP_PX), interpolation=cv2.INTER_NEAREST)
    return np.asarray(grown, dtype=np.uint8)
