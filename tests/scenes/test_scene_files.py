"""Scene and sweep files: what they may say, what they become, and that every mistake in them is told at once."""

from __future__ import annotations

import json
import math
import pickle
import re

import numpy as np
import pytest

import scenes
from pss import ConstantVelocity, PSSError, RandomWalk, Rectangle, Sphere
from scenes import SceneError, load_sweep
from scenes.markers.layout import PLATE_OFFSET_M, overlapping, plate_corners_m, upwards
from scenes.schema.dictionaries import DICTIONARIES
from scenes.steps.schedule_file import load_schedule
from tests.helpers.scene_texts import FOLDER, ROOM, changed, scene_problems, write

# Written beside no other file, where a sweep may name no scene in the folder above.
ZOOM, SELECTION = (
    (FOLDER / "sweeps" / f"{name}.toml").read_text().replace("../room.toml", "room.toml")
    for name in ("zoom", "selection")
)

# Positions are sums of a few decimal fractions of metres.
ROUNDING_M = 1e-12


# ---- what is shipped -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def room():
    return scenes.load(FOLDER / "room.toml")


def test_the_shipped_room_is_the_papers(room):
    assert len(room.state.markers) == 84
    assert sorted(marker.id for marker in room.state.markers) == list(range(84))
    assert [camera.name for camera in room.cameras] == list("1234567")
    assert [item.shape.name for item in room.state.objects] == ["board", "ball", "plinth"]
    assert [model.name for model in room.noise_models] == ["as-printed", "corrected", "physical"]
    assert room.process == RandomWalk(step_std_m=1e-3)
    assert (room.state.room.width_m, room.state.light.panels[1].centre_m) == (6.0, (1.4, 1.2))


def test_cameras_carry_lens_and_pixels_and_look_at_their_aim(room):
    camera = room.camera("4")
    assert camera is room.cameras[3]
    assert (camera.resolution, camera.f_number, camera.max_zoom, camera.widest_fov_deg) == ((1280, 960), 1.8, 8.0, 90.0)
    assert camera.pixel_pitch_m == pytest.approx(4.65e-6, rel=1e-12)
    pixel, _ = camera.project((0.0, -0.7, 1.3))
    np.testing.assert_allclose(pixel, camera.principal_point_px, atol=1e-6)  # px


def test_the_noise_models_have_the_sensors_own_dark_noise(tmp_path):
    scene = scenes.load(FOLDER / "room.toml", ["sensor.read_noise_e=20"])
    assert [factor.ccd_noise for factor in scene.noise_models[0].factors if factor.name == "resolution"] == [20 / 10000]


def test_an_unknown_camera_is_named_with_those_there_are(room):
    with pytest.raises(SceneError, match=r'no camera "8".*allowed: 1, 2, 3, 4, 5, 6, 7'):
        room.camera("8")


