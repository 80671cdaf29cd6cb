"""Paired differences of ρ between noise models, on the same resamples."""

from __future__ import annotations

from collections.abc import Sequence

from pss.hints import Row
from validate.bank.leaderboard import CountVerdict, measures
from validate.stats.ranking import Ranked, with_interval

__all__ = ["METRICS_OF_R", "difference_rows"]


# The paper's metric, of the filter and of one frame.
METRICS_OF_R = ("pss", "pss-single-frame")


def difference_rows(verdict: CountVerdict, contenders: Sequence[str], bases: Sequence[str]) -> list[Row]:
    """A row for each contender less each of `bases`, by both kinds of PSS and each measure: the difference of ρ."""
    ranked = {
        (metric, name): Ranked.of(verdict.terms(name, metric), verdict.chance)
        for metric in METRICS_OF_R
        for name in contenders
    }
    rows: list[Row] = []
    for measure in measures(verdict.measured):
        measured, sign = Ranked.of(measure.values, verdict.chance), 1 if measure.higher_is_better else -1
        judged = {pair: found.against(measured, sign) for pair, found in ranked.items()}
        rows += [
            {
                "cameras": verdict.cameras,
                "measure": measure.name,
                "metric": metric,
                "noise_model": name,
                "baseline": base,
                "n": len(verdict.configurations),
                **with_interval("spearman_difference", judged[metric, name].minus(judged[metric, base])),
            }
            for metric in METRICS_OF_R
            for name in contenders
            for base in bases
            if name != base
        ]
    return rows
