"""Names of a run's files that come from its sweeps' names, and names that would make two of them one file.

Pure names: nothing is opened. Two sweeps count as one where a file system that ignores capitals, or the form in which
accents are written, would take their files for one.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from pathlib import Path

from pss import RangeError

__all__ = ["FIGURES", "check_default_folder", "check_names", "figure_file", "model_file", "sweep_name"]

FIGURES = ("", "_points", "_captures")
"""What follows a sweep's name in the names of its figures: curves, points, contact sheet."""
# Folders of results/ that are not a sweep's own: of the store, of other commands, and of what comes with the project.
RESERVED = (
    "bank",
    "calibration-error",
    "check",
    "compare",
    "figures",
    "hallway",
    "measure",
    "pixel-noise",
    "reference",
    "remote-stores",
    "store",
)


def sweep_name(path_or_name: str) -> str:
    """The name of a sweep by the word that the command line has for it."""
    path = Path(path_or_name)
    return path.stem if path.suffix == ".toml" else path.name


def figure_file(name: str, suffix: str) -> str:
    """A figure of the sweep `name` in `figures/`; `suffix` is one of `FIGURES`."""
    return f"{name}{suffix}.png"


def model_file(name: str, number: int) -> str:
    """The scene of the sweep `name`, which is the run's `number`-th from 0, as glTF."""
    return "scene.glb" if number == 0 else f"scene_{name}.glb"


def check_names(names: Sequence[str]) -> None:
    """Whether each sweep's rows and files are its own.

    Raises:
        RangeError: a name that is given twice, or two names of which one's file is the other's.
    """
    owners: dict[str, tuple[str, str]] = {}
    for number, name in enumerate(names):
        if names.index(name) < number:
            raise RangeError(f"sweep {name!r} is given twice; allowed: each once, as it names its rows")
        files = [f"figures/{figure_file(name, suffix)}" for suffix in FIGURES]
        for file in (*files, model_file(name, number)):
            other, taken = owners.setdefault(_folded(file), (name, file))
            if other != name:
                raise RangeError(
                    f"sweeps {other!r} and {name!r} of one run would both write {taken}; allowed: names that differ in "
                    f"more than capitals, and none that is another's with {' or '.join(filter(None, FIGURES))} behind "
                    "it (run one alone with --out, or rename its file)"
                )


def check_default_folder(names: Sequence[str], folder: Path) -> None:
    """Whether the folder that a run without --out gets of its sweeps' names is free for it.

    Raises:
        RangeError: it belongs to something else.
    """
    if _folded(folder.name) in RESERVED:
        raise RangeError(
            f"the results of {', '.join(map(repr, names))} would go to {folder}, which is not a sweep's own folder; "
            "allowed: another folder by --out"
        )


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()
