"""Tables of what was found, and predictions that count it: of detections drawn from a known ramp."""

from __future__ import annotations

import numpy as np
import pytest

import scenes
from pss import DetectionModel, RandomWalk, evaluate, noise_model
from pss.cameras.views import Views
from pss.noise import Calibration
from pss.visibility.points import VISIBILITY_TESTS, visible_in
from pss.visibility.targets import TARGET_VISIBILITY
from render.keys import state_key
from tests.conftest import ROOM_FILE
from validate.acquire.acquire import Acquired
from validate.bank.design import BankDesign, held_out_views
from validate.bank.detected import detection_rows, reliability_rows
from validate.bank.judge import detection_of, predictions
from validate.bank.measured import BankData
from validate.prediction.contenders import FULL_MODEL, scene_contenders

RAMP = {"constant": 5.0, "size": 1.7, "blur": 4.0, "signal": 5.0, "incidence": 0.0, "lapse": 0.0}


@pytest.fixture(scope="module")
def world():
    """Views of the room whose markers are found in all trials or in none, by a known probability."""
    room = scenes.load(ROOM_FILE)
    bank = held_out_views(room, BankDesign(settings=6, turns=1), "r")
    state, target_appearance = room.state, room.appearance()
    views = Views(list(bank.cameras), state.points_m, state.normals, target_appearance)
    chance = np.where(
        visible_in(views, state.occluders, TARGET_VISIBILITY), DetectionModel(RAMP, room.sensor).probability(views), 0.0
    )
    found = np.random.default_rng(1).uniform(size=chance.shape) < chance
    pixels = np.where(found[:, None, :, None], 1.0, np.nan) * np.ones((1, 4, 1, 2))
    covariance = np.broadcast_to(np.eye(2), (*pixels.shape, 2))
    data = BankData(bank.cameras, state.points_m, pixels, covariance, RandomWalk(), 1)
    return bank, data, Acquired(appearances={state_key(state): target_appearance}), chance


def test_the_true_probability_is_reliable_and_scores_better_than_what_is_seen(world):
    bank, data, acquired, chance = world
    used = np.arange(len(bank.cameras))
    model = DetectionModel(RAMP, bank.scene.sensor)
    seen = {"points": VISIBILITY_TESTS, "whole markers": TARGET_VISIBILITY}
    points, whole, ramp = detection_rows(bank, data, used, seen, model, acquired)
    for row in (points, whole, ramp):
        shares = [row[f"{a}_{b}"] for a in ("visible", "hidden") for b in ("detected", "missed")]
        assert sum(shares) == pytest.approx(1)
    assert whole["expected_found"] == whole["whole_markers"]
    spread = np.sqrt((chance * (1 - chance)).sum())
    assert ramp["expected_found"] == pytest.approx(ramp["found"], abs=4 * spread)
    assert whole["expected_found"] - whole["found"] > 4 * spread
    for score in ("brier", "log_loss"):
        assert ramp[score] < 0.8 * whole[score]
    rows = reliability_rows(bank, data, used, model, acquired)
    assert sum(row["whole_markers"] for row in rows) == ramp["whole_markers"]
    for row in rows:
        if row["whole_markers"]:
            assert row["probability_from"] <= row["predicted"] <= row["probability_to"]
            spread = 4 * np.sqrt(0.25 / row["whole_markers"])
            assert row["found"] == pytest.approx(row["predicted"], abs=spread)
            assert 0 <= row["found_ci_low"] <= row["found"] <= row["found_ci_high"] <= 1


def test_the_full_model_counts_with_the_fitted_probability(world):
    """Its predictions are those of `evaluate` with what is fitted; without a fit it keeps to the limits."""
    bank, _, acquired, _ = world
    scene, (target_appearance,) = bank.scene, acquired.appearances.values()
    limits = {"smallest_module_px": 2.0, "largest_blur_modules": 1.0}
    calibration = Calibration("calibrated", {"brightness-contrast": 1.1}, {}, limits, {}, RAMP)
    (full,) = (c for c in scene_contenders(scene, calibration) if c.name == FULL_MODEL)
    chosen = np.array([[0, 7, 13, 20]])
    found = predictions(bank, [full], chosen, target_appearance)[0][FULL_MODEL]
    truth = evaluate(
        [bank.cameras[view] for view in chosen[0]],
        scene.state.points_m,
        scene.state.normals,
        noise=noise_model("physical", sensor=scene.sensor).weighted({"brightness-contrast": 1.1}),
        process=scene.process,
        occluder=scene.state.occluders,
        appearance=target_appearance,
        detection=DetectionModel(RAMP, scene.sensor),
    )
    assert 0 < truth.found.max() < 1
    np.testing.assert_allclose(found.found, truth.found)
    np.testing.assert_allclose(found.terms["pss-single-frame"].mean(), truth.pss_single_frame)
    np.testing.assert_allclose(found.terms["pss"].mean(), truth.pss)
    np.testing.assert_allclose(found.covariance_m2, truth.single_frame_covariance)
    without = Calibration("calibrated", {"brightness-contrast": 1.1}, {}, limits)
    (hard,) = (c for c in scene_contenders(scene, without) if c.name == FULL_MODEL)
    assert hard.detection is None
    assert hard.visibility[-1].name == "legible"


def test_the_fit_of_a_bank_finds_the_probability(world):
    """`detection_of` of the views themselves: the expected number of finds, and the loss of the truth."""
    bank, data, acquired, chance = world

    class Bank:
        scene, cameras, views = bank.scene, bank.cameras, bank.views

        @staticmethod
        def measured(_):
            return data.pixels, data.covariance

    fitted = detection_of([Bank], acquired, 1)
    state, (target_appearance,) = bank.scene.state, acquired.appearances.values()
    views = Views(list(bank.cameras), state.points_m, state.normals, target_appearance)
    again = np.where(chance > 0, DetectionModel(fitted.coefficients, bank.scene.sensor).probability(views), 0.0)
    assert again.sum() == pytest.approx(data.detected.mean(axis=1).sum(), rel=0.01)
    assert np.abs(again - chance).mean() < 0.02
