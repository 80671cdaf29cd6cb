"""Opening images that others may have written: by the reader that a file's ending names, and of bounded size."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import OpenImageIO as oiio

from pss import RangeError

__all__ = ["MOST_PIXELS", "one_line", "open_image"]

# Of an image: more than the sensors of cameras have. With the channels of a view it takes 4 GB.
MOST_PIXELS = 50_000_000
# Of an image: views have seven.
MOST_CHANNELS = 16

# A longer message would push the rest out of sight.
LONGEST_MESSAGE = 200

# A file is what its ending says, or nothing: not tried with the readers of two dozen formats one after the other.
oiio.attribute("try_all_readers", 0)


def one_line(text: str) -> str:
    """A message of a library, which may hold what is in the file, as a part of a line."""
    return "".join(char if char.isprintable() else "?" for char in " ".join(text.split()))[:LONGEST_MESSAGE]


def open_image(path: Path) -> Any:
    """OpenImageIO's open reader of the image at `path`; to be closed by the caller.

    Raises:
        RangeError: it is no file, no image that is understood, or one of more than `MOST_PIXELS` or `MOST_CHANNELS`.
    """
    if not os.path.isfile(path):
        raise RangeError("there is no such file")
    try:
        image = oiio.ImageInput.open(str(path))
        if image is None:
            raise RangeError(one_line(oiio.geterror()) or "it is no image")
    except UnicodeDecodeError:
        # The reader quotes what it found in the file, whatever bytes those are.
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
