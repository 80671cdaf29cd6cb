"""The probability of detection: its form by hand, its file, and its fit to made-up detectors."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import pss
from pss import DetectionModel, ImageSensor, RangeError
from pss.noise import DETECTION_COEFFICIENTS, Calibration
from pss.visibility.detection import DETECTION_PARTS, detection_features
from pss.visibility.points import visible_in
from pss.visibility.targets import TARGET_VISIBILITY, blur_modules, contrast_over_noise, narrow_side_px
from tests.helpers.markers_before_cameras import world
from validate.prediction.detection import DetectionTrials, detection_trials, fit_detection, log_loss

TRUTH = {"constant": 6.0, "size": 2.0, "blur": 3.0, "signal": 4.0, "incidence": 0.5, "lapse": 0.02}
SENSOR = ImageSensor()
# Probabilities of a fit to 2,000 pairs, of which each is known to a few percent in the middle of the ramp.
FIT = 0.05


def test_the_form_by_hand():
    views = world(1)
    found = DetectionModel(TRUTH, SENSOR).probability(views)
    s, b, q = narrow_side_px(views), blur_modules(views, SENSOR), contrast_over_noise(views, SENSOR)
    rng = np.random.default_rng(2)
    for c, n in zip(rng.integers(12, size=40), rng.integers(200, size=40), strict=True):
        z = 6 - 2 * math.log(1 + (3 / s[c, n]) ** 4) - 3 * math.log(1 + b[c, n] ** 2)
        z += -4 * math.log(1 + (5 / q[c, n]) ** 2) + 0.5 * math.log(views.cos_incidence[c, n])
        expected = 0.98 / (1 + math.exp(-z))
        assert found[c, n] == pytest.approx(expected if expected >= 1e-4 else 0, rel=1e-9)
    gone = DetectionModel(TRUTH | {"constant": -9.0}, SENSOR).probability(views)
    assert (gone == 0).any()
    assert gone[gone > 0].min() >= 1e-4
    assert found.max() <= 0.98


def test_larger_sharper_and_brighter_is_never_found_less_often():
    views = world(1)
    parts = detection_features(views, SENSOR)
    assert (parts <= 0).all()
    side, blur = narrow_side_px(views), blur_modules(views, SENSOR)
    for part, better in ((parts[0], side), (parts[1], -blur)):
        assert (np.diff(part.ravel()[np.argsort(better, axis=None)]) >= -1e-12).all()
    dim = dataclasses.replace(SENSOR, exposure_ms=SENSOR.exposure_ms / 20)
    assert (detection_features(views, dim)[2] <= parts[2] + 1e-12).all()


def test_a_calibration_keeps_it(tmp_path):
    path = tmp_path / "mine.toml"
    calibration = Calibration("mine", {"floor": 1.0}, {}, {}, {}, TRUTH)
    path.write_text(calibration.to_toml())
    assert Calibration.from_file(path) == calibration
    assert pss.detection_model(path) == DetectionModel(TRUTH)
    assert pss.detection_model(str(path), SENSOR).sensor is SENSOR
    path.write_text(Calibration("mine", {"floor": 1.0}, {}).to_toml())
    assert Calibration.from_file(path).detection == {}
    with pytest.raises(RangeError, match=r"mine\.toml: no table \[detection\]; allowed: a calibration"):
        pss.detection_model(path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("size", "-0.1", r"detection\.size = -0\.1; allowed: 0 or more, finite"),
        ("lapse", "1.0", r"detection\.lapse = 1\.0; allowed: 0 or more, below 1"),
        ("constant", "inf", r"detection\.constant = inf; allowed: a finite number"),
        ("constant", "true", r"detection\.constant = True; allowed: a finite number"),
        ("blur", '"much"', r"detection\.blur = much; allowed: 0 or more, finite"),
    ],
)
def test_what_is_wrong_in_a_file_is_one_line(tmp_path, name, value, message):
    path = tmp_path / "wrong.toml"
    text = Calibration("wrong", {"floor": 1.0}, {}, {}, {}, TRUTH).to_toml()
    path.write_text(text.replace(f"{name} = {TRUTH[name]!r}", f"{name} = {value}"))
    with pytest.raises(RangeError, match=message):
        Calibration.from_file(path)
    path.write_text(text.replace("signal", "noise"))
    with pytest.raises(RangeError, match="allowed: none, or constant and size and blur and signal and incidence and"):
        Calibration.from_file(path)


def test_a_model_of_wrong_numbers_is_refused():
    with pytest.raises(RangeError, match="has none; allowed: all of constant, size"):
        DetectionModel({})
    with pytest.raises(RangeError, match=r"coefficients\['lapse'\] = -0\.1; allowed: 0 or more, below 1"):
        DetectionModel(TRUTH | {"lapse": -0.1})
    assert set(DETECTION_COEFFICIENTS) == {"constant", *DETECTION_PARTS, "lapse"}


@pytest.mark.parametrize("seed", [3, 4])
def test_a_planted_ramp_is_found(seed):
    """Finds drawn once a marker and view, all trials alike: the probabilities, and the loss of left-out cameras."""
    views = world(seed)
    views = type(views)(
        [dataclasses.replace(camera, name=str(k)) for k, camera in enumerate(views.cameras)],
        views.points_m,
        views.normals,
        views.appearance,
    )
    truth = DetectionModel(TRUTH, SENSOR).probability(views)
    whole = visible_in(views, (), TARGET_VISIBILITY)
    rate = (np.random.default_rng(seed).uniform(size=truth.shape) < truth).astype(float)
    trials = detection_trials(views, (), rate, 2, SENSOR)
    assert len(trials.rate) == whole.sum()
    fitted = fit_detection(trials)
    found = DetectionModel(fitted.coefficients, SENSOR).probability(views)
    middle = whole & (truth > 0.1) & (truth < 0.9)
    assert middle.sum() > 50
    assert np.sqrt(np.mean((found - truth)[middle] ** 2)) < 2 * FIT
    assert found[whole].sum() == pytest.approx(rate[whole].sum(), rel=0.01)
    best = log_loss(truth[whole], rate[whole])
    assert best - 0.02 < fitted.held_back_log_loss < best + 0.02
    assert fitted.held_back_log_loss < 0.8 * fitted.constant_log_loss


def test_the_weights_of_pairs_are_their_renders():
    """A pair of two renders counts as two pairs of one."""
    rng = np.random.default_rng(5)
    parts, camera = -rng.uniform(0, 3, size=(4, 200)), rng.choice(["a", "b"], size=200)
    rate = (rng.uniform(size=200) < 0.5).astype(float)
    twice = DetectionTrials(parts, rate, np.full(200, 2.0), camera)
    one = DetectionTrials(parts, rate, np.ones(200), camera)
    both = DetectionTrials.together([one, one])
    for name, value in fit_detection(twice).coefficients.items():
        assert fit_detection(both).coefficients[name] == pytest.approx(value, abs=1e-3)


def test_without_whole_markers_there_is_nothing_to_fit():
    empty = DetectionTrials(np.zeros((4, 0)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=str))
    with pytest.raises(RangeError, match="no view has a whole marker in it; allowed: at least one"):
        fit_detection(empty)
