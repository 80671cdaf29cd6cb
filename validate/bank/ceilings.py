"""Upper limits of a prediction: the oracle, split halves, and parts replaced by measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pss import NoiseModel
from pss.cameras.views import Views
from pss.hints import Floats, Row
from pss.riccati.covariances import root_trace
from pss.visibility.points import VisibilityTest
from validate.acquire.acquire import Acquired
from validate.bank.design import ViewBank
from validate.bank.judge import appearance_of, predictions
from validate.bank.leaderboard import CountVerdict, single_frame_terms
from validate.bank.measured import BankData, residual_moments
from validate.bank.predicted import GivenCovariance, GivenVisibility
from validate.prediction.contenders import Contender
from validate.stats.consistency import of_errors, pooled_spearman, root_trace_of
from validate.stats.ranking import Judged, judge_against, with_interval

__all__ = ["attenuation_ceiling", "oracle_rows", "parts_rows"]


# A view is known to find a marker if it does so in this share of the trials.
FOUND_SHARE = 0.5
KNOWN = "known"


def oracle_rows(bank: ViewBank, data: BankData, verdict: CountVerdict) -> list[Row]:
    """What a prediction could reach at best, and what the pixel errors of other captures reach.

    "Ceiling": the ρ of the true values, without the noise of captures, with what was measured over all trials. It is
    what a perfect prediction reaches, and no other can be better but by chance: `attenuation_ceiling` of the split-half
    reliability, the ranks of the measured PSS of the one half of the trials against the other's. What every capture
    repeats, as the bias of a render, is taken to be true.

    "Oracle": its R are the moments of the pixel errors on one half of the trials, and it is judged on the other half.
    It uses half of the trials and is evaluated on half, so that it may be below a contender evaluated on all.
    """
    halves = [data.residuals()[:, first::2] for first in (0, 1)]
    chance = verdict.chance
    measured = [[found.errors.halves()[half] for found in verdict.measured] for half in (0, 1)]
    terms = [np.array([errors.inverse_sigma for errors in half]) for half in measured]
    rms = [np.array([errors.rms_m for errors in half]) for half in measured]
    found, pooled, ratios = [], [], []
    contenders = tuple(
        Contender(
            f"oracle {half}",
            NoiseModel("oracle", (GivenCovariance(bank.cameras, residual_moments(residuals)),)),
        )
        for half, residuals in enumerate(halves)
    )
    predicted = predictions(bank, contenders, verdict.configurations, None)
    for contender, other in zip(contenders, (1, 0), strict=True):
        own = np.array([single_frame_terms(p[contender.name]) for p in predicted])
        found.append(judge_against(own, terms[other], chance))
        expected = np.array([root_trace(p[contender.name].covariance_m2) for p in predicted])
        pooled.append(pooled_spearman(expected, rms[other], chance))
        ratio = np.log(expected / rms[other])
        ratios.append(float(np.median(np.abs(ratio[np.isfinite(ratio)]))))
    reliability = judge_against(terms[0], terms[1], chance)
    points = pooled_spearman(rms[0], rms[1], chance)
    rows = {
        "ceiling, configurations": attenuation_ceiling(reliability),
        "ceiling, points": attenuation_ceiling(points),
        "oracle, configurations": _mean(found),
        "oracle, points": _mean(pooled),
        "split halves, configurations": reliability,
        "split halves, points": points,
    }
    ratio_of = {"oracle, points": float(np.mean(ratios))}
    return [
        {
            "cameras": verdict.cameras,
            "ceiling": name,
            **with_interval("spearman", judged),
            "median_abs_log_ratio": ratio_of.get(name, float("nan")),
        }
        for name, judged in rows.items()
    ]


def parts_rows(
    bank: ViewBank,
    data: BankData,
    verdict: CountVerdict,
    models: Sequence[NoiseModel],
    visibilities: Mapping[str, tuple[VisibilityTest, ...]],
    acquired: Acquired,
) -> list[Row]:
    """Parts of the prediction exchanged for what was measured, one at a time: which of them holds it back?

    Each R with each kind of visibility, then for a prediction that is given which views find which marker (in half of
    the trials or more), then the pixel errors themselves as R (of the same trials: the upper end, and no prediction).
    """
    state = bank.scene.state
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    found = (GivenVisibility(bank.cameras, data.detected.mean(axis=1) >= FOUND_SHARE),)
    moments = GivenCovariance(bank.cameras, residual_moments(data.residuals()))
    parts = [(model, kind, tests) for model in models for kind, tests in (*visibilities.items(), (KNOWN, found))]
    parts.append((NoiseModel("measured pixel errors", (moments,)), KNOWN, found))
    contenders = tuple(Contender(f"{model.name}, {kind}", model, tests) for model, kind, tests in parts)
    found_by_all = predictions(bank, contenders, verdict.configurations, views.appearance)
    chance = verdict.chance
    errors = np.array([f.errors.errors_m for f in verdict.measured])
    rms = np.array([f.errors.rms_m for f in verdict.measured])
    terms = np.array([f.errors.inverse_sigma for f in verdict.measured])
    rows = []
    for contender, (model, kind, _) in zip(contenders, parts, strict=True):
        predicted = [of_all[contender.name] for of_all in found_by_all]
        covariance = np.array([p.covariance_m2 for p in predicted])
        ranked = judge_against(np.array([single_frame_terms(p) for p in predicted]), terms, chance)
        rows.append(
            {
                "cameras": verdict.cameras,
                "noise_model": model.name,
                "visibility": kind,
                **with_interval("spearman", ranked),
                **of_errors(errors, covariance).row(chance),
                **with_interval("point_spearman", pooled_spearman(root_trace_of(covariance), rms, chance)),
            }
        )
    return rows


def attenuation_ceiling(halves: Judged) -> Judged:
    """Largest expected correlation of a prediction with what all trials measure, from that of the two halves.

    √(2r/(1 + r)): the Spearman-Brown reliability of twice the trials is the share of the measured variance that is no
    noise, and the correlation with the noise-free values its root (Spearman 1904, 1910). 0 where r is below 0.
    """

    def of(r: Floats) -> Floats:
        safe = np.clip(r, 0.0, 1.0)
        return np.asarray(np.sqrt(2 * safe / (1 + safe)))

    return halves.resamples.judged(float(of(np.asarray(halves.estimate))), of(halves.samples), 1.0)


def _mean(judged: Sequence[Judged]) -> Judged:
    estimate = float(np.mean([j.estimate for j in judged]))
    return judged[0].resamples.judged(estimate, np.mean([j.samples for j in judged], axis=0), 1.0)
