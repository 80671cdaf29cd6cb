"""From detections to verdicts: calibrate on the training views, predict and measure the held-out configurations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pss import METRICS, Appearance, NoiseModel, noise_model
from pss.noise import CALIBRATION_FACTORS, Calibration
from render.view import random_stream, state_key
from scenes import Scene
from validate.acquire import Acquired
from validate.bank.design import ViewBank, draw_configurations
from validate.bank.measured import BankData, measure_all
from validate.bank.predicted import PredictionTask, predict_all
from validate.bank.verdict import CountVerdict
from validate.calibrate import Fitted, factor_covariances, fit_best_form, pixel_moments

__all__ = [
    "FREE_MODELS",
    "appearance_of",
    "asked_pairs",
    "calibrated",
    "data_of",
    "scene_models",
    "verdict_of",
]

Floats = NDArray[np.float64]
Row = dict[str, object]

# Models that need no measurement.
FREE_MODELS = ("as-printed", "corrected", "physical", "identity")
# Metrics that depend on R; all others are asked once.
OF_NOISE = (
    "pss", "pss-single-frame", "pss-posterior", "worst-sigma", "entropy", "uncertainty-reward",
    "uncertainty-reward-steady-state", "a-optimality", "a-optimality-count-zero", "d-optimality",
    "d-optimality-count-zero", "e-optimality", "e-optimality-count-zero", "t-optimality", "t-optimality-count-zero",
    "worst-diagonal", "worst-diagonal-count-zero", "occlusion-robustness",
)  # fmt: skip
# Under the models beside the one that all metrics are asked under.
ALWAYS = ("pss", "pss-single-frame", "d-optimality-count-zero", "e-optimality-count-zero")
FULL_MODEL = "calibrated"


def data_of(bank: ViewBank, acquired: Acquired, seed: int) -> BankData:
    """A bank's detections."""
    pixels, covariance = bank.measured(acquired)
    return BankData(bank.cameras, bank.scene.state.points_m, pixels, covariance, bank.scene.process, seed)


def appearance_of(scene: Scene, acquired: Acquired) -> Appearance:
    """How the scene's markers look, from its solved light."""
    return acquired.appearances[state_key(scene.state)]


def calibrated(bank: ViewBank, data: BankData, acquired: Acquired, provenance: dict[str, str | int | float]) -> Fitted:
    """Weights fitted on a training bank; factors that the data do not ask for are left out."""
    moments = pixel_moments(data.residuals())
    state = bank.scene.state
    covariances = factor_covariances(
        bank.cameras, state.points_m, state.normals, appearance_of(bank.scene, acquired), bank.scene.sensor, moments
    )
    return fit_best_form(CALIBRATION_FACTORS, covariances, moments)


def scene_models(scene: Scene, calibration: Calibration) -> list[NoiseModel]:
    """The noise models that are judged in a scene, with its own sensor."""
    free = [noise_model(name, sensor=scene.sensor, ccd_noise=scene.sensor.ccd_noise) for name in FREE_MODELS]
    return [*free, NoiseModel(calibration.name, calibration.factors(scene.sensor, scene.sensor.ccd_noise))]


def asked_pairs() -> list[tuple[str, str]]:
    """Pairs of noise model and metric: everything under the calibrated one, what R decides under the others too."""
    pairs = [(FULL_MODEL, name) for name in METRICS]
    return pairs + [(model, name) for model in FREE_MODELS for name in ALWAYS]


def verdict_of(
    bank: ViewBank,
    data: BankData,
    acquired: Acquired,
    models: Sequence[NoiseModel],
    cameras: int,
    count: int,
    seed: int,
    filtered: bool,
) -> CountVerdict:
    """Draw, measure and predict `count` configurations of so many cameras."""
    rng = random_stream(seed, bank.scene.path.name, f"configurations of {cameras}")
    names = [camera.name for camera in bank.cameras]
    configurations = draw_configurations(names, cameras, count, rng)
    state = bank.scene.state
    needs = {model.name: tuple(METRICS) if model.name == FULL_MODEL else ALWAYS for model in models}
    task = PredictionTask(
        bank.cameras,
        state.points_m,
        state.normals,
        state.occluders,
        appearance_of(bank.scene, acquired),
        bank.scene.process,
        tuple(models),
        needs,
    )
    chosen = configurations.tolist()
    return CountVerdict(cameras, configurations, measure_all(data, chosen, filtered), predict_all(task, chosen))