@pytest.mark.parametrize(
    ("name", "count"), [("zoom", 12), ("zoom-of-three", 12), ("focus", 12), ("selection", 6), ("workshop", 5)]
)
def test_the_shipped_sweeps_fit_the_shipped_scenes(name, count, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # names don't depend on where the command runs
    sweep = load_sweep(name)
    assert (sweep.name, sweep.trials) == (name, 20)
    assert len(sweep.configurations(scenes.load(sweep.scene_path))) == count


def test_the_resolved_scene_is_json_and_a_scene_itself(tmp_path):
    scene = scenes.load(FOLDER / "room.toml", ["cameras.2.zoom=4", "process.step_std_mm=2"])
    resolved = json.loads(json.dumps(scene.resolved()))
    assert resolved["cameras"][1]["zoom"] == 4
    assert resolved["process"] == {"model": "random-walk", "step_std_mm": 2}
    assert "pan_deg" not in resolved["cameras"][1]
    assert scenes.load(write(tmp_path, ROOM), ["cameras.2.zoom=4", "process.step_std_mm=2"]).resolved() == resolved


# ---- more of everything by editing the text alone ------------------------------------------------------------------


def test_a_row_of_markers_more(tmp_path):
    text = changed(ROOM, ("rows = 6", "rows = 7"), ("first_id = 48", "first_id = 56"))
    markers = scenes.load(write(tmp_path, text)).state.markers
    assert len(markers) == 8 * 7 + 36
    assert len({marker.id for marker in markers}) == len(markers)


def test_a_camera_more_by_pan_and_tilt(tmp_path):
    text = ROOM + (
        '[[cameras]]\nname = "door"\nposition_m = [2.9, -2.9, 2.0]\npan_deg = -45\ntilt_deg = -10\n'
        "zoom = 1\nfocus_distance_m = 3\nf_number = 4\n"
    )
    camera = scenes.load(write(tmp_path, text)).camera("door")
    assert (camera.pan_deg, camera.tilt_deg, camera.f_number) == (-45, -10, 4)


def test_the_lens_of_a_scene_is_that_of_all_its_cameras(tmp_path):
    """Distortion, blur in focus and blades are the lens's; the shipped room has a plain one."""
    keys = "fov_deg = 90.0\nradial_distortion = [-0.1, 0.02]\npsf_sigma_um = 1.5\naperture_blades = 6"
    for text, expected in (
        (ROOM, ((0.0, 0.0), 0.0, 0)),
        (changed(ROOM, ("fov_deg = 90.0", keys)), ((-0.1, 0.02), 1.5, 6)),
    ):
        (tmp_path / "lens.toml").write_text(text)
        for camera in scenes.load(tmp_path / "lens.toml").cameras:
            assert (camera.radial_distortion, camera.psf_sigma_um, camera.aperture_blades) == expected


def test_an_aperture_may_be_as_wide_as_the_lens_says(tmp_path):
    """The limit itself is allowed; beyond it a file, an override and a sweep are refused alike, a line each."""
    text = changed(ROOM, ("f_number = 1.8", "f_number = 1.8\nwidest_f_number = 1.4"))
    at_limit = scenes.load(write(tmp_path, text), ["cameras.2.f_number=1.4"])
    assert (at_limit.camera("2").f_number, at_limit.widest_f_number) == (1.4, 1.4)
    assert scenes.load(write(tmp_path, ROOM)).widest_f_number == 0.5
    allowed = "allowed: 1.4 or more, lens.widest_f_number"
    problems = scene_problems(tmp_path, text, ("cameras.2.f_number=1.2", "lens.f_number=1.3", "cameras.4.zoom=20"))
    assert {f"lens.f_number = 1.3 (override); {allowed}", f"cameras.2.f_number = 1.2 (override); {allowed}"} < {
        problem.partition("toml: ")[2] for problem in problems
    }
    assert len(problems) == 3
    with pytest.raises(SceneError) as caught:
        load_sweep("zoom", ["sweep.vary.parameter=f_number", "sweep.vary.values=[1.3, 1.4, 2]"]).configurations(
            at_limit
        )
    (problem,) = caught.value.problems
    assert f"vary.values = 1.3; {allowed} (f_number of cameras 2, 4, 6)" in problem


def test_a_wide_sensor(tmp_path):
    scene = scenes.load(write(tmp_path, changed(ROOM, ("[1280, 960]", "[1920, 1080]"))))
    assert {camera.resolution for camera in scene.cameras} == {(1920, 1080)}


def test_another_process_model(tmp_path):
    process = 'model = "constant-velocity"\nacceleration_density_m2_s3 = 0.5\ntime_step_s = 0.04'
    text = re.sub(r'model = "random-walk"\nstep_std_mm.*', process, ROOM)
    assert scenes.load(write(tmp_path, text)).process == ConstantVelocity(0.5, time_step_s=0.04)


# ---- markers -------------------------------------------------------------------------------------------------------


def test_points_of_interest_are_plate_centres_half_a_millimetre_off_the_surface(room):
    board, ball = (item.shape for item in room.state.objects[:2])
    for marker in room.state.markers:
        from_surface = {
            "board": lambda p: (p - board.centre_m) @ board.normal,
            "ball": lambda p: np.linalg.norm(p - ball.centre_m) - ball.radius_m,
        }[marker.object_name](np.array(marker.centre_m))
        assert from_surface == pytest.approx(PLATE_OFFSET_M, abs=ROUNDING_M)


def test_prints_stand_upright(room):
    """Up is the board's own, and on a ball the tangent nearest to world up; right is up × normal."""
    board, ball = (item.shape for item in room.state.objects[:2])
    for marker in room.state.markers:
        normal, up = np.array(marker.normal), np.array(marker.up)
        assert up @ normal == pytest.approx(0, abs=1e-12)
        assert np.linalg.norm(up) == pytest.approx(1)
        if marker.object_name == "board":
            np.testing.assert_allclose(up, board.up, atol=1e-12)
            np.testing.assert_allclose(marker.right, board.right, atol=1e-12)
        else:
            outward = (np.array(marker.centre_m) - ball.centre_m) / (ball.radius_m + PLATE_OFFSET_M)
            np.testing.assert_allclose(normal, outward, atol=1e-12)
            # The largest z that a unit tangent can have is the sine of the angle between the normal and the pole.
            assert up[2] == pytest.approx(math.sqrt(1 - normal[2] ** 2))


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_at_a_pole_up_is_plus_y(z):
    np.testing.assert_allclose(upwards((0, 0, z)), (0, 1, 0), atol=1e-12)


def test_dictionaries_are_opencvs():
    """The table does without OpenCV; OpenCV agrees with every entry and has no other."""
    cv2 = pytest.importorskip("cv2")
    names = {name for name in dir(cv2.aruco) if name.startswith("DICT_")}
    assert set(DICTIONARIES) <= names
    # AprilTag's have a second name each, in capitals.
    assert {getattr(cv2.aruco, name) for name in names} == {getattr(cv2.aruco, name) for name in DICTIONARIES}
    assert len({getattr(cv2.aruco, name) for name in DICTIONARIES}) == len(DICTIONARIES)
    for name, entry in DICTIONARIES.items():
        found = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
        assert (entry.modules, entry.ids) == (found.markerSize + 2, len(found.bytesList))


def test_what_is_said_to_be_the_largest_module_is(tmp_path):
    """The message's own figure is accepted, and by a brute-force look from the ball's centre 2 % more is too much."""
    (problem,) = scene_problems(tmp_path, changed(ROOM, ("module_mm = 14.0", "module_mm = 60.0")))
    largest = float(re.search(r"at most ([\d.]+)", problem).group(1))
    scene = scenes.load(write(tmp_path, changed(ROOM, ("module_mm = 14.0", f"module_mm = {largest}"))))
    markers = [marker for marker in scene.state.markers if marker.object_name == "ball"]
    ball = scene.state.objects[1].shape
    grid = np.linspace(-0.5, 0.5, 41)

    def covered(scale: float) -> bool:
        side = scale * 8 * largest * 1e-3
        for one in markers:
            across, along = np.meshgrid(grid * side, grid * side)
            plate = np.array(one.centre_m) + across[..., None] * one.right + along[..., None] * np.array(one.up)
            rays = (plate - ball.centre_m).reshape(-1, 3)
            for other in markers:
                if other is one:
                    continue
                towards = rays @ np.array(other.normal)
                hit = rays * ((ball.radius_m + PLATE_OFFSET_M) / np.where(towards > 0, towards, np.inf))[:, None]
                offset = hit - (np.array(other.centre_m) - ball.centre_m)
                inside = (np.abs(offset @ other.right) < side / 2) & (np.abs(offset @ np.array(other.up)) < side / 2)
                if (inside & (towards > 0)).any():
                    return True
        return False

    assert not covered(0.999)
    assert covered(1.02)


def test_plates_of_a_full_grid_touch_but_do_not_overlap(tmp_path):
    text = changed(ROOM, ("width_m = 2.4", "width_m = 1.28"), ("height_m = 1.8", "height_m = 0.96"))
    scene = scenes.load(write(tmp_path, text))  # 8 × 6 plates of 0.16 m
    markers = list(scene.state.markers[:48])
    board = scene.state.objects[0].shape
    assert list(overlapping(markers, [0.16] * 48, board)) == []
    assert len(list(overlapping(markers, [0.161] * 48, board))) == 7 * 6 + 8 * 5 + 2 * 7 * 5  # sides and corners
    # The board's corner is that of the first plate, but for the plate's offset.
    corner = np.array(board.centre_m) - 0.64 * board.right + 0.48 * board.up + PLATE_OFFSET_M * board.normal
    np.testing.assert_allclose(plate_corners_m(markers[0], 0.16)[0], corner, atol=ROUNDING_M)


PLACED = """
[[markers.placed]]
id = 90
object = "plinth"
centre_m = [0.25, 0.3, 0.4]
normal = [0.0, 2.0, 0.0]
module_mm = 10.0
"""


def test_a_marker_placed_by_hand(tmp_path):
    scene = scenes.load(write(tmp_path, ROOM + PLACED))
    marker = scene.state.markers[-1]
    assert (marker.id, marker.object_name, len(scene.state.markers)) == (90, "plinth", 85)
    np.testing.assert_allclose(marker.centre_m, (0.25, 0.3 + PLATE_OFFSET_M, 0.4), atol=ROUNDING_M)
    assert (marker.normal, marker.up) == ((0, 1, 0), (0, 0, 1))


# ---- every rule, one broken file each ------------------------------------------------------------------------------

BOARD, BALL = "objects.board.markers.", "objects.ball.markers."

BROKEN = {
    # what: (replacements, dotted key, value as shown, a part of what is allowed)
    "unknown key": ([("albedo = 0.4\n", 'albedo = 0.4\nalbdo = 1\n')], "objects.ball.albdo", "1", 'mean "albedo"'),
    "unknown table": ([("[process]", "[proces]")], "proces", "…", 'mean "process"'),
    "wrong unit": ([("radius_m", "radius_cm")], "objects.ball.radius_cm", "0.45", 'mean "radius_m"'),
    "missing key": ([("exposure_ms = 4.0\n", "")], "sensor.exposure_ms", None, "3.6e+06, in milliseconds"),
    "missing table": ([("radius_m = 0.45\n", "")], "objects.ball.radius_m", None, "above 0, in metres"),
    "text for a number": ([("radius_m = 0.45", 'radius_m = "0.45"')], "objects.ball.radius_m", '"0.45"', "a number"),
    "true for a number": ([("radius_m = 0.45", "radius_m = true")], "objects.ball.radius_m", "true", "a number"),
    "a number for text": ([('name = "2"', "name = 2")], "cameras.#2.name", "2", "text"),
    "no number": ([("radius_m = 0.45", "radius_m = nan")], "objects.ball.radius_m", "nan", "a number above 0"),
    "infinity": ([("[-2.8, 1.6, 2.8]", "[-2.8, inf, 2.8]")], "cameras.2.position_m", "…", "[x, y, z]"),
    "two coordinates": ([("[-2.8, 1.6, 2.8]", "[-2.8, 1.6]")], "cameras.2.position_m", "[-2.8, 1.6]", "[x, y, z]"),
    "zoom below": ([("zoom = 3.0", "zoom = 0.5")], "cameras.1.zoom", "0.5", "1 to 8"),
    "zoom above": ([("zoom = 3.0", "zoom = 12.0")], "cameras.1.zoom", "12.0", "1 to 8"),
    "focus within the lens": (
        [("focus_distance_m = 3.3", "focus_distance_m = 0.01")],
        "cameras.1.focus_distance_m",
        "0.01",
        "beyond the image distance of 0.01111 m",
    ),
    "camera outside": ([("[2.8, 1.6, 2.8]", "[3.8, 1.6, 2.8]")], "cameras.6.position_m", "[3.8, 1.6, 2.8]", "x ±3"),
    "camera in the wall": ([("[2.8, 1.6, 2.8]", "[3, 1.6, 2.8]")], "cameras.6.position_m", "[3, 1.6, 2.8]", "x ±3"),
    "camera in the ball": ([("[2.8, 1.6, 2.8]", "[0.25, 0, 1.5]")], "cameras.6.position_m", "[0.25, 0, 1.5]", '"ball"'),
    "camera in the box": ([("[2.8, 1.6, 2.8]", "[0.25, 0, 0.2]")], "cameras.6.position_m", "…", '"plinth"'),
    "aim and pan": ([("zoom = 3.0", "zoom = 3.0\npan_deg = 4")], "cameras.1.aim_m", "[0.0, -0.7, 1.3]", "not both"),
    "no aim": ([("aim_m = [0.0, -0.7, 1.3] ", "#")], "cameras.1.aim_m", None, "or pan_deg and tilt_deg"),
    "pan alone": ([("aim_m = [0.0, -0.7, 1.3] ", "pan_deg = 4 #")], "cameras.1.tilt_deg", None, "pan_deg and tilt_deg"),
    "tilt too steep": (
        [("aim_m = [0.0, -0.7, 1.3] ", "pan_deg = 4\ntilt_deg = -90.1 #")],
        "cameras.1.tilt_deg",
        "-90.1",
        "from -90 to 90",
    ),
    "aim at itself": (
        [("aim_m = [0.0, -0.7, 1.3] ", "aim_m = [-2.8, 0.2, 2.8] #")],
        "cameras.1.aim_m",
        "[-2.8, 0.2, 2.8]",
        "away from the camera",
    ),
    "two cameras of one name": ([('name = "2"', 'name = "1"')], "cameras.#2.name", '"1"', "no other camera has"),
    "a dot in a name": ([('name = "2"', 'name = "2.b"')], "cameras.2.b.name", '"2.b"', "letters, digits"),
    "two objects of one name": ([('"plinth"', '"ball"')], "objects.#3.name", '"ball"', "no other object has"),
    "unknown kind": ([('"sphere"', '"cone"')], "objects.ball.kind", '"cone"', "rectangle, sphere, box"),
    "no kind": ([('kind = "sphere"\n', "")], "objects.ball.kind", None, "rectangle, sphere, box"),
    "board outside": ([("[0.0, -1.4, 1.3]", "[2.0, -1.4, 1.3]")], "objects.board.centre_m", "[2.0, -1.4, 1.3]", "x ±3"),
    "board on the wall": ([("[0.0, -1.4, 1.3]", "[0, -3, 1.3]")], "objects.board.centre_m", "[0, -3, 1.3]", "1 mm off"),
    "ball outside": ([("[0.25, 0.1, 1.25]", "[0.25, 0.1, 2.75]")], "objects.ball.centre_m", "[0.25, 0.1, 2.75]", "z 0"),
    "box outside": ([("[0.05, -0.1, 0.0]", "[0.05, -0.1, -1]")], "objects.plinth.lowest_m", "[0.05, -0.1, -1]", "z 0"),
    "box turned over": (
        [("[0.45, 0.3, 0.8]", "[0.45, -0.3, 0.8]")],
        "objects.plinth.highest_m",
        "[0.45, -0.3, 0.8]",
        "above that of lowest_m",
    ),
    "albedo above": ([("wall_albedo = 0.55", "wall_albedo = 1.2")], "room.wall_albedo", "1.2", "from 0 to 1"),
    "albedo below": ([("albedo = 0.4\n", "albedo = -0.1\n")], "objects.ball.albedo", "-0.1", "from 0 to 1"),
    "black above white": ([("black_albedo = 0.04", "black_albedo = 0.9")], "markers.black_albedo", "0.9", "below"),
    "panel outside": ([("[1.4, 1.2]", "[2.8, 1.2]")], "light.panels.#2.centre_m", "[2.8, 1.2]", "ceiling: x ±3"),
    "no panel": ([("panels = [", "panels = []\nx = [")], "light.panels", "[]", "at least one"),
    "bits": ([("bits = 12", "bits = 17")], "sensor.bits", "17", "from 8 to 16"),
    "bits in halves": ([("bits = 12", "bits = 12.5")], "sensor.bits", "12.5", "from 8 to 16"),
    "black level": ([("black_level_dn = 64", "black_level_dn = 4095")], "sensor.black_level_dn", "4095", "0 to 4094"),
    "no dark noise": ([("read_noise_e = 6.0", "read_noise_e = 0.0")], "sensor.read_noise_e", "0.0", "above 0"),
    "efficiency": ([("efficiency = 0.5", "efficiency = 1.5")], "sensor.quantum_efficiency", "1.5", "at most 1"),
    "no resolution": ([("[1280, 960]", "[1280, 0]")], "sensor.resolution_px", "[1280, 0]", "16 to 20000"),
    "blades": (
        [("fov_deg = 90.0", "fov_deg = 90.0\naperture_blades = 2")],
        "lens.aperture_blades",
        "2",
        "from 3 to 32",
    ),
    "distortion folds": (
        [("fov_deg = 90.0", "fov_deg = 90.0\nradial_distortion = [-3.0, 0.0]")],
        "lens.radial_distortion",
        "[-3.0, 0.0]",
        "the whole sensor",
    ),
    "psf": ([("fov_deg = 90.0", "fov_deg = 90.0\npsf_sigma_um = -1")], "lens.psf_sigma_um", "-1", "0 or more"),
    "field of view": ([("fov_deg = 90.0", "fov_deg = 180")], "lens.widest_fov_deg", "180", "below 180"),
    "aperture": ([("f_number = 1.8", "f_number = 0.45")], "lens.f_number", "0.45", "0.5 or more, lens.widest_f_number"),
    "aperture of a camera": (
        [("f_number = 1.8", "f_number = 1.8\nwidest_f_number = 1.6"), ("zoom = 3.0", "zoom = 3.0\nf_number = 1.4")],
        "cameras.1.f_number",
        "1.4",
        "1.6 or more, lens.widest_f_number",
    ),
    "widest aperture": (
        [("f_number = 1.8", "f_number = 1.8\nwidest_f_number = 0.3")],
        "lens.widest_f_number",
        "0.3",
        "0.5 or more (no lens in air is faster)",
    ),
    "exposure in words": ([("exposure_ms = 4.0", 'exposure_ms = "autos"')], "sensor.exposure_ms", '"autos"', '"auto"'),
    "exposure of nothing": ([("exposure_ms = 4.0", "exposure_ms = 0")], "sensor.exposure_ms", "0", "3.6e+06, in milli"),
    "share of saturation": (
        [("exposure_ms = 4.0", 'exposure_ms = "auto"\nauto_exposure_share = 1.2')],
        "sensor.auto_exposure_share",
        "1.2",
        "at most 1, of the saturation (without it, 0.7)",
    ),
    "longest exposure": (
        [("exposure_ms = 4.0", 'exposure_ms = "auto"\nlongest_exposure_ms = 0')],
        "sensor.longest_exposure_ms",
        "0",
        "3.6e+06, in milliseconds (without it, 20)",
    ),
    "dictionary": ([("DICT_4X4_100", "DICT_4X4_99")], "markers.dictionary", '"DICT_4X4_99"', "DICT_4X4_100"),
    "id twice": ([("first_id = 48", "first_id = 40")], "objects.ball.markers.first_id", "40", '40 to 47 already'),
    "id beyond": ([("first_id = 48", "first_id = 70")], "objects.ball.markers.first_id", "70", "0 to 64"),
    "too many ids": (
        [("count = 36, module_mm = 14.0", "count = 101, module_mm = 4.0")],
        BALL + "count",
        "101",
        "at most 100 markers in all",
    ),
    "absurdly many": ([("rows = 6", "rows = 99999999")], BOARD + "rows", "99999999", "at most 100 markers"),
    "plate beyond its cell": ([("_mm = 20.0", "_mm = 38.0")], BOARD + "module_mm", "38.0", "at most 37.5"),
    "plates that overlap": ([("_mm = 14.0", "_mm = 24.0")], "objects.ball.markers.module_mm", "24.0", "at most 23.4"),
    "plate beyond the ball": (
        [("count = 36, module_mm = 14.0", "count = 1, module_mm = 80.0")],
        "objects.ball.markers.module_mm",
        "80.0",
        "at most 79.5",
    ),
    "plates out of the room": (
        [("[0.25, 0.1, 1.25]", "[0.25, 0.1, 2.55]"), ("_mm = 14.0", "_mm = 20.0")],
        "objects.ball.markers.module_mm",
        "20.0",
        "every plate inside the room",
    ),
    "process": ([('"random-walk"', '"brownian"')], "process.model", '"brownian"', "random-walk, constant-velocity"),
    "noise model": ([('"corrected"', '"korrect"')], "noise.models.#2", '"korrect"', 'did you mean "corrected"'),
    "noise model twice": (
        [('"corrected"', '"as-printed"')],
        "noise.models",
        '["as-printed", "as-printed", "physical"]',
        "once",
    ),
    "no noise model": (
        [('["as-printed", "corrected", "physical"]', "[]")],
        "noise.models",
        "[]",
        "one or more, at most 30, of as-printed",
    ),
    "factor": ([("off = []", 'off = ["blur"]')], "noise.switched_off", '["blur"]', "distance-incidence, resolution"),
    "all factors off": (
        [("off = []", 'off = ["distance-incidence", "resolution", "defocus"]')],
        "noise.switched_off",
        '["distance-incidence", "resolution", "defocus"]',
        "at least one factor must stay",
    ),
}  # fmt: skip


def start_of_line(key: str, value: str | None) -> str:
    """A missing key has no value; "…" stands for one that would make the table too wide."""
    return f"{key} is missing; " if value is None else f"{key} = " if value == "…" else f"{key} = {value};"


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_rule_is_one_line_with_file_key_value_and_what_is_allowed(what, tmp_path):
    replacements, key, value, allowed = BROKEN[what]
    problems = scene_problems(tmp_path, changed(ROOM, *replacements))
    # Taking the panels' list away leaves its old value under a key of its own.
    problems = [problem for problem in problems if "light.x" not in problem]
    assert len(problems) == 1, problems
    file, _, rest = problems[0].partition("toml: ")
    assert file.endswith("scene.")
    assert rest.startswith(start_of_line(key, value))
    assert "allowed: " in rest
    assert allowed in rest
    assert "\n" not in rest


@pytest.mark.parametrize(
    ("override", "allowed"),
    [
        ("room.width_m=0", "a number above 0, in metres"),
        ("sensor.bits=7", "from 8 to 16"),
        ("sensor.black_level_dn=-1", "0 or more"),
        ("sensor.resolution_px=[30000, 960]", "16 to 20000"),
        ("lens.max_zoom=0.9", "1 or more"),
        ("cameras=[]", "at least one"),
        ("objects=[]", "at least one"),
        ("objects.board.elevation_deg=90.1", "from -90 to 90"),
        ("objects.ball.markers.count=0", "1 or more"),
        ("objects.ball.markers.first_id=-1", "0 or more"),
        ("markers.quiet_zone_modules=-1", "0 or more"),
        ("sweep.seed=-1", "0 or more"),
        ("sweep.title=''", "text"),
        ("sweep.scene=''", "the path of a scene file"),
        ("sweep.active=[]", "one or more"),
        ("sweep.vary.cameras=[]", "one or more"),
        ("sweep.vary={parameter = 'selection', values = []}", "one or more"),
    ],
)
def test_limits_of_single_values(override, allowed):
    with pytest.raises(SceneError) as caught:
        load_sweep("zoom", [override]) and scenes.load(FOLDER / "room.toml", [override])
    (problem,) = caught.value.problems
    assert allowed in problem.partition("allowed: ")[2]


def test_a_camera_may_be_aimed_straight_down():
    scene = scenes.load(FOLDER / "room.toml", ["cameras.1.aim_m=[-2.8, 0.2, 1]"])
    assert (scene.camera("1").pan_deg, scene.camera("1").tilt_deg) == (0, -90)


@pytest.mark.parametrize(("tilt_deg", "allowed"), [(90, True), (90.01, False), (-90, True), (-90.01, False)])
def test_a_camera_may_tilt_to_the_vertical(tilt_deg, allowed):
    overrides = ["cameras.2.pan_deg=0", f"cameras.2.tilt_deg={tilt_deg}"]
    if allowed:
        assert scenes.load(FOLDER / "room.toml", overrides).camera("2").tilt_deg == tilt_deg
    else:
        with pytest.raises(
            SceneError, match=r"cameras\.2\.tilt_deg = -?90\.01 \(override\); allowed: a number from -90 to 90,"
        ):
            scenes.load(FOLDER / "room.toml", overrides)


@pytest.mark.parametrize(
    ("old", "new", "key", "allowed"),
    [
        (
            '"plinth"\ncentre',
            '"plint"\ncentre',
            "markers.placed.#1.object",
            'board, ball, plinth, did you mean "plinth"',
        ),
        ("id = 90", "id = 83", "markers.placed.#1.id", '83 already on "ball"'),
        ("id = 90", "id = 100", "markers.placed.#1.id", "0 to 99"),
        ("normal = [0.0, 2.0, 0.0]", "normal = [0, 0, 0]", "markers.placed.#1.normal", "above 0"),
        (
            "normal = [0.0, 2.0, 0.0]",
            "normal = [0, 2, 0]\nup = [0, -1, 0]",
            "markers.placed.#1.normal",
            "not that of up",
        ),
        ("0.3, 0.4]\n", "0.3, 0.03]\n", "markers.placed.#1.centre_m", "z 0 to 3 m"),
    ],
)
def test_rules_of_markers_placed_by_hand(old, new, key, allowed, tmp_path):
    (problem,) = scene_problems(tmp_path, ROOM + changed(PLACED, (old, new)))
    assert f"{key} = " in problem
    assert allowed in problem


def test_markers_placed_by_hand_keep_clear_of_others(tmp_path):
    on_board = changed(
        PLACED, ("plinth", "board"), ("[0.25, 0.3, 0.4]", "[0.0, -1.4, 1.3]")
    )  # where four cells of 0.3 m meet; plates of 0.16 and 0.08 m leave 0.14 m between them
    assert len(scenes.load(write(tmp_path, ROOM + on_board)).state.markers) == 85
    (problem,) = scene_problems(tmp_path, ROOM + changed(on_board, ("_mm = 10.0", "_mm = 20.0")))
    assert (
        "markers.placed.#1.centre_m = [0.0, -1.4, 1.3]; allowed: a place clear of the plates of 19, 20, 27, 28"
        in problem
    )


def test_a_scene_needs_a_marker(tmp_path):
    text = re.sub(r"(?m)^markers = .*\n", "", ROOM)
    (problem,) = scene_problems(tmp_path, text)
    assert "at least one marker" in problem


def test_all_problems_come_at_once(tmp_path):
    """Pydantic's findings and the rules between keys, even within one camera, one object and beside an unknown kind."""
    text = changed(
        ROOM,
        ("zoom = 3.0", "zoom = 0.5"),
        ("[-2.8, 0.2, 2.8]", "[-9.0, 0.2, 2.8]"),
        ("albedo = 0.4\n", 'albedo = 1.4\ncolour = "red"\n'),
        ("first_id = 48", "first_id = 40"),
        ('kind = "box"', 'kind = "cube"'),
        ("bits = 12", 'bits = "12"'),
    )
    problems = scene_problems(tmp_path, text)
    assert {re.search(r"toml: (\S+)", problem).group(1) for problem in problems} == {
        "cameras.1.zoom",
        "cameras.1.position_m",
        "objects.ball.albedo",
        "objects.ball.colour",
        "objects.ball.markers.first_id",
        "objects.plinth.kind",
        "sensor.bits",
    }
    assert len(problems) == 7


def test_four_mistakes_are_four_lines(tmp_path):
    text = changed(
        ROOM,
        ("zoom = 3.0", "zoom = 0.5"),
        ("radius_m = 0.45", "radius_m = 0.45\ncolour = 3"),
        ("first_id = 48", "first_id = 47"),
        ("[2.8, 1.6, 2.8]", "[3.8, 1.6, 2.8]"),
    )
    with pytest.raises(SceneError) as caught:
        scenes.load(write(tmp_path, text))
    assert len(caught.value.problems) == 4
    assert str(caught.value).split("\n") == caught.value.problems
    assert isinstance(caught.value, PSSError)
    assert isinstance(caught.value, ValueError)
    assert pickle.loads(pickle.dumps(caught.value)).problems == caught.value.problems  # it may cross processes


def test_a_file_of_wrong_things_is_told_of_without_a_crash(tmp_path):
    problems = scene_problems(
        tmp_path, "cameras = 3\nroom = [1]\nobjects = [{ kind = 'box' }, 4]\nprocess = {}\n[markers]\nplaced = 7"
    )
    for key in (
        "cameras = 3",
        "room = [1]",
        "objects.#2",
        "objects.#1.lowest_m",
        "process.model",
        "markers.placed",
        "noise",
    ):
        assert any(f"toml: {key}" in problem for problem in problems), key


# ---- files that are no TOML ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "place"), [("a = 1\nb = = 2\n", "line 2, column 5"), ("a = [1,\n 2", "line 2, column 3")]
)
def test_what_is_no_toml_is_one_line_with_line_and_column(text, place, tmp_path):
    (problem,) = scene_problems(tmp_path, text)
    assert problem.startswith(f"{tmp_path / 'scene.toml'}: {place}: ")


