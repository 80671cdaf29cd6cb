"""`run_sweep.py store`: list what is stored, check it, and remove what is no longer needed."""

from __future__ import annotations

import datetime
import os
import sys
import time
from collections import defaultdict
from collections.abc import Sequence

from render.keys import light_code, view_code
from render.store.checksums import read_sums
from render.store.folder import DAMAGED, Store, StoreError
from render.store.remote import open_store
from validate.commands import subcommands
from validate.commands.store_upkeep import (
    Stored,
    bytes_of,
    check,
    leftovers,
    prune_list,
    remove,
    seconds_of,
    stored_files,
    used_views,
)
from validate.markers.view_measurement import measure_code
from validate.pixel_noise.measure import pixel_noise_code

__all__ = ["execute"]

SECONDS_BETWEEN_LINES = 10.0


def execute(options: subcommands.Store) -> int:
    """Carry out one of the store's own commands; the exit code.

    Raises:
        StoreError: there is no such store, or it cannot be read or written.
    """
    action = options.action
    if isinstance(action, subcommands.StoreList):
        return _list(options.store)
    if isinstance(action, subcommands.StoreVerify):
        return _verify(options.store)
    if isinstance(action, subcommands.StorePrune):
        return _prune(options.store, action)
    return _code()


def _list(store: str) -> int:
    files = list(stored_files(_folder(store).folder))
    groups: dict[tuple[str, bool, str], list[Stored]] = defaultdict(list)
    for stored in files:
        groups[stored.kind, stored.stale, stored.version].append(stored)
    print(f"{'kind':<14}{'made by':<28}{'files':>7}{'bytes':>16}  {'oldest':<17}newest")
    for (kind, stale, version), members in sorted(groups.items()):
        code = "" if kind == DAMAGED else "other code" if stale else "this code"
        print(f"{kind:<14}{f'{code} {version}'.strip() or '-':<28}{_counts(members)}")
    print(f"{'all':<42}{_counts(files)}" if files else "nothing is stored")
    if old := [stored for stored in files if stored.stale]:
        size = sum(stored.size_bytes for stored in old)
        print(f"other code or libraries made {len(old)} files, {size:,} bytes; store prune --stale lists them")
    return 0


def _verify(store: str) -> int:
    opened = _folder(store)
    files = [stored for stored in stored_files(opened.folder) if stored.kind != DAMAGED]
    damaged = without = gone = 0
    last_line = time.monotonic()
    for number, stored in enumerate(files):
        has_sum = read_sums(stored.path) is not None
        if not check(opened, stored):
            # Another process may have pruned it since it was listed.
            lost = _was_set_aside(opened, stored)
            damaged, gone = damaged + lost, gone + (not lost)
        without += not has_sum and read_sums(stored.path) is None
        if time.monotonic() - last_line > SECONDS_BETWEEN_LINES:
            last_line = time.monotonic()
            print(f"{number + 1} of {len(files)} files", file=sys.stderr, flush=True)
    print(f"{len(files) - gone} files checked, {damaged} damaged" + (" and set aside" if damaged else ""))
    if without:
        print(f"{without} files without a checksum were read whole, and could not be given one")
    return 1 if damaged else 0


def _prune(store: str, options: subcommands.StorePrune) -> int:
    folder, now = _folder(store).folder, time.time()
    files = prune_list(
        list(stored_files(folder)),
        now,
        None if options.older_than is None else seconds_of(options.older_than, "--older-than"),
        None if options.keep_below is None else bytes_of(options.keep_below, "--keep-below"),
        used_views(options.unused_by) if options.unused_by else None,
        options.stale,
    )
    abandoned = leftovers(folder, now)
    paths = [stored.path for stored in files] + abandoned
    for path in paths:
        print(path.relative_to(folder).as_posix())
    size = sum(stored.size_bytes for stored in files) + sum(path.stat().st_size for path in abandoned)
    if options.yes:
        count, size = remove(paths)
        print(f"{count} files removed, {size:,} bytes")
    else:
        print(f"{len(paths)} files would be removed, {size:,} bytes; --yes removes them")
    return 0


def _code() -> int:
    kinds = {"views": view_code, "light": light_code, "measurements": measure_code, "pixel-noise": pixel_noise_code}
    for kind, of in kinds.items():
        found = of()
        print(f"{kind}: code {found.digest}")
        print("  libraries: " + ", ".join(f"{name} {version}" for name, version in found.libraries))
        print("\n".join(f"  {name}" for name in found.modules))
    return 0


def _folder(store: str) -> Store:
    opened = open_store(store)
    if not opened.folder.is_dir():
        found = "is a file" if opened.folder.exists() else "is not there"
        raise StoreError(f"--store {store} {found}; allowed is a store that a run left")
    return opened


def _was_set_aside(store: Store, stored: Stored) -> bool:
    aside = store.folder / DAMAGED / stored.path.relative_to(store.folder)
    return any(aside.parent.glob(f"{aside.stem}*{aside.suffix}")) and not os.path.exists(stored.path)


def _counts(members: Sequence[Stored]) -> str:
    oldest, newest = (
        datetime.datetime.fromtimestamp(chosen(stored.changed_s for stored in members)).strftime("%Y-%m-%d %H:%M")
        for chosen in (min, max)
    )
    return f"{len(members):>7}{sum(stored.size_bytes for stored in members):>16,}  {oldest:<17}{newest}"
