"""Where views, solved light and measurements lie, found by the hash of all that determines them.

A file is written under a temporary name, flushed and renamed: what is there is whole. Several runs share one store.
Disks and other programs still damage files, so each has its checksum in a file beside it (`render.store.checksums`),
and nothing is read that was not checked. What does not fit its checksum is moved to `damaged/`, never deleted, with one
line of warning, and counts as missing: whoever wanted it makes it again.

A file without any sum is one of an older version. It is read whole once, and given a sum if that succeeds: an old store
goes on working without rendering again.

`docs/store.md` is the page for users.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import logging
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pss import RangeError
from render.store.arrays import Arrays, read_arrays
from render.store.atomic import StoreError, atomic_path, discard_unfinished, write_text
from render.store.checksums import FileSum, add_sum, read_sums, sum_of, sum_path

__all__ = ["DAMAGED", "Store", "StoreError", "atomic_path", "discard_unfinished", "write_text"]

T = TypeVar("T")

# Folder in a store for what is set aside.
DAMAGED = "damaged"
# Times that a file may change under a reader's eyes, by other processes that write the same name.
MOST_CHANGES = 20

_log = logging.getLogger(__name__)
# Folders whose older files this process has said that it gives sums.
_adopting: set[Path] = set()


@dataclass(frozen=True)
class Store:
    """A folder of views (EXR), solved light and measurements (NPZ), and the interface of stores that lie elsewhere.

    Paths are those of files on this machine. A store that lies elsewhere (`render.store.remote`) keeps what programs
    need here, in `folder`, and has its own `has`, `fetch` and `push`; for a folder these have nothing to do.
    """

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

    @property
    def writable(self) -> bool:
        """Whether files can be written here."""
        existing = next(parent for parent in [self.folder, *self.folder.absolute().parents] if parent.exists())
        return os.access(existing, os.W_OK)

    def has(self, path: Path) -> bool:
        """Whether there is a file for one of the store's paths; it is not checked."""
        return path.exists()

    def fetch(self, path: Path) -> bool:
        """Get the file of one of the store's paths to that path; False where the store has none."""
        return path.exists()

    def push(self, path: Path) -> None:
        """Hand on a file that was written at one of the store's paths, by this process or a worker."""

    def write(
        self,
        path: Path,
        write: Callable[[Path], None],
        facts: dict[str, Any] | None = None,
        needed_bytes: int | None = None,
    ) -> None:
        """Write a file by `write(temporary path)`, with its sum.

        Args:
            facts: what the sum says of the content; must go into JSON.
            needed_bytes: of the file, where known beforehand.

        Raises:
            StoreError: the store cannot be written, or the disk is full.
        """

        def add(temporary: Path) -> None:
            if os.path.lexists(sum_path(path)) and not sum_path(path).is_file():
                self._set_sum_aside(path)
            add_sum(path, sum_of(temporary, facts))

        with atomic_path(path, needed_bytes=needed_bytes, before_rename=add) as temporary:
            write(temporary)
        self.push(path)

    def read(
        self, path: Path, reader: Callable[[Path], T], facts_of: Callable[[T], dict[str, Any]] = lambda value: {}
    ) -> T | None:
        """What `reader` makes of a file that was checked; None where there is none, or none that is whole.

        Args:
            reader: reads all of the file, and raises an exception if it is not one of its kind.
            facts_of: what the sum of an older file is to say of the value.

        Raises:
            StoreError: a damaged file cannot be set aside.
        """
        for _ in range(MOST_CHANGES):
            if (before := self._found(path)) is None:
                return None
            try:
                now, sums = sum_of(path), read_sums(path)
                why = _misfit(now, sums)
                value = None if why else reader(path)
            except MemoryError:
                raise
            except PermissionError as error:
                raise StoreError(f"{path}: {error.strerror}; allowed is a file that can be read") from error
            except Exception as error:  # whatever a reader makes of damaged bytes
                why, value = f"{type(error).__name__}: {error}".replace(f"{path}: ", ""), None
            if _identity(path) != before:
                continue  # replaced meanwhile
            if why or value is None:
                self._set_aside(path, before, why or "nothing in it")
                continue  # a store elsewhere may have it whole
            if sums is None:
                self._adopt(path, dataclasses.replace(now, facts=facts_of(value)))
            return value
        raise StoreError(f"{path}: changed {MOST_CHANGES} times while it was read; allowed is a file that stays")

    def facts(self, path: Path) -> dict[str, Any] | None:
        """What a file's sum says of it, without reading the file where size and time of change are the sum's.

        None where there is no file, no whole one, or one of an older version, which `read` gives a sum.

        Raises:
            StoreError: as `read`.
        """
        for _ in range(MOST_CHANGES):
            if (before := self._found(path)) is None:
                return None
            sums = read_sums(path)
            if sums is None:
                return None
            for known in reversed(sums):
                if (known.size_bytes, known.changed_ns) == before[1:]:
                    return known.facts
            now = _sum_or_none(path)
            if _identity(path) != before:
                continue
            if (why := _misfit(now, sums)) or now is None:
                self._set_aside(path, before, why or "it cannot be read")
                continue
            facts = next(known.facts for known in reversed(sums) if known.same_content(now))
            self._adopt(path, dataclasses.replace(now, facts=facts), older=False)
            return facts
        raise StoreError(f"{path}: changed {MOST_CHANGES} times while it was read; allowed is a file that stays")

    def save(self, path: Path, arrays: Arrays, version: str = "", facts: dict[str, Any] | None = None) -> None:
        """Write arrays to one of the store's paths; `version` names what made them, `facts` are as of `write`."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)
        data = buffer.getvalue()
        said = ({"version": version} if version else {}) | (facts or {})
        self.write(path, lambda temporary: _write_bytes(temporary, data), said, len(data))

    def load(self, path: Path, check: Callable[[Arrays], object] = lambda arrays: None) -> Arrays | None:
        """The arrays of one of the store's paths; None where there is nothing (or nothing whole).

        Args:
            check: raises an exception where the arrays are not those that belong at this path: then the file is set
                aside, as other damage is.
        """

        def read(path: Path) -> Arrays:
            arrays = read_arrays(path)
            check(arrays)
            return arrays

        return self.read(path, read)

    def set_aside(self, path: Path, why: str) -> None:
        """Move the file of one of the store's paths to `damaged/`, with its sums, and report it in one line.

        Raises:
            StoreError: it cannot be moved.
        """
        if (identity := _identity(path)) is not None:
            self._set_aside(path, identity, why, with_sums=True)

    def _found(self, path: Path) -> tuple[int, int, int] | None:
        if not self.fetch(path):
            return None
        identity = _identity(path)
        if identity is not None and not path.is_file():
            # A pipe or a device, which reading might never end, or a folder.
            self._set_aside(path, identity, "it is no plain file")
            return _identity(path) if path.is_file() else None
        return identity

    def _set_aside(self, path: Path, identity: tuple[int, int, int], why: str, with_sums: bool = False) -> None:
        """Move a damaged file to `damaged/`, if it is still the one that was looked at, and say so."""
        target = _free_name(self.folder / DAMAGED / path.relative_to(self.folder))
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            if _identity(path) != identity:
                return
            path.rename(target)
            if _identity(target) != identity:
                # Another process made it anew in this very moment: a whole file goes back to its name.
                target.replace(path)
                return
            if with_sums or read_sums(path) == []:
                sum_path(path).rename(sum_path(target))
        except FileNotFoundError:
            return  # another process was faster
        except OSError as error:
            raise StoreError(
                f"{path}: {why}; it cannot be set aside ({error.strerror}), allowed is a store that can be written"
            ) from error
        _log.warning("%s: %s; set aside as %s", path, why, target)

    def _set_sum_aside(self, path: Path) -> None:
        """Move what has the name of a sum and is no plain file out of the way."""
        odd = sum_path(path)
        target = _free_name(self.folder / DAMAGED / odd.relative_to(self.folder))
        target.parent.mkdir(parents=True, exist_ok=True)
        odd.rename(target)
        _log.warning("%s: it is no plain file; set aside as %s", odd, target)

    def _adopt(self, path: Path, found: FileSum, older: bool = True) -> None:
        # A store that cannot be written is as good without: its files are read whole each time.
        with contextlib.suppress(OSError):
            add_sum(path, dataclasses.replace(found, facts=found.facts | {"adopted": True}) if older else found)
            if older and self.folder not in _adopting:
                _adopting.add(self.folder)
                _log.warning("%s: files of an older version are read whole once, and given checksums", self.folder)


def _misfit(now: FileSum | None, sums: list[FileSum] | None) -> str:
    """Why a file does not fit its sums; "" where it does, or where it is an older one without."""
    if sums is None:
        return ""
    if not sums:
        return "the file with its checksum is damaged"
    if now is None:
        return "it cannot be read"
    if any(known.same_content(now) for known in sums):
        return ""
    if now.size_bytes != sums[-1].size_bytes:
        return f"{now.size_bytes:,} bytes, {sums[-1].size_bytes:,} were written"
    return "its bytes are not those that were written"


def _identity(path: Path) -> tuple[int, int, int] | None:
    """Inode, size in bytes, and time of change in ns; None where there is no file."""
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def _sum_or_none(path: Path) -> FileSum | None:
    try:
        return sum_of(path)
    except (OSError, RangeError):
        return None


def _free_name(path: Path) -> Path:
    """`path`, or the first with a number before its suffix that nothing has."""
    number, free = 0, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}.{number}{path.suffix}")
    return free


def _write_bytes(path: Path, data: bytes) -> None:
    path.write_bytes(data)
