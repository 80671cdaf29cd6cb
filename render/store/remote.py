"""A remote store, at any address supported by fsspec (`s3://…`, `gs://…`, `sftp://…`, `file://…`).

Programs need local files, so that each is downloaded to a folder on this machine before it is read, and uploaded after
it was written. That folder is a complete store: worker processes use it alone, without the remote one.

Remote files cannot be appended to, so that each content's sum has its own file, `<name>.<start of SHA-256>.sum`,
written before the content: two machines that write one name do not overwrite each other's sum. `<name>.sum` is read as
well, for a store that was copied there as it is.
"""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import os
import re
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pss import MissingLibraryError
from render.store.atomic import FULL
from render.store.checksums import SUFFIX, FileSum, add_sum, read_sums, sum_of
from render.store.folder import DAMAGED, Store, StoreError, atomic_path

__all__ = ["RemoteStore", "is_address", "open_store"]

# Local folders of remote stores, unless the environment variable sets another.
CACHES = Path("results/remote-stores")
CACHE_VARIABLE = "PSS_STORE_CACHE"
# Digits of a content's SHA-256 in the name of its sum.
NAME_DIGITS = 16
# Number of downloads before a mismatch with the sum is attributed to the file.
DOWNLOADS = 2

_log = logging.getLogger(__name__)


def is_address(store: str | Path) -> bool:
    """Whether a store is given as an address, not as a folder."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]*(::|://)", str(store)) is not None


def open_store(store: str | Path) -> Store:
    """The store in a folder, or at an address supported by fsspec.

    Raises:
        MissingLibraryError: fsspec, or the library it needs for this kind of address, is not installed.
        StoreError: fsspec cannot use the address.
    """
    if not is_address(store):
        return Store(Path(store))
    address = str(store)
    try:
        import fsspec
    except ImportError as error:
        raise MissingLibraryError(
            f"--store {address} needs fsspec: pip install 'pss-testbed[cloud]'; a folder needs nothing"
        ) from error
    try:
        files, root = fsspec.core.url_to_fs(address)
    except ImportError as error:
        raise MissingLibraryError(f"--store {address}: {error}") from error
    except Exception as error:  # the exceptions depend on the kind of address
        raise StoreError(f"--store {address}: {error}; allowed is a folder, or an address that fsspec knows") from error
    name = re.sub(r"[^A-Za-z0-9.-]+", "-", address).strip("-")[-60:]
    # The name is for readability; the hash keeps addresses apart.
    folder = f"{name}-{hashlib.sha256(address.encode()).hexdigest()[:8]}"
    return RemoteStore(Path(os.environ.get(CACHE_VARIABLE) or CACHES) / folder, files, root.rstrip("/"), address)


@dataclass(frozen=True)
class RemoteStore(Store):
    """A store at an address; `folder` is its local copy.

    Attributes:
        files: fsspec's file system.
        root: path in it.
        address: as given by the user.
    """

    files: Any
    root: str
    address: str

    def has(self, path: Path) -> bool:
        """Whether there is a file for one of the store's paths, local or remote; it is not verified."""
        if path.exists():
            return True
        with self._reached():
            return bool(self.files.exists(self._there(path)))

    def fetch(self, path: Path) -> bool:
        """Get the file of one of the store's paths to that path, verified; False if the store has none."""
        if path.exists():
            return True
        there, why = self._there(path), ""
        for _ in range(DOWNLOADS):
            with self._reached():
                self.files.invalidate_cache()
                if not self.files.exists(there):
                    return False
                size = int(self.files.size(there) or 0)
            try:
                self._download(there, path, size)
                return True
            except _MisfitError as error:
                why = str(error)
        self._set_aside_there(there, why)
        return False

    def push(self, path: Path) -> None:
        """Upload a file that was written at one of the store's paths, unless the store has one by now."""
        there = self._there(path)
        now = sum_of(path)
        known = next((known for known in read_sums(path) or [] if known.same_content(now)), now)
        folder, _, name = there.rpartition("/")
        temporary = f"{folder}/.{uuid.uuid4().hex}-{name}"
        with self._reached():
            self.files.invalidate_cache()
            if self.files.exists(there):
                return
            self.files.makedirs(folder, exist_ok=True)
            self.files.pipe_file(f"{there}.{now.sha256[:NAME_DIGITS]}{SUFFIX}", f"{known.to_line()}\n".encode())
            # Some kinds of address show incomplete files.
            self.files.put_file(str(path), temporary)
            self.files.mv(temporary, there)

    def _download(self, there: str, path: Path, size_bytes: int) -> None:
        def check(temporary: Path) -> None:
            self._check(path, temporary)

        with atomic_path(path, needed_bytes=size_bytes, before_rename=check) as temporary, self._reached():
            self.files.get_file(there, str(temporary))

    def _there(self, path: Path) -> str:
        return f"{self.root}/{path.relative_to(self.folder).as_posix()}"

    def _check(self, path: Path, temporary: Path) -> None:
        """Store the sum of a downloaded file locally, or raise why it does not match the remote sum."""
        now, sums = sum_of(temporary), self._sums(self._there(path))
        if sums is None:
            return  # of an older version: verified by reading it
        known = next((known for known in sums if known.same_content(now)), None)
        if known is None:
            raise _MisfitError("its bytes are not those that were written" if sums else "its checksum is damaged")
        add_sum(path, dataclasses.replace(now, facts=known.facts))

    def _sums(self, there: str) -> list[FileSum] | None:
        """The valid sums of a remote file; None without any."""
        with self._reached():
            names = self._names_of_sums(there)
            texts = [self.files.cat_file(name).decode("utf-8", errors="replace") for name in names]
        lines = [line for text in texts for line in text.splitlines()]
        return [found for line in lines if (found := FileSum.from_line(line)) is not None] if names else None

    def _names_of_sums(self, there: str) -> list[str]:
        folder, _, name = there.rpartition("/")
        listed = [str(each).rpartition("/")[2] for each in self.files.ls(folder, detail=False)]
        return [f"{folder}/{each}" for each in listed if each.startswith(f"{name}.") and each.endswith(SUFFIX)]

    def _set_aside_there(self, there: str, why: str) -> None:
        """Move a remote file that does not match its sum to `damaged/`; with its sums if none is valid."""
        target = f"{self.root}/{DAMAGED}/{there.removeprefix(self.root).strip('/')}.{uuid.uuid4().hex[:8]}"
        sums_are_damaged = self._sums(there) == []
        with self._reached():
            names = self._names_of_sums(there) if sums_are_damaged else []
            self.files.makedirs(target.rpartition("/")[0], exist_ok=True)
            self.files.mv(there, target)
            for number, name in enumerate(names):
                self.files.mv(name, f"{target}.{number}{SUFFIX}")
        _log.warning("%s: %s: %s; set aside as %s", self.address, there, why, target)

    @contextmanager
    def _reached(self) -> Iterator[None]:
        """Convert any exception of an address to one clear line."""
        try:
            yield
        except StoreError:
            raise
        except Exception as error:
            if isinstance(error, OSError) and error.errno in FULL:
                raise  # from this machine's disk
            reason = str(error) or type(error).__name__
            raise StoreError(f"{self.address}: {reason}; allowed is a store that can be reached") from error


class _MisfitError(Exception):
    """A downloaded file does not match its sum."""
