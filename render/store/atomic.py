"""Atomic writes: files are written under a temporary name, flushed to the disk, and renamed.

Other processes see the file only after the rename. It comes after the file's bytes have reached the disk, and the
folder is flushed after it, so that not even a power cut leaves a partial file under the final name.

A process that is killed leaves its temporary file behind. The next run removes it: the writer holds a lock on it while
it lives, so that a file without a lock, and not quite new, is abandoned.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from pss import PSSError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = [
    "FULL",
    "StoreError",
    "atomic_path",
    "discard_unfinished",
    "disk_full",
    "flush",
    "free_bytes",
    "remove_abandoned",
    "write_text",
]

# Errors when no more data fit: on the disk, or in the user's quota.
FULL = {errno.ENOSPC, *({errno.EDQUOT} if hasattr(errno, "EDQUOT") else ())}

# Prefix of temporary files, which no file of a user has.
UNFINISHED = ".unfinished-"
# s: a temporary file without a lock is abandoned if it is older than this (or newer: a clock was set). A file just
# created may be about to be locked, and network drives may not share their locks between machines.
ABANDONED_S = 60.0

# Temporary files that this process is writing, for their removal if it is stopped.
_unfinished: set[Path] = set()
# Folders that this process has searched for abandoned files.
_tidied: set[Path] = set()


class StoreError(PSSError, OSError):
    """A folder cannot be used, or the disk is full."""


@contextlib.contextmanager
def atomic_path(
    path: Path, *, needed_bytes: int | None = None, before_rename: Callable[[Path], None] | None = None
) -> Iterator[Path]:
    """A temporary path beside `path` that is renamed to it when the block succeeds, and removed if it fails.

    Args:
        needed_bytes: size of the file, if known beforehand; for the message if the disk is full.
        before_rename: called with the temporary path when its bytes are on the disk, before it is renamed.

    Raises:
        StoreError: the folder cannot be written, the disk is full, or a folder has the file's name.
    """
    if path.is_dir():
        raise StoreError(f"{path} is a folder; allowed is a file in its place, or nothing")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.parent not in _tidied:
            _tidied.add(path.parent)
            remove_abandoned([path.parent, *path.parent.glob("*/")])
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=UNFINISHED, suffix=path.suffix)
    except OSError as error:
        if error.errno in FULL:
            raise disk_full(path, _size_text(needed_bytes)) from error
        raise StoreError(f"{path.parent}: {error.strerror}; allowed is a folder that can be written") from error
    temporary = Path(name)
    _unfinished.add(temporary)
    if not _locked(handle):
        os.close(handle)
        handle = -1
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
            raise disk_full(path, _size_text(needed_bytes, written), written) from error
        raise
    finally:
        if handle >= 0:
            os.close(handle)
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def disk_full(path: Path, needs_bytes: str, written_bytes: int = 0) -> StoreError:
    """The error for a file that did not fit, with its size and the free space.

    Args:
        path: the file that did not fit.
        needs_bytes: size of the file as text: a number, with "more than" or "up to" if it is a bound.
        written_bytes: size of the temporary file, which is about to be removed and counts as free.
    """
    return StoreError(
        f"{path}: the disk is full; the file needs {needs_bytes} bytes, {free_bytes(path) + written_bytes:,} are free; "
        "what is stored already is whole and will be found"
    )


def free_bytes(path: Path) -> int:
    """Free bytes on the disk of a path, which need not exist."""
    existing = next(parent for parent in path.absolute().parents if parent.exists())
    return shutil.disk_usage(existing).free


def discard_unfinished() -> None:
    """Remove the unfinished files of this process, before it ends without unwinding."""
    for temporary in list(_unfinished):
        temporary.unlink(missing_ok=True)


def remove_abandoned(folders: Iterable[Path]) -> None:
    """Remove temporary files of killed processes from folders, but not from their subfolders."""
    if fcntl is None:
        return  # without locks, `run_sweep.py store prune` removes those that are a day old
    for path in (path for folder in folders for path in folder.glob(f"{UNFINISHED}*")):
        with contextlib.suppress(OSError):  # its writer, or another process that tidies, was faster
            if abs(time.time() - path.stat().st_mtime) < ABANDONED_S:
                continue
            handle = os.open(path, os.O_RDWR)
            try:
                if _locked(handle):
                    path.unlink()
            finally:
                os.close(handle)


def _locked(handle: int) -> bool:
    """Lock an open file until it is closed; False if another process has the lock, or without locks."""
    if fcntl is None:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


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
    """Write a text file completely or not at all."""
    with atomic_path(path, needed_bytes=len(text.encode())) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _size_text(needed_bytes: int | None, written_bytes: int = 0) -> str:
    return f"more than {written_bytes:,}" if needed_bytes is None else f"{needed_bytes:,}"
