"""What a mistake's line has of its file: as TOML writes it, and the mistake that it is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import scenes
from scenes import SceneError
from validate.run_sweep import main

ROOM = Path(scenes.__file__).parent / "room.toml"


@pytest.fixture
def room_without(tmp_path):
    """Write a room with another text in the place of its cameras; its path."""

    def write(cameras: str, before: str = "") -> Path:
        text = ROOM.read_text(encoding="utf-8")
        first, _, rest = text.partition("[[cameras]]")
        _, _, after = rest.partition("[[objects]]")
        markers = re.search(r"\[markers\].*?(?=\n\[)", text, re.S)[0]
        first = first.replace(markers, "")
        path = tmp_path / "room.toml"
        path.write_text(f"{before}\n{first}\n{cameras}\n{markers}\n[[objects]]{after.replace(markers, '')}")
        return path

    return write


@pytest.mark.parametrize(
    ("cameras", "before", "value"),
    [
        ("", "", "is missing"),
        ("", "cameras = []", "= []"),
        ("", "cameras = 3", "= 3"),
        ("[cameras]\nzoom = 1", "", "= {"),
    ],
)
def test_a_scene_without_cameras_names_them_as_toml_does(room_without, cameras, before, value):
    with pytest.raises(SceneError) as caught:
        scenes.load(room_without(cameras, before))
    [line] = caught.value.problems
    assert f"cameras {value}" in line
    assert "allowed: at least one [[cameras]], each a table with name, position_m" in line


@pytest.mark.parametrize(
    ("override", "value"),
    [("cameras.1.position_m=[nan,0,1]", "[nan, 0, 1]"), ("room.width_m=inf", "inf"), ("lens.max_zoom=-inf", "-inf")],
)
def test_numbers_that_are_none_are_told_from_a_wrong_shape(override, value):
    with pytest.raises(SceneError) as caught:
        scenes.load(ROOM, [override])
    assert any(f"= {value}" in line and "finite numbers, not nan or inf" in line for line in caught.value.problems)
    with pytest.raises(SceneError) as caught:
        scenes.load(ROOM, ["cameras.1.position_m=[0,1]"])
    assert "finite" not in str(caught.value)


def test_a_byte_order_mark_is_passed_over(tmp_path):
    """As Windows' editors write it."""
    (tmp_path / "room.toml").write_bytes(b"\xef\xbb\xbf" + ROOM.read_bytes())
    assert scenes.load(tmp_path / "room.toml").resolved() == scenes.load(ROOM).resolved()


def test_a_folder_is_told_from_a_file(tmp_path, capsys):
    """Not, as for the stem that it lacks, that `--out` is wrong."""
    for command in (["check", "."], ["check", str(tmp_path)], ["zoom", "--scene", str(tmp_path)]):
        assert main(command) == 2
        message = capsys.readouterr().err
        assert message.endswith(": Is a directory\n")
        assert "--out" not in message
