"""From detections to verdicts: calibrate on the training views, predict and measure the held-out configurations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pss import METRICS, Appearance, NoiseModel, noise_model
from pss.covariances import root_trace
from pss.noise import CALIBRATION_FACTORS, Calibration
from pss.views import Views
from render.view import random_stream, state_key
from scenes import Scene
from validate.acquire import Acquired
from validate.bank.consistency import anisotropy, of_errors, of_moments, pooled_spearman, sandwich
from validate.bank.design import ViewBank, draw_configurations
from validate.bank.measured import BankData, measure_all
from validate.bank.predicted import GivenCovariance, Predicted, PredictionTask, predict_all
from validate.bank.ranking import Judged, Resamples, judge_against
from validate.bank.verdict import RESAMPLES, CountVerdict
from validate.calibrate import Fitted, factor_covariances, fit_best_form, pixel_moments

__all__ = [
    "FREE_MODELS",
    "asked_pairs",
    "calibrated",
    "consistency_rows",
    "data_of",
    "detection_row",
    "oracle_rows",
    "pixel_rows",
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


# ---- the oracle ------------------------------------------------------------------------------------------------------


def oracle_rows(bank: ViewBank, data: BankData, verdict: CountVerdict, rng: np.random.Generator) -> list[Row]:
    """What a perfect R could reach: moments of the pixel errors on one half of the trials, judged on the other half.

    Beside it the split-half reliability: the ranks of the measured PSS of the one half against the other's.
    """
    state = bank.scene.state
    halves = [data.residuals()[:, first::2] for first in (0, 1)]
    chance = Resamples.drawn(verdict.configurations, len(state.points_m), rng, RESAMPLES)
    measured = [[found.errors.halves()[half] for found in verdict.measured] for half in (0, 1)]
    terms = [np.array([errors.inverse_sigma for errors in half]) for half in measured]
    rms = [np.array([errors.rms_m for errors in half]) for half in measured]
    found, pooled, ratios = [], [], []
    for half, other in ((0, 1), (1, 0)):
        model = NoiseModel("oracle", (GivenCovariance(bank.cameras, _moments(halves[half])),))
        task = PredictionTask(
            bank.cameras, state.points_m, state.normals, state.occluders, None, data.process, (model,), {"oracle": ()}
        )
        predicted = predict_all(task, verdict.configurations.tolist())
        oracle = CountVerdict(verdict.cameras, verdict.configurations, verdict.measured, predicted)
        found.append(judge_against(oracle.terms("oracle", "pss-single-frame"), terms[other], chance))
        expected = np.array([root_trace(p["oracle"].covariance_m2) for p in predicted])
        pooled.append(pooled_spearman(expected, rms[other], chance))
        ratio = np.log(expected / rms[other])
        ratios.append(float(np.median(np.abs(ratio[np.isfinite(ratio)]))))
    reliability = judge_against(terms[0], terms[1], chance)
    points = pooled_spearman(rms[0], rms[1], chance)
    return [
        _oracle_row(verdict, "oracle, configurations", _mean(found)) | {"median_abs_log_ratio": float("nan")},
        _oracle_row(verdict, "oracle, points", _mean(pooled)) | {"median_abs_log_ratio": float(np.mean(ratios))},
        _oracle_row(verdict, "split halves, configurations", reliability) | {"median_abs_log_ratio": float("nan")},
        _oracle_row(verdict, "split halves, points", points) | {"median_abs_log_ratio": float("nan")},
    ]


def _moments(residuals: Floats) -> Floats:
    """px², second moments (V, N, 2, 2) of residuals (V, T, N, 2); nan with fewer than three."""
    seen = np.isfinite(residuals[..., 0])
    known = np.where(seen[..., None], residuals, 0.0)
    count = seen.sum(axis=1)[..., None, None]
    moment = np.einsum("vtni,vtnj->vnij", known, known) / np.maximum(count, 1)
    return np.where(count >= 3, moment, np.nan)


def _mean(judged: Sequence[Judged]) -> Judged:
    return Judged(
        float(np.mean([j.estimate for j in judged])), np.asarray(np.mean([j.samples for j in judged], axis=0))
    )


def _oracle_row(verdict: CountVerdict, what: str, judged: Judged) -> Row:
    low, high = judged.interval
    return {
        "cameras": verdict.cameras,
        "ceiling": what,
        "spearman": judged.estimate,
        "spearman_ci_low": low,
        "spearman_ci_high": high,
    }


# ---- consistency -----------------------------------------------------------------------------------------------------


def pixel_rows(bank: ViewBank, data: BankData, acquired: Acquired, models: Sequence[NoiseModel]) -> list[Row]:
    """Each model's R, and each detection's own covariance, against the pixel errors of all views."""
    state = bank.scene.state
    residuals = data.residuals()
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    rng = random_stream(data.seed, bank.scene.path.name, "pixel level")
    chance = Resamples.drawn(np.arange(len(bank.cameras))[:, None], len(state.points_m), rng, RESAMPLES)
    trials = np.isfinite(residuals[..., 0]).sum(axis=1)
    rows = []
    for model in models:
        covariance = np.broadcast_to(
            model.of_views(views).matrix(len(bank.cameras), len(state.points_m)), (*trials.shape, 2, 2)
        )
        rows.append(_pixel_row(model.name, residuals, covariance, trials, chance))
    seen = np.isfinite(residuals[..., :1, None])
    total = np.where(seen, data.covariance, 0.0).sum(axis=1)
    own = np.where(trials[..., None, None] > 0, total / np.maximum(trials, 1)[..., None, None], np.nan)
    rows.append(_pixel_row("detection's own", residuals, own, trials, chance))
    return rows


def _pixel_row(name: str, residuals: Floats, covariance: Floats, trials: NDArray[np.int64], chance: Resamples) -> Row:
    covariance = np.where(np.isfinite(covariance), covariance, np.nan)
    found = of_errors(residuals, covariance)
    enough = np.isfinite(found.log_ratio) & (trials >= 10)
    # The logarithm of a variance over n trials of two axes has the variance 2/(2n): that of its root a quarter of it.
    sampling = float(np.mean(1 / (4 * trials[enough]))) if enough.any() else float("nan")
    scatter = float(np.var(found.log_ratio[enough])) if enough.any() else float("nan")
    return {
        "level": "pixel",
        "cameras": 1,
        "noise_model": name,
        **found.row(chance),
        "log_scatter": float(np.sqrt(max(scatter - sampling, 0.0))),
    }


def consistency_rows(
    verdict: CountVerdict, bank: ViewBank, data: BankData, models: Sequence[NoiseModel], acquired: Acquired
) -> list[Row]:
    """Single frame, and the filter where it was run, of each model over the configurations of one camera count."""
    rng = random_stream(data.seed, bank.scene.path.name, f"consistency of {verdict.cameras}")
    chance = Resamples.drawn(verdict.configurations, len(data.points_m), rng, RESAMPLES)
    errors = np.array([found.errors.errors_m for found in verdict.measured])
    moment = np.array([found.errors.second_moment_m2 for found in verdict.measured])
    trials = np.array([found.errors.detections for found in verdict.measured])
    rms = np.array([found.errors.rms_m for found in verdict.measured])
    rows = []
    for model in models:
        of_model = [found[model.name] for found in verdict.predicted]
        covariance = np.array([found.covariance_m2 for found in of_model])
        ratio = _sandwich_medians(verdict, bank, data, model, acquired)
        rows.append(
            {
                "level": "single frame",
                "cameras": verdict.cameras,
                "noise_model": model.name,
                **of_errors(errors, covariance).row(chance),
                **_with_interval("point_spearman", pooled_spearman(_rms(covariance), rms, chance)),
                **anisotropy(moment, covariance, trials),
                "sandwich_over_claimed_median": ratio[0],
            }
        )
        rows += _filter_rows(verdict, model.name, of_model, ratio[1])
    return rows


def _filter_rows(verdict: CountVerdict, name: str, predicted: Sequence[Predicted], ratio: float) -> list[Row]:
    rows = []
    for kind, attribute in (("prior", "prior_m2"), ("posterior", "posterior_m2")):
        moments = [getattr(found, f"{kind}_moment_m2") for found in verdict.measured]
        if any(moment is None for moment in moments):
            return []
        found = of_moments(np.array(moments), np.array([getattr(p, attribute) for p in predicted]))
        known = found[np.isfinite(found)]
        rows.append(
            {
                "level": f"filter, {kind}",
                "cameras": verdict.cameras,
                "noise_model": name,
                "cells": int(known.size),
                "predicted_over_measured_rms_median": float(np.median(known)),
                "median_abs_log_ratio": float(np.median(np.abs(np.log(known)))),
                "median_log_ratio": float(np.median(np.log(known))),
                "sandwich_over_claimed_median": ratio,
            }
        )
    return rows


def _sandwich_medians(
    verdict: CountVerdict, bank: ViewBank, data: BankData, model: NoiseModel, acquired: Acquired
) -> tuple[float, float]:
    """Median over configurations and points of actual over claimed √tr, weighted by the model's R: frame and filter."""
    state = bank.scene.state
    true = _moments(data.residuals())
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    with np.errstate(divide="ignore", invalid="ignore"):
        claimed = np.broadcast_to(model.of_views(views).matrix(*true.shape[:2]), true.shape)
    jacobians = np.array([camera.jacobian(state.points_m) for camera in bank.cameras])
    found = []
    q = float(data.process.Q[0, 0])
    for chosen, predicted in zip(verdict.configurations, verdict.predicted, strict=True):
        seen = predicted[model.name].visible & np.isfinite(true[chosen]).all(axis=(-2, -1))
        seen &= np.isfinite(claimed[chosen]).all(axis=(-2, -1))
        cell = seen[..., None, None]
        found.append(
            sandwich(
                np.where(cell, jacobians[chosen], 0.0),
                np.where(cell, claimed[chosen], np.eye(2)),
                np.where(cell, true[chosen], np.eye(2)),
                q,
            )
        )
    ratio = np.array(found)
    return float(np.nanmedian(ratio[:, 0])), float(np.nanmedian(ratio[:, 1]))


def detection_row(bank: ViewBank, data: BankData, verdict: CountVerdict) -> Row:
    """Predicted visible × detected, over views and markers in a configuration's predictions and all trials."""
    visible = np.zeros((len(bank.cameras), len(data.points_m)), dtype=bool)
    for chosen, predicted in zip(verdict.configurations, verdict.predicted, strict=True):
        visible[chosen] = next(iter(predicted.values())).visible
    used = np.unique(verdict.configurations)
    rate = data.detected[used].mean(axis=1)
    seen = visible[used]
    return {
        "visible_detected": float((rate * seen).mean()),
        "visible_missed": float(((1 - rate) * seen).mean()),
        "hidden_detected": float((rate * ~seen).mean()),
        "hidden_missed": float(((1 - rate) * ~seen).mean()),
        "views": len(used),
    }


def _rms(covariance: Floats) -> Floats:
    return np.asarray(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1)))


def _with_interval(name: str, judged: Judged) -> Row:
    low, high = judged.interval
    return {name: judged.estimate, f"{name}_ci_low": low, f"{name}_ci_high": high}
