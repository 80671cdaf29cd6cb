"""How well prediction follows measurement over the steps of a walk: Spearman's ρ and the log ratio.

Neighbouring steps look alike, and the runs share steps and views: intervals are those of a short correlated series,
with all runs of a step together (`validate.stats.series`). Beside each ρ of PSS stands that of the share of
markers that the same model expects to be seen: where the two are alike, PSS is a count.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from pss.hints import Floats, Row
from validate.schedule.results import KINDS, ScheduleResult
from validate.schedule.runs import limit_name
from validate.stats.intervals import weighted_spearman
from validate.stats.series import (
    median_interval,
    spearman_difference_interval,
    spearman_interval,
    step_correlation,
)

__all__ = ["ALL_RUNS", "agreement_rows", "with_ends"]


ALL_RUNS = "all"


def agreement_rows(result: ScheduleResult) -> list[Row]:
    """A row for each run, and for all runs of a zoom limit, noise model and kind."""
    runs = result.held.design.runs
    limits = list(dict.fromkeys(run.zoom_limit for run in runs))
    rows = []
    for limit in limits:
        of_limit = [index for index, run in enumerate(runs) if run.zoom_limit == limit]
        chosen = {runs[index].strategy: [index] for index in of_limit}
        for name, members in {**chosen, ALL_RUNS: of_limit}.items():
            for row in _rows(result, members):
                rows.append({"avatar": result.avatar, "zoom_limit": limit_name(limit), "strategy": name, **row})
    return rows


def _rows(result: ScheduleResult, members: list[int]) -> Iterator[Row]:
    for kind in KINDS:
        measured = result.curves["", kind].values[members]
        triangulated = result.counts["", kind].values[members]
        of_triangulated = float(weighted_spearman(triangulated.ravel(), measured.ravel()))
        for model in result.noise_models:
            predicted = result.curves[model, kind].values[members]
            seen = result.counts[model, kind].values[members]
            ratio = _log_ratios(predicted, measured)
            yield {
                "kind": kind,
                "noise_model": model,
                "n": predicted.size,
                **with_ends("spearman", spearman_interval(predicted, measured)),
                **with_ends("median_abs_log_ratio", median_interval(np.abs(ratio))),
                "median_log_ratio": _median(ratio),
                **with_ends("visible_share_spearman", spearman_interval(seen, measured)),
                **with_ends("minus_visible_share", spearman_difference_interval(predicted, seen, measured)),
                "triangulated_share_spearman": of_triangulated,
                "step_correlation": step_correlation(predicted, measured),
            }


def with_ends(name: str, found: tuple[float, float, float]) -> Row:
    """Columns of an estimate and its interval's ends."""
    estimate, low, high = found
    return {name: estimate, f"{name}_ci_low": low, f"{name}_ci_high": high}


def _log_ratios(predicted: Floats, measured: Floats) -> Floats:
    """ln(predicted/measured): infinite where one of them is zero, nan where both are, which agree without a ratio."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(predicted) - np.log(measured))


def _median(values: Floats) -> float:
    """Of those that are not nan; nan where all are."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return float(np.nanmedian(values))
