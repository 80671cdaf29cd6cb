"""The exposure that a run chooses when a scene says "auto": by how much light, for whom, and what is told of it."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

import scenes
from pss import Appearance, ImageSensor, PTZCamera, RangeError
from render.lens.sampling import Sampling
from render.light.exposure import AutoExposure, choose_exposure
from render.sensor import expected_electrons
from render.store.folder import Store
from scenes import load_sweep
from validate.acquire.auto_exposure import with_exposures
from validate.sweeps.sweep import plan

FOLDER = Path(scenes.__file__).parent
ROOM = (FOLDER / "room.toml").read_text()
# An odd number of pixels: one of them is on the axis.
CAMERA = PTZCamera((0, 0, 1), 0, 0, zoom=4, focus_distance_m=3, resolution=(321, 241), pixel_pitch_m=1e-5, name="a")
SENSOR = ImageSensor()
POINTS = np.array([[0.0, 3.0, 1.0], [0.1, 2.0, 1.0], [-0.2, 4.0, 1.1]])
TOWARDS = np.tile([0.0, -1.0, 0.0], (3, 1))
WHITE = np.array([0.5, 0.8, 0.3])
ANY_TIME = AutoExposure(0.7, 1e9)
# 3.49 ms are rounded to 3.4: up to a tenth is lost where the first digit is 1.
LOST_TO_ROUNDING = 0.1


def choose(white=WHITE, cameras=(CAMERA,), sensor=SENSOR, wish=ANY_TIME, normals=TOWARDS, **appearance):
    appearance = Appearance(0.02, white, np.asarray(white) / 20, **appearance)
    return choose_exposure(appearance, POINTS, normals, cameras, sensor, wish)


def white_electrons(white: float, exposure_ms: float, camera=CAMERA, sensor=SENSOR) -> float:
    """Electrons on the axis, dark current with them, by the way that a render takes."""
    sensor = dataclasses.replace(sensor, exposure_ms=exposure_ms)
    width, height = camera.resolution
    image = expected_electrons(np.full((height, width), white), camera, sensor)
    return float(image[height // 2, width // 2]) + sensor.dark_signal_e


@pytest.mark.parametrize("share", [0.1, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("dark_current_e_per_s", [0.0, 50_000.0])
def test_the_brightest_white_reaches_the_share_that_is_asked(share, dark_current_e_per_s):
    """Never more, less by what rounding takes, and what is said of the share is so."""
    sensor = dataclasses.replace(SENSOR, dark_current_e_per_s=dark_current_e_per_s, system_gain_dn_per_e=0.5)
    choice = choose(sensor=sensor, wish=AutoExposure(share, 1e9))
    reached = white_electrons(WHITE.max(), choice.exposure_ms, sensor=sensor) / sensor.saturation_e
    assert share * (1 - LOST_TO_ROUNDING) < reached <= share * (1 + 1e-9)
    assert choice.share == pytest.approx(reached, rel=1e-9)
    assert (choice.point, choice.camera, choice.longest) == (1, CAMERA, False)


@pytest.mark.parametrize("factor", np.geomspace(1e-4, 1e4, 29))
def test_exposures_are_numbers_of_two_digits_rounded_down(factor):
    choice = choose(WHITE * factor)
    assert choice.exposure_ms == float(f"{choice.exposure_ms:.2g}")
    step = 10 ** (math.floor(math.log10(choice.exposure_ms)) - 1)
    more = white_electrons(WHITE.max() * factor, choice.exposure_ms + step * (1 + 1e-6))
    assert choice.share <= 0.7 < more / SENSOR.saturation_e


def test_an_exact_number_of_two_digits_stays():
    """A light that asks for 3.4 ms gets 3.4 ms, whatever the last bit of the quotient is."""
    for exposure_ms in (0.0012, 0.34, 3.4, 7.0, 34.0, 9900.0):
        white = 0.7 * SENSOR.saturation_e / white_electrons(1.0, exposure_ms)
        assert choose([white] * 3).exposure_ms == exposure_ms


def test_one_exposure_for_the_camera_that_gets_most_light():
    """Wide apertures and near focus count, in any order; a camera that is met twice counts once."""
    cameras = [
        CAMERA,
        dataclasses.replace(CAMERA, f_number=4.0),
        dataclasses.replace(CAMERA, f_number=1.2, name="wide"),
        dataclasses.replace(CAMERA, f_number=2.8),
    ]
    choice = choose(cameras=cameras)
    assert choice.camera.name == "wide"
    assert choice == choose(cameras=[*cameras[::-1], *cameras])
    assert choice.exposure_ms == choose(cameras=cameras[2:3]).exposure_ms < choose().exposure_ms


def test_only_markers_in_view_count():
    """The brightest faces away, or is beside the image: the next one decides; with none it is the longest allowed."""
    away = TOWARDS.copy()
    away[1] *= -1
    turned = choose(normals=away)
    assert turned.point == 0
    assert turned.exposure_ms == pytest.approx(choose().exposure_ms * 0.8 / 0.5, rel=LOST_TO_ROUNDING)
    aside = dataclasses.replace(CAMERA, position_m=(0.7, 0, 1), zoom=3.0)
    assert not aside.in_frustum(POINTS[1])
    assert choose(cameras=[aside]).point == 0
    nobody = choose(cameras=[dataclasses.replace(CAMERA, pan_deg=180)], wish=AutoExposure(0.7, 12.0))
    assert (nobody.exposure_ms, nobody.share, nobody.camera, nobody.longest) == (12.0, 0.0, None, True)


def test_the_longest_exposure_is_a_limit():
    limited = choose(WHITE * 1e-6, wish=AutoExposure(0.7, 13.37))
    assert (limited.exposure_ms, limited.longest) == (13.37, True)
    assert limited.share == pytest.approx(white_electrons(0.8e-6, 13.37) / SENSOR.saturation_e)
    assert not choose(wish=AutoExposure(0.7, 1e4)).longest


def test_under_ring_lights_distance_and_angle_count():
    """I cos α/D² of each marker for each camera: the dim one nearby is the brightest."""
    slanted = np.array([[0, -1.0, 0], [0, -0.5, math.sqrt(0.75)], [0, -1.0, 0]])
    white = [1.0, 1.0, 2.5]
    choice = choose(white, normals=slanted, ring_light=True)
    seen = [
        w * CAMERA.cos_incidence(point, normal) / CAMERA.range_m(point) ** 2
        for w, point, normal in zip(white, POINTS, slanted, strict=True)
    ]
    assert choice.point == int(np.argmax(seen))
    reached = white_electrons(max(seen), choice.exposure_ms) / SENSOR.saturation_e
    assert choice.share == pytest.approx(reached, rel=1e-9)
    near = dataclasses.replace(CAMERA, position_m=(0.1, 1.5, 1.0))
    assert choose(white, cameras=[CAMERA, near], ring_light=True).point == 1


def test_what_the_sensor_says_of_its_exposure_does_not_count():
    assert choose(sensor=dataclasses.replace(SENSOR, exposure_ms=77.0)) == choose()


@pytest.mark.parametrize("values", [(0.0, 20.0), (1.1, 20.0), (0.7, 0.0), (0.7, math.inf), (math.nan, 20.0)])
def test_wishes_out_of_range_are_refused(values):
    with pytest.raises(RangeError, match=r"AutoExposure\.\w+ = .*; allowed: above 0"):
        AutoExposure(*values)


# ---- in scene files --------------------------------------------------------------------------------------------------

AUTO = ROOM.replace("exposure_ms = 4.0", 'exposure_ms = "auto"')


def ring(text: str) -> str:
    """The room under ring lights, which need no solving."""
    start, end = text.index("radiance_w_per_m2_sr"), text.index("[sensor]")
    return f'{text[:start]}kind = "ring"\nring_w_per_sr = 4.0\n\n{text[end:]}'


def load(folder, text=AUTO, *overrides):
    (folder / "scene.toml").write_text(text)
    return scenes.load(folder / "scene.toml", overrides)


def test_a_scene_of_auto_exposure_waits_for_a_number(tmp_path):
    """Until then no view has a name; then sensor, noise models and contents are as if the file had said it."""
    scene = load(tmp_path)
    assert scene.auto_exposure == AutoExposure(0.7, 20.0)
    assert scene.resolved()["sensor"]["exposure_ms"] == "auto"
    with pytest.raises(RangeError, match=r'exposure_ms = "auto"; allowed: .*with_exposure'):
        plan(load_sweep("zoom"), scene, "renderer", Sampling())
    scene_file = load(tmp_path, ROOM.replace("exposure_ms = 4.0", "exposure_ms = 3.4\ndark_current_e_per_s = 9000.0"))
    dark = AUTO.replace("[lens]", "dark_current_e_per_s = 9000.0\nlongest_exposure_ms = 30.0\n[lens]")
    chosen = load(tmp_path, dark).with_exposure(3.4)
    assert (chosen.sensor, chosen.auto_exposure, chosen.state) == (scene_file.sensor, None, scene_file.state)
    assert chosen.resolved() == json.loads(json.dumps(scene_file.resolved()))
    # With dark current, Eqs. 12 and 13 know the exposure; and `physical` has a sensor.
    assert chosen.noise_models == scene_file.noise_models != load(tmp_path, dark).noise_models
    assert len(plan(load_sweep("zoom"), chosen, "renderer", Sampling()).views) == 12


def test_auto_by_override_with_its_keys(tmp_path):
    overrides = ("sensor.exposure_ms=auto", "sensor.auto_exposure_share=0.5", "sensor.longest_exposure_ms=40")
    scene = load(tmp_path, ROOM, *overrides)
    assert (scene.auto_exposure, scene.warnings) == (AutoExposure(0.5, 40.0), ())
    assert load(tmp_path, AUTO, "sensor.exposure_ms=2").auto_exposure is None


def test_its_keys_without_auto_are_a_warning(tmp_path):
    (warning,) = load(tmp_path, ROOM, "sensor.auto_exposure_share=0.5").warnings
    assert warning.endswith('warning: sensor.auto_exposure_share = 0.5; has no effect without exposure_ms = "auto"')


def chosen(folder, sweeps, *overrides, text=AUTO):
    """The scenes of sweeps after the choice, and the lines that were said."""
    lines, notes = [], []
    loaded = [(load_sweep(sweep), load(folder, ring(text), *overrides)) for sweep in sweeps]
    exposed = with_exposures(loaded, Store(folder / "store"), lines.append, notes.append)
    return [scene for _, scene in exposed], lines, notes


def test_sweeps_of_one_scene_share_an_exposure(tmp_path):
    """The camera that is the brightest in either decides for both, and one line says so."""
    apart = [chosen(tmp_path, [sweep])[0][0].sensor.exposure_ms for sweep in ("zoom", "selection")]
    both, lines, _ = chosen(tmp_path, ["zoom", "selection"])
    assert {scene.sensor.exposure_ms for scene in both} == {min(apart)}
    assert len(lines) == 1


def test_the_line_says_what_was_chosen_and_why(tmp_path):
    (scene,), (line,), notes = chosen(tmp_path, ["zoom"])
    exposure_ms = scene.sensor.exposure_ms
    assert line.startswith(f"exposure: {exposure_ms:g} ms chosen (brightest marker at ")
    assert line.endswith(tuple(f" in camera {name})" for name in "1234567"))
    assert " of saturation, requested: 70%; it is " in line
    assert notes == ["solving the scene's light, by which the exposure is chosen"]
    _, (line,), notes = chosen(tmp_path, ["zoom"], "sensor.longest_exposure_ms=0.01")
    assert line.startswith("exposure: 0.01 ms chosen, the longest allowed (brightest marker at ")
    assert notes == []  # the light is in the store


def test_numbers_are_left_alone(tmp_path):
    scenes_, lines, notes = chosen(tmp_path, ["zoom"], text=ROOM)
    assert (scenes_[0].sensor.exposure_ms, lines, notes) == (4.0, [], [])
    assert not (tmp_path / "store").exists()
