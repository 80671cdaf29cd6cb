"""Files from others: none outside their folder is opened, nothing grows without end, and each refusal is one line."""

from __future__ import annotations

import os
import re

import pytest

import scenes
import scenes.errors
import scenes.mesh_file
from pss import GeometryError
from pss.files import DEEPEST_TABLE, MOST_TOML_BYTES, is_inside, read_toml
from pss.noise.calibrated import Calibration
from render.world.state import Light, MarkerPrint, Room, SceneState
from scenes import SceneError, load_sweep
from scenes.steps.schedule_file import load_schedule
from tests.helpers.foreign_files import FOLDER, ROOM, WALK, ZOOM, changed, crate, problem_of, write
from validate.run_sweep import main

CRATE = """
[[objects]]
name = "crate"
kind = "mesh"
file = "{file}"
position_m = [-1.5, 1.0, 0.5]
albedo = 0.5
"""


# ---- paths -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["up", "absolute", "link", "link of a folder"])
def test_a_scene_does_not_open_files_outside_its_folder(home, way):
    mine = home / "mine"
    (mine / "link.ply").symlink_to(home / "crate.ply")
    (mine / "folder").symlink_to(home)
    file = {"up": "../crate.ply", "absolute": str(home / "crate.ply"), "link": "link.ply"}.get(way, "folder/crate.ply")
    path = write(mine / "scene.toml", ROOM + CRATE.format(file=file))
    message = problem_of(scenes.load, path)
    assert message.startswith(f'{path}: objects.crate.file = "')
    assert "leads outside (--allow-outside" in message
    scene = scenes.load(path, allow_outside=True)
    assert scene.state.objects[-1].shape.name == "crate"
    # What was allowed once stays so where the scene is changed.
    assert scene.with_settings({"sensor.exposure_ms": 3.0}).state.objects[-1].shape.name == "crate"


def test_nothing_is_told_of_what_is_outside(home):
    """The line is the same whether there is such a file or not."""
    lines = []
    for file in ("../crate.ply", "../there-is-none.ply"):
        path = write(home / "mine" / "scene.toml", ROOM + CRATE.format(file=file))
        lines.append(problem_of(scenes.load, path).replace(file, "FILE"))
    assert lines[0] == lines[1]


def test_folders_below_and_links_within_are_inside(home):
    mine = home / "mine"
    (mine / "parts").mkdir()
    crate(mine / "parts" / "crate.ply")
    (mine / "link.ply").symlink_to("parts/crate.ply")
    for file in ("parts/crate.ply", "parts/../parts/crate.ply", "link.ply", str(mine / "parts" / "crate.ply")):
        assert scenes.load(write(mine / "scene.toml", ROOM + CRATE.format(file=file))).state.objects[-1].shape.name


def test_a_step_of_a_sweep_does_not_lead_outside_either(home):
    crate(home / "mine" / "crate.ply")
    scene = scenes.load(write(home / "mine" / "scene.toml", ROOM + CRATE.format(file="crate.ply")))
    with pytest.raises(SceneError, match="leads outside"):
        scene.with_settings({"objects.crate.file": "../crate.ply"})


@pytest.mark.parametrize("file", ["a\\u0000b.ply", "x" * 5000 + ".ply", "/dev/zero", "pipe.ply"])
def test_paths_that_are_no_files_are_one_line(home, file):
    os.mkfifo(home / "mine" / "pipe.ply")
    path = write(home / "mine" / "scene.toml", ROOM + CRATE.format(file=file))
    for outside in (False, True):
        assert "objects.crate.file = " in problem_of(scenes.load, path, allow_outside=outside)


def test_is_inside_by_hand(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "ab").mkdir()
    (tmp_path / "a" / "round").symlink_to("round")
    assert is_inside(tmp_path / "a" / "b" / "c", [tmp_path / "a"])
    assert is_inside(tmp_path / "a", [tmp_path / "ab", tmp_path / "a"])
    for outside in ("ab/c", "a/../ab", "a/..", "a/round/x", "a/\0"):
        assert not is_inside(tmp_path / outside, [tmp_path / "a"])


