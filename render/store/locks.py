"""Reservation of views, so that two runs over one store do not render the same view.

Runs that start together need the same views in the same order, and would render each of them twice. Therefore a view is
reserved by a lock on one byte of the store's file `reservations`, at the hash of its name. A lock ends with its
process, however that ends, and needs no clean-up. If the file system has no locks, each run renders what it does not
find.
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

# File in a store's folder; always empty.
RESERVATIONS = "reservations"
# Seconds between two attempts at a lock of another process: short compared with rendering a view.
ATTEMPTS_EVERY_S = 0.2
# A view takes seconds, and solving its light minutes at most: a process with a longer reservation is stuck.
LONGEST_WAIT_S = 600.0
# Range of the name's hash that selects the byte: two of 10^4 views share one in one of 10^6 stores.
PLACE_BYTES = 6
# Errors when another process has the lock.
TAKEN = {errno.EACCES, errno.EAGAIN}


def in_turn(items: Iterable[T], name_of: Callable[[T], str], folder: Path) -> Iterator[T]:
    """All items in their order, each reserved until the next is taken; those reserved by other processes come last.

    The caller searches the store again for each item, since another process may have stored it in the meantime.

    Args:
        name_of: function from an item to the name to reserve.
        folder: the store's.
    """
    with contextlib.ExitStack() as stack:
        try:
            if fcntl is None:
                raise OSError
            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(folder / RESERVATIONS, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError:  # no locks here, or a read-only store
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
    """Whether the byte is now locked by this process, or locks are not available."""
    try:
        fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except OSError as error:
        return error.errno not in TAKEN
    return True
