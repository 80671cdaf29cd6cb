"""How well prediction follows measurement over the steps of a walk: Spearman's ρ and the log ratio, by block bootstrap.

Neighbouring steps look alike, and the runs share steps and views: so whole blocks of steps are drawn, the same ones for
all runs (Künsch 1989, circular as by Politis & Romano 1992).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from render.view import random_stream
from validate.hallway.results import KINDS, ScheduleResult
from validate.hallway.runs import limit_name
from validate.hallway.study import MODELS
from validate.intervals import interval, sample_interval, weighted_spearman

__all__ = ["ALL_RUNS", "agreement_rows", "circular_blocks"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Row = dict[str, object]

RESAMPLES = 1000
ALL_RUNS = "all"


def circular_blocks(steps: int, resamples: int, rng: np.random.Generator) -> Integers:
    """Resampled steps, (B, K): blocks of about the cube root of K, from anywhere, the first following the last."""
    length = max(1, round(steps ** (1 / 3)))
    starts = rng.integers(steps, size=(resamples, -(-steps // length)))
    blocks = (starts[..., None] + np.arange(length)) % steps
    return blocks.reshape(resamples, -1)[:, :steps]


def agreement_rows(result: ScheduleResult) -> list[Row]:
    """A row for each run, and for all runs of a zoom limit, noise model and kind."""
    runs, said = result.held.design.runs, result.held.design.schedule.said
    limits = list(dict.fromkeys(run.zoom_limit for run in runs))
    rng = random_stream(said.seed, result.avatar, "blocks of steps")
    resampled = circular_blocks(result.shape[1], RESAMPLES, rng)
    rows = []
    for limit in limits:
        of_limit = [index for index, run in enumerate(runs) if run.zoom_limit == limit]
        chosen = {runs[index].strategy: [index] for index in of_limit}
        for name, members in {**chosen, ALL_RUNS: of_limit}.items():
            for row in _rows(result, members, resampled):
                rows.append({"avatar": result.avatar, "zoom_limit": limit_name(limit), "strategy": name, **row})
    return rows


def _rows(result: ScheduleResult, members: list[int], resampled: Integers) -> Iterator[Row]:
    for kind in KINDS:
        measured = result.curves["", kind].values[members]
        for model in MODELS:
            predicted = result.curves[model, kind].values[members]
            # (B, members, K): the same steps of every run.
            x, y = (values[:, resampled].swapaxes(0, 1).reshape(len(resampled), -1) for values in (predicted, measured))
            rho = float(weighted_spearman(predicted.ravel(), measured.ravel()))
            samples = np.asarray(weighted_spearman(x, y))
            low, high = interval(samples[np.isfinite(samples)]) if np.isfinite(samples).any() else (np.nan, np.nan)
            ratios = _log_ratios(x, y)
            ratio = _log_ratios(predicted.ravel(), measured.ravel())
            ratio_low, ratio_high = sample_interval(_medians(np.abs(ratios)))
            yield {
                "kind": kind,
                "noise_model": model,
                "n": predicted.size,
                "spearman": rho,
                "spearman_ci_low": float(low),
                "spearman_ci_high": float(high),
                "median_abs_log_ratio": float(_medians(np.abs(ratio))),
                "median_abs_log_ratio_ci_low": float(ratio_low),
                "median_abs_log_ratio_ci_high": float(ratio_high),
                "median_log_ratio": float(_medians(ratio)),
            }


def _log_ratios(predicted: Floats, measured: Floats) -> Floats:
    """ln(predicted/measured): infinite where one of them is zero, nan where both are, which agree without a ratio."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(predicted) - np.log(measured))


def _medians(values: Floats) -> Floats:
    """Along the last axis, of those that are not nan; nan where all are."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(np.nanmedian(values, axis=-1))
