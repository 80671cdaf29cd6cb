"""The store's folder of views, solved light and measurements, each under the hash of everything that determines it.

A file is written under a temporary name, flushed and renamed, so that every file is complete. Several runs can share
one store. Disks and other programs may still damage files, so that each has its checksum in a file beside it
(`render.store.checksums`), which is verified before use. A file that does not match is moved to `damaged/`, never
deleted, with one line of warning, and counts as missing: it is computed again on request.

A file without any sum is one of an older version. It is read completely once, and given a sum if that succeeds: old
stores stay usable without rendering again.

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

# Subfolder for damaged files.
DAMAGED = "damaged"
# How often a file may change while it is read, by other processes that write the same name.
MOST_CHANGES = 20

_log = logging.getLogger(__name__)
# Folders for which this process has reported that it adds sums to older files.
_adopting: set[Path] = set()


@dataclass(frozen=True)
class Store:
    """A folder of views (EXR), solved light and measurements (NPZ); the base class of remote stores.

    Paths are those of files on this machine. A remote store (`render.store.remote`) uses `folder` as a local copy, and
    overrides `has`, `fetch` and `push`; for a local folder these have no effect.
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
        """Whether the store has a file for one of its paths; it is not verified."""
        return path.exists()

    def fetch(self, path: Path) -> bool:
        """Get the file of one of the store's paths to that path; False if the store has none."""
        return path.exists()

    def push(self, path: Path) -> None:
        """Upload a file that was written at one of the store's paths, by this process or a worker."""

    def write(
        self,
        path: Path,
        write: Callable[[Path], None],
        facts: dict[str, Any] | None = None,
        needed_bytes: int | None = None,
    ) -> None:
        """Write a file by `write(temporary path)`, with its sum.

        Args:
            facts: facts about the content for its sum; must be JSON-serialisable.
            needed_bytes: size of the file, if known beforehand.

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
        """Result of `reader` on a verified file; None if it is missing or damaged.

        Args:
            reader: reads all of the file, and raises an exception if it is not of its kind.
            facts_of: function from the result to the facts for the sum of an older file.

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
            except Exception as error:  # readers raise anything on damaged bytes
                why, value = f"{type(error).__name__}: {error}".replace(f"{path}: ", ""), None
            if _identity(path) != before:
                continue  # replaced in the meantime
            if why or value is None:
                self._set_aside(path, before, why or "nothing in it")
                continue  # a remote store may have an intact one
            if sums is None:
                self._adopt(path, dataclasses.replace(now, facts=facts_of(value)))
            return value
        raise StoreError(f"{path}: changed {MOST_CHANGES} times while it was read; allowed is a file that stays")

    def facts(self, path: Path) -> dict[str, Any] | None:
        """A file's facts from its sum, without reading the file if size and time of change match the sum.

        None if the file is missing, damaged, or of an older version, to which `read` adds a sum.

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
        """Write arrays to one of the store's paths; `version` is the digest of their code, `facts` as in `write`."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)
        data = buffer.getvalue()
        all_facts = ({"version": version} if version else {}) | (facts or {})
        self.write(path, lambda temporary: _write_bytes(temporary, data), all_facts, len(data))

    def load(self, path: Path, check: Callable[[Arrays], object] = lambda arrays: None) -> Arrays | None:
        """The arrays of one of the store's paths; None if they are missing or damaged.

        Args:
            check: raises an exception if the arrays do not belong at this path: the file is then set aside like a
                damaged one.
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
            # A pipe or a device, whose reading might never end, or a folder.
            self._set_aside(path, identity, "it is no plain file")
            return _identity(path) if path.is_file() else None
        return identity

    def _set_aside(self, path: Path, identity: tuple[int, int, int], why: str, with_sums: bool = False) -> None:
        """Move a damaged file to `damaged/`, if it is still the inspected one, and report it."""
        target = _free_name(self.folder / DAMAGED / path.relative_to(self.folder))
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            if _identity(path) != identity:
                return
            path.rename(target)
            if _identity(target) != identity:
                # Another process has just replaced it: an intact file gets its name back.
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
        """Move aside something with the name of a sum that is not a plain file."""
        odd = sum_path(path)
        target = _free_name(self.folder / DAMAGED / odd.relative_to(self.folder))
        target.parent.mkdir(parents=True, exist_ok=True)
        odd.rename(target)
        _log.warning("%s: it is no plain file; set aside as %s", odd, target)

    def _adopt(self, path: Path, found: FileSum, older: bool = True) -> None:
        # In a read-only store this fails without harm: its files are read completely each time.
        with contextlib.suppress(OSError):
            add_sum(path, dataclasses.replace(found, facts=found.facts | {"adopted": True}) if older else found)
            if older and self.folder not in _adopting:
                _adopting.add(self.folder)
                _log.warning("%s: files of an older version are read whole once, and given checksums", self.folder)


def _misfit(now: FileSum | None, sums: list[FileSum] | None) -> str:
    """Why a file does not match its sums; "" if it does, or if it is an older one without sums."""
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
    """Inode, size in bytes, and time of change in ns; None if there is no file."""
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
    """`path`, or with the first free number before its suffix."""
    number, free = 0, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}.{number}{path.suffix}")
    return free


def _write_bytes(path: Path, data: bytes) -> None:
    path.write_bytes(data)
