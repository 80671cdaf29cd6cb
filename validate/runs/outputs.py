"""What stands in the way of a run's files: found before it takes its time, and not when its tables are written."""

from __future__ import annotations

from pathlib import Path

from render.store.atomic import StoreError

__all__ = ["check_outputs"]

FOLDERS = ("views", "figures", "trajectories")
"""Folders in those of results, by the names that all commands have for them."""
# Of the files that commands write there.
ENDINGS = (".csv", ".json", ".html", ".glb", ".toml", ".md", ".png", ".pdf", ".svg", ".webp", ".tum")


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
