"""Named sensors in a scene file: what they stand for, what overrides them, and how a wrong one is told."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

import scenes
import scenes.reading.sensor_file
from scenes import SceneError
from scenes.reading.sensor_file import known_sensors, read_sensor
from scenes.schema.camera_tables import SensorFileSpec, SensorSpec

FOLDER = Path(scenes.__file__).parent
ROOM = (FOLDER / "room.toml").read_text()
NAMES = ["low-light-large-pixel", "machine-vision-global-shutter", "surveillance-ptz"]
# What public data sheets of each class leave room for: lowest and highest.
CLASSES = {
    "surveillance-ptz": {
        "pixel_pitch_um": (2.7, 3.1),
        "quantum_efficiency": (0.6, 0.85),
        "full_well_e": (8_000, 16_000),
        "read_noise_e": (2.0, 6.0),
        "bits": (10, 12),
        "width_mm": (5.0, 5.8),  # 1/2.8"
    },
    "machine-vision-global-shutter": {
        "pixel_pitch_um": (3.45, 3.45),
        "quantum_efficiency": (0.6, 0.7),
        "full_well_e": (10_000, 11_000),
        "read_noise_e": (2.2, 2.5),
        "bits": (12, 12),
        "width_mm": (8.0, 8.8),  # 2/3"
    },
    "low-light-large-pixel": {
        "pixel_pitch_um": (6.0, 9.0),
        "quantum_efficiency": (0.5, 0.85),
        "full_well_e": (30_000, 100_000),
        "read_noise_e": (1.0, 3.0),
        "bits": (12, 16),
        "width_mm": (10.0, 37.0),
    },
}
# Whatever the class: electrons per second uncooled, PRNU as a share, DSNU in electrons.
ANY_CLASS = {"dark_current_e_per_s": (0.1, 100), "prnu_share": (0.002, 0.02), "dsnu_e": (0.2, 5)}


def with_sensor(text: str) -> str:
    """The shipped room with another [sensor]."""
    changed, count = re.subn(r"(?s)\[sensor\].*?\n\n", f"[sensor]\n{text}\n\n", ROOM)
    assert count == 1
    return changed


def load(folder: Path, text: str, *overrides: str):
    path = folder / "scene.toml"
    path.write_text(with_sensor(text))
    return scenes.load(path, overrides)


def problems(folder: Path, text: str, *overrides: str) -> list[str]:
    with pytest.raises(SceneError) as caught:
        load(folder, text, *overrides)
    return [line.partition("toml: ")[2] for line in caught.value.problems]


@pytest.mark.parametrize("name", NAMES)
def test_a_named_sensor_is_what_data_sheets_of_its_class_say(name, tmp_path):
    scene = load(tmp_path, f'name = "{name}"\nexposure_ms = 4')
    values = scene.resolved()["sensor"]
    values["width_mm"] = values["resolution_px"][0] * values["pixel_pitch_um"] * 1e-3
    for key, (lowest, highest) in (CLASSES[name] | ANY_CLASS).items():
        assert lowest <= values[key] <= highest, key
    # The converter's steps do not drown the dark noise (EMVA 1288 asks for 0.5 DN), nor the black level cut it off.
    sensor = scene.sensor
    assert sensor.read_noise_e / sensor.gain_e_per_dn > 0.5
    assert sensor.black_level_dn > 6 * (sensor.read_noise_e**2 + sensor.dsnu_e**2) ** 0.5 / sensor.gain_e_per_dn


@pytest.mark.parametrize("name", NAMES)
def test_the_scene_has_every_number_of_the_file(name, tmp_path):
    """Cameras get the pixels, the image sensor the rest; nothing stays at a default."""
    scene = load(tmp_path, f'name = "{name}"\nexposure_ms = 2.5')
    values = tomllib.loads((FOLDER / "sensors" / f"{name}.toml").read_text())
    assert set(values) == set(SensorFileSpec.model_fields) - {"system_gain_dn_per_e"}
    assert {camera.resolution for camera in scene.cameras} == {tuple(values.pop("resolution_px"))}
    assert scene.cameras[0].pixel_pitch_m == pytest.approx(values.pop("pixel_pitch_um") * 1e-6, rel=1e-12)
    assert {key: getattr(scene.sensor, key) for key in values} == values
    assert scene.sensor.exposure_ms == 2.5


@pytest.mark.parametrize("name", NAMES)
def test_every_number_of_a_file_says_what_kind_of_source_it_has(name):
    lines = (FOLDER / "sensors" / f"{name}.toml").read_text().splitlines()
    assert lines[0].startswith("# ")
    bare = [line for line in lines if "=" in line and not line.startswith("#") and "# " not in line]
    assert [line.partition(" ")[0] for line in bare] in (["resolution_px", "bits"], ["resolution_px", "bits"][::-1])


def test_the_shipped_names():
    assert known_sensors() == NAMES


def test_a_key_of_the_scene_goes_before_the_named_sensors(tmp_path):
    text = 'name = "surveillance-ptz"\nexposure_ms = 4\nread_noise_e = 9.5\nresolution_px = [640, 480]'
    scene = load(tmp_path, text, "sensor.dsnu_e=0.5")
    assert (scene.sensor.read_noise_e, scene.sensor.dsnu_e) == (9.5, 0.5)
    assert scene.cameras[0].resolution == (640, 480)
    assert scene.sensor.full_well_e == read_sensor("surveillance-ptz")["full_well_e"]
    assert scene.noise_models[0].factors[1].ccd_noise == scene.sensor.ccd_noise


def test_the_name_as_an_override_is_another_sensor_with_the_old_exposure():
    """The room's own numbers go, as they describe the old sensor; an override after it counts again."""
    name = "low-light-large-pixel"
    overrides = ["sensor.bits=10", f"sensor.name={name}", "sensor.read_noise_e=3"]
    sensor = scenes.load(FOLDER / "room.toml", overrides).sensor
    values = read_sensor(name)
    assert (sensor.full_well_e, sensor.bits, sensor.prnu_share) == tuple(
        values[key] for key in ("full_well_e", "bits", "prnu_share")
    )
    assert (sensor.exposure_ms, sensor.read_noise_e) == (4.0, 3.0)


