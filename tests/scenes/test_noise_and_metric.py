"""[noise] and [metric] of a scene file: models by name and by path, switches, weights, and what counts as seen."""

from __future__ import annotations

import importlib.metadata
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import scenes
from pss import NOISE_MODELS, NoiseModel, noise_model
from pss.noise import Calibration, IdentityNoise, Weighted
from pss.visibility.targets import TARGET_VISIBILITY, Legible
from scenes import SceneError
from tests.helpers.entry_points import Entry
from tests.helpers.installed import own_noise

ROOM = Path(__file__).parents[2] / "scenes" / "room.toml"
LIMITS = {"smallest_module_px": 2.5, "largest_blur_modules": 0.8}
MINE = Calibration("by another name", {"brightness-contrast": 2.0, "floor": 0.01}, {}, LIMITS)


@pytest.fixture
def room(tmp_path):
    """The room in a folder of its own, with a calibration beside it, one below and one outside."""
    folder = tmp_path / "mine"
    (folder / "fitted").mkdir(parents=True)
    shutil.copy(ROOM, folder)
    for path in (folder / "lab.toml", folder / "fitted" / "lab.toml", tmp_path / "outside.toml"):
        path.write_text(MINE.to_toml())
    return folder / "room.toml"


def problem(path, *overrides, **options):
    with pytest.raises(SceneError) as refused:
        scenes.load(path, overrides, **options)
    [line] = refused.value.problems
    return line


def test_a_calibration_is_named_by_its_path_from_the_scene(room, monkeypatch, tmp_path):
    """Wherever the program runs; with the scene's sensor, under the name that the scene's file has."""
    monkeypatch.chdir(tmp_path)
    scene = scenes.load(room, ('noise.models=["calibrated", "lab.toml", "fitted/lab.toml"]', "sensor.exposure_ms=7"))
    assert [model.name for model in scene.noise_models] == ["calibrated", "lab.toml", "fitted/lab.toml"]
    assert scene.noise_models[0] == noise_model("calibrated", sensor=scene.sensor)
    for model in scene.noise_models[1:]:
        assert model.factors == MINE.factors(scene.sensor, scene.sensor.ccd_noise)
    assert scene.resolved()["noise"]["models"] == ["calibrated", "lab.toml", "fitted/lab.toml"]
    again = scene.with_settings({"cameras.2.zoom": 4.0})
    assert again.noise_models == scene.noise_models
    shorter = scene.with_exposure(1.0)
    assert shorter.noise_models[1].factors == MINE.factors(shorter.sensor, shorter.sensor.ccd_noise)


def test_a_calibration_outside_the_folder_needs_the_option(room):
    for key in ("noise.models", "metric.visibility"):
        value = '["../outside.toml"]' if key == "noise.models" else "../outside.toml"
        assert "leads outside (--allow-outside permits it)" in problem(room, f"{key}={value}")
        scenes.load(room, (f"{key}={value}",), allow_outside=True)


def test_the_limits_of_a_calibration_are_what_counts_as_seen(room):
    """With the scene's sensor, and with that of another exposure after it was chosen."""
    for name, limits in (
        ("lab.toml", LIMITS),
        ("calibrated", {"smallest_module_px": 1.9, "largest_blur_modules": 1.35}),
    ):
        scene = scenes.load(room, (f"metric.visibility={name}",))
        assert scene.visibility == (*TARGET_VISIBILITY, Legible(**limits, sensor=scene.sensor))
        shorter = scene.with_exposure(1.0)
        assert shorter.visibility[-1].sensor.exposure_ms == 1.0


def test_an_installed_model_is_a_name_like_any_other(room, tmp_path):
    """It gets the scene's sensor; without its package the name means nothing."""
    named = 'noise.models=["physical", "on-a-mast"]'
    with own_noise(tmp_path) as name:
        scene = scenes.load(room, (named, 'noise.weights={"nodding-mast"=4.0}', "sensor.exposure_ms=7"))
        physical, mine = scene.noise_models
        assert (physical.name, mine.name) == ("physical", f"{name} weighted")
        assert mine.factors[0] == physical.factors[0]
        assert (mine.factors[1].name, mine.factors[1].weight) == ("nodding-mast", 4.0)
    assert 'noise.models.#2 = "on-a-mast"; allowed: as-printed, corrected' in problem(room, named)


