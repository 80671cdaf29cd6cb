"""Files that are whole or not there: written under a temporary name, flushed to the disk, and renamed.

The rename is what others see. It comes after the file's bytes have reached the disk, and the folder is flushed after
it, so that not even a power cut leaves half a file under its own name.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from pss import PSSError

__all__ = ["FULL", "StoreError", "atomic_path", "discard_unfinished", "disk_full", "flush", "free_bytes", "write_text"]

# What systems say when no more fits: on the disk, or in the user's share of it.
FULL = {errno.ENOSPC, *({errno.EDQUOT} if hasattr(errno, "EDQUOT") else ())}

# Temporary files that this process is writing, for whoever must stop it in the middle.
_unfinished: set[Path] = set()


class StoreError(PSSError, OSError):
    """A folder cannot be used, or the disk is full."""


@contextlib.contextmanager
def atomic_path(
    path: Path, *, needed_bytes: int | None = None, before_rename: Callable[[Path], None] | None = None
) -> Iterator[Path]:
    """A temporary path beside `path` that takes its name when the block ends well, and is removed if it does not.

    Args:
        needed_bytes: of the file, where known beforehand; said if the disk is full.
        before_rename: is given the temporary path when its bytes are on the disk, and not yet under its own name.

    Raises:
        StoreError: the folder cannot be written, or the disk is full.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
    except OSError as error:
        if error.errno in FULL:
            raise disk_full(path, _said(needed_bytes)) from error
        raise StoreError(f"{path.parent}: {error.strerror}; allowed is a folder that can be written") from error
    os.close(handle)
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        yield temporary
        os.chmod(temporary, 0o644)
        flush(temporary)
        if before_rename is not None:
            before_rename(temporary)
        temporary.replace(path)
        flush(path.parent)
    except OSError as error:
        if error.errno in FULL:
            written = temporary.stat().st_size if temporary.exists() else 0
            raise disk_full(path, _said(needed_bytes, written), written) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def disk_full(path: Path, needs_bytes: str, written_bytes: int = 0) -> StoreError:
    """The error that says which file did not fit, how large it is and how much room there is.

    Args:
        path: what did not fit.
        needs_bytes: of the file, as it is said: a number, "more than" or "up to" one.
        written_bytes: of the temporary file, which is about to be removed and counts as free.
    """
    return StoreError(
        f"{path}: the disk is full; the file needs {needs_bytes} bytes, {free_bytes(path) + written_bytes:,} are free; "
        "what is stored already is whole and will be found"
    )


def free_bytes(path: Path) -> int:
    """Room on the disk of a path, which need not exist."""
    existing = next(parent for parent in path.absolute().parents if parent.exists())
    return shutil.disk_usage(existing).free


def discard_unfinished() -> None:
    """Remove the files that this process has begun and not finished, before it ends without unwinding."""
    for temporary in list(_unfinished):
        temporary.unlink(missing_ok=True)


def flush(path: Path) -> None:
    """Wait until a file's bytes, or a folder's names, have reached the disk."""
    folder = path.is_dir()
    try:
        handle = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    except OSError:
        if folder:  # Windows opens none
            return
        raise
    try:
        os.fsync(handle)
    except OSError:
        if not folder:  # some network drives cannot flush a folder
            raise
    finally:
        os.close(handle)


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with atomic_path(path, needed_bytes=len(text.encode())) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _said(needed_bytes: int | None, written_bytes: int = 0) -> str:
    return f"more than {written_bytes:,}" if needed_bytes is None else f"{needed_bytes:,}"
