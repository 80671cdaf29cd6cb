"""Too little light: check, run and report name it, with the figures that a slip of units would be in."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import scenes
from pss import PTZCamera, evaluate
from pss.cameras.luminous import illuminance_lux, luminous_efficiency
from pss.cameras.sensor import PLANCK_TIMES_LIGHT_SPEED_J_M
from pss.cameras.views import Views
from pss.visibility.targets import LEAST_CONTRAST_OVER_NOISE, Legible, contrast_over_noise, visibility_tests
from render.keys import state_key
from render.lens.sampling import Sampling
from render.light.estimated_light import estimated_appearance
from render.renderer import ViewRequest
from tests.helpers import made_up_run as made_up
from tests.helpers.closet import SCENE, SWEEP
from validate.acquire.acquire import Acquired, Acquisition
from validate.acquire.quality_warnings import warn_of_darkness
from validate.acquire.view_names import view_names
from validate.commands import check
from validate.commands.options import SceneFiles
from validate.commands.subcommands import Check
from validate.markers.darkness import light_words
from validate.pages.data import read_sweeps
from validate.pages.sentences import remarks
from validate.prediction.foresight import camera_rows, foresee
from validate.prediction.warnings import warnings_of
from validate.sweeps.rows import detection_rows

ROOT = Path(__file__).parents[3]
# nm, ∫V(λ) dλ as the CIE has it; the table is summed by logarithms between its values.
CIE_INTEGRAL_NM, WITHIN = 106.857, 0.01
# Seconds typed as milliseconds.
SECONDS = "sensor.exposure_ms=0.004"


def bench(*overrides):
    return scenes.load(ROOT / "scenes" / "bench.toml", overrides)


# ---- lux -------------------------------------------------------------------------------------------------------------


def test_the_eye_sees_what_the_cie_says():
    """The peak, the integral, the ends, and 683 lux for a watt of green light a square metre."""
    assert luminous_efficiency(555) == 1
    assert luminous_efficiency([379.9, 780.1]).tolist() == [0, 0]
    nanometres = np.arange(380.0, 780.5, 0.5)
    assert np.trapezoid(luminous_efficiency(nanometres), nanometres) == pytest.approx(CIE_INTEGRAL_NM, rel=WITHIN)
    assert illuminance_lux(2.0, 555) == pytest.approx(1366.004)
    assert illuminance_lux(1.0, 550) == pytest.approx(679.55, rel=1e-4)
    of_a_band = luminous_efficiency(np.arange(400.0, 701.0)).mean() / luminous_efficiency(550)
    assert of_a_band == pytest.approx(0.355, abs=0.001)  # as the docstring states


@pytest.mark.parametrize(
    ("watts", "words"), [(0.15, "0.15 W/m² (100 lux at 550 nm)"), (100.0, "100 W/m² (68,000 lux at 550 nm)")]
)
def test_light_is_written_for_readers(watts, words):
    """Two digits, without powers of ten where people would not write them."""
    assert light_words(watts, 550.0) == words


# ---- the limit -------------------------------------------------------------------------------------------------------


def test_contrast_over_noise_by_hand():
    """Photons through the lens, one by one factor, on the axis of a camera that looks at the marker straight on."""
    scene = bench()
    camera = PTZCamera((0.0, -2.0, 1.0), 0, 0, focus_distance_m=2.0)
    target_appearance = dataclasses.replace(estimated_appearance(scene.state).at(np.array([0])), white_w_per_m2_sr=0.1)
    target_appearance = dataclasses.replace(target_appearance, black_w_per_m2_sr=0.01)
    views = Views([camera], np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, -1.0, 0.0]]), target_appearance)
    s = scene.sensor
    solid_angle = np.pi / 4 * (camera.aperture_diameter_m / camera.image_distance_m) ** 2
    joules = solid_angle * camera.pixel_pitch_m**2 * s.exposure_ms * 1e-3
    electrons = joules * s.wavelength_nm * 1e-9 / PLANCK_TIMES_LIGHT_SPEED_J_M * s.quantum_efficiency
    white, black = 0.1 * electrons, 0.01 * electrons
    assert white < s.saturation_e
    expected = (white - black) / np.sqrt(white + s.dark_signal_e + s.read_noise_e**2 + s.gain_e_per_dn**2 / 12)
    assert contrast_over_noise(views, s)[0, 0] == pytest.approx(expected, rel=1e-9)


def test_legible_targets_need_light_where_a_sensor_is_known():
    """In a hundredth of a thousandth of the exposure none is; without a sensor nothing is asked."""
    scene = bench()
    state, target_appearance = scene.state, estimated_appearance(scene.state)

    def seen(sensor):
        tests = (*visibility_tests("target"), Legible(1.0, 2.0, sensor=sensor))
        return evaluate(
            scene.cameras,
            state.points_m,
            state.normals,
            occluder=state.occluders,
            appearance=target_appearance,
            visibility=tests,
        ).visible

    assert seen(scene.sensor).any()
    np.testing.assert_array_equal(seen(scene.sensor), seen(None))
    assert not seen(dataclasses.replace(scene.sensor, exposure_ms=scene.sensor.exposure_ms * 1e-5)).any()


# ---- check -----------------------------------------------------------------------------------------------------------


def test_check_promises_nothing_in_the_dark(tmp_path, capsys):
    """It promised 28 to 30 markers a camera; the warning has exposure, pixels and lux to find the slip in."""
    seen = foresee(scenes.load(ROOT / "scenes" / "room.toml", [SECONDS]))
    for row in camera_rows(seen):
        assert row["likely_found"] == 0
        assert row["too_small"] + row["too_blurred"] + row["too_dark"] == row["whole"]
        assert row["too_dark"] > row["whole"] / 2
    lines = warnings_of(seen)
    assert sum("will find none: most are too dark" in line for line in lines) == 7
    [line] = [line for line in lines if line.startswith("too dark: ") and "at camera 4," in line]
    assert re.search(r"white gives 0\.\d+ e⁻ at camera 4, a contrast of 0\.\d+ times the noise", line)
    assert re.search(r"light on it \S+ W/m² \(\d+ lux at 550 nm\), exposure 0\.004 ms, f/\S+, pixels of 4\.65 µm", line)
    assert check.execute(Check("room", tmp_path / "plan.svg", files=SceneFiles((SECONDS,)))) == 0
    printed = capsys.readouterr()
    assert re.search(r"light on the markers in view: .* lux at 550 nm\) to .* lux", printed.out)
    assert "found by two cameras and more: 0 of 84" in printed.out


def test_check_has_nothing_against_the_shipped_scenes():
    """Every marker that their cameras see is well above the limit."""
    for name in ("room", "atrium", "studio", "workshop"):
        seen = foresee(scenes.load(ROOT / "scenes" / f"{name}.toml"))
        assert seen.contrast[seen.legible].min() > 1.5 * LEAST_CONTRAST_OVER_NOISE
        assert not seen.too_dark.any()
        assert not any("dark" in line for line in warnings_of(seen))


# ---- runs ------------------------------------------------------------------------------------------------------------


def test_a_run_warns_of_views_in_the_dark():
    """From the solved light of each state, view by view; bright ones are not counted."""
    scene, acquired, requested = bench(), Acquired(), []
    acquired.appearances[state_key(scene.state)] = estimated_appearance(scene.state)
    for sensor in (scene.sensor, dataclasses.replace(scene.sensor, exposure_ms=scene.sensor.exposure_ms * 1e-5)):
        for camera in scene.cameras[:2]:
            requested.append(Acquisition(ViewRequest(scene.state, camera, sensor, Sampling(), "none"), 1, 2))
    lines: list[str] = []
    warn_of_darkness(requested, acquired, lines.append, view_names(requested))
    [line] = lines
    assert line.startswith("2 of 4 views are too dark; the worst is the view of camera ")
    assert "lux at" in line
    assert "markers are found from 2" in line
    lines.clear()
    warn_of_darkness(requested[:2], acquired, lines.append, view_names(requested))
    assert not lines


@pytest.mark.parametrize(
    ("exposure", "cause"), [("2.0", "found. The paper"), ("2.0e-5", "found: too dark, with a contrast")]
)
def test_the_report_blames_light_only_where_it_is_light(exposure, cause, tmp_path, monkeypatch):
    """A made-up run that finds nothing, in the light and in the dark."""
    monkeypatch.setattr(made_up, "FOUND", 0.0)
    scene = SCENE.replace("exposure_ms = 2.0", f"exposure_ms = {exposure}")
    made_up_scene = load_scene_of(tmp_path, scene)
    target_appearance = estimated_appearance(made_up_scene.state)
    real = made_up.Acquired

    def lit():
        acquired = real()
        acquired.appearances[state_key(made_up_scene.state)] = target_appearance
        return acquired

    monkeypatch.setattr(made_up, "Acquired", lit)
    results, _, _ = made_up.made_up_run(tmp_path, scene, {"zooming": SWEEP})
    [row] = detection_rows(results)
    assert row["visible_missed"] > 0
    assert row["visible_missed_too_dark"] == (row["visible_missed"] if "dark" in cause else 0)
    [output] = [line for line in remarks(read_sweeps(tmp_path / "run")[0]) if "were not found" in line]
    assert cause in output
    assert ("too dark" in output) == ("too dark" in cause)


def load_scene_of(folder, text):
    path = folder / "closet.toml"
    path.write_text(text)
    return scenes.load(path)
