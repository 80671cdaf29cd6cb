"""A scene measured as it is, in numbers: predicted against measured PSS and errors of a sweep of one step.

`measurement.csv` has a row for each noise model and kind of PSS. A ratio's interval comes from the same resamples of
trials and points as that of measured PSS; the prediction is taken at the same points.
"""

from __future__ import annotations

import numpy as np

from pss import Evaluation
from pss.hints import Floats, Row
from validate.points.configuration import Measured
from validate.stats.intervals import interval
from validate.stats.measured_errors import MeasuredErrors
from validate.sweeps.derived import derived
from validate.sweeps.optima import kind_words
from validate.sweeps.replicates import SweepReplicates
from validate.sweeps.sweep import SweepResult

__all__ = ["comparison_row", "is_measurement", "measurement_rows"]


def is_measurement(result: SweepResult) -> bool:
    """Whether a sweep has one step, whose order with others is no question."""
    return len(result.plan.configurations) == 1 and len(result.assessments) == 1


@derived
def measurement_rows(result: SweepResult) -> list[Row]:
    """Rows of a sweep of one step; none of any other."""
    if not is_measurement(result):
        return []
    (assessment,), name = result.assessments, result.plan.sweep.name
    return [
        comparison_row(
            name, model, assessment.predicted[model], assessment.measured, result.replicates[model], single_frame
        )
        for model in result.noise_models
        for single_frame in (True, False)
    ]


def comparison_row(
    name: str, model: str, predicted: Evaluation, measured: Measured, replicates: SweepReplicates, single_frame: bool
) -> Row:
    """Predicted against measured PSS of one kind, with the ratio's 95 % interval and, of single frames, NEES/3.

    Args:
        name: of the sweep, or of the scene.
        replicates: resamples of the measurement's trials and points; the first of their steps counts.
    """
    sigma = predicted.single_frame_sigma_m if single_frame else predicted.sigma_m
    of_points = replicates.point_weights @ np.nan_to_num(1 / sigma)
    if single_frame:
        samples = replicates.measured_pss[:, 0]
    else:
        samples = replicates.point_weights @ measured.inverse_filter_sigma
    expected = predicted.pss_single_frame if single_frame else predicted.pss
    found = measured.errors.pss() if single_frame else measured.pss_filter
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = interval(samples / of_points)
        ratio = float(np.divide(found, expected))
    nees = (np.nan,) * 3
    if single_frame:
        nees = _nees_share(measured.errors, predicted.single_frame_covariance, replicates)
    return {
        "sweep": name,
        "noise_model": model,
        "kind": kind_words(single_frame),
        "predicted_pss": float(expected),
        "measured_pss": float(found),
        "ratio": ratio,
        "ratio_ci_low": float(low),
        "ratio_ci_high": float(high),
        "nees_over_3": nees[0],
        "nees_over_3_ci_low": nees[1],
        "nees_over_3_ci_high": nees[2],
    }


def _nees_share(
    errors: MeasuredErrors, covariance_m2: Floats, replicates: SweepReplicates
) -> tuple[float, float, float]:
    """Mean of eᵀC⁻¹e/3 over all trials of all points that have both, with its interval; nan where none has."""
    known = np.isfinite(covariance_m2).all(axis=(1, 2))
    there = errors.detected & known
    squares = np.zeros(there.shape)
    if there.any():
        inverse = np.linalg.inv(covariance_m2[known])
        e = np.where(there[..., None], errors.errors_m, 0.0)[:, known]
        squares[:, known] = np.einsum("tni,nij,tnj->tn", e, inverse, e) / 3
    with np.errstate(divide="ignore", invalid="ignore"):
        value = float(np.divide(squares.sum(), there.sum()))
        total, count = (
            np.einsum("bt,tn,bn->b", replicates.trial_weights, each, replicates.point_weights, optimize=True)
            for each in (squares, there.astype(float))
        )
        low, high = interval(total / count)
    return value, float(low), float(high)
