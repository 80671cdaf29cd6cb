"""`run_sweep.py store`: list what is stored, check it, and take out what is not wanted any more."""

from __future__ import annotations

import datetime
import os
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from render.keys import light_code, view_code
from render.store.checksums import read_sums
from render.store.folder import DAMAGED, Store, StoreError
from render.store.remote import open_store
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
from validate.runs.program import program_name

__all__ = ["main"]

StoreOption = Annotated[str, tyro.conf.arg(metavar="DIR")]
DEFAULT = "results/store"
SECONDS_BETWEEN_LINES = 10.0


def list_(store: StoreOption = DEFAULT) -> int:
    """Report how many files and bytes there are of each kind and code that made them, and how old they are.

    Args:
        store: folder of rendered views and measurements; of an address, what is on this machine is listed.
    """
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


def verify(store: StoreOption = DEFAULT) -> int:
    """Read every file and compare it with its checksum. Exit code 1 if any is damaged; those are set aside.

    Args:
        store: folder of rendered views and measurements; of an address, what is on this machine is checked.
    """
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


def prune(
    store: StoreOption = DEFAULT,
    older_than: Annotated[str | None, tyro.conf.arg(metavar="AGE")] = None,
    keep_below: Annotated[str | None, tyro.conf.arg(metavar="SIZE")] = None,
    unused_by: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="RUN")] = (),
    stale: bool = False,
    yes: bool = False,
) -> int:
    """Say what would be removed, or remove it with --yes. What is younger than an hour always stays.

    Several options together remove only what meets them all. Temporary files older than a day go in any case.

    Args:
        store: folder of rendered views and measurements; of an address, what is on this machine is removed.
        older_than: age, such as 30d or 12h.
        keep_below: size of all that stays, such as 20GB; the oldest goes first.
        unused_by: folders that runs left: views and measurements that none of them uses.
        stale: what other code or other versions of libraries made, so that no run of this installation uses it.
        yes: remove it.
    """
    folder, now = _folder(store).folder, time.time()
    files = prune_list(
        list(stored_files(folder)),
        now,
        None if older_than is None else seconds_of(older_than, "--older-than"),
        None if keep_below is None else bytes_of(keep_below, "--keep-below"),
        used_views(unused_by) if unused_by else None,
        stale,
    )
    abandoned = leftovers(folder, now)
    paths = [stored.path for stored in files] + abandoned
    for path in paths:
        print(path.relative_to(folder).as_posix())
    size = sum(stored.size_bytes for stored in files) + sum(path.stat().st_size for path in abandoned)
    if yes:
        count, size = remove(paths)
        print(f"{count} files removed, {size:,} bytes")
    else:
        print(f"{len(paths)} files would be removed, {size:,} bytes; --yes removes them")
    return 0


def code() -> int:
    """Print which modules and libraries the names of stored files cover; a change in one of them makes new files."""
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
        raise StoreError(f"--store {store}: {opened.folder} is not there; allowed is a store that a run left")
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


def main(arguments: list[str]) -> int:
    """Parse the subcommand's own arguments and run it; --store may come before its name as well."""
    if arguments[:1] == ["--store"]:
        arguments = [*arguments[2:3], *arguments[:2], *arguments[3:]]
    commands = {"list": list_, "verify": verify, "prune": prune, "code": code}
    return int(tyro.extras.subcommand_cli_from_dict(commands, prog=f"{program_name()} store", args=arguments))
