"""Scenes from Python: by name, their cameras selected, made of tables, and saved."""

from __future__ import annotations

import dataclasses
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

import scenes
from pss import RangeError
from pss.noise import Calibration
from render.keys import state_key
from scenes import Scene, SceneError
from scenes.schema.camera_tables import CameraSpec

FOLDER = Path(scenes.__file__).parent
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))


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


# ---- made in Python --------------------------------------------------------------------------------------------------


def tables_of(name: str) -> dict:
    return tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", NAMES)
def test_tables_make_the_scene_that_their_file_makes(name):
    made = Scene(FOLDER / f"{name}.toml", **tables_of(name))
    loaded = scenes.load(name)
    assert made == loaded
    assert made.resolved() == loaded.resolved()


def test_tables_may_hold_pythons_own_values(room):
    """Arrays, tuples, a path, objects of the schema, and None for a key that is missing."""
    tables = tables_of("room")
    for camera in tables["cameras"]:
        camera["position_m"] = np.array(camera["position_m"])
        camera["aim_m"] = tuple(camera["aim_m"])
        camera["f_number"] = None
    tables["cameras"] = (CameraSpec(**tables["cameras"][0] | {"position_m": (-2.8, 0.2, 2.8)}), *tables["cameras"][1:])
    tables["room"] |= {"width_m": np.float64(tables["room"]["width_m"])}
    made = Scene("mine.toml", backdrop=None, **tables)
    assert (made.state, made.cameras) == (room.state, room.cameras)
    assert made.path == Path("mine.toml")


def test_every_problem_of_tables_is_a_line():
    tables = tables_of("room")
    tables["cameras"][0]["zoom"] = 99.0
    tables["lens"]["max_zom"] = tables["lens"].pop("max_zoom")
    del tables["process"]
    with pytest.raises(SceneError) as caught:
        Scene("mine.toml", **tables, rom={})
    lines = caught.value.problems
    assert all(line.startswith("mine.toml: ") for line in lines)
    text = "\n".join(lines)
    for words in ("rom = {}", 'did you mean "room"', "max_zom", "process is missing"):
        assert words in text
    with pytest.raises(SceneError, match=r"mine\.toml: .*1e\+?31"):
        Scene("mine.toml", **tables_of("room") | {"noise": {"models": ["corrected"], "px2_per_m2": 1e31}})


# ---- saved -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_saved_scene_is_loaded_as_the_same(name, tmp_path):
    """Beside its meshes, or elsewhere with paths to them."""
    scene = scenes.load(name, ["sensor.exposure_ms=7"], allow_outside=True)
    path = scene.save(tmp_path / "below" / "saved.toml")
    again = scenes.load(path, allow_outside=True)
    assert state_key(again.state) == state_key(scene.state)
    for part in ("cameras", "sensor", "process", "noise_models", "visibility", "auto_exposure"):
        assert getattr(again, part) == getattr(scene, part), part
    assert again.sensor.exposure_ms == 7


def test_files_outside_the_new_folder_are_a_line_each(tmp_path):
    scene = scenes.load("workshop")
    with pytest.raises(SceneError) as caught:
        scene.save(tmp_path / "saved.toml")
    assert caught.value.problems
    assert all("file = " in line and "this is outside" in line for line in caught.value.problems)
    assert not list(tmp_path.iterdir())


def test_a_calibration_is_named_from_the_new_folder(tmp_path):
    """Its path in `noise.models` and `metric.visibility`, which are relative to the scene's folder."""
    below = tmp_path / "below"
    below.mkdir()
    limits = {"smallest_module_px": 2.0, "largest_blur_modules": 1.5}
    (below / "mine.toml").write_text(Calibration("mine", {"floor": 1.0}, {}, limits).to_toml(), encoding="utf-8")
    shutil.copy(FOLDER / "room.toml", below)
    scene = scenes.load(below / "room.toml", ['noise.models=["mine.toml"]', "metric.visibility=mine.toml"])
    path = scene.save(tmp_path / "saved.toml")
    saved = tomllib.loads(path.read_text(encoding="utf-8"))
    assert (saved["noise"]["models"], saved["metric"]["visibility"]) == (["below/mine.toml"], "below/mine.toml")
    again = scenes.load(path)
    assert again.visibility == scene.visibility
    assert again.noise_models[0].factors == scene.noise_models[0].factors


def test_a_scene_of_replaced_objects_is_not_saved(room, tmp_path):
    """A file could not hold them; another exposure keeps them."""
    turned = tuple(dataclasses.replace(camera, pan_deg=3.0) for camera in room.cameras[:2])
    other = room.replace(cameras=turned)
    assert other.cameras == turned
    assert other.with_exposure(8.0).cameras == turned
    assert other.with_exposure(8.0).sensor.exposure_ms == 8
    models = room.noise_models[:1]
    assert room.replace(noise_models=models).with_exposure(8.0).noise_models == models
    for act in (other.to_toml, lambda: other.save(tmp_path / "x.toml"), lambda: other.with_settings({})):
        with pytest.raises(SceneError, match="its cameras were replaced by objects; allowed: a scene made of tables"):
            act()
    with pytest.raises(SceneError, match="a scene has no camera; allowed: path, state, cameras"):
        room.replace(camera=turned)


def test_other_types_are_one_line(room):
    """A number for a camera's name, one text for a list of overrides, text for an exposure."""
    with pytest.raises(SceneError, match=r'there is no camera 2, did you mean "2"\?; allowed: 1, 2'):
        room.select(2, 4)
    with pytest.raises(SceneError, match=r'^overrides = "sensor.exposure_ms=8"; allowed: a list of "key=value"$'):
        scenes.load("room", "sensor.exposure_ms=8")
    for value in ("8", -1, np.nan, np.inf):
        with pytest.raises(RangeError, match="exposure_ms"):
            room.with_exposure(value)
    with pytest.raises(SceneError, match='the file has no key "1"'):
        room.with_settings({1: 2})
    with pytest.raises(SceneError, match="there is no such file"):
        scenes.load("room", [f'noise.models=["{"a" * 500}.toml"]'])
    tables = tables_of("room")
    assert Scene("mine.toml", **tables | {"cameras": iter(tables["cameras"])}).cameras == room.cameras
