"""The verdict over a bank: how well each metric ranks configurations of one camera count, and what its choice costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pss import METRICS
from validate.bank.measured import ConfigurationErrors
from validate.bank.predicted import Predicted
from validate.bank.ranking import Judged, Ranked, Resamples, partial, regrets, top_hits, with_interval
from validate.errors3d import MeasuredErrors, measured_inverse_sigma
from validate.intervals import CROSSED_SPREAD, kendall, pearson_log

__all__ = ["CountVerdict", "Yardstick", "leaderboard", "yardsticks"]

Floats = NDArray[np.float64]
Row = dict[str, object]

UNDER_M = 0.005
CHOICES = (5, 20, 100)
TOP_SHARE = 0.1
# What the others are compared with, pairwise.
BASELINES = ("pss-single-frame", "visibility-count")


@dataclass(frozen=True, eq=False)
class Yardstick:
    """A measured number of K configurations: terms of a mean over the points (K, N), or the number (K,).

    `halves` are the same from the even and from the odd trials, (K,) each, higher is better; None where there is none.
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
        if metric == "pss":
            return np.array([np.nan_to_num(1 / found.sigma_m) for found in of_model])
        if metric == "pss-single-frame":
            return np.array([single_frame_terms(found) for found in of_model])
        return np.array([found.scores[metric] for found in of_model])


def single_frame_terms(found: Predicted) -> Floats:
    """1/m, (N,), 1/√λmax of C; 0 where not observable."""
    terms = np.zeros(len(found.covariance_m2))
    known = np.isfinite(found.covariance_m2).all(axis=(1, 2))
    terms[known] = 1 / np.sqrt(np.linalg.eigvalsh(found.covariance_m2[known])[:, -1])
    return terms


def yardsticks(measured: Sequence[ConfigurationErrors]) -> list[Yardstick]:
    """Measured PSS (single frame; of the filter where it was run), share under 5 mm, median RMS over all points."""
    halves = [found.errors.halves() for found in measured]

    def of_halves(number: Callable[[MeasuredErrors], float]) -> tuple[Floats, Floats]:
        return np.array([number(a) for a, _ in halves]), np.array([number(b) for _, b in halves])

    under = np.array([(np.linalg.norm(f.errors.errors_m, axis=2) < UNDER_M).mean(axis=0) for f in measured])
    found = [
        Yardstick(
            "measured_pss_single_frame",
            np.array([f.errors.inverse_sigma for f in measured]),
            True,
            of_halves(lambda errors: errors.pss()),
        ),
        Yardstick("share_under_5mm", under, True, of_halves(lambda errors: errors.share_under(UNDER_M))),
        Yardstick(
            "median_rms_m",
            np.array([f.errors.median_rms_m for f in measured]),
            False,
            of_halves(lambda errors: -errors.median_rms_m),
        ),
    ]
    if all(f.prior_moment_m2 is not None for f in measured):
        terms = []
        for f in measured:
            assert f.prior_moment_m2 is not None
            sigma = np.full(len(f.prior_moment_m2), np.nan)
            known = np.isfinite(f.prior_moment_m2).all(axis=(1, 2))
            sigma[known] = np.sqrt(np.linalg.eigvalsh(f.prior_moment_m2[known])[:, -1])
            terms.append(measured_inverse_sigma(sigma, f.errors.detection_rate))
        found.append(Yardstick("measured_pss_filter", np.array(terms), True, None))
    return found