def test_factors_are_switched_and_weighted_wherever_a_model_has_them(room):
    scene = scenes.load(
        room,
        (
            'noise.models=["corrected", "physical", "lab.toml"]',
            'noise.switched_off=["resolution", "incidence", "floor"]',
            "noise.weights={defocus=0.5, brightness-contrast=3.0}",
        ),
    )
    corrected, physical, mine = scene.noise_models
    assert [factor.name for factor in corrected.factors] == ["distance-incidence", "defocus"]
    assert (corrected.factors[0].distance, corrected.factors[0].incidence) == (True, False)
    assert corrected.factors[1].weight == 0.5
    assert [(factor.name, factor.weight) for factor in physical.factors] == [("brightness-contrast", 3.0)]
    assert [factor.name for factor in mine.factors] == ["brightness-contrast"]
    assert scene.resolved()["noise"]["weights"] == {"defocus": 0.5, "brightness-contrast": 3.0}
    # A model that the file does not list, as commands compare some always.
    assert [factor.name for factor in scene.noise_model("as-printed").factors] == ["distance-incidence", "defocus"]
    assert scene.noise_model("identity").factors == (IdentityNoise(),)
    assert isinstance(scene.noise_model("physical").factors[0], Weighted)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (('noise.models=["nowhere.toml"]',), "nowhere.toml: there is no such file"),
        (('noise.models=["korrect"]',), 'noise.models.#1 = "korrect"; allowed: as-printed, corrected'),
        (('noise.models=["lab.toml", "lab.toml"]',), "each name once"),
        (('noise.switched_off=["floor"]',), "factors that a model in noise.models has: distance-incidence"),
        (
            ("noise.weights={floor=2.0}",),
            "noise.weights.floor = 2.0; allowed: factors that a model in noise.models has",
        ),
        (("noise.weights={defocus=2.0}", 'noise.switched_off=["defocus"]'), "and that are not switched off"),
        (("noise.weights={defocus=0.0}",), "allowed: a table of numbers above 0 by the name of a factor"),
        (('noise.models=["lab.toml"]', "noise.px2_per_m2=3.0"), "no model in noise.models has this equation"),
        (('noise.switched_off=["brightness-contrast"]',), 'all that is left of "physical"; at least one factor must'),
        (("metric.visibility=nowhere.toml",), "nowhere.toml: there is no such file"),
        (("metric.visibility=lab",), 'metric.visibility = "lab" (override); allowed: point, target, calibrated'),
    ],
)
def test_what_would_be_without_effect_is_one_line(room, overrides, message):
    assert message in problem(room, *overrides)


def test_a_calibration_without_limits_does_not_count_as_seen(room):
    (room.parent / "weights.toml").write_text(Calibration("mine", {"floor": 1.0}, {}).to_toml())
    assert "a calibration with [limits]" in problem(room, "metric.visibility=weights.toml")


@dataclass(frozen=True)
class OfArrays:
    """A factor that cannot be compared with another one: Python asks an array whether it is true."""

    matrix: np.ndarray
    name: str = "of-arrays"

    def covariance(self, views):
        return self.matrix


def test_a_model_that_cannot_be_compared_may_have_the_scale_of_equation_11(room, monkeypatch):
    entries = (Entry("mine", lambda settings: NoiseModel("mine", (OfArrays(settings.px2_per_m2 * np.eye(2)),))),)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group: entries)
    NOISE_MODELS.reload_entry_points()
    try:
        scene = scenes.load(room, ('noise.models=["mine"]', "noise.px2_per_m2=3.0"))
    finally:
        monkeypatch.undo()
        NOISE_MODELS.reload_entry_points()
    assert scene.noise_models[0].factors[0].matrix.tolist() == [[3, 0], [0, 3]]
