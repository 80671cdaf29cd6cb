"""A contact sheet of a sweep's captures: what the cameras saw, with what the detector found drawn in."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from pss.hints import Pixels
from render.renderer import RenderedView
from render.store.folder import Store, atomic_path
from render.store.views import stored_view
from validate.acquire.acquire import Acquisition
from validate.markers.detect import find_markers
from validate.plots.drawing import plt
from validate.plots.glyphs import glyph_runs
from validate.sweeps.sweep import SweepResult

__all__ = ["captures", "captures_figure", "contact_sheet", "displayed"]

# Dots per inch of a figure.
DPI = 130
THUMBNAIL_PX = 420
MOST_COLUMNS, MOST_ROWS = 4, 3
GREEN, WHITE, BLACK = (80, 220, 60), (255, 255, 255), (0, 0, 0)
CAPTION_PX, LETTERS_PX = 18, 12


def displayed(capture_dn: NDArray[np.uint16], black_level_dn: int) -> NDArray[np.uint8]:
    """A capture as an 8-bit grey picture: black level off, bright end at the 99.7th percentile, gamma 2.2."""
    light = np.maximum(capture_dn.astype(np.float32) - black_level_dn, 0)
    return np.asarray(255 * np.clip(light / max(np.percentile(light, 99.7), 1), 0, 1) ** (1 / 2.2), dtype=np.uint8)


def contact_sheet(path: Path, result: SweepResult, store: Store) -> Path:
    """Write the picture of a sweep's captures (`captures`); the path.

    Raises:
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    sheet = captures(result, store)
    with atomic_path(path) as temporary:
        cv2.imwrite(str(temporary), sheet)
    return path


def captures_figure(result: SweepResult, store: Store) -> Figure:
    """The same picture as a figure, a pixel for each of its own.

    Raises:
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    sheet = captures(result, store)
    height, width = sheet.shape[:2]
    figure = plt.figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(sheet[..., ::-1])  # OpenCV's channels are blue, green, red
    axes.set_axis_off()
    return figure


def captures(result: SweepResult, store: Store) -> Pixels:
    """The captures of the varied cameras (rows) over a few steps (columns): BGR, (height, width, 3).

    Raises:
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    steps = np.unique(np.linspace(0, len(result.configurations) - 1, MOST_COLUMNS).astype(int))
    names = _cameras_to_show(result)
    shown: list[list[tuple[str, Acquisition]]] = []
    for step in steps:
        configuration = result.configurations[step]
        pairs = zip(configuration.cameras, result.views[step], strict=True)
        chosen = [(camera, item) for camera, item in pairs if names is None or camera.name in names][:MOST_ROWS]
        shown.append([(f"{configuration.label}  camera {camera.name}", item) for camera, item in chosen])
    keys = {item.request.key for column in shown for _, item in column}
    # Unpacking the images is most of the work, and releases Python's lock.
    with ThreadPoolExecutor() as pool:
        views = dict(zip(keys, pool.map(lambda key: stored_view(store, key), keys), strict=True))
    columns = [[_thumbnail(item, views[item.request.key], caption) for caption, item in column] for column in shown]
    rows = max(len(column) for column in columns)
    height, width = max(picture.shape[:2] for column in columns for picture in column)
    sheet = np.full((rows * (height + 6), len(columns) * (width + 6), 3), 255, dtype=np.uint8)
    for c, column in enumerate(columns):
        for r, picture in enumerate(column):
            top, left = r * (height + 6), c * (width + 6)
            sheet[top : top + picture.shape[0], left : left + picture.shape[1]] = picture
    return sheet


def _cameras_to_show(result: SweepResult) -> set[str] | None:
    """Names of the cameras whose settings change over the sweep; None to show those that there are."""
    first = {camera.name: camera for camera in result.configurations[0].cameras}
    last = {camera.name: camera for camera in result.configurations[-1].cameras}
    changed = {name for name, camera in first.items() if name in last and camera != last[name]}
    return changed or None


def _thumbnail(item: Acquisition, view: RenderedView, caption: str) -> NDArray[np.uint8]:
    grey = displayed(view.capture_dn, view.sensor.black_level_dn)
    scale = THUMBNAIL_PX / grey.shape[1]
    small = cv2.cvtColor(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), cv2.COLOR_GRAY2BGR)
    found = find_markers(view.capture_dn, item.request.state.print.dictionary)
    for corners in found.corners_px:
        outline = np.rint((corners + 0.5) * scale - 0.5).astype(np.int32)
        cv2.polylines(small, [outline], True, GREEN, 1, cv2.LINE_AA)
    return _captioned(np.asarray(small), f"{caption}: {len(found.ids)} found")


def _captioned(picture: NDArray[np.uint8], words: str) -> NDArray[np.uint8]:
    """A picture with words in white over its dark top edge, in whatever script they are."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, 0, image.width, CAPTION_PX), fill=BLACK)
    x = 5.0
    for file, part in glyph_runs(words):
        font = ImageFont.truetype(str(file), LETTERS_PX)
        draw.text((x, CAPTION_PX / 2), part, WHITE, font, anchor="lm")
        x += font.getlength(part)
    return np.asarray(image)
