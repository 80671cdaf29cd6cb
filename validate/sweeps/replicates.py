"""Resamples of a sweep: random weights for its trials and points, shared by all of its configurations.

The steps of a sweep are fixed; chance is in the trials and in which points there are (`validate.stats.intervals`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import ShapeError
from pss.hints import Floats
from validate.stats.intervals import FEWEST_RESAMPLED
from validate.stats.measured_errors import MeasuredErrors

__all__ = ["SweepReplicates", "sweep_replicates"]


@dataclass(frozen=True, eq=False)
class SweepReplicates:
    """B resamples of a sweep of S configurations, each (B, S), with the same weights along each row.

    Attributes:
        measured_pss: 1/m, single-frame kind.
        predicted_pss: 1/m, Eq. 10 under the same point weights.
        rms_m: m, pooled over the detected points; nan where there is none.
        measured_pss_of_trials, measured_pss_of_points: 1/m, as `measured_pss`, but the trials or the points alone
            resampled.
        trial_weights, point_weights: (B, T) and (B, N), rows of sum 1, for other statistics on the same resamples;
            those of too few trials are nan.
    """

    measured_pss: Floats
    predicted_pss: Floats
    rms_m: Floats
    measured_pss_of_trials: Floats
    measured_pss_of_points: Floats
    trial_weights: Floats
    point_weights: Floats


def sweep_replicates(
    errors: Sequence[MeasuredErrors],
    predicted_inverse_sigma: ArrayLike,
    rng: np.random.Generator,
    replicates: int = 500,
) -> SweepReplicates:
    """Resample the trials and points of a sweep; both are shared by all its configurations, which stay as they are.

    A trial of a view is the same capture in every configuration that has the view, and the points are the same
    everywhere; so a row is one world seen by all configurations, and differences between them keep their pairing. The
    product of two weights counts what is peculiar to one trial of one point about twice: the intervals err to the long
    side where that dominates. Errors that all points of a trial have in common depend on one variance from T trials,
    for which 95 % intervals cover about 88 %. What is measured over fewer trials than `FEWEST_RESAMPLED` has no
    interval: its resamples are nan.

    Args:
        errors: one for each configuration, all of T trials and N points.
        predicted_inverse_sigma: 1/m, (S, N), 0 where the point is not observable.
    """
    predicted = np.asarray(predicted_inverse_sigma, dtype=np.float64)
    shapes = {e.errors_m.shape for e in errors}
    if len(shapes) != 1 or predicted.shape != (len(errors), errors[0].errors_m.shape[1]):
        raise ShapeError(
            f"errors {sorted(shapes)} and predicted_inverse_sigma {predicted.shape}; allowed: all (T, N, 3), and (S, N)"
        )
    trials, points, _ = shapes.pop()
    trial_weights = rng.dirichlet(np.ones(trials), size=replicates)
    if trials < FEWEST_RESAMPLED:
        trial_weights = np.full_like(trial_weights, np.nan)
    point_weights = rng.dirichlet(np.ones(points), size=replicates)
    measured_pss, of_trials, of_points, rms = np.empty((4, replicates, len(errors)))
    for s, configuration in enumerate(errors):
        inverse_sigma, mean_squares = _trial_replicates(configuration, trial_weights)
        measured_pss[:, s] = (inverse_sigma * point_weights).sum(axis=1)
        of_trials[:, s] = inverse_sigma.mean(axis=1)
        of_points[:, s] = point_weights @ configuration.inverse_sigma
        weights = point_weights * (configuration.detections > 0)
        with np.errstate(invalid="ignore"):  # no point detected: 0/0, nan
            rms[:, s] = np.sqrt((weights * mean_squares).sum(axis=1) / weights.sum(axis=1))
    predicted_pss = point_weights @ predicted.T
    return SweepReplicates(measured_pss, predicted_pss, rms, of_trials, of_points, trial_weights, point_weights)


def _trial_replicates(errors: MeasuredErrors, trial_weights: Floats) -> tuple[Floats, Floats]:
    """Terms of the measured PSS (1/m) and mean squared errors (m²), both (B, N), under (B, T) weights of the trials."""
    detected = errors.detected
    known = np.where(detected[..., None], errors.errors_m, 0.0)
    i, j = np.triu_indices(3)
    products = (known[..., i] * known[..., j]).reshape(len(known), -1)
    rate = trial_weights @ detected
    moments = (trial_weights @ products).reshape(*rate.shape, 6) / np.where(rate > 0, rate, 1.0)[..., None]
    estimate = errors.inverse_sigma
    counts = estimate > 0
    inverse_sigma = np.zeros_like(rate)
    inverse_sigma[:, counts] = rate[:, counts] / np.sqrt(_largest_eigenvalue(moments[:, counts]))
    # The resample adds the small-sample bias of 1/σ̂ once more to data that already had it. Its own mean shows how much,
    # whatever the errors' distribution; without this, an interval of many points excludes its estimate.
    inverse_sigma[:, counts] *= estimate[counts] / inverse_sigma[:, counts].mean(axis=0)
    return inverse_sigma, moments[..., [0, 3, 5]].sum(axis=-1)


def _largest_eigenvalue(upper: Floats) -> Floats:
    """Largest eigenvalue (...) of symmetric 3 × 3 matrices given by rows of the upper triangle (..., 6).

    Trigonometric closed form (Smith 1961), good to about 1e-8 of the value: a fifth of the time of a batched solver.
    """
    xx, xy, xz, yy, yz, zz = np.moveaxis(upper, -1, 0)
    mean = (xx + yy + zz) / 3
    dx, dy, dz = xx - mean, yy - mean, zz - mean
    spread = np.sqrt((dx * dx + dy * dy + dz * dz + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    determinant = dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * xz) + xz * (xy * yz - dy * xz)
    cosine = determinant / np.where(spread > 0, 2 * spread**3, 1.0)
    return mean + 2 * spread * np.cos(np.arccos(np.clip(cosine, -1.0, 1.0)) / 3)
