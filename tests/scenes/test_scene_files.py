"""Scene files: what they may state, and what they become."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

import scenes
from pss import ConstantVelocity, RandomWalk
from scenes import SceneError, load_sweep
from scenes.markers.layout import PLATE_OFFSET_M, overlapping, plate_corners_m, upwards
from scenes.schema.dictionaries import DICTIONARIES
from tests.helpers.scene_texts import FOLDER, PLACED, ROOM, changed, scene_problems, write

# Positions are sums of a few decimal fractions of metres.
ROUNDING_M = 1e-12


# ---- what is shipped -----------------------------------------------------------------------------------------------


def test_the_shipped_room_is_the_papers(room):
    assert len(room.state.markers) == 84
    assert sorted(marker.id for marker in room.state.markers) == list(range(84))
    assert [camera.name for camera in room.cameras] == list("1234567")
    assert [item.shape.name for item in room.state.objects] == ["board", "ball", "plinth"]
    assert [model.name for model in room.noise_models] == ["as-printed", "corrected", "physical", "calibrated"]
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


def test_a_marker_placed_by_hand(tmp_path):
    scene = scenes.load(write(tmp_path, ROOM + PLACED))
    marker = scene.state.markers[-1]
    assert (marker.id, marker.object_name, len(scene.state.markers)) == (90, "plinth", 85)
    np.testing.assert_allclose(marker.centre_m, (0.25, 0.3 + PLATE_OFFSET_M, 0.4), atol=ROUNDING_M)
    assert (marker.normal, marker.up) == ((0, 1, 0), (0, 0, 1))