def test_a_sweep_names_scenes_of_its_folder_of_the_project_or_above_a_folder_of_sweeps(tmp_path):
    above = write(tmp_path / "room.toml", ROOM)
    for folder, allowed in (("sweeps", True), ("mine", False)):
        path = write(tmp_path / folder / "zoom.toml", ZOOM)
        if allowed:
            assert load_sweep(path).scene_path == above
        else:
            message = problem_of(load_sweep, path)
            assert message.startswith(f'{path}: scene = "../room.toml"; allowed: a scene that comes with the project')
            assert load_sweep(path, allow_outside=True).scene_path == above
    near = write(tmp_path / "mine" / "zoom.toml", changed(ZOOM, "../room.toml", "room.toml"))
    assert load_sweep(near).scene_path == tmp_path / "mine" / "room.toml"
    shipped = write(tmp_path / "mine" / "zoom.toml", changed(ZOOM, "../room.toml", str(FOLDER / "room.toml")))
    assert load_sweep(shipped).scene_path == FOLDER / "room.toml"
    # A folder two above is not one above.
    far = write(tmp_path / "deep" / "sweeps" / "zoom.toml", changed(ZOOM, "../room.toml", "../../room.toml"))
    assert "leads outside" in problem_of(load_sweep, far)


def test_a_schedule_names_scenes_as_a_sweep_does(tmp_path):
    path = write(tmp_path / "mine" / "walk.toml", WALK)
    assert "leads outside" in problem_of(load_schedule, path)
    assert load_schedule(path, allow_outside=True).scene_path == tmp_path / "hallway.toml"
    assert load_schedule(write(tmp_path / "schedules" / "walk.toml", WALK)).scene_path == tmp_path / "hallway.toml"


def test_a_sweep_does_not_wait_for_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "room.toml")
    path = write(tmp_path / "zoom.toml", changed(ZOOM, "../room.toml", "room.toml"))
    assert "scene = " in problem_of(load_sweep, path)


def test_the_command_has_the_option(tmp_path, capsys):
    write(tmp_path / "closet.toml", ROOM)
    path = write(tmp_path / "mine" / "zoom.toml", changed(ZOOM, "../room.toml", "../closet.toml"))
    arguments = [str(path), "--dry-run", "--out", str(tmp_path / "out"), "--store", str(tmp_path / "store")]
    assert main(arguments) == 2
    assert "--allow-outside" in capsys.readouterr().err
    assert main([*arguments, "--allow-outside"]) == 0


@pytest.mark.parametrize("command", ["bank", "calibration-error", "schedule"])
def test_the_other_commands_have_it_too(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    assert "--allow-outside" in capsys.readouterr().out


# ---- sizes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"#" * (MOST_TOML_BYTES + 1), f"{MOST_TOML_BYTES + 1} bytes; allowed: at most {MOST_TOML_BYTES}"),
        (b"x = " + b"[" * 100_000, "too deep; allowed: at most 32 levels"),
        (b"x = " + b"[" * 40 + b"]" * 40, "too deep; allowed: at most 32 levels"),
        (b"x = " + b"{a=" * 40 + b"1" + b"}" * 40, "too deep; allowed: at most 32 levels"),
        (b"\n" + b"a." * 100_000 + b"a = 1", "line 2: a key of more than 32 parts"),
        (b'"a" . ' * 50_000 + b"a = 1", "line 1: a key of more than 32 parts"),
        (b"x = " + b"1" * 5000, "x.toml: "),
        (b"x = 0x" + b"f" * 5000, "a whole number of 20000 bits; allowed: within"),
        (b"x = 9223372036854775808", "a whole number of 64 bits; allowed: within"),
        (b"x = 2020-13-01", "x.toml: "),
        (b"x = 1\nx = 2", "line 2, column"),
    ],
)
def test_a_toml_file_that_would_take_too_much_is_one_line(tmp_path, content, message):
    path = tmp_path / "x.toml"
    path.write_bytes(content)
    for read in (read_toml, scenes.load, load_sweep, Calibration.from_file):
        line = problem_of(read, path)
        assert line.startswith(f"{path}: ")
        assert message in line


