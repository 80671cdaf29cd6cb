"""Mistakes in a scene's file: each is one line with file, key, value and what is allowed; and overrides."""

from __future__ import annotations

import pickle
import re

import pytest

import scenes
from pss import PSSError
from scenes import SceneError, load_sweep
from tests.helpers.scene_texts import FOLDER, PLACED, ROOM, changed, scene_problems, start_of_line, write

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
        '["as-printed", "as-printed", "physical", "calibrated"]',
        "once",
    ),
    "no noise model": (
        [('["as-printed", "corrected", "physical", "calibrated"]', "[]")],
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
    with pytest.raises(SceneError, match=r"none\.toml: there is no such file; allowed: the path of a \.toml file$"):
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
