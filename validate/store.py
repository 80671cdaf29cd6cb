"""Where views, solved light and measurements lie, found by the hash of all that determines them.

A file is written under a temporary name and renamed: what is there is whole. Several runs share one store.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import math
import os
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pss import PSSError

__all__ = ["Store", "StoreError", "atomic_path", "discard_unfinished", "write_text"]

Arrays = dict[str, NDArray[np.generic]]

# Of an archive, unpacked: the light of the largest scene takes a tenth of it.
MOST_BYTES = 2**30
# What zipfile, zlib, tokenize and numpy raise on a damaged archive.
DAMAGE = (
    OSError,
    ValueError,
    TypeError,
    EOFError,
    LookupError,
    RuntimeError,
    ArithmeticError,
    SyntaxError,
    struct.error,
    zlib.error,
    zipfile.BadZipFile,
)

# Temporary files that this process is writing, for whoever must stop it in the middle.
_unfinished: set[Path] = set()


class StoreError(PSSError, OSError):
    """A folder cannot be used, or the disk is full."""


@contextlib.contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its name when the block ends well, and is removed if it does not."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
    except OSError as error:
        raise StoreError(f"{path.parent}: {error.strerror}; allowed is a folder that can be written") from error
    os.close(handle)
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        yield temporary
        os.chmod(temporary, 0o644)
        temporary.replace(path)
    except OSError as error:
        if error.errno == errno.ENOSPC:
            raise StoreError(f"{path}: the disk is full; what is stored already is whole and will be found") from error
        raise
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def discard_unfinished() -> None:
    """Remove the files that this process has begun and not finished, before it ends without unwinding."""
    for temporary in list(_unfinished):
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class Store:
    """A folder of views (EXR), solved light and measurements (NPZ)."""

    folder: Path

    def view(self, key: str) -> Path:
        """Path of a view's image."""
        return self.folder / "views" / key[:2] / f"{key}.exr"

    def light(self, key: str) -> Path:
        """Path of the baked scene of a scene state."""
        return self.folder / "light" / f"{key}.npz"

    def measurement(self, view_key: str, detector: str, seed: int, trials: int) -> Path:
        """Path of a view's detections over its trials."""
        tail = hashlib.sha256(f"{detector}/{seed}/{trials}".encode()).hexdigest()[:12]
        return self.folder / "measurements" / view_key[:2] / f"{view_key}-{tail}.npz"

    def save(self, path: Path, arrays: Arrays) -> None:
        """Write arrays to one of the store's paths."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)
        with atomic_path(path) as temporary:
            temporary.write_bytes(buffer.getvalue())

    def load(self, path: Path) -> Arrays | None:
        """The arrays of one of the store's paths; None where there is nothing (or nothing whole)."""
        try:
            return _arrays_in(path)
        except FileNotFoundError:
            return None
        except DAMAGE:
            # Cut short by another program: made again.
            path.unlink(missing_ok=True)
            return None


def _arrays_in(path: Path) -> Arrays:
    """The arrays of an archive, of which none is larger than what the archive holds of it.

    Raises:
        OSError, ValueError and the rest of `DAMAGE`: it is none, or is damaged.
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
                # numpy makes room for what the header says before it finds that there is less.
                if dtype.hasobject or math.prod(shape) * dtype.itemsize > member.file_size:
                    raise ValueError(f"{member.filename} does not hold {shape} of {dtype}")
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
