"""The filter over held steps at many levels of process noise, of which one is the headline.

At the schedule's own process the position gathers 1 mm between two frames, twenty times what a frame errs by: σ∞ is
that step wherever a marker is found at all, and PSS of the filter counts markers. So the filter is judged at other
accelerations too, by the levels and the rule of `validate.prediction.process_levels`: the headline is where the
variance q = q̃ Δt³ that a marker gathers between two frames is the variance c of a single frame, by what the physical R
predicts for the training views. The same q is had by a calmer walk or by more frames in a second.

What is measured is a linearised simulation that rendered residuals drive, solved for its second moments
(`validate.points.filter_moments`). What is predicted needs the same information of the same markers: nothing is looked
up again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pss import Evaluation, PTZCamera
from pss.errors import RangeError
from pss.hints import Floats
from pss.processes.process import ConstantVelocity, ProcessModel
from pss.riccati.axes import axis_blocks, position_variance
from pss.riccati.covariances import largest_standard_deviation
from validate.markers.view_measurement import ViewMeasurement
from validate.points.configuration import Measured
from validate.points.filter_moments import steady_moments
from validate.points.static_filter import trial_terms
from validate.points.triangulate import detection_weights
from validate.prediction.process_levels import Level, levels_about
from validate.stats.measured_errors import measured_inverse_sigma

__all__ = [
    "RULED_BY",
    "FilterLevels",
    "equivalent_frame_rate_hz",
    "headline_of_walk",
    "inverse_sigma",
    "levels_of_walk",
    "measured_inverse",
    "predicted_inverse",
]


RULED_BY = "physical"
"""The noise model whose prediction of the training views the rule takes: it is fitted to nothing."""


@dataclass(frozen=True, eq=False)
class FilterLevels:
    """What N markers add to PSS of the filter at L levels: 1/m, (L, N), predicted by noise model, and measured."""

    predicted: dict[str, Floats]
    measured: Floats


def levels_of_walk(predicted: Sequence[Evaluation], own: ProcessModel) -> list[Level]:
    """The constant velocities about the median error that is predicted for training views, after the schedule's own.

    Args:
        predicted: the training views by `RULED_BY`.
        own: the schedule's process.

    Raises:
        RangeError: another process than constant velocity, or no marker is observable in any training view.
    """
    if not isinstance(own, ConstantVelocity):
        raise RangeError(f"the process is a {type(own).__name__}; allowed in a schedule: ConstantVelocity")
    sigma = np.concatenate([found.single_frame_sigma_m for found in predicted])
    known = sigma[np.isfinite(sigma)]
    typical = float(np.median(known)) if known.size else float("nan")
    levels = [level for level in levels_about(typical, own.time_step_s) if not level.walks]
    q_over_c = own.acceleration_density_m2_s3 * own.time_step_s**3 / typical**2
    return [Level(own, q_over_c, False), *levels]


def headline_of_walk(levels: Sequence[Level]) -> int:
    """Which of `levels_of_walk` is the headline."""
    return next(number for number, level in enumerate(levels) if level.headline)


def equivalent_frame_rate_hz(level: Level, own: Level) -> float:
    """1/s, frames at which `own`'s acceleration gathers the level's q: positions obey the same equations in both."""
    assert isinstance(own.process, ConstantVelocity)  # of `levels_of_walk`
    return float((own.process.acceleration_density_m2_s3 / level.variance_m2) ** (1 / 3))


def inverse_sigma(evaluation: Evaluation, single_frame: bool) -> Floats:
    """1/m, (N,), what each marker adds to predicted PSS of the single frame, or of the filter at the task's process.

    With a probability of detection it is an expectation over which cameras find the marker, as `Evaluation.pss` is.
    """
    if single_frame and evaluation.expected is not None:
        return evaluation.expected.inverse_sigma
    sigma = evaluation.single_frame_sigma_m if single_frame else evaluation.sigma_m
    return np.nan_to_num(evaluation.found / sigma)


def predicted_inverse(evaluation: Evaluation, levels: Sequence[Level]) -> Floats:
    """1/m, (L, N), what each marker adds to predicted PSS of the filter at each level; 0 where it is not observable."""
    seen = np.flatnonzero(evaluation.observable)
    terms = np.zeros((len(levels), len(evaluation.observable)))
    smallest = np.linalg.eigvalsh(evaluation.information[seen, :3, :3])[:, 0]
    for of_level, level in zip(terms, levels, strict=True):
        process = level.process
        blocks = axis_blocks(process.A, process.Q, np.zeros((process.states, process.states)))
        assert blocks is not None  # of constant velocity, all axes move alike
        variance = position_variance(*blocks, smallest, unsolvable="nan")
        of_level[seen] = np.nan_to_num(evaluation.found[seen] / np.sqrt(variance))
    return terms


def measured_inverse(
    cameras: Sequence[PTZCamera],
    points_m: Floats,
    views: Sequence[ViewMeasurement],
    measured: Measured,
    levels: Sequence[Level],
) -> Floats:
    """1/m, (L, N), what each marker adds to measured PSS of the filter at each level: detection rate over a-priori σ.

    Args:
        points_m: m, the truth, (N, 3).
        views: detections of each camera.
        measured: of the same views: which detections triangulation kept.
    """
    kept = np.where(measured.triangulated.used[..., None], [view.pixels for view in views], np.nan)
    detected, weight = detection_weights(cameras, kept, np.array([view.covariance for view in views]))
    information, pull = (part.sum(axis=0) for part in trial_terms(cameras, points_m, kept, detected, weight))
    usable, rate = measured.errors.detected, measured.errors.detection_rate
    sigma = [
        largest_standard_deviation(steady_moments(information, pull, usable, level.process)[0]) for level in levels
    ]
    return np.array([measured_inverse_sigma(of_level, rate) for of_level in sigma])
