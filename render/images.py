"""Reading of images from untrusted sources: by the reader of the file's suffix only, and of bounded size."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import OpenImageIO as oiio

from pss import RangeError

__all__ = ["MOST_PIXELS", "one_line", "open_image"]

# Of an image: more than any camera's sensor. With the channels of a view it takes 4 GB.
MOST_PIXELS = 50_000_000
# Of an image: views have seven.
MOST_CHANNELS = 16

# A longer message would hide the rest of the line.
LONGEST_MESSAGE = 200

# A file is read in the format of its suffix or not at all, instead of trying two dozen readers in turn.
oiio.attribute("try_all_readers", 0)


def one_line(text: str) -> str:
    """A library's message, which may quote parts of the file, as a part of one line."""
    return "".join(char if char.isprintable() else "?" for char in " ".join(text.split()))[:LONGEST_MESSAGE]


def open_image(path: Path) -> Any:
    """OpenImageIO's open reader of the image at `path`; to be closed by the caller.

    Raises:
        RangeError: the file is missing, not a readable image, or has more than `MOST_PIXELS` or `MOST_CHANNELS`.
    """
    if not os.path.isfile(path):
        raise RangeError("there is no such file")
    try:
        image = oiio.ImageInput.open(str(path))
        if image is None:
            raise RangeError(one_line(oiio.geterror()) or "it is no image")
    except UnicodeDecodeError:
        # The reader quotes bytes of the file, whatever they are.
        raise RangeError("its header is damaged; allowed: an image whose names are text") from None
    spec = image.spec()
    size = (spec.width, spec.height, spec.depth)
    try:
        if spec.deep:
            raise RangeError("it holds deep samples; allowed: an image with one value a pixel and channel")
        if not all(side >= 1 for side in size) or math.prod(size) > MOST_PIXELS:
            shown = " × ".join(str(side) for side in size)
            raise RangeError(f"its size is {shown} pixels; allowed: at most {MOST_PIXELS} in all")
        if spec.nchannels > MOST_CHANNELS:
            raise RangeError(f"it has {spec.nchannels} channels; allowed: at most {MOST_CHANNELS}")
    except RangeError:
        image.close()
        raise
    return image
