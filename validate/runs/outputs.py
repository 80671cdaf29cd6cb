"""Obstacles to writing a run's files, found before the run starts and not when its tables are written."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from render.store.folder import Store, StoreError
from render.store.remote import is_address

__all__ = ["ENDINGS", "FOLDERS", "check_folders", "check_outputs", "link", "linked_views"]

FOLDERS = ("views", "figures", "trajectories")
"""Folders in those of results, by the names that all commands have for them."""
# Of the files that commands write there.
ENDINGS = (".csv", ".json", ".html", ".glb", ".toml", ".md", ".png", ".pdf", ".svg", ".webp", ".tum")


def check_folders(out: Path, store: str) -> None:
    """Whether a run could leave something there, before it takes its time.

    Raises:
        StoreError: a file is in the way, or the folder of results cannot be written.
    """
    # A store that holds all requested views need not be writable.
    if not is_address(store) and Path(store).exists() and not Path(store).is_dir():
        raise StoreError(f"--store {store} is a file; allowed is a folder")
    if out.exists() and not out.is_dir():
        raise StoreError(f"--out {out} is a file; allowed is a folder")
    if not is_address(store) and out.resolve() == Path(store).resolve():
        raise StoreError(f"--out {out} is the store; allowed is another folder")
    existing = next(parent for parent in [out, *out.resolve().parents] if parent.exists())
    if not os.access(existing, os.W_OK):
        raise StoreError(f"--out {out} cannot be written; allowed is a folder that you may write to")
    check_outputs(out)


def check_outputs(folder: Path) -> None:
    """Whether a run can write its files into `folder`, as far as what is there shows.

    Raises:
        StoreError: a file where a folder goes, or a folder with the name of a file.
    """
    if not folder.is_dir():
        return
    for name in FOLDERS:
        path = folder / name
        if (path.exists() or path.is_symlink()) and not path.is_dir():
            raise StoreError(f"{path} is a file; allowed is a folder in its place, nothing, or another --out")
    places = [folder, *(folder / name for name in FOLDERS if name != "views")]
    for path in (path for place in places if place.is_dir() for path in sorted(place.iterdir())):
        if path.suffix in ENDINGS and path.is_dir():
            raise StoreError(f"{path} is a folder; allowed is a file in its place, nothing, or another --out")


def linked_views(folder: Path, keys: Iterable[str], store: Store) -> None:
    """Point `views/` of a run's folder into the store."""
    (folder / "views").mkdir(parents=True, exist_ok=True)
    for key in dict.fromkeys(keys):
        link(folder / "views" / f"{key}.exr", store.view(key))


def link(path: Path, target: Path) -> None:
    """Have `path` point to a file, by a relative link.

    Raises:
        StoreError: a folder is in its place.
    """
    if path.is_dir() and not path.is_symlink():
        raise StoreError(f"{path} is a folder; allowed is a file in its place, or nothing")
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink() or path.exists():
        path.unlink()
    path.symlink_to(os.path.relpath(target, path.parent))
