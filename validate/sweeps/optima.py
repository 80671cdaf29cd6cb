"""Where PSS is best over the steps of a sweep, measured and predicted: inside, at an end, or nowhere (`optima.csv`).

A statement about the sweep, whatever it varies. A curve whose range is one that chance makes of a flat one has no
optimum (`validate.stats.flatness`: by trials for the single frame, by points for the filter's long record). Steps that
would not be told apart from the best one with other markers are named beside it. A prediction has no trials: it is flat
where its steps agree to `SAME`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pss.hints import Floats, Row
from validate.stats.flatness import is_flat, least_difference, spread_of_points
from validate.stats.intervals import interval
from validate.stats.optimum import FLAT, NO_OPTIMUM, optimum
from validate.sweeps.derived import derived
from validate.sweeps.sweep import SweepResult

__all__ = ["MEASURED", "PREDICTED", "Trend", "kind_words", "optimum_rows", "trend", "trends"]


MEASURED, PREDICTED = "measured", "predicted"
# Predictions that agree to this share are one to every reader of three digits.
SAME = 1e-3


@dataclass(frozen=True, eq=False)
class Trend:
    """PSS of one kind over S steps, 1/m, of what was measured or of one noise model.

    Attributes:
        labels: of the steps' values; `ordered` if they lie along a number.
        samples: 1/m, (B, S), resamples; nan where there are none.
        flat: whether no step is better than another by more than chance.
        least_difference: 1/m, of steps that are told apart with other markers of this kind; nan where it is not known.
    """

    side: str
    noise_model: str
    single_frame: bool
    labels: tuple[str, ...]
    ordered: bool
    values: Floats
    samples: Floats
    flat: bool
    least_difference: float

    @property
    def of_these_markers(self) -> bool:
        """Whether the curve has an optimum for these markers alone: others may well have none, or another one."""
        return self.best is not None and bool(np.ptp(self.values) <= self.least_difference)

    @property
    def best(self) -> int | None:
        """The step of the optimum; None of a flat curve, and where no step resolves a point."""
        return None if self.flat else optimum(self.values)

    @property
    def optimum(self) -> str:
        """The value of the best step, or why there is none."""
        if optimum(self.values) is None:
            return NO_OPTIMUM
        return FLAT if self.best is None else self.labels[self.best]

    @property
    def place(self) -> str:
        """Of the optimum in the range: "first", "last" or "inside"; "" without an optimum, or an order of the steps."""
        if self.best is None or not self.ordered:
            return ""
        return {0: "first", len(self.values) - 1: "last"}.get(self.best, "inside")

    @property
    def as_good(self) -> tuple[str, ...]:
        """Values of the steps that are not told apart from the best one with other markers."""
        if self.best is None:
            return ()
        behind = self.values[self.best] - self.values
        close = np.flatnonzero(behind <= self.least_difference)
        return tuple(self.labels[step] for step in close if step != self.best)

    def fold(self, over: int) -> tuple[float, float, float]:
        """How many times the PSS of another step the highest is, with its interval; ∞ over a step of 0."""
        best = int(np.argmax(self.values))
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = interval(self.samples[:, best] / self.samples[:, over])
            return float(self.values[best] / self.values[over]), float(low), float(high)

    @property
    def finding(self) -> str:
        """A sentence."""
        worst, last = int(np.argmin(self.values)), len(self.values) - 1
        if optimum(self.values) is None:
            return "0 at every step: no optimum"
        if self.best is None:
            words = "the same at every step" if self.side == PREDICTED else "flat within its interval, no optimum"
            return f"{words} (highest / lowest {_times(self.fold(worst))})"
        at = self.labels[self.best]
        if not self.ordered:
            words = f"highest with {at}, {_fold(self.fold(worst))} the lowest, {self.labels[worst]}"
        elif self.place == "inside":
            ends = (f"{_fold(self.fold(end))} that of the {name} value" for end, name in ((0, "first"), (last, "last")))
            words = f"highest at {at}, inside the range: {', '.join(ends)}"
        elif worst in (0, last):
            way = "rises" if self.place == "last" else "falls"
            words = f"{way} {_fold(self.fold(worst))} from {self.labels[0]} to {self.labels[last]}"
        else:
            words = f"highest at the {self.place} value {at}, {_fold(self.fold(worst))} the lowest, at "
            words += self.labels[worst]
        if self.of_these_markers:
            return f"{words}; shown for these markers alone, as others could make all of the difference"
        return words + (f"; not told apart from {at}: {', '.join(self.as_good)}" if self.as_good else "")


def _times(fold: tuple[float, float, float]) -> str:
    value, low, high = fold
    if math.isinf(value):
        return "from 0"
    return f"{value:.3g}" + ("" if math.isnan(low) else f" [{low:.3g}, {high:.3g}]")


def _fold(fold: tuple[float, float, float]) -> str:
    value, low, high = fold
    if math.isinf(value):
        return "many times (0)"
    return f"{value:.3g}-fold" + ("" if math.isnan(low) else f" [{low:.3g}, {high:.3g}]")


def kind_words(single_frame: bool) -> str:
    """The name of a kind of PSS."""
    return "single frame" if single_frame else "filter"


@derived
def trends(result: SweepResult) -> list[Trend]:
    """Of each kind the measured curve, then that of each noise model; none of a sweep of one step."""
    if len(result.assessments) < 2:
        return []
    models = [None, *result.noise_models]
    return [trend(result, single_frame, model) for single_frame in (True, False) for model in models]


@derived
def trend(result: SweepResult, single_frame: bool, model: str | None = None) -> Trend:
    """The measured curve (None) or that of a noise model."""
    values = result.measured_pss(single_frame) if model is None else result.predicted_pss(model, single_frame)
    if model is None:
        samples, flat, least = _measured(result, values, single_frame)
    else:
        weights = result.replicates[model].point_weights
        evaluations = [assessment.predicted[model] for assessment in result.assessments]
        sigma = [e.single_frame_sigma_m if single_frame else e.sigma_m for e in evaluations]
        samples, least = weights @ np.nan_to_num(1 / np.array(sigma)).T, SAME * float(values.max())
        flat = bool(np.ptp(values) <= least)
    steps = [configuration.value for configuration in result.configurations]
    return Trend(
        PREDICTED if model else MEASURED,
        model or "",
        single_frame,
        tuple(value if isinstance(value, str) else f"{value:g}" for value in steps),
        not any(isinstance(value, str) for value in steps),
        values,
        samples,
        flat,
        least,
    )


def _measured(result: SweepResult, values: Floats, single_frame: bool) -> tuple[Floats, bool, float]:
    """Resamples of a measured curve, whether it is flat, and its least difference."""
    replicates = next(iter(result.replicates.values()))
    trials, points = result.assessments[0].measured.errors.detected.shape
    if single_frame:
        samples = replicates.measured_pss
        of_trials, of_points = replicates.measured_pss_of_trials, replicates.measured_pss_of_points
        least = least_difference(values, of_trials, of_points, samples, trials, points)
        return samples, is_flat(values, result.exchanged_ranges), least
    # The filter's own record is long; what is left to chance is which points there are.
    samples = replicates.point_weights @ np.array([a.measured.inverse_filter_sigma for a in result.assessments]).T
    least = spread_of_points(values, samples, points)
    return samples, bool(np.ptp(values) <= least), least


@derived
def optimum_rows(result: SweepResult) -> list[Row]:
    """A row for each curve of a sweep."""
    return [_row(result.plan.sweep.name, each) for each in trends(result)]


def _row(sweep: str, curve: Trend) -> Row:
    fold = curve.fold(int(np.argmin(curve.values))) if optimum(curve.values) is not None else (math.nan,) * 3
    return {
        "sweep": sweep,
        "side": curve.side,
        "noise_model": curve.noise_model,
        "kind": kind_words(curve.single_frame),
        "steps": len(curve.values),
        "flat": "yes" if curve.flat else "no",
        "optimum": "" if curve.best is None else curve.labels[curve.best],
        "optimum_position": curve.place,
        "tied_with_optimum": " ".join(curve.as_good),
        "holds_for_these_markers_only": "yes" if curve.of_these_markers else "no",
        "highest_over_lowest": fold[0],
        "highest_over_lowest_ci_low": fold[1],
        "highest_over_lowest_ci_high": fold[2],
        "finding": curve.finding,
    }
