"""The noise models by name: switches and weights of factors, the shipped calibration, and other packages' models."""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass, replace

import numpy as np
import pytest

from pss import (
    NOISE_MODELS,
    Appearance,
    ImageSensor,
    NoiseModel,
    NoiseSettings,
    PTZCamera,
    RangeError,
    ShapeError,
    noise_model,
)
from pss.noise import Calibration, IdentityNoise, NoiseTable, shipped_calibration
from pss.noise.table import ENTRY_POINTS, SHIPPED_CALIBRATION
from pss.visibility.targets import Legible, visibility_tests
from tests.helpers.entry_points import Entry
from tests.helpers.installed import own_noise

CAMERA = PTZCamera((0, 0, 0), 0, 0)
POINTS = np.array([[0.0, 5.0, 0.0], [0.5, 4.0, 0.2]])
NORMALS = np.array([[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
LOOK = Appearance(0.02, 0.2, 0.01)


def covariance(model):
    return model.covariance(CAMERA, POINTS, NORMALS, LOOK)


def test_weights_multiply_the_factors_that_they_name():
    weighted = noise_model("corrected", weights={"defocus": 0.5, "resolution": 3.0})
    parts = {name: noise_model("corrected").weighted({}).without(*others(name)) for name in PAPER}
    expected = covariance(parts["distance-incidence"]) + 3 * covariance(parts["resolution"])
    np.testing.assert_allclose(covariance(weighted), expected + 0.5 * covariance(parts["defocus"]), rtol=1e-12)


PAPER = ("distance-incidence", "resolution", "defocus")


def others(kept):
    return [name for name in PAPER if name != kept]


@dataclass(frozen=True)
class TwoParts:
    """A factor of two parts that no module of the project knows."""

    left: tuple[str, ...] = ("wind", "heat")
    name: str = "weather"
    parts: tuple[str, ...] = ("wind", "heat")

    def covariance(self, views):
        return len(self.left) * np.eye(2)

    def without(self, part):
        left = tuple(each for each in self.left if each != part)
        return replace(self, left=left) if left else None


@pytest.mark.parametrize("weight", [None, 2.0])
def test_parts_are_switched_off_by_the_factor_itself(weight):
    """Of any factor that has parts, weighted or not; with none left, the factor is gone."""
    model = NoiseModel("mine", (TwoParts(), IdentityNoise()))
    model, times = (model, 1.0) if weight is None else (model.weighted({"weather": weight}), weight)
    assert model.switches == ("weather", "identity", "wind", "heat")
    np.testing.assert_allclose(covariance(model)[0], (2 * times + 1) * np.eye(2))
    np.testing.assert_allclose(covariance(model.without("wind"))[0], (times + 1) * np.eye(2))
    np.testing.assert_allclose(covariance(model.without("wind", "heat"))[0], np.eye(2))
    assert [factor.name for factor in model.without("wind", "heat").factors] == ["identity"]
    with pytest.raises(RangeError, match=r"'rain' is not in 'mine.*allowed: weather, identity, wind, heat"):
        model.without("rain")


def test_the_shipped_calibration_has_a_name():
    """Its weights with the caller's sensor, and its limits."""
    sensor = ImageSensor(exposure_ms=9.0)
    written = Calibration.from_file(SHIPPED_CALIBRATION)
    assert shipped_calibration() == written
    model = noise_model("calibrated", sensor=sensor)
    assert (model.name, model.factors) == ("calibrated", written.factors(sensor))
    assert model.factors[0].factor.sensor is sensor
    limits = Legible(written.limits["smallest_module_px"], written.limits["largest_blur_modules"], sensor=sensor)
    assert visibility_tests("calibrated", sensor)[-1] == limits


@pytest.fixture
def entries(monkeypatch):
    """Installs entries; the list is filled by the test."""
    found = []

    def entry_points(*, group):
        assert group == ENTRY_POINTS == "pss.noise_models"
        return tuple(found)

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    return found


def test_a_model_or_a_function_joins_under_the_name_of_its_entry_point(entries):
    given = NoiseModel("by another name", (IdentityNoise(4.0),))
    entries += [
        Entry("given", given),
        Entry("built", lambda settings: NoiseModel("x", (IdentityNoise(settings.px2_per_m2),))),
    ]
    table = NoiseTable({"ours": lambda settings: given})
    assert list(table) == ["ours", "given", "built"]
    assert table["given"](NoiseSettings()) == replace(given, name="given")
    assert table["built"](NoiseSettings(px2_per_m2=9.0)) == NoiseModel("built", (IdentityNoise(9.0),))


def test_what_is_no_model_is_left_out_with_a_warning(entries):
    entries += [
        Entry("number", 42),
        Entry("two words", NoiseModel("x", (IdentityNoise(),))),
        Entry("file.toml", NoiseModel("x", (IdentityNoise(),))),
        Entry("ours", NoiseModel("x", (IdentityNoise(9.0),))),
        Entry("good", NoiseModel("x", (IdentityNoise(),))),
    ]
    table = NoiseTable({"ours": lambda settings: NoiseModel("ours", (IdentityNoise(),))})
    with pytest.warns(UserWarning, match="noise models of entry point") as caught:
        assert list(table) == ["ours", "good"]
    reasons = (
        "allowed: a pss.NoiseModel, or",
        "the name 'two words'",
        "the name 'file.toml'",
        "'ours' is there already",
    )
    assert [reason in str(each.message) for reason, each in zip(reasons, caught, strict=True)] == [True] * 4
    assert table["ours"](NoiseSettings()).factors == (IdentityNoise(),)


def test_a_function_that_fails_is_named(entries):
    def broken(settings):
        raise ZeroDivisionError("of mine")

    entries += [Entry("broken", broken), Entry("number", lambda settings: 42)]
    table = NoiseTable({})
    with pytest.raises(RangeError, match="noise model 'broken' raised ZeroDivisionError: of mine"):
        table["broken"](NoiseSettings())
    with pytest.raises(RangeError, match=r"noise model 'number' is built as 42; allowed: a pss\.NoiseModel"):
        table["number"](NoiseSettings())


@dataclass(frozen=True)
class Broken:
    """A factor with a mistake in it."""

    error: Exception
    name: str = "broken"

    def covariance(self, views):
        raise self.error


def test_a_factor_that_fails_is_named():
    """An error of the project, and lack of memory, stay what they are."""
    with pytest.raises(RangeError, match="noise factor 'broken' raised KeyError: 'wind'"):
        covariance(NoiseModel("mine", (Broken(KeyError("wind")),)))
    for error in (ShapeError("of mine"), MemoryError("of mine")):
        with pytest.raises(type(error), match=r"^of mine$"):
            covariance(NoiseModel("mine", (IdentityNoise(), Broken(error))))


def test_the_example_of_the_docs_is_in_the_table_while_it_is_installed(tmp_path):
    assert "on-a-mast" not in NOISE_MODELS
    with own_noise(tmp_path) as name:
        assert name in NOISE_MODELS
        model = noise_model(name, weights={"nodding-mast": 4.0})
        added = covariance(model)[0] - covariance(noise_model("physical"))[0]
        np.testing.assert_allclose(added, np.diag([0, 4 * (CAMERA.focal_px * 1e-4) ** 2]), atol=1e-12)
    assert "on-a-mast" not in NOISE_MODELS
