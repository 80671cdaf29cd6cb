"""The shipped room as text, and changes of it."""

from __future__ import annotations

from pathlib import Path

import pytest

import scenes
import scenes.steps.sweep_file
from scenes import SceneError

FOLDER = Path(scenes.__file__).parent
ROOM = (FOLDER / "room.toml").read_text()


def changed(text: str, *replacements: tuple[str, str]) -> str:
    """`text` with the first place of each replaced; a pattern that is not there would test nothing."""
    for old, new in replacements:
        assert old in text, f"{old!r} is not in the file"
        text = text.replace(old, new, 1)
    return text


def write(folder: Path, text: str, name: str = "scene.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def scene_problems(folder: Path, text: str, overrides: tuple[str, ...] = ()) -> list[str]:
    with pytest.raises(SceneError) as caught:
        scenes.load(write(folder, text), overrides)
    return caught.value.problems


# Written beside no other file, where a sweep may name no scene in the folder above.
ZOOM, SELECTION = (
    (FOLDER / "sweeps" / f"{name}.toml").read_text().replace("../room.toml", "room.toml")
    for name in ("zoom", "selection")
)
PLACED = """
[[markers.placed]]
id = 90
object = "plinth"
centre_m = [0.25, 0.3, 0.4]
normal = [0.0, 2.0, 0.0]
module_mm = 10.0
"""


def start_of_line(key: str, value: str | None) -> str:
    """A missing key has no value; "…" stands for one that would make the table too wide."""
    return f"{key} is missing; " if value is None else f"{key} = " if value == "…" else f"{key} = {value};"