def leaderboard(verdict: CountVerdict, asked: Sequence[tuple[str, str]]) -> list[Row]:
    """A row for each metric under a noise model (`asked` pairs of model and metric) and each yardstick."""
    rows: list[Row] = []
    chance = verdict.chance
    visible = Ranked.of(verdict.terms(asked[0][0], "visible-share"), chance)
    numbers, ranked = {}, {}
    for model, metric in asked:
        better = METRICS[metric].higher_is_better
        values = verdict.terms(model, metric) * (1 if better else -1)
        if values.ndim == 1:  # where a number is not defined, the configuration is the worst
            values = np.where(np.isnan(values), -np.inf, values)
        numbers[model, metric] = values.mean(axis=1) if values.ndim == 2 else values
        ranked[model, metric] = Ranked.of(values, chance)
    of_visible = {pair: found.against(visible) for pair, found in ranked.items()}
    for yardstick in yardsticks(verdict.measured):
        sign = 1 if yardstick.higher_is_better else -1
        measured = Ranked.of(yardstick.values, chance)
        judged_by = {pair: found.against(measured, sign) for pair, found in ranked.items()}
        with_visible = visible.against(measured, sign)
        ranks = _ranks(list(judged_by.values()))
        for (pair, judged), (rank, low, high) in zip(judged_by.items(), ranks, strict=True):
            model, metric = pair
            number = numbers[pair]
            row = {
                "cameras": verdict.cameras,
                "yardstick": yardstick.name,
                "metric": metric,
                "noise_model": model,
                "n": len(number),
                **with_interval("spearman", judged),
                "rank": rank,
                "rank_ci_low": low,
                "rank_ci_high": high,
                "kendall": kendall(number, sign * yardstick.number),
                "pearson_log": _pearson_log(number, yardstick, METRICS[metric].higher_is_better),
                **with_interval("partial_given_visible", partial(judged, of_visible[pair], with_visible)),
            }
            for baseline in BASELINES:
                other = judged_by.get((model, baseline)) or judged_by[asked[0][0], baseline]
                row |= with_interval(f"minus_{baseline.replace('-', '_')}", judged.minus(other))
            row |= _choosing(number, yardstick)
            rows.append(row)
    return rows


def _choosing(number: Floats, yardstick: Yardstick) -> Row:
    """Regret of choosing one of 5, 20 and 100, the oracle's, and hits among the best tenth."""
    row: Row = {}
    for size in CHOICES:
        lost = oracle = np.array([np.nan])
        # A regret is a share of the best: it needs a yardstick that is a positive number.
        if yardstick.halves is not None and yardstick.higher_is_better:
            lost, oracle = regrets(number, yardstick.halves, size)
        row |= {
            f"regret_of_{size}_median": float(np.median(lost)),
            f"regret_of_{size}_mean": float(lost.mean()),
            f"oracle_regret_of_{size}_median": float(np.median(oracle)),
        }
    sign = 1 if yardstick.higher_is_better else -1
    return row | {"top_tenth_hits": top_hits(number, sign * yardstick.number, TOP_SHARE)}


def _ranks(judged: Sequence[Judged]) -> list[tuple[int, int, int]]:
    """Rank of each, 1 the best, and its interval: over the resamples, deviations as in `Judged.interval`."""
    estimate = np.array([j.estimate for j in judged])
    order = np.argsort(np.argsort(-np.nan_to_num(estimate, nan=-2.0))) + 1
    samples = np.array([j.samples for j in judged])
    known = np.nan_to_num(samples, nan=-2.0)
    # A resample's ranks are those of statistics as far from their estimates as the crossed spread says.
    centred = (known - known.mean(axis=1, keepdims=True)) / CROSSED_SPREAD + np.nan_to_num(estimate, nan=-2.0)[:, None]
    ranks = np.argsort(np.argsort(-centred, axis=0), axis=0) + 1
    low, high = np.quantile(ranks, [0.025, 0.975], axis=1)
    return [(int(o), int(a), int(b)) for o, a, b in zip(order, low, high, strict=True)]


def _pearson_log(number: Floats, yardstick: Yardstick, higher_is_better: bool) -> float:
    """Of the metric itself, which `number` has negated if it is better when lower; positive where they agree."""
    sign = 1 if higher_is_better else -1
    return sign * (1 if yardstick.higher_is_better else -1) * pearson_log(sign * number, yardstick.number)
