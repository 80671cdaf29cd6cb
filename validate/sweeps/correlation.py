"""Correlation of metrics with measures over the steps of a sweep, with intervals: `correlation.csv`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pss import METRICS, Evaluation
from pss.hints import Floats, Row
from pss.metrics import CAMERAS_TO_OBSERVE
from validate.prediction.own_metrics import best_step, own_metrics
from validate.stats.intervals import interval_with, kendall, oracle_regret, pearson_log, regret, weighted_spearman
from validate.sweeps.derived import derived
from validate.sweeps.optima import trend
from validate.sweeps.replicates import SweepReplicates
from validate.sweeps.sweep import SweepResult

__all__ = ["SHARES_UNDER_MM", "Correlation", "correlation_rows", "headline", "own_rows"]


# mm. Errors of well set cameras are tenths of a millimetre: a share under 5 mm then only counts points.
SHARES_UNDER_MM = (5, 0.02, 0.05, 0.1, 0.2)
# A sweep of a dozen steps cannot distinguish forty metrics: it has the paper's own, the plainest measure, and what
# users bring of their own.
COMPARED = ("pss", "pss-single-frame", "worst-sigma", "visible-share")

# Whether each metric that may be flat is of the single-frame kind.
KINDS_OF_PSS = {"pss": False, "pss-single-frame": True}


@dataclass(frozen=True, eq=False)
class Series:
    """A number for each of S configurations, and its B resamples (B, S); None where it has none.

    Of a `flat` one the order of the configurations is chance, and nothing is correlated with it.
    """

    name: str
    values: Floats
    samples: Floats | None
    higher_is_better: bool
    halves: tuple[Floats, Floats] | None = None
    flat: bool = False


@dataclass(frozen=True)
class Correlation:
    """Spearman's ρ with its interval."""

    n: int
    rho: float
    low: float
    high: float


@derived
def correlation_rows(result: SweepResult) -> list[Row]:
    """Rows of a sweep: each metric and noise model against each measure, over configurations and over points."""
    rows: list[Row] = []
    counts = {len(configuration.cameras) for configuration in result.configurations}
    cameras = str(counts.pop()) if len(counts) == 1 else "all"
    one_step = len(result.assessments) < 2
    for model in result.noise_models:
        replicates = result.replicates[model]
        # Of one step there is no order.
        measures = [] if one_step else _measures(result, replicates)
        for metric in [] if one_step else _metrics(result, model, replicates):
            for measure in measures:
                sign = 1 if metric.higher_is_better == measure.higher_is_better else -1
                found = _correlate(metric, measure, sign)
                flat = metric.flat or measure.flat
                both = (metric.values, np.full_like(metric.values, np.nan) if flat else measure.values)
                rows.append(
                    _row(result, metric.name, model, "configuration", measure.name, cameras, found)
                    | {
                        "kendall": sign * kendall(*both),
                        "pearson_log": sign * pearson_log(*both),
                        "regret": _regret(metric, measure),
                        "oracle_regret": oracle_regret(*measure.halves) if measure.halves else np.nan,
                        "measured_flat": "yes" if measure.flat else "no",
                    }
                )
        rows += list(_point_rows(result, model, replicates, cameras))
    return rows


@derived
def own_rows(result: SweepResult) -> list[Row]:
    """Rows of own metrics alone, against measured single-frame PSS over the steps, with the step each would choose."""
    rows: list[Row] = []
    for model in result.noise_models if len(result.assessments) > 1 else ():
        measure = _measures(result, result.replicates[model])[0]
        of_users = _metrics(result, model, result.replicates[model])[len(COMPARED) :]
        for metric, series in zip(own_metrics(), of_users, strict=True):
            sign = 1 if metric.higher_is_better else -1
            best = best_step(metric, series.values)
            rows.append(
                _row(result, metric.name, model, "configuration", measure.name, "", _correlate(series, measure, sign))
                | {
                    "regret": _regret(series, measure),
                    "chosen": None if best is None else result.configurations[best].value,
                }
            )
    return rows


@derived
def headline(result: SweepResult, model: str, single_frame: bool) -> tuple[Correlation, float]:
    """ρ of predicted with measured PSS over the steps, of one kind, and the regret (nan for the filter kind)."""
    replicates = result.replicates[model]
    metric = _metrics(result, model, replicates)[1 if single_frame else 0]
    measure = _measures(result, replicates)[0 if single_frame else 1]
    return _correlate(metric, measure, 1), _regret(metric, measure)


def _correlate(metric: Series, measure: Series, sign: int) -> Correlation:
    if measure.flat or metric.flat:
        return Correlation(len(metric.values), np.nan, np.nan, np.nan)
    rho = sign * float(weighted_spearman(metric.values, measure.values))
    low = high = np.nan
    if metric.samples is not None and measure.samples is not None:
        samples = sign * np.asarray(weighted_spearman(metric.samples, measure.samples))
        known = samples[np.isfinite(samples)]
        if len(known) > len(samples) / 2:
            low, high = interval_with(rho, known)
    return Correlation(len(metric.values), rho, low, high)


