"""Consistency of errors with their covariance at three levels: pixel, single frame, filter.

Convention: NEES is eᵀC⁻¹e of the error about the truth, over its degrees of freedom: 1 where C is right, above it where
C is too small. Coverage is the share of errors within the ellipsoid that should hold 50, 90 or 95 % of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from pss.hints import Floats
from validate.stats.crossed import Judged, Resamples, Scale, with_interval
from validate.stats.intervals import spearman_of_groups, tie_groups, weighted_spearman
from validate.stats.measured_errors import inverse_sigma_bias
from validate.stats.small_samples import after_trials

__all__ = ["LEVELS", "Consistency", "anisotropy", "crossed_mean", "of_errors", "of_moments", "sandwich"]


LEVELS = (0.5, 0.9, 0.95)
# Trials from which a point's own moment is compared with a covariance.
FEWEST_TRIALS = 5


@dataclass(frozen=True, eq=False)
class Consistency:
    """Of K × N cells: mean NEES over the degrees of freedom, and the share of errors inside, (K, N) each.

    Attributes:
        nees: nan where nothing was measured or predicted.
        inside: by level of `LEVELS`.
        log_ratio: log of predicted over measured RMS.
    """

    nees: Floats
    inside: Mapping[float, Floats]
    log_ratio: Floats

    def row(self, resamples: Resamples) -> dict[str, object]:
        """Means with 95 % intervals over cameras, views and points, and the median of |log ratio|."""
        row: dict[str, object] = {"cells": int(np.isfinite(self.nees).sum())}
        row |= with_interval("nees_per_dof", crossed_mean(self.nees, resamples))
        for level, inside in self.inside.items():
            row |= with_interval(f"coverage_{round(100 * level)}", crossed_mean(inside, resamples, "share"))
        ratio = self.log_ratio[np.isfinite(self.log_ratio)]
        return row | {
            "median_abs_log_ratio": float(np.median(np.abs(ratio))) if ratio.size else float("nan"),
            "median_log_ratio": float(np.median(ratio)) if ratio.size else float("nan"),
        }


def of_errors(errors: Floats, covariance: Floats) -> Consistency:
    """Compare errors (K, T, N, d), nan where there is none, with covariances (K, N, d, d), nan where not predicted."""
    dof = errors.shape[-1]
    known = np.isfinite(covariance).all(axis=(-2, -1))
    safe = np.where(known[..., None, None], covariance, np.eye(dof))
    inverse = np.linalg.inv(safe)
    seen = np.isfinite(errors[..., 0])
    filled = np.where(seen[..., None], errors, 0.0)
    # Entry by entry: long arrays are quicker than many small matrices.
    squared = np.zeros(seen.shape)
    for i in range(dof):
        for j in range(i, dof):
            twice = 1 if i == j else 2
            squared += (twice * inverse[..., i, j])[:, None] * (filled[..., i] * filled[..., j])
    count = seen.sum(axis=1)
    usable = known & (count >= 1)

    def mean(values: Floats) -> Floats:
        return np.where(usable, (values * seen).sum(axis=1) / np.maximum(count, 1), np.nan)

    inside = {level: mean((squared < scipy.stats.chi2.ppf(level, dof)).astype(float)) for level in LEVELS}
    moment = (filled**2).sum(axis=(1, 3)) / np.maximum(count, 1)
    compared = usable & (count >= FEWEST_TRIALS) & (moment > 0)
    ratio = np.full(usable.shape, np.nan)
    ratio[compared] = 0.5 * np.log(np.trace(safe, axis1=-2, axis2=-1)[compared] / moment[compared])
    return Consistency(mean(squared) / dof, inside, ratio)


def of_moments(moment: Floats, covariance: Floats) -> Floats:
    """√tr of predicted over √tr of measured (…, d, d); nan where either is."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(np.trace(covariance, axis1=-2, axis2=-1) / np.trace(moment, axis1=-2, axis2=-1))


def root_trace_of(covariance: Floats) -> Floats:
    """√tr of matrices of any shape (…, d, d); nan where they are."""
    return np.asarray(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1)))


def crossed_mean(values: Floats, resamples: Resamples, scale: Scale = "positive") -> Judged:
    """Mean over the cells (K, N) that are not nan, and itself on each resample; `scale` is that of its interval."""
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    total, weight = (((resamples.views @ cells) * resamples.points).sum(axis=1) for cells in (filled, known * 1.0))
    estimate = float(filled.sum() / known.sum()) if known.any() else float("nan")
    samples = np.where(weight > 0, total / np.where(weight > 0, weight, 1.0), np.nan)
    return resamples.judged(estimate, samples, 1.0 if scale == "share" else np.inf, scale)


def pooled_spearman(predicted: Floats, measured: Floats, resamples: Resamples) -> Judged:
    """ρ over all cells (K, N) that have both, pooled, and itself on each resample."""
    known = np.isfinite(predicted) & np.isfinite(measured)
    if known.sum() < 3:
        return resamples.judged(float("nan"), np.full(len(resamples.points), np.nan))
    row, column = np.nonzero(known)
    x, y = tie_groups(predicted[known]), tie_groups(measured[known])
    samples = np.array(
        [
            spearman_of_groups(x, y, views[row] * points[column])
            for views, points in zip(resamples.views, resamples.points, strict=True)
        ]
    )
    return resamples.judged(spearman_of_groups(x, y, np.ones(len(x))), samples, 1.0)


