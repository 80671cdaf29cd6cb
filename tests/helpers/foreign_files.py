"""Files that somebody else wrote: a crate's mesh, a scene that names it, and the one line that refuses a file."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

import pss.files
from pss import PSSError

FOLDER = Path(pss.files.__file__).parents[1] / "scenes"
ROOM = (FOLDER / "room.toml").read_text(encoding="utf-8")
ZOOM = (FOLDER / "sweeps" / "zoom.toml").read_text(encoding="utf-8")
WALK = (FOLDER / "schedules" / "hallway.toml").read_text(encoding="utf-8")
CUBE = '<shape type="cube" id="crate"><transform name="to_world"><scale value="0.2"/></transform></shape>'


def crate(path: Path) -> Path:
    trimesh.creation.box(extents=(0.3, 0.3, 0.3)).export(path)
    return path


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def changed(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


def problem_of(read, *arguments, **options) -> str:
    """The one line with which something is refused."""
    with pytest.raises(PSSError) as caught:
        read(*arguments, **options)
    text = str(caught.value)
    assert "\n" not in text
    assert text.isprintable()
    return text