def test_a_toml_file_up_to_the_bounds_is_read(tmp_path):
    """Not only is too much refused: as much as is allowed is read, and dots in numbers and texts are no keys."""
    path = tmp_path / "x.toml"
    deep = "[" * (DEEPEST_TABLE - 1) + "]" * (DEEPEST_TABLE - 1)
    numbers = ", ".join(["1.5"] * 1000)
    path.write_text(f'deep = {deep}\nlist = [{numbers}]\ntext = "{"a. b " * 20}"\nlow = -9223372036854775807\n#')
    path.write_bytes(path.read_bytes().ljust(MOST_TOML_BYTES, b"#"))
    assert len(read_toml(path)["list"]) == 1000


MANY_CAMERAS = (
    '\n[[cameras]]\nname = "c{0}"\nposition_m = [0, 2, 2]\naim_m = [0, 0, 1]\nzoom = 2\nfocus_distance_m = 3\n'
)
MANY_OBJECTS = (
    '\n[[objects]]\nname = "o{0}"\nkind = "box"\nlowest_m = [2, 2, 0]\nhighest_m = [2.1, 2.1, 1]\nalbedo = 0.5\n'
)


@pytest.mark.parametrize(
    ("text", "start", "allowed"),
    [
        (ROOM + "".join(MANY_CAMERAS.format(n) for n in range(256)), "cameras = ", "at most 256; there are 263"),
        (ROOM + "".join(MANY_OBJECTS.format(n) for n in range(200)), "objects = ", "at most 200; there are 203"),
        (changed(ROOM, "[1280, 960]", "[20000, 20000]"), "sensor.resolution_px = ", "at most 50000000 pixels in all"),
        (changed(ROOM, "width_m = 6.0", "width_m = 101.0"), "room.width_m = 101.0", "in metres, at most 100"),
        (changed(ROOM, 'name = "board"', f'name = "{"b" * 61}"'), "objects.bbb", "60 at most"),
    ],
)
def test_a_scene_that_asks_for_too_much_is_one_line(tmp_path, text, start, allowed):
    path = write(tmp_path / "scene.toml", text)
    message = problem_of(scenes.load, path)
    assert message.startswith(f"{path}: {start}")
    assert allowed in message


@pytest.mark.parametrize(
    ("read", "text", "start", "allowed"),
    [
        (load_sweep, changed(ZOOM, "trials = 20", "trials = 10001"), "trials = 10001", "at most 10000"),
        (load_sweep, re.sub(r"values = .*", f"values = {[1.0] * 1001}", ZOOM), "vary.values = ", "at most 1000"),
        (
            load_sweep,
            re.sub(r"values = .*", "values = {start = 1, stop = 2, steps = 1001}", ZOOM),
            "vary.values = ",
            "at most 1000",
        ),
        (load_schedule, changed(WALK, "steps = 21", "steps = 1001"), "walk.steps = 1001", "at most 1000"),
        (load_schedule, changed(WALK, "trials = 12", "trials = 10001"), "trials = 10001", "at most 10000"),
        (
            load_schedule,
            changed(WALK, 'zoom_limits = ["none", 8.0, 4.0]', f"zoom_limits = {[1 + n / 8 for n in range(51)]}"),
            "zoom_limits = ",
            "numbers",
        ),
    ],
)
def test_a_sweep_or_schedule_that_asks_for_too_much_is_one_line(tmp_path, read, text, start, allowed):
    path = write(tmp_path / "sweeps" / "x.toml", text)
    message = problem_of(read, path)
    assert message.startswith(f"{path}: {start}")
    assert allowed in message


def test_a_walk_that_never_ends_is_refused(tmp_path):
    """8 m at 1 mm/s are 8000 s: 240,000 frames at 30 a second."""
    path = write(tmp_path / "schedules" / "x.toml", changed(WALK, "speed_m_per_s = 1.2", "speed_m_per_s = 0.001"))
    with pytest.raises(SceneError) as caught:
        load_schedule(path)
    assert all("at most 108000 frames on the way of the walk" in line for line in caught.value.problems)
    assert caught.value.problems[0].startswith(f"{path}: tracking.frame_rate_hz = 30.0; ")


