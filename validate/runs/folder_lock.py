"""One command at a time writes into a folder of results: tables of two runs would be mixed.

The folder's file `.in-use` is locked while a command writes. A lock ends with its process, however that ends: what a
killed process leaves behind blocks no other run. Where the file system has no locks, nothing is refused.
"""

from __future__ import annotations

import contextlib
import datetime
import os
from collections.abc import Iterator
from pathlib import Path

from render.store.atomic import StoreError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["IN_USE", "alone_in"]

IN_USE = ".in-use"
# Of the line that the holder writes.
MOST_BYTES = 200


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """A context in which no other process writes into `folder`, which is made if it is not there.

    Raises:
        StoreError: another process is in such a context; the line has its number and since when, where known.
    """
    handle = _locked_file(folder)
    try:
        yield
    finally:
        if handle is not None:
            # The name goes while the lock is held, so that whoever has opened it in the meantime looks again.
            with contextlib.suppress(OSError):
                (folder / IN_USE).unlink()
            os.close(handle)


def _locked_file(folder: Path) -> int | None:
    """The open lock file of a folder; None where there are no locks, or nothing can be written."""
    if fcntl is None:
        return None
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(folder / IN_USE, os.O_RDWR | os.O_CREAT | os.O_NONBLOCK | os.O_NOFOLLOW, 0o644)
        except OSError:
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(handle, MOST_BYTES).decode("utf-8", errors="replace").strip()
            os.close(handle)
            raise StoreError(
                f"{folder} is in use by another run{f' ({holder})' if holder.isprintable() and holder else ''}; "
                "allowed: another --out, or this folder when that run has ended"
            ) from None
        except OSError:  # no locks on this file system
            os.close(handle)
            return None
        if _is_at(handle, folder / IN_USE):
            now = datetime.datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
            with contextlib.suppress(OSError):
                os.ftruncate(handle, 0)
                os.write(handle, f"process {os.getpid()}, since {now}\n".encode())
            return handle
        # The last holder has removed it between the two calls.
        os.close(handle)


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except OSError:
        return False
