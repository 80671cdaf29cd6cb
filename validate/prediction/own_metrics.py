"""Metrics that users bring by entry point (`pss.METRICS`, docs/own-metric.md): their numbers and their table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from pss import METRICS, Evaluation, Metric
from pss.hints import Row
from validate.stats.optimum import NO_OPTIMUM

__all__ = ["OWN_COLUMN", "OwnScores", "best_step", "failures_of", "own_metrics", "own_scores", "own_table"]

OWN_COLUMN = "metric_"
"""What the columns of own metrics begin with, the metric's name behind it."""


@dataclass(frozen=True)
class OwnScores:
    """The own metrics of one configuration by name: nan, and the cause, where a score raised or gave no number."""

    values: dict[str, float]
    failures: dict[str, str]

    @property
    def columns(self) -> Row:
        """The same as columns of a table."""
        return {f"{OWN_COLUMN}{name}": value for name, value in self.values.items()}


def own_metrics() -> tuple[Metric, ...]:
    """The metrics of installed entry points."""
    return METRICS.of_entry_points()


def own_scores(evaluation: Evaluation) -> OwnScores:
    """What each own metric gives for a configuration."""
    values, failures = {}, {}
    for metric in own_metrics():
        try:
            values[metric.name] = float(metric.score(evaluation))
        except Exception as error:  # somebody else's code: it must not take a run's tables along
            values[metric.name] = np.nan
            failures[metric.name] = f"{type(error).__name__}: {error}"
    return OwnScores(values, failures)


def failures_of(scores: Iterable[OwnScores]) -> list[str]:
    """A line for each own metric that failed, with its first cause."""
    first: dict[str, str] = {}
    for each in scores:
        for name, cause in each.failures.items():
            first.setdefault(name, cause)
    return [f"metric {name} has no number ({cause})" for name, cause in first.items()]


def best_step(metric: Metric, values: NDArray[np.float64]) -> int | None:
    """The step that a metric would choose, of (S,) values; None where it has no number at any."""
    known = ~np.isnan(values)
    if not known.any():
        return None
    signed = np.where(known, values if metric.higher_is_better else -values, -np.inf)
    return int(np.argmax(np.where(known, signed, -np.inf)))


def own_table(rows: Sequence[Row]) -> Table:
    """Own metrics against measured single-frame PSS, from rows with `spearman`, its limits, `regret` and `chosen`."""
    table = Table(title="Metrics of your own against measured single-frame PSS over the steps of each sweep")
    for name in ("sweep", "noise model", "metric"):
        table.add_column(name)
    for name in ("Spearman ρ [95 %]", "would choose", "regret"):
        table.add_column(name, justify="right")
    for row in rows:
        rho, low, high, regret = (
            float(str(row[k])) for k in ("spearman", "spearman_ci_low", "spearman_ci_high", "regret")
        )
        words = "undefined" if np.isnan(rho) else f"{rho:+.2f}"
        words += "" if np.isnan(low) or np.isnan(rho) else f" [{low:+.2f}, {high:+.2f}]"
        chosen = NO_OPTIMUM if row["chosen"] is None else str(row["chosen"])
        lost = "" if np.isnan(regret) else f"{regret:.1%}"
        table.add_row(str(row["sweep"]), str(row["noise_model"]), str(row["metric"]), words, chosen, lost)
    return table
