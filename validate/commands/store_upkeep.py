"""The files of a store: counted, checked, and removed on the user's request; see `run_sweep.py store`."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pss import RangeError
from render.store.checksums import SUFFIX, read_sums, sum_path
from render.store.folder import DAMAGED, Store, StoreError
from render.store.views import adopt_view
from validate.commands.store_codes import codes_here

__all__ = [
    "Stored",
    "bytes_of",
    "check",
    "leftovers",
    "prune_list",
    "remove",
    "seconds_of",
    "stored_files",
    "used_views",
]

# s: what is younger may be somebody's who has just written it, and is about to read it.
UNTOUCHED_S = 3600.0
# s: an older temporary file is abandoned.
ABANDONED_S = 24 * 3600.0
SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 7 * 86400.0}
BYTES = {"B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}


@dataclass(frozen=True)
class Stored:
    """A file of the store.

    Attributes:
        kind: the folder of the store that holds it: views, light, measurements, pixel-noise or damaged.
        size_bytes: of the file, with its sum.
        changed_s: s since 1970 of its last change.
        version: digest of the code that made it, by its sum; "" where that is not known.
        stale: whether other code made it than this installation's, so that no run of this code requests it.
    """

    path: Path
    kind: str
    size_bytes: int
    changed_s: float
    version: str
    stale: bool = False


def stored_files(folder: Path) -> Iterator[Stored]:
    """All files of a store, oldest first; sums and temporary files are none."""
    found, codes = [], codes_here()
    for path in folder.glob("*/**/*"):
        kind = path.relative_to(folder).parts[0]
        is_sum = path.suffix == SUFFIX and kind != DAMAGED
        # What is no plain file is listed as well: `store verify` sets it aside.
        if is_sum or path.name.startswith(".") or path.is_dir() or not path.exists():
            continue
        beside = sum_path(path)
        size = path.stat().st_size + (beside.stat().st_size if beside.exists() else 0)
        sums = None if kind == DAMAGED else read_sums(path)
        version = str(sums[-1].facts.get("version", "")) if sums else ""
        stale = not codes.can_use(kind, path.name, version)
        found.append(Stored(path, kind, size, path.stat().st_mtime, version, stale))
    yield from sorted(found, key=lambda stored: (stored.changed_s, stored.path))


def check(store: Store, stored: Stored) -> bool:
    """Read one file and compare it with its sum; what is damaged is set aside, an older file without gets a sum.

    Raises:
        StoreError: the file cannot be read, or a damaged one not be set aside.
    """
    if stored.path.suffix == ".npz":
        return store.load(stored.path) is not None
    if stored.path.suffix == ".exr":
        return adopt_view(store, stored.path)
    return store.read(stored.path, lambda path: path.stat().st_size) is not None


def leftovers(folder: Path, now_s: float) -> list[Path]:
    """Abandoned temporary files, and sums without a file, that are older than a day."""
    found = []
    for path in folder.glob("*/**/*"):
        if path.relative_to(folder).parts[0] == DAMAGED or not path.is_file():
            continue
        alone = path.suffix == SUFFIX and not path.with_suffix("").exists()
        if (alone or path.name.startswith(".")) and now_s - path.stat().st_mtime > ABANDONED_S:
            found.append(path)
    return found


def prune_list(
    files: Sequence[Stored],
    now_s: float,
    older_than_s: float | None = None,
    keep_below_bytes: float | None = None,
    used: frozenset[str] | None = None,
    stale: bool = False,
) -> list[Stored]:
    """What would go: what meets every wish that is given, and of that, for a size to keep, the oldest first.

    Args:
        files: of the store.
        now_s: s since 1970; files that are younger than an hour, or of the future, stay.
        older_than_s: s, the age that is old enough.
        keep_below_bytes: of the whole store, when it is done.
        used: names of views that are to stay, with their measurements; light stays as well, which is no view's.
        stale: what other code made.

    Raises:
        RangeError: no wish is given.
    """
    if older_than_s is None and keep_below_bytes is None and used is None and not stale:
        raise RangeError(
            "nothing to go by; allowed: --stale, --older-than 30d, --keep-below 20GB, --unused-by results/RUN"
        )
    least_s = max(UNTOUCHED_S, older_than_s or 0.0)
    chosen = [stored for stored in files if now_s - stored.changed_s > least_s and (stored.stale or not stale)]
    if used is not None:
        # A measurement's name begins with its view's; what is damaged is not used.
        chosen = [
            stored
            for stored in chosen
            if stored.kind == DAMAGED
            or (stored.kind in ("views", "measurements") and re.split(r"[-.]", stored.path.name)[0] not in used)
        ]
    if keep_below_bytes is None:
        return chosen
    left, gone = sum(stored.size_bytes for stored in files), []
    for stored in sorted(chosen, key=lambda stored: stored.changed_s):
        if left <= keep_below_bytes:
            break
        gone.append(stored)
        left -= stored.size_bytes
    return gone


def used_views(folders: Iterable[Path]) -> frozenset[str]:
    """Names of the views that runs' folders point at.

    Raises:
        StoreError: a folder is not one that a run left.
    """
    names: set[str] = set()
    for folder in folders:
        if not (folder / "views").is_dir():
            raise StoreError(f"--unused-by {folder}: no views/ in it; allowed is a folder that a run left")
        names |= {path.stem for path in (folder / "views").iterdir()}
    return frozenset(names)


def remove(paths: Iterable[Path], now_s: Callable[[], float] = time.time) -> tuple[int, int]:
    """Remove files and their sums; what has been written again in the last hour stays. Gives files and bytes removed.

    Raises:
        StoreError: a file cannot be removed.
    """
    count = size = 0
    for path in paths:
        try:
            if now_s() - path.stat().st_mtime < UNTOUCHED_S:
                continue
            size += path.stat().st_size
            path.unlink()
            count += 1
            beside = sum_path(path)
            size += beside.stat().st_size
            beside.unlink()
        except FileNotFoundError:
            continue  # it has no sum, or another process was faster
        except OSError as error:
            raise StoreError(f"{path}: {error.strerror}; allowed is a store that can be written") from error
    return count, size


def seconds_of(text: str, option: str) -> float:
    """s of a time such as "30d" or "12h".

    Raises:
        RangeError: it is not one.
    """
    return _number_with_unit(text, SECONDS, option)


def bytes_of(text: str, option: str) -> float:
    """Bytes of a size such as "20GB".

    Raises:
        RangeError: it is not one.
    """
    return _number_with_unit(text, BYTES, option)


def _number_with_unit(text: str, units: dict[str, float] | dict[str, int], option: str) -> float:
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([A-Za-z]+)", text.strip())
    if found is None or found[2] not in units:
        raise RangeError(f"{option} {text!r}; allowed: a number and one of {', '.join(units)}")
    return float(found[1]) * units[found[2]]
