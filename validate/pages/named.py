"""Files, stores and addresses that a folder's run.json names, and the user's permission to open them.

The folder may come from elsewhere. Without permission nothing is opened but files in the folder, files of the project,
and the store in `results/store`, which all commands use; no address is contacted.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import scenes
from pss.files import is_inside
from render.store.folder import StoreError
from render.store.remote import is_address

__all__ = ["DEFAULT_STORE", "Given"]

DEFAULT_STORE = "results/store"
SHIPPED = Path(scenes.__file__).parent
UNASKED = "nothing outside the folder is opened without an option"


@dataclass(frozen=True)
class Given:
    """What the user gave on the command line to make a report again.

    Attributes:
        store: a folder or an address; None for what run.json names.
        scene: the scene that was given to the run.
        files: sweeps or a schedule that were given to the run.
        allow_outside: whether run.json, and files, may name others outside their folder.
    """

    store: str | None = None
    scene: Path | None = None
    files: tuple[Path, ...] = ()
    allow_outside: bool = False

    def store_of(self, folder: Path, named: str) -> str:
        """The store to use, where run.json in `folder` names one.

        Raises:
            StoreError: it may not be used without an option.
        """
        if self.store is not None:
            return self.store
        if is_address(named):
            raise StoreError(
                f"{folder}/run.json names the store {named}, and no address is contacted without an option; "
                f"allowed: --store {named}, or the folder of a store that has the same views"
            )
        if named == DEFAULT_STORE or self.allow_outside or is_inside(named, [folder]):
            return named
        raise StoreError(
            f"{folder}/run.json names the store {named}, and {UNASKED}; allowed: --store {named}, or another store "
            "that has the same views"
        )

    def scene_of(self, folder: Path, named: str | None) -> Path | None:
        """The scene to use in place of the file's own; None for the file's own.

        Args:
            folder: of the run.
            named: the scene that the run was given, as run.json names it.

        Raises:
            StoreError: it may not be opened without an option.
        """
        if self.scene is not None or named is None:
            return self.scene
        self._check(folder, "scene", named, "--scene")
        return Path(named)

    def file_of(self, folder: Path, kind: str, named: str) -> str | Path:
        """The sweep or schedule to use, where run.json in `folder` names one.

        Args:
            folder: of the run.
            kind: "sweep" or "schedule".
            named: a path, or the name of a file that comes with the project.

        Raises:
            StoreError: it may not be opened without an option.
        """
        for file in self.files:
            if file.stem == Path(named).stem:
                return file
        if Path(named).suffix == ".toml" or len(Path(named).parts) != 1:
            self._check(folder, kind, named, "--file")
        return named

    def check_scene_of(self, folder: Path, file: Path, scene: Path) -> None:
        """That the scene which a sweep or schedule names may be opened: one in `folder` opens nothing outside it.

        Raises:
            StoreError: it may not.
        """
        # A file that the user gave, or of the project, may name scenes near it, as everywhere
        # (`scenes.reading.inside`).
        if file not in self.files and is_inside(file, [folder]):
            self._check(folder, "scene", str(scene), "--scene")

    def _check(self, folder: Path, kind: str, named: str, option: str) -> None:
        if self.allow_outside or is_inside(named, [folder, SHIPPED]):
            return
        raise StoreError(
            f"{folder} names the {kind} {named}, and {UNASKED}; allowed: {option} {named}, or --allow-outside"
        )
