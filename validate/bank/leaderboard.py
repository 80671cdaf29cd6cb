"""The verdict over a bank: how well each metric ranks configurations of one camera count, and what its choice costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pss import METRICS
from pss.hints import Floats, Row
from validate.bank.measured import ConfigurationErrors
from validate.bank.predicted import Predicted
from validate.stats.crossed import deviations
from validate.stats.intervals import kendall, pearson_log, tie_groups
from validate.stats.measured_errors import measured_inverse_sigma
from validate.stats.ranking import Judged, Ranked, Resamples, partial, top_hits, with_interval
from validate.stats.regret import Choices, Picked, Regrets, numbers_of

__all__ = ["CountVerdict", "Measure", "leaderboard", "measures"]


# Errors are tenths of a millimetre: a share under 5 mm only counts what was triangulated.
UNDER_MM = (5, 0.02, 0.05, 0.1, 0.2)
# Draws of the statistics from their jackknife, for intervals of ranks.
RANK_DRAWS = 4000
CHOICES = (5, 20, 100)
TOP_SHARE = 0.1
# What the others are compared with, pairwise.
BASELINES = ("pss-single-frame", "visibility-count")


@dataclass(frozen=True, eq=False)
class Measure:
    """A measured number of K configurations: terms of a mean over the points (K, N), or the number (K,).

    `halves` are the same from the even and from the odd trials, higher is better; None where there is none.
    """

    name: str
    values: Floats
    higher_is_better: bool
    halves: tuple[Floats, Floats] | None

    @property
    def number(self) -> Floats:
        """(K,)."""
        return self.values.mean(axis=1) if self.values.ndim == 2 else self.values


@dataclass(frozen=True, eq=False)
class CountVerdict:
    """Configurations of one camera count, as drawn, measured and predicted; `camera_names` of each view of the bank."""

    cameras: int
    configurations: NDArray[np.int64]
    measured: Sequence[ConfigurationErrors]
    predicted: Sequence[Mapping[str, Predicted]]
    camera_names: Sequence[str]

    @cached_property
    def chance(self) -> Resamples:
        """Resamples of cameras, views and points, the same for all that is judged on these configurations."""
        points = len(self.measured[0].errors.detections)
        return Resamples.of_configurations(self.configurations, points, self.camera_names)

    def terms(self, model: str, metric: str) -> Floats:
        """The metric under a noise model: its terms (K, N) if it is a mean over points, else its values (K,)."""
        of_model = [found[model] for found in self.predicted]
        if METRICS[metric].terms is not None:
            return np.array([found.terms[metric] for found in of_model])
        return np.array([found.scores[metric] for found in of_model])


def single_frame_terms(found: Predicted) -> Floats:
    """1/m, (N,), what each point adds to the single-frame PSS; 0 where it is not observable."""
    return found.terms["pss-single-frame"]


def measures(measured: Sequence[ConfigurationErrors]) -> list[Measure]:
    """Measured PSS (single frame; of the filter where it was run), shares under some mm, median RMS over all points."""
    pairs = [found.errors.halves() for found in measured]
    whole, *halves = (
        [found.errors for found in measured],
        [even for even, _ in pairs],
        [odd for _, odd in pairs],
    )
    single, *of_halves = (np.array([e.inverse_sigma for e in errors]) for errors in (whole, *halves))
    found = [Measure("measured_pss_single_frame", single, True, (of_halves[0], of_halves[1]))]
    distances = [np.linalg.norm([e.errors_m for e in errors], axis=-1) for errors in (whole, *halves)]
    for limit in UNDER_MM:
        share, a, b = ((distance < limit / 1000).mean(axis=1) for distance in distances)  # nan is not under
        found.append(Measure(f"share_under_{limit:g}mm", share, True, (a, b)))
    median = np.array([errors.median_rms_m for errors in whole])
    found.append(Measure("median_rms_m", median, False, None))
    if all(f.prior_moment_m2 is not None for f in measured):
        terms = []
        for f in measured:
            assert f.prior_moment_m2 is not None
            sigma = np.full(len(f.prior_moment_m2), np.nan)
            known = np.isfinite(f.prior_moment_m2).all(axis=(1, 2))
            sigma[known] = np.sqrt(np.linalg.eigvalsh(f.prior_moment_m2[known])[:, -1])
            terms.append(measured_inverse_sigma(sigma, f.errors.detection_rate))
        found.append(Measure("measured_pss_filter", np.array(terms), True, None))
    return found


def leaderboard(verdict: CountVerdict, requested: Sequence[tuple[str, str]]) -> list[Row]:
    """A row for each metric under a noise model (`requested` pairs of model and metric) and each measure.

    `equivalent_to` names the first pair that orders the configurations the same way; ranks count the two once.
    """
    rows: list[Row] = []
    chance = verdict.chance
    choices = {size: Choices.of(chance, size) for size in CHOICES}
    visible = Ranked.of(verdict.terms(requested[0][0], "visible-share"), chance)
    numbers, ranked, picked = {}, {}, {}
    for model, metric in requested:
        better = METRICS[metric].higher_is_better
        values = verdict.terms(model, metric) * (1 if better else -1)
        values = np.where(np.isnan(values), -np.inf, values)  # where a number is not defined, it is the worst
        of_all = numbers_of(values, chance)
        numbers[model, metric] = of_all[0]
        ranked[model, metric] = Ranked.of(values, chance)
        picked[model, metric] = Picked.by(of_all, choices)
    of_visible = {pair: found.against(visible) for pair, found in ranked.items()}
    first = twins(numbers)
    for measure in measures(verdict.measured):
        sign = 1 if measure.higher_is_better else -1
        measured = Ranked.of(measure.values, chance)
        judged_by = {pair: found.against(measured, sign) for pair, found in ranked.items()}
        with_visible = visible.against(measured, sign)
        own = [pair for pair in requested if first[pair] == pair]
        ranks = dict(zip(own, ranks_of([judged_by[pair] for pair in own]), strict=True))
        costs = Regrets.of_values(measure.halves, choices) if measure.halves else None
        for pair, judged in judged_by.items():
            model, metric = pair
            number = numbers[pair]
            rank, low, high = ranks[first[pair]]
            row = {
                "cameras": verdict.cameras,
                "measure": measure.name,
                "metric": metric,
                "noise_model": model,
                "n": len(number),
                **with_interval("spearman", judged),
                "rank": rank,
                "rank_ci_low": low,
                "rank_ci_high": high,
                "equivalent_to": "" if first[pair] == pair else "{1} ({0})".format(*first[pair]),
                "kendall": kendall(number, sign * measure.number),
                "pearson_log": _pearson_log(number, measure, METRICS[metric].higher_is_better),
                **with_interval("partial_given_visible", partial(judged, of_visible[pair], with_visible)),
            }
            for baseline in BASELINES:
                other = judged_by.get((model, baseline)) or judged_by[requested[0][0], baseline]
                row |= with_interval(f"minus_{baseline.replace('-', '_')}", judged.minus(other))
            row |= _choosing(picked[pair], costs, chance)
            rows.append(row | {"top_tenth_hits": top_hits(number, sign * measure.number, TOP_SHARE)})
    return rows


def _choosing(picked: Picked, costs: Regrets | None, chance: Resamples) -> Row:
    """Regret of choosing one of 5, 20 and 100, the oracle's, and what the one is over the other.

    A regret is a share of the best: it needs a measure that is a positive number, and halves of it.
    """
    row: Row = {}
    unknown = chance.judged(float("nan"), np.full(len(chance.points), np.nan))
    for size in CHOICES:
        (lost, median), (oracle, oracle_median) = (
            (costs.of(picked, size), costs.oracle(size)) if costs else ((unknown, float("nan")),) * 2
        )
        row |= {
            f"regret_of_{size}_median": median,
            **with_interval(f"regret_of_{size}_mean", lost),
            f"oracle_regret_of_{size}_median": oracle_median,
            **with_interval(f"oracle_regret_of_{size}_mean", oracle),
            **with_interval(f"regret_over_oracle_of_{size}", lost.minus(oracle)),
        }
    return row


def twins(numbers: Mapping[tuple[str, str], Floats]) -> dict[tuple[str, str], tuple[str, str]]:
    """For each pair, the first one with the same order of configurations, ties included: itself, or its twin."""
    seen: dict[bytes, tuple[str, str]] = {}
    return {pair: seen.setdefault(tie_groups(number).tobytes(), pair) for pair, number in numbers.items()}


def ranks_of(judged: Sequence[Judged]) -> list[tuple[int, int, int]]:
    """Rank of each, 1 the best, and its interval: ranks in draws of all statistics with their common chance.

    A draw moves the statistics along what each camera, view and point does to them.
    """
    estimate = np.nan_to_num([j.estimate for j in judged], nan=-2.0)
    order = np.argsort(np.argsort(-estimate, kind="stable"), kind="stable") + 1
    moved = estimate + deviations(judged, np.random.default_rng(RANK_DRAWS), RANK_DRAWS)
    ranks = np.argsort(np.argsort(-moved, axis=1, kind="stable"), axis=1, kind="stable") + 1
    low, high = np.quantile(ranks, [0.025, 0.975], axis=0)
    return [
        (int(o), int(min(np.floor(a), o)), int(max(np.ceil(b), o))) for o, a, b in zip(order, low, high, strict=True)
    ]


def _pearson_log(number: Floats, measure: Measure, higher_is_better: bool) -> float:
    """Of the metric itself, which `number` has negated if it is better when lower; positive where they agree."""
    sign = 1 if higher_is_better else -1
    return sign * (1 if measure.higher_is_better else -1) * pearson_log(sign * number, measure.number)