def anisotropy(moment: Floats, covariance: Floats, trials: NDArray[np.int64]) -> dict[str, float]:
    """How long, and in which direction, the measured error ellipsoids are against the predicted ones.

    Args:
        moment, covariance: m², (K, N, 3, 3); nan where not known.
        trials: (K, N), of each moment.

    Beside what was predicted stands what moments of as many trials show where the prediction is right
    (`validate.stats.small_samples`). 1/σ, in 1/m, is the mean over cells, freed of its bias as measured PSS is.
    """
    known = np.isfinite(moment).all(axis=(-2, -1)) & np.isfinite(covariance).all(axis=(-2, -1))
    known &= trials >= 2 * FEWEST_TRIALS
    if not known.any():
        return {}
    values = [np.linalg.eigh(matrix[known]) for matrix in (moment, covariance)]
    measured, predicted = (np.sqrt(v[:, -1] / np.maximum(v[:, 0], 1e-300)) for v, _ in values)
    cosine = np.abs((values[0][1][:, :, -1] * values[1][1][:, :, -1]).sum(axis=1))
    # The direction is meaningful only where the ellipsoid is elongated.
    long = predicted > 2
    count = np.asarray(trials)[known]
    sampled = after_trials(covariance[known], count, np.random.default_rng(0))
    by_trials = np.sqrt(values[0][0][:, -1]) * inverse_sigma_bias(count)
    return {
        "measured_axis_ratio_median": float(np.median(measured)),
        "predicted_axis_ratio_median": float(np.median(predicted)),
        "axis_ratio_after_trials_median": float(np.median(sampled.axis_ratio)),
        "axis_ratio_spearman": float(weighted_spearman(predicted, measured)),
        "axis_angle_median_deg": float(np.degrees(np.median(np.arccos(np.clip(cosine[long], 0, 1)))))
        if long.any()
        else float("nan"),
        "axis_angle_after_trials_median_deg": float(np.median(sampled.axis_angle_deg[:, long]))
        if long.any()
        else float("nan"),
        "measured_inverse_sigma_mean": float(np.mean(1 / by_trials)),
        "predicted_inverse_sigma_mean": float(np.mean(1 / np.sqrt(values[1][0][:, -1]))),
        "inverse_sigma_after_trials_mean": float(sampled.inverse_sigma.mean()),
    }


def sandwich(jacobians: Sequence[Floats], claimed: Sequence[Floats], true: Sequence[Floats], q: float) -> Floats:
    """√tr of actual over claimed covariance of a fit, and of a filter, weighted by R where the noise is S; (2, N).

    Of one frame C_R (Σ HᵀR⁻¹ S R⁻¹H) C_R against C_R. Of the filter of a random walk, with the steady gain R gives,
    X = F X Fᵀ + P⁺(Σ HᵀR⁻¹ S R⁻¹H)P⁺ + qI, F = I − P⁺Λ, against P⁻.

    Args:
        jacobians: of each view, (N, 2, 3) px/m; zero where it does not see the point.
        claimed, true: R and S of each view, (N, 2, 2) px².
        q: m², the walk's variance a frame.
    """
    information = np.zeros((len(jacobians[0]), 3, 3))
    meat = np.zeros_like(information)
    for h, r, s in zip(jacobians, claimed, true, strict=True):
        weighted = h.mT @ np.linalg.inv(r)
        information += weighted @ h
        meat += weighted @ s @ weighted.mT
    ratio = np.full((2, len(information)), np.nan)
    values = np.linalg.eigvalsh(information)
    solid = np.flatnonzero(values[:, 0] > 1e-12 * values[:, -1])
    if not solid.size:
        return ratio
    information, meat = information[solid], meat[solid]
    claimed_c = np.linalg.inv(information)
    actual_c = claimed_c @ meat @ claimed_c
    values, axes = np.linalg.eigh(claimed_c)
    prior = (axes * (q / 2 + np.sqrt(q * q / 4 + q * values))[:, None, :]) @ axes.mT
    posterior = np.linalg.inv(np.linalg.inv(prior) + information)
    step = np.eye(3) - posterior @ information
    forcing = posterior @ meat @ posterior + q * np.eye(3)
    # X = F X Fᵀ + M, written as one linear system a point.
    kron = np.einsum("nij,nkl->nikjl", step, step).reshape(-1, 9, 9)
    actual_p = np.linalg.solve(np.eye(9) - kron, forcing.reshape(-1, 9, 1)).reshape(-1, 3, 3)
    for row, actual, stated in ((0, actual_c, claimed_c), (1, actual_p, prior)):
        ratio[row, solid] = np.sqrt(np.trace(actual, axis1=1, axis2=2) / np.trace(stated, axis1=1, axis2=2))
    return ratio