def _regret(metric: Series, measure: Series) -> float:
    if measure.halves is None or metric.flat:
        return np.nan
    return regret(metric.values, *measure.halves, higher_is_better=metric.higher_is_better)


def _row(
    result: SweepResult, metric: str, model: str, level: str, measure: str, cameras: str, found: Correlation
) -> Row:
    return {
        "sweep": result.plan.sweep.name,
        "metric": metric,
        "noise_model": model,
        "level": level,
        "measure": measure,
        "cameras": cameras,
        "n": found.n,
        "spearman": found.rho,
        "spearman_ci_low": found.low,
        "spearman_ci_high": found.high,
    }


def _metrics(result: SweepResult, model: str, replicates: SweepReplicates) -> list[Series]:
    """The metrics that a sweep compares, those that are a mean over points with resamples."""
    evaluations = [assessment.predicted[model] for assessment in result.assessments]
    means = {"pss": _inverse_sigma, "pss-single-frame": _inverse_single_frame_sigma, "visible-share": _seen_twice}
    found = []
    for name in COMPARED:
        metric = METRICS[name]
        values = np.array([metric.score(evaluation) for evaluation in evaluations])
        samples = None
        if name in means:
            samples = replicates.point_weights @ np.array([means[name](e) for e in evaluations]).T
        else:
            samples = np.broadcast_to(values, (len(replicates.point_weights), len(values)))
        flat = name in KINDS_OF_PSS and trend(result, KINDS_OF_PSS[name], model).flat
        found.append(Series(name, values, samples, metric.higher_is_better, flat=flat))
    for metric in own_metrics():
        values = np.array([scores.values[metric.name] for scores in result.own_scores[model]])
        samples = np.broadcast_to(values, (len(replicates.point_weights), len(values)))
        found.append(Series(metric.name, values, samples, metric.higher_is_better))
    return found


def _inverse_sigma(evaluation: Evaluation) -> Floats:
    return np.nan_to_num(1 / evaluation.sigma_m)


def _inverse_single_frame_sigma(evaluation: Evaluation) -> Floats:
    return np.nan_to_num(1 / evaluation.single_frame_sigma_m)


def _seen_twice(evaluation: Evaluation) -> Floats:
    return (evaluation.visible.sum(axis=0) >= CAMERAS_TO_OBSERVE).astype(float)


def _measures(result: SweepResult, replicates: SweepReplicates) -> list[Series]:
    """Measured PSS of both kinds, the share of all points under 5 mm, and the median RMS over all points."""
    errors = [assessment.measured.errors for assessment in result.assessments]
    distance_m = np.array([np.linalg.norm(e.errors_m, axis=2) for e in errors])
    single, filtered = (trend(result, single_frame) for single_frame in (True, False))
    return [
        Series(
            "measured_pss_single_frame",
            single.values,
            single.samples,
            True,
            result.measured_halves(),
            single.flat,
        ),
        Series("measured_pss_filter", filtered.values, filtered.samples, True, None, filtered.flat),
        *(_share_under(limit, distance_m, replicates) for limit in SHARES_UNDER_MM),
        Series("median_rms_m", np.array([e.median_rms_m for e in errors]), None, False),
    ]


def _share_under(limit_mm: float, distance_m: Floats, replicates: SweepReplicates) -> Series:
    """The share of all trials of all points with an error below so many mm, of distances (S, T, N)."""
    under = (distance_m < limit_mm / 1000).astype(float)  # nan, not triangulated, is not under
    share = np.einsum("bt,stn,bn->bs", replicates.trial_weights, under, replicates.point_weights, optimize=True)
    halves = under[:, ::2].mean(axis=(1, 2)), under[:, 1::2].mean(axis=(1, 2))
    return Series(f"share_under_{limit_mm:g}mm", under.mean(axis=(1, 2)), share, True, halves)


def _point_rows(result: SweepResult, model: str, replicates: SweepReplicates, cameras: str) -> Iterator[Row]:
    """Predicted against measured RMS and σ per point, pooled over the steps; intervals from the points' weights."""
    pairs = {
        ("pss-single-frame", "measured_rms_m"): (
            [a.predicted[model].single_frame_rms_m for a in result.assessments],
            [a.measured.errors.rms_m for a in result.assessments],
        ),
        ("pss", "measured_filter_sigma_m"): (
            [a.predicted[model].sigma_m for a in result.assessments],
            [a.measured.filter_sigma_m for a in result.assessments],
        ),
    }
    for (metric, measure), (predicted, measured) in pairs.items():
        x, y = np.concatenate(predicted), np.concatenate(measured)
        point = np.tile(np.arange(len(predicted[0])), len(predicted))
        known = np.isfinite(x) & np.isfinite(y)
        x, y, point = x[known], y[known], point[known]
        if len(x) < 3:
            continue
        rho = float(weighted_spearman(x, y))
        low, high = interval_with(rho, weighted_spearman(x, y, replicates.point_weights[:, point]))
        found = Correlation(len(x), rho, low, high)
        yield _row(result, metric, model, "point", measure, cameras, found) | {
            "kendall": kendall(x, y),
            "pearson_log": pearson_log(x, y),
            "regret": np.nan,
            "oracle_regret": np.nan,
            "measured_flat": "",
        }
