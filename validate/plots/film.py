"""The film of a run of the hallway: its pictures, one after the other, in a file that a browser shows."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pss import RangeError
from pss.errors import MissingLibraryError
from pss.hints import Pixels
from pss.processes.process import require_positive
from render.store.folder import atomic_path
from render.world.state import Room
from validate.plots.film_frame import PICTURE_PX, FilmFrame, draw_frame

__all__ = ["FILM_ENDINGS", "FilmFrame", "draw_frame", "write_film"]


# Of Pillow's 0 to 100: the text's edges stay clean. Slower methods than the fourth save some percent.
WEBP_QUALITY, WEBP_METHOD = 85, 4
# Steps of four levels don't show as bands in a noisy image. Channels that differ by less than so many levels are grey.
GIF_GREYS, GREY_LEVELS = 64, 8
# Free of patents, and part of OpenCV's own wheels. H.264 is not, and what they have of MPEG-4 no browser shows. OpenCV
# prints on stderr that WebM has no such tag, and writes it all the same.
WEBM_CODEC = "VP90"


def write_film(
    path: Path, frames: Iterable[FilmFrame], room: Room, strategy: str, frames_per_second: float = 3.0
) -> None:
    """Write the film of a run, whole or not at all; its format is by the ending of `path`, one of `FILM_ENDINGS`.

    WebP and GIF play over and over in a page; WebM is a video. Frames are taken one at a time, and of each only the
    drawn picture is kept (WebM: not even that). Every picture also shows where the avatars walked in those before.

    Args:
        strategy: its name, as the pictures show it.
        frames_per_second: 1/s; a GIF holds pictures for whole hundredths of a second, a WebP for whole milliseconds.

    Raises:
        RangeError: no frames, another ending, a rate that is not above 0 or too fast for the format.
        MissingLibraryError: this OpenCV cannot write WebM.
        StoreError: the folder cannot be written.
    """
    if path.suffix not in FILM_ENDINGS:
        raise RangeError(f"{path.name} ends in {path.suffix!r}; allowed: {', '.join(FILM_ENDINGS)}")
    require_positive("frames_per_second", frames_per_second, "1/s")
    pictures = _pictures(frames, room, strategy)
    first = next(pictures, None)
    if first is None:
        raise RangeError("frames is empty; allowed: at least one")
    with atomic_path(path) as temporary:
        FILM_ENDINGS[path.suffix](temporary, itertools.chain([first], pictures), frames_per_second)


def _pictures(frames: Iterable[FilmFrame], room: Room, strategy: str) -> Iterator[Pixels]:
    walked: dict[str, list[NDArray[np.float64]]] = {}
    for frame in frames:
        for name, place in frame.avatars.items():
            walked.setdefault(name, []).append(np.asarray(place, dtype=float))
        so_far = {name: np.array(walked[name]) for name in frame.avatars}
        yield draw_frame(frame, room, strategy, so_far)


def _write_webp(path: Path, pictures: Iterator[Pixels], frames_per_second: float) -> None:
    _save(path, map(Image.fromarray, pictures), frames_per_second, 1, quality=WEBP_QUALITY, method=WEBP_METHOD)


def _write_gif(path: Path, pictures: Iterator[Pixels], frames_per_second: float) -> None:
    _save(path, map(_paletted, pictures), frames_per_second, 10, optimize=False)


def _paletted(picture: Pixels) -> Image.Image:
    """A picture in 256 colours: evenly spaced greys for the views, and what the rest needs."""
    greys = np.repeat(np.linspace(0, 255, GIF_GREYS).round().astype(np.uint8), 3)
    coloured = picture[np.ptp(picture, axis=2) > GREY_LEVELS]
    # Median cut, Pillow's own choice, gives its colours to large areas and none to the marks.
    chosen = Image.fromarray(coloured[None]).quantize(256 - GIF_GREYS, method=Image.Quantize.FASTOCTREE)
    palette = Image.new("P", (1, 1))
    palette.putpalette([*greys.tolist(), *(chosen.getpalette() or [])])
    # Dithering makes grey images larger and no better.
    return Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)


def _save(path: Path, pictures: Iterator[Image.Image], frames_per_second: float, unit_ms: int, **options: int) -> None:
    """Save by Pillow, each picture held for the whole number of `unit_ms` that is nearest to the requested time."""
    if frames_per_second * unit_ms > 1000:
        most = 1000 / unit_ms
        raise RangeError(f"frames_per_second = {frames_per_second!r} for {path.suffix}; allowed: up to {most:g}")
    held_ms = unit_ms * round(1000 / frames_per_second / unit_ms)
    first = next(pictures)
    first.save(path, save_all=True, append_images=pictures, duration=held_ms, loop=0, **options)


def _write_webm(path: Path, pictures: Iterator[Pixels], frames_per_second: float) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*WEBM_CODEC), frames_per_second, PICTURE_PX)
    if not writer.isOpened():
        raise MissingLibraryError(f"this OpenCV has no {WEBM_CODEC} to write .webm with; allowed: .webp, .gif")
    try:
        for picture in pictures:
            writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    finally:
        writer.release()


FILM_ENDINGS: dict[str, Callable[[Path, Iterator[Pixels], float], None]] = {
    ".webp": _write_webp,
    ".gif": _write_gif,
    ".webm": _write_webm,
}
"""The formats that a film can have, by the ending of its file, with what writes them."""