def test_the_shipped_room_is_as_before():
    """No dark current, no fixed pattern, the full well over the converter's range: results stay comparable."""
    sensor = scenes.load(FOLDER / "room.toml").sensor
    assert (sensor.dark_current_e_per_s, sensor.prnu_share, sensor.dsnu_e) == (0, 0, 0)
    assert sensor.system_gain_dn_per_e is None


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("gain", [None, 0.5])
def test_the_resolved_scene_has_everything_and_is_a_scene_itself(name, gain, tmp_path, monkeypatch):
    text = f'name = "{name}"\nexposure_ms = 4\nprnu_share = 0.02'
    scene = load(tmp_path, text if gain is None else f"{text}\nsystem_gain_dn_per_e = {gain}")
    resolved = json.loads(json.dumps(scene.resolved()))
    absent = {"auto_exposure_share", "longest_exposure_ms"} | ({"system_gain_dn_per_e"} if gain is None else set())
    assert set(resolved["sensor"]) == set(SensorSpec.model_fields) - absent
    # Everything is said outright: what the named file says later, or whether it is there, no longer counts.
    written = "\n".join(f"{key} = {json.dumps(value)}" for key, value in resolved["sensor"].items() if key != "name")
    for again in (load(tmp_path, written), load(tmp_path, f'name = "{name}"\n{written}')):
        assert again.sensor == scene.sensor
        assert again.cameras == scene.cameras
    assert load(tmp_path, f'name = "{name}"\n{written}').resolved() == scene.resolved()


# ---- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "hint"),
    [
        ('"machine-vision-global-shuter"', ', did you mean "machine-vision-global-shutter"?'),
        ('"surveilance"', ', did you mean "surveillance-ptz"?'),
        ('"xyz"', ""),
        ("3", ""),
    ],
)
def test_a_wrong_name_is_one_line_with_the_nearest(values, hint, tmp_path):
    """What the name would have filled in is not told as missing."""
    assert problems(tmp_path, f"name = {values}\nexposure_ms = 4") == [
        f"sensor.name = {values}; allowed: {', '.join(NAMES)}{hint}"
    ]


def test_a_named_sensor_leaves_the_exposure_to_the_scene(tmp_path):
    assert problems(tmp_path, 'name = "surveillance-ptz"') == [
        'sensor.exposure_ms is missing; allowed: a number from 1e-06 to 3.6e+06, in milliseconds, or "auto"'
    ]


def test_without_a_name_everything_must_be_said_but_what_has_a_default(tmp_path):
    missing = {line.partition(" is missing")[0] for line in problems(tmp_path, "exposure_ms = 4")}
    keys = set(SensorFileSpec.model_fields) - {"dark_current_e_per_s", "prnu_share", "dsnu_e", "system_gain_dn_per_e"}
    assert missing == {f"sensor.{key}" for key in keys}


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("dark_current_e_per_s", "-1", "0 or more, in electrons per second"),
        ("dark_current_e_per_s", "inf", "0 or more, in electrons per second"),
        ("prnu_share", "0.21", "from 0 to 0.2"),
        ("prnu_share", "-0.01", "from 0 to 0.2"),
        ("prnu_share", '"1 %"', "from 0 to 0.2"),
        ("dsnu_e", "-0.1", "0 or more, in electrons"),
        ("dsnu_e", "true", "0 or more, in electrons"),
        ("system_gain_dn_per_e", "0", "above 0, in digital numbers per electron"),
        ("prnu_shar", "0.1", 'did you mean "prnu_share"?'),
    ],
)
def test_a_wrong_number_is_one_line(key, value, allowed, tmp_path):
    (problem,) = problems(tmp_path, f'name = "surveillance-ptz"\nexposure_ms = 4\n{key} = {value}')
    assert problem.startswith(f"sensor.{key} = ")
    assert allowed in problem


def test_all_problems_of_a_sensor_come_at_once(tmp_path):
    """A wrong name beside wrong keys, a rule between keys, and a camera's setting; black level against 12 bits."""
    text = 'name = "surveilance-ptz"\nexposure_ms = 0\ndsnu_e = -1\nblack_level_dn = 4095\nbit = 3'
    found = problems(tmp_path, text, "cameras.1.zoom=99")
    assert [line.partition(" ")[0] for line in sorted(found)] == [
        "cameras.1.zoom",
        "sensor.bit",
        "sensor.black_level_dn",
        "sensor.dsnu_e",
        "sensor.exposure_ms",
        "sensor.name",
    ]


def test_a_sensor_that_is_no_table_is_one_line(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("sensor = 3\n" + re.sub(r"(?s)\[sensor\].*?\n\n", "", ROOM))
    with pytest.raises(SceneError) as caught:
        scenes.load(path)
    (problem,) = caught.value.problems
    assert "sensor = 3; allowed: a table with " in problem
