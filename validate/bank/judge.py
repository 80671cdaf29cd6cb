"""From detections to results: calibrate on the training views, predict and measure the held-out configurations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pss import METRICS, Appearance
from pss.cameras.views import Views
from pss.noise import CALIBRATION_FACTORS, SCALED_MODELS
from render.keys import state_key
from render.random_streams import random_stream
from scenes import Scene
from validate.acquire.acquire import Acquired
from validate.bank.design import ViewBank, draw_configurations
from validate.bank.leaderboard import CountVerdict
from validate.bank.measured import BankData, measure_all
from validate.bank.predicted import Predicted, PredictionTask, predict_all
from validate.prediction.contenders import CALIBRATED_LIMITS, FULL_MODEL, PHYSICAL_WHOLE, Contender
from validate.prediction.detection import DetectionTrials, FittedDetection, detection_trials, fit_detection
from validate.prediction.limits import FittedLimits, fit_limits
from validate.prediction.weights import (
    Fitted,
    factor_covariances,
    fit_best_form,
    fit_scale,
    model_covariance,
    pixel_moments,
)

__all__ = [
    "appearance_of",
    "calibrated",
    "data_of",
    "detection_of",
    "limits_of",
    "predictions",
    "requested_pairs",
    "scales_of",
    "verdict_of",
]


# Under the models other than the one under which all metrics are evaluated.
ALWAYS = ("pss", "pss-single-frame", "d-optimality-count-zero", "e-optimality-count-zero")
# What is judged under the full model: the metrics that expected counts define.
OF_FULL_MODEL = ("pss", "pss-single-frame", "visibility-count", "visible-share")


def data_of(bank: ViewBank, acquired: Acquired, seed: int) -> BankData:
    """A bank's detections."""
    pixels, covariance = bank.measured(acquired)
    return BankData(bank.cameras, bank.scene.state.points_m, pixels, covariance, bank.scene.process, seed)


def appearance_of(scene: Scene, acquired: Acquired) -> Appearance:
    """How the scene's markers look, from its solved light."""
    return acquired.appearances[state_key(scene.state)]


def calibrated(bank: ViewBank, data: BankData, acquired: Acquired) -> Fitted:
    """Weights fitted on a training bank; factors with a weight of 0 are omitted."""
    moments = pixel_moments(data.residuals())
    state = bank.scene.state
    covariances = factor_covariances(
        bank.cameras, state.points_m, state.normals, appearance_of(bank.scene, acquired), bank.scene.sensor, moments
    )
    return fit_best_form(CALIBRATION_FACTORS, covariances, moments)


def scales_of(bank: ViewBank, data: BankData, acquired: Acquired, fitted: Fitted) -> dict[str, float]:
    """What each of `SCALED_MODELS`, as it is in the scene, is multiplied by to fit the moments that `fitted` kept."""
    moments = pixel_moments(data.residuals())[fitted.kept]
    state = bank.scene.state
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    return {
        name: fit_scale(model_covariance(bank.scene.noise_model(name), views, moments), moments)
        for name in SCALED_MODELS
    }


def limits_of(bank: ViewBank, data: BankData, acquired: Acquired) -> FittedLimits:
    """Limits of detection fitted on a training bank."""
    state = bank.scene.state
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    return fit_limits(views, state.occluders, data.detected.mean(axis=1), bank.scene.sensor)


def detection_of(banks: Sequence[ViewBank], acquired: Acquired, seed: int) -> FittedDetection:
    """The probability of detection fitted on banks of training views."""
    trials = []
    for bank in (bank for bank in banks if bank.views):
        state = bank.scene.state
        views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
        rate, renders = data_of(bank, acquired, seed).detected.mean(axis=1), len(bank.views[0].renders)
        trials.append(detection_trials(views, state.occluders, rate, renders, bank.scene.sensor))
    return fit_detection(DetectionTrials.together(trials))


def requested_pairs(contenders: Sequence[Contender]) -> list[tuple[str, str]]:
    """Pairs of contender and metric: everything under the fitted limits, what R decides under the others too."""
    pairs = [(CALIBRATED_LIMITS, metric) for metric in METRICS]
    for contender in contenders:
        if contender.name == FULL_MODEL:
            pairs += [(FULL_MODEL, metric) for metric in OF_FULL_MODEL]
        elif contender.name != CALIBRATED_LIMITS:
            pairs += [(contender.name, metric) for metric in ALWAYS]
    return pairs + [("physical", "visibility-count"), (PHYSICAL_WHOLE, "visibility-count")]


def predictions(
    bank: ViewBank,
    contenders: Sequence[Contender],
    configurations: NDArray[np.int64],
    appearance: Appearance | None,
    needs: Mapping[str, tuple[str, ...]] | None = None,
) -> list[dict[str, Predicted]]:
    """Each contender's predictions of each configuration; `needs`: by contender, the requested metrics (else none)."""
    state = bank.scene.state
    task = PredictionTask(
        bank.cameras,
        state.points_m,
        state.normals,
        state.occluders,
        appearance,
        bank.scene.process,
        tuple(contenders),
        {contender.name: () for contender in contenders} if needs is None else needs,
    )
    return predict_all(task, configurations.tolist())


def verdict_of(
    bank: ViewBank,
    data: BankData,
    acquired: Acquired,
    contenders: Sequence[Contender],
    cameras: int,
    count: int,
    seed: int,
    filtered: bool,
) -> CountVerdict:
    """Draw, measure and predict `count` configurations of so many cameras."""
    rng = random_stream(seed, bank.scene.path.name, f"configurations of {cameras}")
    names = [camera.name for camera in bank.cameras]
    configurations = draw_configurations(names, cameras, count, rng)
    needs: dict[str, tuple[str, ...]] = {contender.name: () for contender in contenders}
    for name, metric in requested_pairs(contenders):
        needs[name] += (metric,)
    predicted = predictions(bank, contenders, configurations, appearance_of(bank.scene, acquired), needs)
    measured = measure_all(data, configurations.tolist(), filtered)
    return CountVerdict(cameras, configurations, measured, predicted, names)
