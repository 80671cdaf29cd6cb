"""Sweep files: which configurations they make, and their mistakes."""

from __future__ import annotations

import json

import pytest

import scenes
from pss import Rectangle, Sphere
from scenes import SceneError, load_sweep
from scenes.steps.schedule_file import load_schedule
from tests.helpers.scene_texts import FOLDER, ROOM, SELECTION, ZOOM, changed, start_of_line, write


def test_a_sweep_of_a_setting_changes_its_cameras_only(room):
    configurations = load_sweep("zoom").configurations(room)
    first = configurations[0]
    assert (first.label, first.parameter, first.value) == ("zoom=1", "zoom", 1.0)
    assert [camera.zoom for camera in first.cameras] == [3, 1, 3, 1, 3, 1, 3]
    assert first.cameras[0] is room.cameras[0]  # so that its view is the same view
    assert [configuration.value for configuration in configurations][-2:] == [7.0, 8.0]


def test_a_sweep_of_the_selection(room):
    configurations = load_sweep("selection", ['sweep.vary.values=["2", ["7", "3"]]']).configurations(room)
    assert [configuration.label for configuration in configurations] == ["1+2", "1+3+7"]
    assert [camera.name for camera in configurations[1].cameras] == ["1", "3", "7"]
    assert configurations[1].value == "1+3+7"


def test_active_cameras_are_the_only_ones(room):
    sweep = load_sweep("zoom", ['sweep.active=["6", "4", "2", "1"]'])
    assert [camera.name for camera in sweep.configurations(room)[0].cameras] == ["1", "2", "4", "6"]


def test_a_line_of_values_gives_the_same_views_as_the_list(room):
    line = load_sweep("zoom", ["sweep.vary.values={start = 2.2, stop = 3.4, steps = 4}"])
    written = load_sweep("zoom", ["sweep.vary.values=[2.2, 2.6, 3.0, 3.4]"])
    assert line.configurations(room) == written.configurations(room)


@pytest.mark.parametrize("parameter", ["focus_distance_m", "pan_deg", "tilt_deg", "f_number"])
def test_every_setting_can_be_swept(parameter, room):
    overrides = [f"sweep.vary.parameter={parameter}", "sweep.vary.values=[2.5]"]
    (configuration,) = load_sweep("zoom", overrides).configurations(room)
    assert [getattr(camera, parameter) == 2.5 for camera in configuration.cameras] == [False, True] * 3 + [False]


def test_overrides_of_the_sweep_and_its_resolved_contents():
    sweep = load_sweep("zoom", ["sweep.trials=5", "sweep.seed=7", "cameras.2.zoom=4", "sweep.vary.values=[1,2]"])
    assert (sweep.trials, sweep.seed) == (5, 7)
    resolved = json.loads(json.dumps(sweep.resolved()))
    assert resolved["vary"] == {"cameras": ["2", "4", "6"], "parameter": "zoom", "values": [1, 2]}
    assert "active" not in resolved
    assert json.loads(json.dumps(load_sweep("selection").resolved()))["vary"]["with"] == ["1"]


def test_the_scene_is_found_from_the_sweep_file(tmp_path):
    (tmp_path / "sweeps").mkdir()
    path = write(tmp_path / "sweeps", ZOOM.replace("room.toml", "../room.toml"), "near.toml")
    write(tmp_path, ROOM, "room.toml")
    sweep = load_sweep(path)
    assert (sweep.name, sweep.scene_path) == ("near", tmp_path / "room.toml")
    assert len(sweep.configurations(scenes.load(sweep.scene_path))) == 12


def test_an_unknown_sweep_is_told_with_the_nearest():
    with pytest.raises(SceneError) as caught:
        load_sweep("zom")
    (problem,) = caught.value.problems
    assert problem.startswith('there is no sweep "zom", did you mean "zoom"?; allowed: ')
    assert {"focus", "selection", "zoom"} <= set(problem.partition("allowed: ")[2].split(", "))


