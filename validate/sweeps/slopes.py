"""How errors grow with what a sweep varies: log-log slopes of predicted and of measured RMS, `slopes.csv`.

A slope of 1 means "in proportion". It is fitted by least squares to the logarithms over the steps, on the points that
all steps have in common: a step that loses its difficult points would else look the better for it. A line is all that
it sees: `measured_departure` is how far the measured RMS is from one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import ShapeError
from pss.hints import Bools, Floats, Row
from render.random_streams import random_stream
from validate.stats.intervals import interval
from validate.stats.measured_errors import MeasuredErrors
from validate.sweeps.derived import derived
from validate.sweeps.replicates import sweep_replicates
from validate.sweeps.sweep import REPLICATES, SweepResult

__all__ = ["Slopes", "common_points", "log_slope", "slope_rows", "slopes", "slopes_of"]


# A point whose detection is rarer than this in some step would be judged there by its lucky trials.
SMALLEST_DETECTION_RATE = 0.5
# A line through fewer steps has no direction.
FEWEST_STEPS = 2


@dataclass(frozen=True, eq=False)
class Slopes:
    """Log-log slopes of RMS against a parameter over S steps, no unit.

    Attributes:
        points: number of points that all steps have in common.
        predicted: by noise model.
        measured: with `low` and `high`, its 95 % interval over resampled trials and points.
        departure: RMS of the measured logarithms about their line; 0.1 is a tenth of the RMS.
        predicted_rms_m: m, by noise model, pooled over the common points, (S,).
        measured_rms_m: m, likewise, (S,).
    """

    points: int
    predicted: Mapping[str, float]
    measured: float
    low: float
    high: float
    departure: float
    predicted_rms_m: Mapping[str, Floats]
    measured_rms_m: Floats


def log_slope(parameter: ArrayLike, rms_m: ArrayLike) -> Floats:
    """Slopes (...) of the least-squares lines through ln `rms_m` (..., S) over ln `parameter` (S,), both above 0."""
    x, y = np.log(np.asarray(parameter, dtype=float)), np.log(np.asarray(rms_m, dtype=float))
    if x.ndim != 1 or y.shape[-1:] != x.shape:
        raise ShapeError(f"parameter {x.shape} and rms_m {y.shape}; allowed: (S,) and (..., S)")
    centred = x - x.mean()
    return np.asarray(y @ centred / (centred @ centred))


def common_points(predicted_m: Mapping[str, ArrayLike], errors: Sequence[MeasuredErrors]) -> Bools:
    """(N,), the points that every step predicts, by every model (S, N), and found in half of its trials or more."""
    found = np.array([e.detection_rate >= SMALLEST_DETECTION_RATE for e in errors])
    known = [np.isfinite(np.asarray(values, dtype=float)) for values in predicted_m.values()]
    return np.asarray(np.all([found, *known], axis=(0, 1)))


def slopes(
    parameter: ArrayLike,
    predicted_m: Mapping[str, ArrayLike],
    errors: Sequence[MeasuredErrors],
    rng: np.random.Generator,
    replicates: int = REPLICATES,
) -> Slopes:
    """The slopes of one sweep; nan where no point is common to all steps.

    Args:
        parameter: (S,), above 0.
        predicted_m: m, by noise model, each point's single-frame RMS, (S, N).
        errors: S, of T trials and N points.
    """
    common = common_points(predicted_m, errors)
    if not common.any():
        nothing, none = float("nan"), np.full(len(errors), np.nan)
        of_models = dict.fromkeys(predicted_m, none)
        return Slopes(0, dict.fromkeys(predicted_m, nothing), nothing, nothing, nothing, nothing, of_models, none)
    kept = [MeasuredErrors(e.errors_m[:, common]) for e in errors]
    rms = np.array([e.pooled_rms_m for e in kept])
    measured = float(log_slope(parameter, rms))
    resampled = sweep_replicates(kept, np.zeros((len(kept), int(common.sum()))), rng, replicates).rms_m
    # A resample in which no trial of a point has weight leaves nothing to take a logarithm of.
    samples = log_slope(parameter, resampled[np.isfinite(resampled).all(axis=1)])
    low, high = interval(samples) if len(samples) else (np.float64("nan"), np.float64("nan"))
    predicted = {name: _pooled(np.asarray(of_points)[:, common]) for name, of_points in predicted_m.items()}
    line = np.log(rms).mean() + measured * (np.log(parameter) - np.log(parameter).mean())
    return Slopes(
        int(common.sum()),
        {name: float(log_slope(parameter, pooled)) for name, pooled in predicted.items()},
        measured,
        float(low),
        float(high),
        float(np.sqrt(((np.log(rms) - line) ** 2).mean())),
        predicted,
        rms,
    )


def _pooled(rms_m: Floats) -> Floats:
    """m, root mean square over the points of (S, N); (S,)."""
    return np.asarray(np.sqrt((rms_m**2).mean(axis=1)))


@derived
def slopes_of(result: SweepResult) -> Slopes | None:
    """The slopes of a sweep; None where its values are no different numbers above 0."""
    values = [configuration.value for configuration in result.configurations]
    if not all(isinstance(value, float) and value > 0 for value in values) or len(set(values)) < FEWEST_STEPS:
        return None
    return slopes(
        np.array(values, dtype=float),
        {m: np.array([a.predicted[m].single_frame_rms_m for a in result.assessments]) for m in result.noise_models},
        [assessment.measured.errors for assessment in result.assessments],
        random_stream(result.plan.sweep.seed, result.plan.sweep.name, "slopes"),
    )


@derived
def slope_rows(result: SweepResult) -> list[Row]:
    """A row for each noise model; none where there is no slope."""
    found = slopes_of(result)
    if found is None:
        return []
    return [
        {
            "sweep": result.plan.sweep.name,
            "parameter": result.configurations[0].parameter,
            "noise_model": model,
            "steps": len(result.configurations),
            "points": found.points,
            "predicted_slope": found.predicted[model],
            "measured_slope": found.measured,
            "measured_slope_ci_low": found.low,
            "measured_slope_ci_high": found.high,
            "measured_departure": found.departure,
        }
        for model in result.noise_models
    ]