def test_a_file_that_is_not_there_or_cannot_be_read_is_one_line(tmp_path):
    with pytest.raises(SceneError, match=r"none\.toml: there is no such file$"):
        scenes.load(tmp_path / "none.toml")
    with pytest.raises(SceneError, match=r": Is a directory$"):
        scenes.load(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b"title = '\xe9'")
    with pytest.raises(SceneError, match=r"latin\.toml: byte 9 is no UTF-8"):
        scenes.load(tmp_path / "latin.toml")


# ---- overrides -----------------------------------------------------------------------------------------------------


def test_overrides_reach_items_by_name_and_number():
    overrides = [
        "cameras.2.zoom=4",
        "objects.ball.radius_m = 0.35",
        "sensor.exposure_ms=2",
        "light.panels.#2.size_m=[1, 1]",
        "cameras.3.f_number=4",  # allowed, but not in the file
        "noise.switched_off=['defocus']",
        "markers.dictionary=DICT_5X5_250",  # a bare word needs no quotes
        "sweep.trials=5",  # the sweep file's
        "cameras.2.zoom=5",  # the last word counts
    ]
    scene = scenes.load(FOLDER / "room.toml", overrides)
    assert scene.camera("2").zoom == 5
    assert scene.state.objects[1].shape.radius_m == 0.35
    assert scene.sensor.exposure_ms == 2
    assert scene.state.light.panels[1].size_m == (1, 1)
    assert (scene.camera("3").f_number, scene.camera("4").f_number) == (4, 1.8)
    assert scene.noise_models[0].name == "as-printed without defocus"
    assert scene.state.print.dictionary == "DICT_5X5_250"


