"""A finished run, loaded from the folder of its results; column names of older versions are read as today's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from pss.hints import CsvRow
from render.store.atomic import atomic_path
from render.store.folder import StoreError, write_text
from validate.runs.csv_file import read_csv, read_head
from validate.runs.events import EVENTS
from validate.runs.folder_lock import alone_in
from validate.runs.outputs import ENDINGS, FOLDERS, check_outputs, link
from validate.runs.run_file import read_run
from validate.runs.tables import RunTables, table_file

__all__ = ["SavedRun", "load"]

TABLE = ".csv"


class SavedRun(RunTables):
    """The files of a run. A table is read when it is first needed, so that one damaged file does not hide the others.

    Attributes:
        folder: of the results.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._rows: dict[str, Sequence[CsvRow]] = {}

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the tables in the folder, in alphabetical order."""
        return tuple(sorted(path.stem for path in self.folder.glob(f"*{TABLE}")))

    @cached_property
    def run(self) -> dict[str, Any]:
        """What `run.json` has: options, files, seeds, versions and seconds; nothing without the file.

        Raises:
            StoreError: it is no JSON object.
        """
        return read_run(self.folder) or {}

    def written(self, name: str) -> Sequence[CsvRow]:
        """The rows of a table, text by column.

        Raises:
            RangeError: the run has no such table.
            StoreError: the file is no table; the line has its name and the line in it.
        """
        self._check_name(name)
        if name not in self._rows:
            self._rows[name] = read_csv(self.path(name))
        return self._rows[name]

    def path(self, name: str) -> Path:
        """The CSV file of a table."""
        return self.folder / f"{name}{TABLE}"

    def save(self, folder: str | Path) -> Path:
        """Write tables, figures, report and `run.json` into another folder, and link its views; the folder.

        Raises:
            StoreError: the folder cannot be written, something is in the way, or another process uses it.
        """
        target = Path(folder)
        if target.exists() and target.resolve() == self.folder.resolve():
            raise StoreError(f"{target} is the folder of the run; allowed is another folder")
        check_outputs(target)
        others = sorted({path.stem for path in target.glob(f"*{TABLE}")} - set(self.names))
        if others:
            raise StoreError(
                f"{target} has tables of another run, such as {others[0]}{TABLE}; allowed is another folder"
            )
        with alone_in(target):
            for name in self.names:
                write_text(target / f"{name}{TABLE}", table_file(self.written(name), read_head(self.path(name))))
            for path in self._others():
                copy = target / path.relative_to(self.folder)
                if path.is_symlink():
                    link(copy, path.resolve())
                    continue
                with atomic_path(copy) as temporary:
                    temporary.write_bytes(path.read_bytes())
        return target

    def _others(self) -> Iterator[Path]:
        """The files of a run that are no tables, and the links to its views; other files are not the run's."""
        for place in (self.folder, *(self.folder / name for name in FOLDERS)):
            for path in sorted(place.iterdir()) if place.is_dir() else ():
                if path.is_symlink():
                    ours = place.name == "views"
                else:
                    ours = path.is_file() and path.suffix != TABLE
                    ours = ours and (path.suffix in ENDINGS or path.name == EVENTS)
                if ours:
                    yield path

    def __repr__(self) -> str:
        """The folder and the names of its tables."""
        return f"SavedRun({str(self.folder)!r}: {', '.join(self.names)})"


def load(folder: str | Path) -> SavedRun:
    """A finished run from the folder of its results, such as `results/zoom`.

    Raises:
        StoreError: there is no such folder, or it has no table.
    """
    run = SavedRun(Path(folder))
    if not run.folder.is_dir():
        raise StoreError(f"{folder} is no folder; allowed is one that a run has left, such as results/zoom")
    if not run.names:
        raise StoreError(f"{folder} has no table (.csv); allowed is a folder that a run has left, such as results/zoom")
    return run
