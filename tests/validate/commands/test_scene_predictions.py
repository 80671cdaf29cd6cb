"""[noise] and [metric] of a scene count in banks and schedules too: obeyed, or refused in a line; never ignored."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import scenes
from pss import noise_model
from pss.noise.calibrated import Calibration
from pss.visibility.points import VISIBILITY_TESTS
from pss.visibility.targets import TARGET_VISIBILITY
from scenes import SceneError
from validate.bank.judge import requested_pairs
from validate.bank.sensitivity import variants
from validate.commands.calibration_error import check_keys
from validate.prediction.contenders import FREE_MODELS, judged, scene_contenders

ROOT = Path(__file__).parents[3]
CALIBRATION = Calibration.from_file(ROOT / "results" / "reference" / "bank" / "calibrated.toml")
ROUNDING = 1e-12


def load(name="room", *overrides):
    return scenes.load(ROOT / "scenes" / f"{name}.toml", overrides)


def contenders(scene):
    return {each.name: each for each in scene_contenders(scene, CALIBRATION)}


@pytest.mark.parametrize("name", ["room", "atrium", "studio", "hallway"])
def test_the_shipped_scenes_are_judged_as_ever(name):
    """R with the sensor's own dark noise and nothing else, and the paper's visibility."""
    scene = load(name)
    found = contenders(scene)
    for model in FREE_MODELS:
        expected = noise_model(model, sensor=scene.sensor, ccd_noise=scene.sensor.ccd_noise)
        assert repr(found[model].noise) == repr(expected)
        assert found[model].visibility == VISIBILITY_TESTS
    assert found["calibrated R"].visibility == VISIBILITY_TESTS
    check_keys(scene)


def test_factors_and_scale_of_the_file_count():
    """In the paper's models and in their variants; the others have neither."""
    scene = load("room", 'noise.switched_off=["defocus"]', "noise.px2_per_m2=4.0")
    found = contenders(scene)
    for model in ("as-printed", "corrected"):
        assert [factor.name for factor in found[model].noise.factors] == ["distance-incidence", "resolution"]
        assert found[model].noise.factors[0].px2_per_m2 == 4.0
    plain = contenders(load("room"))
    for model in ("physical", "identity", "calibrated, limits"):
        assert repr(found[model].noise) == repr(plain[model].noise)
    by_name = {each.name: each.noise for _, each in variants(scene, VISIBILITY_TESTS)}
    assert by_name["corrected, px2_per_m2 × 10"].factors[0].px2_per_m2 == 40.0
    assert repr(by_name["corrected, px2_per_m2 × 1"].factors) == repr(scene.noise_model("corrected").factors)


def test_scaled_models_are_the_scenes_own_times_one_number():
    """Every entry of R, in the scene's own form and with its own visibility; without scales there are none."""
    scales = {"as-printed": 1e-5, "corrected": 4e-6, "identity": 2e-3}
    scene = load("atrium", "noise.px2_per_m2=4.0")
    found = {each.name: each for each in scene_contenders(scene, dataclasses.replace(CALIBRATION, scales=scales))}
    for name, scale in scales.items():
        scaled, literal = found[f"{name}, scaled"], found[name]
        where = scene.cameras[0], scene.state.points_m[:20], scene.state.normals[:20]
        np.testing.assert_allclose(
            scaled.noise.covariance(*where), scale * literal.noise.covariance(*where), rtol=ROUNDING
        )
        assert scaled.visibility == literal.visibility
        assert (f"{name}, scaled", "pss") in requested_pairs(list(found.values()))
    plain = [each.name for each in scene_contenders(scene, dataclasses.replace(CALIBRATION, scales={}))]
    assert plain == [name for name in found if not name.endswith("scaled")]
    assert {name for name, _ in requested_pairs(list(found.values()))} == set(found)


def test_visibility_of_the_file_counts():
    """Whole markers for each R; those that are about whole markers anyway, and the fitted limits, stay as they are."""
    found, plain = contenders(load("room", 'metric.visibility="target"')), contenders(load("room"))
    for name in (*FREE_MODELS, "calibrated R"):
        assert found[name].visibility == TARGET_VISIBILITY
    for name in ("physical, whole markers", "calibrated, limits"):
        assert found[name].visibility == plain[name].visibility
    reported = judged(found.values())
    assert reported["as-printed"]["visibility"] == [test.name for test in TARGET_VISIBILITY]
    assert reported["as-printed"]["noise"] == ["distance-incidence", "resolution", "defocus"]


def test_calibration_error_refuses_what_it_cannot_obey():
    """It judges the one model that it fits."""
    check_keys(load("room", 'noise.models=["identity", "calibrated"]'))
    with pytest.raises(SceneError) as refused:
        check_keys(
            load("room", 'noise.switched_off=["defocus"]', "noise.weights={resolution=2.0}", "metric.visibility=target")
        )
    [line] = refused.value.problems
    for key in ('noise.switched_off = ["defocus"]', 'noise.weights = {"resolution": 2.0}', '.visibility = "target"'):
        assert key in line
    assert "px2_per_m2" not in line
    assert "noise.models" not in line
