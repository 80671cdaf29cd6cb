"""Ranking of the strategies: by predicted PSS, against each measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pss.hints import Floats, Row
from validate.schedule.results import KINDS, ScheduleResult
from validate.schedule.runs import limit_name
from validate.stats.intervals import interval, sample_interval, weighted_spearman
from validate.sweeps.rows import THRESHOLDS_MM

__all__ = ["Measure", "measures", "ranking_rows", "strategy_rows"]


# Below a sweep's thresholds: the errors of these markers are tenths and hundredths of a millimetre.
FINE_MM = (0.02, 0.05, 0.1, 0.2)


@dataclass(frozen=True, eq=False)
class Measure:
    """A figure of each of R runs over its whole walk, (R,), with resamples (B, R)."""

    name: str
    values: Floats
    samples: Floats
    higher_is_better: bool

    @property
    def signed(self) -> tuple[Floats, Floats]:
        """Both, higher being better."""
        sign = 1.0 if self.higher_is_better else -1.0
        return sign * self.values, sign * self.samples


def measures(result: ScheduleResult) -> list[Measure]:
    """Measured PSS of every kind, shares of all markers under some millimetres, the median RMS, and what is counted."""
    replicates = result.replicates[result.noise_models[0]]
    runs, steps = result.shape
    found = [_mean_over_steps(f"measured PSS, {kind}", result, "", kind) for kind in KINDS]
    distance = np.array([np.linalg.norm(a.measured.errors.errors_m, axis=2) for a in result.assessments])
    for mm in (*FINE_MM, *THRESHOLDS_MM):
        under = (distance < mm / 1000).astype(float)  # nan is not under
        samples = np.einsum("bt,stn,bn->bs", replicates.trial_weights, under, replicates.point_weights, optimize=True)
        by_run = (under.mean(axis=(1, 2)).reshape(runs, steps), samples.reshape(-1, runs, steps))
        found.append(Measure(f"share under {mm} mm", by_run[0].mean(axis=1), by_run[1].mean(axis=2), True))
    rms = np.array([a.measured.errors.rms_m for a in result.assessments])
    rms = np.where(np.isfinite(rms), rms, np.inf).reshape(runs, -1)
    weights = np.tile(replicates.point_weights, (1, steps))
    medians = np.array([_weighted_medians(of_run, weights) for of_run in rms]).T
    found.append(Measure("median RMS", np.median(rms, axis=1), medians, False))
    found.append(_mean_share("share triangulated", result, "", "single frame"))
    return found


def _mean_share(name: str, result: ScheduleResult, model: str, kind: str) -> Measure:
    """The share of markers in PSS, over the whole walk."""
    counts = result.counts[model, kind]
    return Measure(name, counts.values.mean(axis=1), counts.samples.mean(axis=2), True)


def _mean_over_steps(name: str, result: ScheduleResult, model: str, kind: str) -> Measure:
    curves = result.curves[model, kind]
    return Measure(name, curves.values.mean(axis=1), curves.samples.mean(axis=2), True)


def _weighted_medians(values: Floats, weights: Floats) -> Floats:
    """The medians of (M,) values under each row of weights (B, M); infinite values count as such."""
    order = np.argsort(values)
    up_to = np.cumsum(weights[:, order], axis=1)
    at = (up_to >= 0.5 * up_to[:, -1:]).argmax(axis=1)
    return np.asarray(values[order][at])


def strategy_rows(result: ScheduleResult) -> list[Row]:
    """A row for each run and figure, with its rank: predicted PSS and share by each model, and each measure.

    Ranks are among the strategies of the same zoom limit, 1 being the best.
    """
    figures = [
        (model, _mean_over_steps(f"predicted PSS, {kind}", result, model, kind))
        for model in result.noise_models
        for kind in KINDS
    ]
    figures += [(model, _mean_share("predicted share seen", result, model, "filter")) for model in result.noise_models]
    figures += [("", measure) for measure in measures(result)]
    rows: list[Row] = []
    for limit, members in _by_limit(result).items():
        for model, figure in figures:
            values, samples = (part[..., members] for part in figure.signed)
            ranks, sampled = _ranks(values), _ranks(samples)
            low, high = sample_interval(figure.samples[:, members])
            rank_low, rank_high = sample_interval(sampled)
            for place, member in enumerate(members):
                rows.append(
                    {
                        "avatar": result.avatar,
                        "zoom_limit": limit,
                        "statistic": figure.name,
                        "noise_model": model,
                        "strategy": result.held.design.runs[member].strategy,
                        "value": float(figure.values[member]),
                        "ci_low": float(low[place]),
                        "ci_high": float(high[place]),
                        "rank": float(ranks[place]),
                        "rank_ci_low": float(rank_low[place]),
                        "rank_ci_high": float(rank_high[place]),
                    }
                )
    return rows


def ranking_rows(result: ScheduleResult) -> list[Row]:
    """A row for each model, kind and measure: Spearman's ρ over the strategies, and the regret of the chosen one.

    Columns `visible_share_…` have the same of a choice by the share of markers that the model expects to be seen.
    """
    rows: list[Row] = []
    measured = measures(result)
    for limit, members in _by_limit(result).items():
        for model in result.noise_models:
            for kind in KINDS:
                predicted = _mean_over_steps("", result, model, kind)
                counted = _mean_share("", result, model, kind)
                for measure in measured:
                    rows.append(
                        {
                            "avatar": result.avatar,
                            "zoom_limit": limit,
                            "noise_model": model,
                            "kind": kind,
                            "measure": measure.name,
                            **_agreement(result, members, predicted, measure),
                            **_by_count(_agreement(result, members, counted, measure)),
                        }
                    )
    return rows


def _by_count(row: Row) -> Row:
    """The columns of a choice by the count that are not those of the measure."""
    of_choice = ("spearman", "spearman_ci_low", "spearman_ci_high", "chosen", "regret")
    return {f"visible_share_{name}": row[name] for name in of_choice}


def _agreement(result: ScheduleResult, members: list[int], predicted: Measure, measure: Measure) -> Row:
    names = [result.held.design.runs[member].strategy for member in members]
    (x, x_samples), (y, y_samples) = (
        (values[members], samples[:, members]) for values, samples in (predicted.signed, measure.signed)
    )
    rho = float(weighted_spearman(x, y))
    samples = np.asarray(weighted_spearman(x_samples, y_samples))
    known = samples[np.isfinite(samples)]
    low, high = interval(known) if len(known) > len(samples) / 2 else (np.nan, np.nan)
    chosen, best = int(x.argmax()), int(y.argmax())
    if measure.higher_is_better:
        lost = 1 - y[chosen] / y[best] if y[best] > 0 else np.nan
    else:
        lost = 1 - y[best] / y[chosen] if np.isfinite(y[best]) else np.nan
    return {
        "strategies": len(members),
        "spearman": rho,
        "spearman_ci_low": float(low),
        "spearman_ci_high": float(high),
        "chosen": names[chosen],
        "best": names[best],
        "chosen_is_best_share": float((x_samples.argmax(axis=1) == y_samples.argmax(axis=1)).mean()),
        "regret": float(lost),
    }


def _by_limit(result: ScheduleResult) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for number, run in enumerate(result.held.design.runs):
        found.setdefault(limit_name(run.zoom_limit), []).append(number)
    return found


def _ranks(signed: Floats) -> Floats:
    """Mid-ranks along the last axis, 1 for the highest."""
    above = (signed[..., None, :] > signed[..., :, None]).sum(axis=-1)
    level = (signed[..., None, :] == signed[..., :, None]).sum(axis=-1)
    return np.asarray(above + (level + 1) / 2)
