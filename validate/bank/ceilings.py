"""How good could a prediction be? The oracle, split halves, and parts exchanged for what was measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pss import NoiseModel
from pss.covariances import root_trace
from pss.views import Views
from render.view import random_stream
from validate.acquire import Acquired
from validate.bank.consistency import of_errors, pooled_spearman, root_trace_of
from validate.bank.design import ViewBank
from validate.bank.measured import BankData, residual_moments
from validate.bank.predicted import GivenCovariance, PredictionTask, predict_all
from validate.bank.ranking import Judged, Resamples, judge_against, with_interval
from validate.bank.study import appearance_of
from validate.bank.verdict import RESAMPLES, CountVerdict, single_frame_terms

__all__ = ["oracle_rows", "parts_rows"]

Floats = NDArray[np.float64]
Row = dict[str, object]

# A view is known to find a marker if it does so in this share of the trials.
FOUND_SHARE = 0.5


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
        model = NoiseModel("oracle", (GivenCovariance(bank.cameras, residual_moments(halves[half])),))
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


def parts_rows(
    bank: ViewBank, data: BankData, verdict: CountVerdict, models: Sequence[NoiseModel], acquired: Acquired
) -> list[Row]:
    """Parts of the prediction exchanged for what was measured, one at a time: which of them holds it back?

    Each R as it is, then the same R for a prediction that knows which views find which marker (in half of the trials or
    more), then the pixel errors themselves as R (of the same trials: the upper end, and no prediction).
    """
    state = bank.scene.state
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    found = (data.detected.mean(axis=1) >= FOUND_SHARE)[..., None, None]
    tables: list[tuple[str, NoiseModel | None, Floats | None]] = [(model.name, model, None) for model in models]
    for model in models:
        with np.errstate(divide="ignore", invalid="ignore"):
            covariance = np.broadcast_to(
                model.of_views(views).matrix(len(bank.cameras), len(state.points_m)), (*found.shape[:2], 2, 2)
            )
        tables.append((f"{model.name}, detection known", None, np.where(found, covariance, np.nan)))
    moments = residual_moments(data.residuals())
    tables.append(("measured pixel errors, detection known", None, np.where(found, moments, np.nan)))
    rng = random_stream(data.seed, bank.scene.path.name, f"parts of {verdict.cameras}")
    chance = Resamples.drawn(verdict.configurations, len(state.points_m), rng, RESAMPLES)
    errors = np.array([f.errors.errors_m for f in verdict.measured])
    rms = np.array([f.errors.rms_m for f in verdict.measured])
    terms = np.array([f.errors.inverse_sigma for f in verdict.measured])
    rows = []
    for name, model, table in tables:
        if model is not None:
            predicted = [p[name] for p in verdict.predicted]
        else:
            assert table is not None
            known = NoiseModel(name, (GivenCovariance(bank.cameras, table),))
            task = PredictionTask(
                bank.cameras, state.points_m, state.normals, state.occluders, None, data.process, (known,), {name: ()}
            )
            predicted = [p[name] for p in predict_all(task, verdict.configurations.tolist())]
        covariance = np.array([p.covariance_m2 for p in predicted])
        ranked = judge_against(np.array([single_frame_terms(p) for p in predicted]), terms, chance)
        rows.append(
            {
                "cameras": verdict.cameras,
                "prediction": name,
                **with_interval("spearman", ranked),
                **of_errors(errors, covariance).row(chance),
                **with_interval("point_spearman", pooled_spearman(root_trace_of(covariance), rms, chance)),
            }
        )
    return rows


def _mean(judged: Sequence[Judged]) -> Judged:
    return Judged(
        float(np.mean([j.estimate for j in judged])), np.asarray(np.mean([j.samples for j in judged], axis=0)), 1.0
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
