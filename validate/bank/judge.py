"""From detections to verdicts: calibrate on the training views, predict and measure the held-out configurations."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pss import METRICS, Appearance, DetectionModel, NoiseModel
from pss.cameras.views import Views
from pss.json_text import json_text
from pss.noise import CALIBRATION_FACTORS, SCALED_MODELS, Calibration
from pss.visibility.points import VISIBILITY_TESTS, VisibilityTest
from pss.visibility.targets import TARGET_VISIBILITY, within_limits
from render.keys import state_key
from render.random_streams import random_stream
from scenes import Scene, SceneError
from validate.acquire.acquire import Acquired
from validate.bank.design import ViewBank, draw_configurations
from validate.bank.leaderboard import CountVerdict
from validate.bank.measured import BankData, measure_all
from validate.bank.predicted import Contender, Predicted, PredictionTask, predict_all
from validate.prediction.detection import DetectionTrials, FittedDetection, detection_trials, fit_detection
from validate.prediction.limits import FittedLimits, fit_limits
from validate.prediction.weights import (
    Fitted,
    factor_covariances,
    fit_best_form,
    fit_scale,
    model_covariance,
    pixel_moments,
    scaled,
)

__all__ = [
    "BASES",
    "CALIBRATED_LIMITS",
    "CALIBRATED_R",
    "FREE_MODELS",
    "FULL_MODEL",
    "PHYSICAL_WHOLE",
    "SCALED",
    "appearance_of",
    "calibrated",
    "check_models",
    "data_of",
    "detection_model_of",
    "detection_of",
    "judged",
    "limits_of",
    "noise_models",
    "predictions",
    "requested_pairs",
    "scales_of",
    "scene_contenders",
    "verdict_of",
    "visibilities",
]


# Models that need no measurement.
FREE_MODELS = ("as-printed", "corrected", "physical", "identity")
# Under the models other than the one under which all metrics are evaluated.
ALWAYS = ("pss", "pss-single-frame", "d-optimality-count-zero", "e-optimality-count-zero")
# R and limits of detection, both fitted on the training views; all metrics are judged under it.
CALIBRATED_LIMITS = "calibrated, limits"
# The fitted R with all that was fitted of detection.
FULL_MODEL = "calibrated"
# What is judged under the full model: the metrics that expected counts define.
OF_FULL_MODEL = ("pss", "pss-single-frame", "visibility-count", "visible-share")
# The fitted R alone, and the one that fits nothing with whole markers in place of their centres.
CALIBRATED_R, PHYSICAL_WHOLE = "calibrated R", "physical, whole markers"
# The models whose unit is open, times one scalar fitted on the training views.
SCALED = {name: f"{name}, scaled" for name in SCALED_MODELS}
# What every contender is compared with, pairwise: no R at all, the same in the unit that fits, the one that fits
# nothing, and the one that all metrics are judged under.
BASES = ("identity", SCALED["identity"], "physical", CALIBRATED_LIMITS)


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


def detection_model_of(scene: Scene, calibration: Calibration) -> DetectionModel | None:
    """The calibration's probability of detection by the scene's sensor; None if it has none."""
    return DetectionModel(calibration.detection, scene.sensor) if calibration.detection else None


def noise_models(scene: Scene, calibration: Calibration) -> list[NoiseModel]:
    """The R_k that are judged in a scene, with its own sensor, switched-off factors and scale of Eq. 11.

    Those that are scaled as a whole are among them if the calibration has their scales; the calibrated R is the last.
    """
    # Under the names that the tables have, which a model without some of its factors would extend.
    free = {name: dataclasses.replace(scene.noise_model(name), name=name) for name in FREE_MODELS}
    in_unit = [scaled(free[name], scale, SCALED[name]) for name, scale in calibration.scales.items()]
    return [
        *free.values(),
        *in_unit,
        NoiseModel(calibration.name, calibration.factors(scene.sensor, scene.sensor.ccd_noise)),
    ]


def visibilities(scene: Scene, calibration: Calibration) -> dict[str, tuple[VisibilityTest, ...]]:
    """What may count as visible: the paper's points, whole markers, and those within the fitted limits."""
    fitted = within_limits(calibration.limits, scene.sensor)
    return {"points": VISIBILITY_TESTS, "whole markers": TARGET_VISIBILITY, "fitted limits": fitted}


def scene_contenders(scene: Scene, calibration: Calibration) -> list[Contender]:
    """What is judged in a scene: each R with the scene's [metric], and those that know of whole markers in any case."""
    models = {model.name: model for model in noise_models(scene, calibration)}
    visible = visibilities(scene, calibration)
    return [
        *(Contender(name, models[name], scene.visibility) for name in FREE_MODELS),
        *(Contender(SCALED[name], models[SCALED[name]], scene.visibility) for name in calibration.scales),
        Contender(PHYSICAL_WHOLE, models["physical"], visible["whole markers"]),
        Contender(CALIBRATED_R, models[calibration.name], scene.visibility),
        Contender(CALIBRATED_LIMITS, models[calibration.name], visible["fitted limits"]),
        _full_model(models[calibration.name], visible, detection_model_of(scene, calibration)),
    ]


def _full_model(
    noise: NoiseModel, visible: Mapping[str, tuple[VisibilityTest, ...]], detection: DetectionModel | None
) -> Contender:
    """The fitted R with the probability of detection; with the limits, if the calibration has no such probability."""
    if detection is None:
        return Contender(FULL_MODEL, noise, visible["fitted limits"])
    return Contender(FULL_MODEL, noise, visible["whole markers"], detection)


def judged(contenders: Sequence[Contender]) -> dict[str, dict[str, list[str]]]:
    """What was predicted with, for run.json: by the contender's name, the factors of its R and its visibility tests."""
    return {
        contender.name: {
            "noise": [factor.name for factor in contender.noise.factors],
            "visibility": [test.name for test in contender.visibility]
            + ["probability of detection"] * (contender.detection is not None),
        }
        for contender in contenders
    }


def check_models(scene: Scene, command: str, used: Collection[str]) -> None:
    """Refuse a scene whose list of noise models is not that of a command which compares the same ones always.

    Args:
        used: those that need no calibration; of them, "identity" may be in the file or not.

    Raises:
        SceneError: with the list and what is allowed.
    """
    models = list(scene.resolved()["noise"]["models"])
    needed = [name for name in used if name != "identity"]
    if not set(needed) <= set(models) <= set(used):
        allowed = f"allowed with {command}, whose tables compare all of these: {json_text(needed)}, in any order"
        raise SceneError([f"{scene.path}: noise.models = {json_text(models)}; {allowed}"])


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
