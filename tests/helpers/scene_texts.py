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
