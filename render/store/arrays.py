"""Arrays from a stored archive: no larger than the file, and with the expected names and shapes."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Arrays", "check_arrays", "read_arrays"]

Arrays = dict[str, NDArray[np.generic]]

# Size of an unpacked archive: the light of the largest scene takes a tenth of it.
MOST_BYTES = 2**30


def check_arrays(arrays: Mapping[str, NDArray[np.generic]], shapes: Mapping[str, tuple[int | None, ...]]) -> None:
    """Check that arrays have these names, these shapes (None: any length), and numbers in them.

    Raises:
        ValueError: they do not; one line.
    """
    if set(arrays) != set(shapes):
        raise ValueError(f"it holds {', '.join(sorted(arrays))[:200]}; allowed: {', '.join(shapes)}")
    for name, shape in shapes.items():
        array = arrays[name]
        fits = array.ndim == len(shape) and all(
            allowed in (None, length) for allowed, length in zip(shape, array.shape, strict=True)
        )
        if not fits or array.dtype.kind not in "fiu":
            sizes = ", ".join("any" if length is None else str(length) for length in shape)
            raise ValueError(f"{name} is {array.dtype} of shape {array.shape}; allowed: numbers of shape ({sizes})")


def read_arrays(path: Path) -> Arrays:
    """The arrays of an archive, none larger than its data in the archive.

    Raises:
        OSError, ValueError and the rest of `DAMAGE`: it is not an archive, or is damaged.
    """
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        size = sum(member.file_size for member in members)
        if size > MOST_BYTES:
            raise ValueError(f"{size} bytes; allowed: at most {MOST_BYTES}")
        for member in members:
            with archive.open(member) as file:
                version = np.lib.format.read_magic(file)
                reader = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}[version[0]]
                shape, _, dtype = reader(file)
                # numpy allocates the size in the header before it finds that there are fewer data.
                if dtype.hasobject or math.prod(shape) * dtype.itemsize > member.file_size:
                    raise ValueError(f"{member.filename} does not hold {shape} of {dtype}")
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
