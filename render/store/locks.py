"""Two runs over one store do not render the same view: each takes a view for itself while it renders it.

Runs that begin together want the same views in the same order, and would render each twice, side by side. So a view is
reserved by a lock on one byte of the store's file `reservations`, the byte that its name hashes to. A lock ends with
its process, however that ends, and leaves nothing to clear away. Where the file system has no locks, each run renders
what it does not find.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["RESERVATIONS", "in_turn"]

T = TypeVar("T")

# File in a store's folder, beside `views` and the others; always empty.
RESERVATIONS = "reservations"
# Between two attempts at what another process has: short beside the seconds that a view takes.
ATTEMPTS_EVERY_S = 0.2
# A view takes seconds, and solving light before it minutes at most: a process that has one for longer is held up.
LONGEST_WAIT_S = 600.0
# Bytes of the name's hash that say which byte is locked: two views of 10^4 share one once in 10^6 stores.
PLACE_BYTES = 6
# What the system says when another process has the lock.
TAKEN = {errno.EACCES, errno.EAGAIN}


def in_turn(items: Iterable[T], name_of: Callable[[T], str], folder: Path) -> Iterator[T]:
    """All items in their order, each reserved until the next is asked for; those that another process has come last.

    Whoever gets an item looks into the store again, where the other process may have put what is wanted.

    Args:
        name_of: what is reserved of an item.
        folder: of the store.
    """
    with contextlib.ExitStack() as stack:
        try:
            if fcntl is None:
                raise OSError
            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(folder / RESERVATIONS, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError:  # no locks here, or a store that cannot be written
            yield from items
            return
        stack.callback(os.close, handle)
        waiting = list(items)
        last_turn = time.monotonic()
        while waiting:
            if time.monotonic() - last_turn > LONGEST_WAIT_S:
                yield from waiting
                return
            taken = []
            for item in waiting:
                place = int.from_bytes(hashlib.sha256(name_of(item).encode()).digest()[:PLACE_BYTES])
                if not _reserve(handle, place):
                    taken.append(item)
                    continue
                try:
                    yield item
                finally:
                    fcntl.lockf(handle, fcntl.LOCK_UN, 1, place)
                    last_turn = time.monotonic()
            if len(taken) == len(waiting):
                time.sleep(ATTEMPTS_EVERY_S)
            waiting = taken


def _reserve(handle: int, place: int) -> bool:
    """Whether the byte is this process's now, or cannot be anybody's."""
    try:
        fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except OSError as error:
        return error.errno not in TAKEN
    return True