def test_meshes_are_counted_together(tmp_path, monkeypatch):
    crate(tmp_path / "crate.ply")
    second = CRATE.format(file="crate.ply").replace('"crate"', '"other"')
    path = write(tmp_path / "scene.toml", ROOM + CRATE.format(file="crate.ply") + second.replace("1.0,", "2.0,"))
    monkeypatch.setattr(scenes.mesh_file, "MOST_FACES_IN_ALL", 24)
    scenes.load(path)
    monkeypatch.setattr(scenes.mesh_file, "MOST_FACES_IN_ALL", 23)
    message = problem_of(scenes.load, path)
    assert 'objects.other.file = "crate.ply"; allowed: at most 23 faces in all meshes of the scene' in message


def test_many_mistakes_are_told_up_to_a_number(tmp_path):
    lines = "".join(f"key{number} = 1\n" for number in range(30_000))
    path = write(tmp_path / "scene.toml", lines + ROOM)
    with pytest.raises(SceneError) as caught:
        scenes.load(path)
    most = scenes.errors.MOST_PROBLEMS
    assert len(caught.value.problems) == most + 1
    assert caught.value.problems[-1] == f"{path}: there are more problems; these are the first {most}"


def test_keys_do_not_speak_to_the_terminal_or_break_the_line(tmp_path):
    path = write(tmp_path / "scene.toml", '"a\\n\\u001b[31m\\u009bb" = 1\n' + f'"{"k" * 9000}" = 1\n' + ROOM)
    with pytest.raises(SceneError) as caught:
        scenes.load(path)
    first, second = caught.value.problems
    assert first.startswith(path.as_posix() + r": a\n\x1b[31m\x9bb = 1; unknown key")
    assert len(second) < len(str(path)) + 400
    assert all(line.isprintable() for line in caught.value.problems)


def test_a_hall_whose_light_is_a_matrix_too_large_is_refused():
    from render.light.patches import scene_patches

    hall = Room(100.0, 100.0, 3.0, 0.5, 0.5, 0.5)
    state = SceneState(hall, Light(0.2, ()), (), (), MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04))
    with pytest.raises(GeometryError, match=r"make \d+ patches of light; allowed: at most 16000"):
        scene_patches(state)


# ---- what mutated files found ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        # A range of more items than a length can have.
        ("columns = 8, rows = 6", "columns = 4000000000000000000, rows = 9", "markers.rows"),
        ("count = 36", "count = 9223372036854775807", "markers.count"),
        # The largest module that fits was looked for in steps finer than such numbers are.
        ("radius_m = 0.45", "radius_m = 1e18", "centre_m"),
        # Products were infinite, and are to be written as whole numbers.
        ("module_mm = 20.0", "module_mm = 1e30", "module_mm"),
        ("quiet_zone_modules = 1.0", "quiet_zone_modules = 1e30", "module_mm"),
        ("albedo = 0.3", "albedo = 1e300", "'albedo' has the number 1e+300; allowed: 0, or of a size from 1e-30 to"),
        ("zoom = 3.0", "zoom = 1e-300", "'zoom' has the number 1e-300"),
    ],
)
def test_numbers_beyond_measure_are_told(tmp_path, old, new, key):
    path = write(tmp_path / "scene.toml", changed(ROOM, old, new).replace("module_mm = 14.0", "module_mm = 1e18"))
    with pytest.raises(SceneError) as caught:
        scenes.load(path)
    assert any(key in line for line in caught.value.problems)


def test_an_override_beyond_measure_is_told_too():
    message = problem_of(scenes.load, FOLDER / "room.toml", ["cameras.2.zoom=1e300"])
    assert 'override "cameras.2.zoom=1e300"; ' in message


def test_a_suit_of_modules_without_measure_is_told(tmp_path):
    walk = (FOLDER / "hallway.toml").read_text(encoding="utf-8")
    text = changed(walk, "first_id = 0 }", "first_id = 0, head_module_mm = 1e30 }")
    message = problem_of(scenes.load, write(tmp_path / "scene.toml", text))
    assert "objects.H1.markers.head_module_mm = 1e+30; allowed: at most" in message