def test_an_override_of_pan_and_tilt_takes_the_place_of_the_aim():
    scene = scenes.load(FOLDER / "room.toml", ["cameras.2.pan_deg=90", "cameras.2.tilt_deg=-20"])
    assert (scene.camera("2").pan_deg, scene.camera("2").tilt_deg) == (90, -20)


@pytest.mark.parametrize(
    ("override", "message", "allowed"),
    [
        ("cameras.8.zoom=1", 'cameras has no key "8"', "allowed: 1, 2, 3, 4, 5, 6, 7"),
        ("cameras.2.zom=3", 'cameras.2 has no key "zom", did you mean "zoom"?', "allowed: name, position_m, aim_m"),
        ("sensr.bits=8", 'the file has no key "sensr", did you mean "sensor"?', "allowed: room, light, sensor"),
        ("objects.plinth.markers.count=3", 'objects.plinth has no key "markers"', "allowed: name, kind, lowest_m"),
        (
            "objects.ball.centre_m.2=3",
            'objects.ball.centre_m has no key "2"',
            "allowed: objects.ball.centre_m as a whole",
        ),
        ("cameras.2.zoom", 'override "cameras.2.zoom"', "allowed: key=value"),
        ("cameras.2.zoom=50", "cameras.2.zoom = 50 (override)", "allowed: 1 to 8"),
        ("cameras.2.zoom=wide", 'cameras.2.zoom = "wide" (override)', "allowed: a number"),
        ("room=3", "room = 3 (override)", "allowed: a table with width_m"),
    ],
)
def test_a_wrong_override_is_one_line(override, message, allowed, tmp_path):
    (problem,) = scene_problems(tmp_path, ROOM, (override,))
    assert message in problem
    assert allowed in problem


def test_wrong_overrides_and_a_wrong_file_come_at_once(tmp_path):
    text = changed(ROOM, ("radius_m = 0.45", "radius_m = -1"))
    assert len(scene_problems(tmp_path, text, ("cameras.8.zoom=1", "cameras.2.zoom=50"))) == 3


# ---- sweeps --------------------------------------------------------------------------------------------------------


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