BROKEN_SWEEPS = {
    "unknown key": (ZOOM, [("trials", "trails")], "trails", "20", 'mean "trials"'),
    "removed": (ZOOM, [("seed", 'search = "plain"\nseed')], "search", '"plain"', "the key was removed: there is one"),
    "missing": (ZOOM, [("seed = 2011\n", "")], "seed", None, "a whole number"),
    "one trial": (ZOOM, [("trials = 20", "trials = 1")], "trials", "1", "2 or more"),
    "parameter": (ZOOM, [('"zoom"', '"zom"')], "vary.parameter", '"zom"', "zoom, focus_distance_m, pan_deg, tilt_deg"),
    "with a setting": (ZOOM, [("[vary]", '[vary]\nwith = ["1"]')], "vary.with", '["1"]', "cameras, values"),
    "no values": (ZOOM, [("values = [", "values = [] # ")], "vary.values", "[]", "one or more numbers"),
    "one step": (ZOOM, [("[1.0", "{start = 1, stop = 2, steps = 1} # ")], "vary.values", "…", "2 steps"),
    "no way": (ZOOM, [("[1.0", "{start = 2, stop = 2, steps = 3} # ")], "vary.values", "…", "that differ"),
    "value twice": (ZOOM, [("[1.0, 1.5", "[1.5, 1.5")], "vary.values", '"1.5"', "nothing twice"),
    "camera twice": (ZOOM, [('["2", "4"', '["4", "4"')], "vary.cameras", '"4"', "nothing twice"),
    "varied but not active": (ZOOM, [("seed", 'active = ["1", "2", "4"]\nseed')], "vary.cameras", '"6"', "1, 2, 4"),
    "unknown camera": (ZOOM, [('["2", "4"', '["2", "9"')], "vary.cameras", '"9"', "1, 2, 3, 4, 5, 6, 7 (the"),
    "unknown active": (ZOOM, [("seed", 'active = ["2", "4", "6", "x"]\nseed')], "active", '"x"', "1, 2, 3, 4, 5, 6, 7"),
    "zoom below": (ZOOM, [("[1.0,", "[0.5,")], "vary.values", "0.5", "1 to 8 (zoom of cameras 2, 4, 6)"),
    "zoom above": (ZOOM, [("8.0]", "12.0]")], "vary.values", "12.0", "1 to 8 (zoom of cameras 2, 4, 6)"),
    "aperture": (ZOOM, [('"zoom"', '"f_number"'), ("[1.0,", "[0.4,")], "vary.values", "0.4", "0.5 or more, lens.wid"),
    "selection unknown": (SELECTION, [('["2",', '["9",')], "vary.values", '"9"', "1, 2, 3, 4, 5, 6, 7"),
    "selection with unknown": (SELECTION, [('["1"]', '["9"]')], "vary.with", '"9"', "1, 2, 3, 4, 5, 6, 7"),
    "selection of nobody": (SELECTION, [('["2",', "[[],")], "vary.values", "…", "names of cameras"),
    "selection twice": (SELECTION, [('["2", "3"', '["3", "3"')], "vary.values", '"1+3"', "nothing twice"),
    "with and value": (SELECTION, [('["2",', '["1",')], "vary.values", '"1"', "nothing twice"),
    "active selection": (SELECTION, [("seed", 'active = ["1"]\nseed')], "active", '["1"]', "no active"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN_SWEEPS)
def test_a_broken_sweep_is_one_line_with_file_key_value_and_what_is_allowed(what, tmp_path, room):
    text, replacements, key, value, allowed = BROKEN_SWEEPS[what]
    path = write(tmp_path, changed(text, *replacements), "broken.toml")
    with pytest.raises(SceneError) as caught:
        load_sweep(path).configurations(room)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{path}: {start_of_line(key, value)}")
    assert allowed in problem.partition("; ")[2]


def test_a_removed_key_is_named_in_schedules_and_overrides_too():
    """One line each: what was removed and why, with no list of keys to search."""
    for load, name in ((load_sweep, "zoom"), (load_schedule, "hallway")):
        with pytest.raises(SceneError) as caught:
            load(name, ["sweep.search=thorough"])
        (problem,) = caught.value.problems
        assert "search" in problem
        assert "the key was removed: there is one search" in problem


def test_all_problems_of_a_sweep_come_at_once(tmp_path, room):
    text = changed(ZOOM, ("trials = 20", "trials = 1"), ("[1.0, 1.5", "[1.5, 1.5"), ('["2", "4"', '["4", "4"'))
    with pytest.raises(SceneError) as caught:
        load_sweep(write(tmp_path, text), ["sweep.vary.valus=[1]"])
    assert len(caught.value.problems) == 4
    text = changed(ZOOM, ('["2", "4"', '["2", "9"'), ("[1.0,", "[0.5,"), ("8.0]", "12.0]"))
    with pytest.raises(SceneError) as caught:
        load_sweep(write(tmp_path, text)).configurations(room)
    assert len(caught.value.problems) == 3


def test_a_zoom_that_moves_the_lens_past_the_focus_says_so(tmp_path):
    """At zoom 8 the image distance is 30 mm: a camera focused at 20 mm has no image there."""
    scene = scenes.load(FOLDER / "room.toml", ["cameras.2.focus_distance_m=0.02"])
    with pytest.raises(SceneError, match=r"vary\.values = 8\.0; allowed: values with focus_distance_m beyond the"):
        load_sweep("zoom").configurations(scene)


def test_shapes_are_the_metrics_own(room):
    assert [type(item.shape) for item in room.state.objects[:2]] == [Rectangle, Sphere]
