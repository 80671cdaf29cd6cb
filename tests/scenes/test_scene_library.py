"""Scenes from Python: by name, their cameras selected, made of tables, and saved."""

from __future__ import annotations

from pathlib import Path

import pytest

import scenes
from scenes import SceneError

FOLDER = Path(scenes.__file__).parent


def test_a_shipped_scene_is_loaded_by_its_name(room):
    by_name = scenes.load("room", overrides=["sensor.exposure_ms=8"])
    assert by_name.path == FOLDER / "room.toml"
    assert by_name.sensor.exposure_ms == 8 != room.sensor.exposure_ms
    assert by_name.state == room.state


def test_an_unknown_name_has_one_line_with_the_names_there_are():
    with pytest.raises(SceneError) as caught:
        scenes.load("rom")
    (line,) = caught.value.problems
    assert 'there is no scene "rom", did you mean "room"?' in line
    assert "allowed: atrium, bench, hallway, room, studio, workshop, or the path of a .toml file" in line


def test_cameras_are_selected_in_the_given_order(room):
    assert [camera.name for camera in room.select("6", "2")] == ["6", "2"]
    assert room.select("4") == (room.camera("4"),)


@pytest.mark.parametrize(
    ("names", "value"),
    [(("2", "x"), '"x"'), ((), "no camera is selected"), (("2", "2"), 'camera "2" is selected twice')],
)
def test_a_selection_that_is_not_allowed_is_one_line(room, names, value):
    with pytest.raises(SceneError) as caught:
        room.select(*names)
    (line,) = caught.value.problems
    assert value in line
    assert ", ".join(camera.name for camera in room.cameras) in line.partition("allowed: ")[2]
