"""How errors of calibration change the ranking by PSS: for both kinds, with and without a term for them.

Like is compared with like. Over calibrations (each frame another one, or many frozen draws taken together) the measured
second moment is that of C + GΣGᵀ if triangulation weights by its detections' own covariances, and of C with R + JΣJᵀ
if it has the term in its weights. Within one frozen draw, as a user has it, the measured RMS is about the truth and
contains a bias unknown to any prediction: PSS and ρ of each draw by itself, then averaged over the draws. What a
prediction can reach there at most is shown by the mean of the other draws' measured terms.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats, Row
from validate.bank.calibration_errors import (
    PTZ_SIZES,
    CalibrationSizes,
    passing_covariance,
    shifts_px,
    without_blunders,
)
from validate.bank.calibration_measured import MeasuredMoments, carried_through, triangulated
from validate.bank.calibration_predicted import PredictedErrors, Predictions
from validate.bank.measured import BankData
from validate.bank.processes import workers_context
from validate.stats.crossed import mean_over_draws
from validate.stats.ranking import Judged, Ranked, Resamples

__all__ = ["DRAWS", "EACH_FRAME", "FROZEN", "IN_WEIGHTS", "OVER", "OWN", "WITHIN", "study"]


# Values of the columns `kind`, `judged` and `weights`.
EACH_FRAME, FROZEN = "each frame", "frozen"
OVER, WITHIN = "over calibrations", "within one calibration"
OWN, IN_WEIGHTS = "own", "with term"
# Independent frozen calibrations.
DRAWS = 12
# One configuration in so many is triangulated in full, beside the errors to first order.
CHECKED = 10
# Columns of ρ of which the least and the most of the draws are given, too.
WITH_EXTREMES = ("spearman_plain", "spearman_with_term", "spearman_propagated", "spearman_other_draws")


@dataclass(frozen=True, eq=False)
class Study:
    """What all sizes share; `chance` for intervals."""

    data: BankData
    predictions: Predictions
    draws: int
    chance: Resamples

    @property
    def chosen(self) -> NDArray[np.int64]:
        """The configurations, (K, c)."""
        return self.predictions.configurations


def study(
    data: BankData,
    predictions: Predictions,
    sizes: Sequence[CalibrationSizes] = PTZ_SIZES,
    draws: int = DRAWS,
    processes: int | None = None,
) -> list[Row]:
    """Rows for each size of error: how PSS, without and with a term for it, ranks what is then measured.

    Args:
        predictions: of the views of `data`, without errors.
        draws: number of frozen calibrations, 2 or more.

    Returns:
        A row for each size, kind, weights of triangulation and what is judged; without errors, one of each kind.
        Spearman's ρ of measured single-frame PSS with the prediction by R ("plain"), by R + JΣJᵀ ("with_term") and by
        C + GΣGᵀ ("propagated"), what the two gain, and with the mean of the other draws ("other_draws"), each with a
        95 % interval over cameras, views, points and draws; within one calibration ρ is the mean over the draws,
        `_min` and `_max` are the extremes among them. `median_pss` (1/m) and `median_rms_m` (pooled) are medians
        over the configurations (and draws); `spearman_median_rms` is that of the prediction which is like the weights
        with the median RMS over all points, a measure that favours no metric's form; `rms_over_…` is the median over
        points of measured over predicted RMS, "matching" that prediction; `first_order_rms_ratio` is the RMS to first
        order, as all rows with errors have it, over that of full triangulation, median of every tenth configuration.
    """
    cameras = [camera.name for camera in data.cameras]
    chance = Resamples.of_configurations(predictions.configurations, len(data.points_m), cameras)
    whole = Study(data, predictions, draws, chance)
    if processes == 1:
        return [row for size in sizes for row in _rows(whole, size)]
    with ProcessPoolExecutor(processes, workers_context(), _begin, (whole,)) as pool:
        return [row for rows in pool.map(_in_worker, sizes) for row in rows]


_study: Study | None = None


def _begin(whole: Study) -> None:
    global _study
    _study = whole


def _in_worker(size: CalibrationSizes) -> list[Row]:
    assert _study is not None
    return _rows(_study, size)


def _rows(whole: Study, size: CalibrationSizes) -> list[Row]:
    plain = whole.predictions.plain()
    if size.none:
        # Without errors the term is zero, and predictions are the same to the last bit.
        predicted = {"plain": plain, "with_term": plain, "propagated": plain}
        judge = _Judge(whole, predicted, size, OWN)
        measured = [triangulated(whole.data, whole.chosen, 1)]
        return [judge.row(kind, judged, measured) for kind, judged in ((EACH_FRAME, OVER), (FROZEN, WITHIN))]
    predicted = {
        "plain": plain,
        "with_term": whole.predictions.term_in_r(size),
        "propagated": whole.predictions.propagated(size),
    }
    pixels = without_blunders(whole.data).pixels
    shifts = [shifts_px(whole.data, size), *(shifts_px(whole.data, size, draw) for draw in range(whole.draws))]
    rows: list[Row] = []
    for weights in (OWN, IN_WEIGHTS):
        judge = _Judge(whole, predicted, size, weights)
        covariance = passing_covariance(whole.data, size, weights == IN_WEIGHTS)
        unmoved = dataclasses.replace(whole.data, pixels=pixels, covariance=covariance)
        full = triangulated(dataclasses.replace(unmoved, pixels=pixels - shifts[0]), whole.chosen[::CHECKED], 1)
        first, *frozen = carried_through(unmoved, shifts, whole.chosen)
        ratio = float(np.nanmedian(first.rms_m[::CHECKED] / full.rms_m))
        rows.append(judge.row(EACH_FRAME, OVER, [first]) | {"first_order_rms_ratio": ratio})
        rows.append(judge.row(FROZEN, WITHIN, frozen))
        rows.append(judge.row(FROZEN, OVER, [MeasuredMoments.together(frozen)]) | {"draws": whole.draws})
    return rows


class _Judge:
    """Rows of one size and kind of weights."""

    def __init__(
        self, whole: Study, predicted: dict[str, PredictedErrors], size: CalibrationSizes, weights: str
    ) -> None:
        self.whole, self.size, self.weights, self.predicted = whole, size, weights, predicted
        self.matching = "propagated" if weights == OWN else "with_term"

    def row(self, kind: str, judged: str, measured: list[MeasuredMoments]) -> Row:
        """`measured`: of each draw by itself."""
        terms = [one.inverse_sigma for one in measured]
        chance = self.whole.chance
        ranked = {name: Ranked.of(one.inverse_sigma, chance) for name, one in self.predicted.items()}
        against = [Ranked.of(values, chance) for values in terms]
        row: Row = dataclasses.asdict(self.size) | {"kind": kind, "judged": judged, "weights": self.weights}
        row |= {
            "n": len(self.whole.chosen),
            "draws": len(measured) if kind == FROZEN else "",
            "median_pss": float(np.median([values.mean(axis=1) for values in terms])),
            "median_rms_m": float(np.nanmedian([one.pooled_rms_m for one in measured])),
        }
        of = {name: [own.against(other) for other in against] for name, own in ranked.items()}
        for gain, name in (("gain", "with_term"), ("gain_propagated", "propagated")):
            of[gain] = [one.minus(plain) for one, plain in zip(of[name], of["plain"], strict=True)]
        of["other_draws"] = _other_draws(terms, against, chance)
        for name, judgements in of.items():
            row |= self._columns(f"spearman_{name}", judgements)
        # By the median RMS over all points, which favours no metric's form.
        neutral = [ranked[self.matching].against(Ranked.of(one.median_rms_m, chance), -1) for one in measured]
        row |= self._columns("spearman_median_rms", neutral)
        for name, of_kind in (("plain", "plain"), ("matching", self.matching)):
            predicted = self.predicted[of_kind].rms_m
            row[f"rms_over_{name}"] = float(np.nanmedian([one.rms_m / predicted for one in measured]))
        return row | {"first_order_rms_ratio": float("nan")}

    def _columns(self, name: str, judged: list[Judged]) -> Row:
        """The mean over the draws with its interval, and the extremes."""
        nan = float("nan")
        columns = [name, f"{name}_low", f"{name}_high"]
        columns += [f"{name}_min", f"{name}_max"] if name in WITH_EXTREMES else []
        if not judged:
            return dict.fromkeys(columns, nan)
        single, extremes = judged[0], (nan, nan)
        if len(judged) > 1:
            estimates = [one.estimate for one in judged]
            single = mean_over_draws(judged)
            extremes = (float(np.nanmin(estimates)), float(np.nanmax(estimates)))
        return dict(zip(columns, (single.estimate, *single.interval, *extremes), strict=False))


def _other_draws(terms: list[Floats], against: list[Ranked], chance: Resamples) -> list[Judged]:
    """ρ of each draw with the mean of the others' terms; none of a single one."""
    if len(terms) < 2:
        return []
    total = np.sum(terms, axis=0)
    others = (Ranked.of((total - own) / (len(terms) - 1), chance) for own in terms)
    return [other.against(own) for other, own in zip(others, against, strict=True)]
