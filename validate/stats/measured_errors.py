"""The measured error of one configuration: its accuracy from trials of triangulation at known points.

Everything is of the single-frame kind unless a caller hands in a filter's σ (`measured_pss`). σ is √λmax of the second
moment E[eeᵀ], as the paper's σ∞ is √λmax of a covariance; the RMS is √tr of the same matrix. The second moment is about
the truth, so that a bias that every trial repeats counts as error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaln

from pss.errors import RangeError, ShapeError
from pss.hints import Floats
from pss.inputs import number
from pss.riccati.covariances import largest_standard_deviation, root_trace

__all__ = [
    "FEWEST_TRIALS",
    "MeasuredErrors",
    "check_trials",
    "inverse_sigma_bias",
    "measured_inverse_sigma",
    "measured_pss",
]


# 1/σ̂ has no mean over one trial, so that nothing corrects it: a point that was triangulated only once counts zero.
FEWEST_TRIALS = 2


@dataclass(frozen=True, eq=False)
class MeasuredErrors:
    """Errors of one configuration over T trials at N points.

    Where a figure needs more detections than a point has (one for moments, two for the spread), the point is nan.

    Attributes:
        errors_m: m, (T, N, 3), estimate − truth; nan in all three where the point was not triangulated.

    Raises:
        ShapeError: not (T, N, 3) with T, N ≥ 1.
        RangeError: an infinite error, or nan in only some coordinates.
    """

    errors_m: Floats

    def __post_init__(self) -> None:
        errors = np.asarray(self.errors_m, dtype=np.float64)
        if errors.ndim != 3 or errors.shape[2] != 3 or 0 in errors.shape:
            raise ShapeError(f"errors_m {errors.shape}; allowed is (T, N, 3) with at least one trial and one point")
        missing = np.isnan(errors)
        if np.isinf(errors).any() or (missing.any(axis=2) != missing.all(axis=2)).any():
            raise RangeError("errors_m with inf, or nan in some coordinates only; allowed: finite, or nan in all three")
        object.__setattr__(self, "errors_m", errors)

    def of_trials(self, trials: ArrayLike) -> MeasuredErrors:
        """The errors of some trials only: indices or a mask over T."""
        return MeasuredErrors(self.errors_m[np.asarray(trials)])

    def halves(self) -> tuple[MeasuredErrors, MeasuredErrors]:
        """The even and the odd trials: what is fitted or chosen on one half is judged on the other."""
        return self.of_trials(np.arange(0, self.trials, 2)), self.of_trials(np.arange(1, self.trials, 2))

    @property
    def trials(self) -> int:
        """T."""
        return len(self.errors_m)

    @cached_property
    def detected(self) -> NDArray[np.bool_]:
        """(T, N), the point was triangulated in the trial."""
        return ~np.isnan(self.errors_m[:, :, 0])

    @cached_property
    def detections(self) -> NDArray[np.int64]:
        """(N,), the number of trials that each point's moments are taken over."""
        return self.detected.sum(axis=0)

    @property
    def detection_rate(self) -> Floats:
        """(N,), detections over trials."""
        return self.detections / self.trials

    @cached_property
    def second_moment_m2(self) -> Floats:
        """m², (N, 3, 3), E[eeᵀ] over the trials that triangulated the point."""
        known = np.where(self.detected[..., None], self.errors_m, 0.0)
        return _over(np.einsum("tni,tnj->nij", known, known), self.detections[:, None, None])

    @cached_property
    def mean_error_m(self) -> Floats:
        """m, (N, 3)."""
        return _over(np.nansum(self.errors_m, axis=0), self.detections[:, None])

    @cached_property
    def sigma_m(self) -> Floats:
        """m, (N,), √λmax of E[eeᵀ]: beside the predicted √λmax of C.

        The largest eigenvalue of a sample moment is too large on average where eigenvalues are close to each other: 1/σ̂
        is then too small, by about a fifth for isotropic errors and 20 trials. Triangulation errors are long along the
        line of sight, which makes this small.
        """
        return largest_standard_deviation(self.second_moment_m2)

    @cached_property
    def rms_m(self) -> Floats:
        """m, (N,), √tr of E[eeᵀ]: beside the predicted √tr of C."""
        return root_trace(self.second_moment_m2)

    @cached_property
    def bias_m(self) -> Floats:
        """m, (N,), length of the mean error; too large by its own scatter: its square by std² over detections."""
        return np.linalg.norm(self.mean_error_m, axis=1)

    @cached_property
    def std_m(self) -> Floats:
        """m, (N,), √tr of the covariance about the mean error, with one degree of freedom taken by the mean."""
        squares = np.nansum((self.errors_m - self.mean_error_m) ** 2, axis=(0, 2))
        return np.sqrt(_over(squares, self.detections - 1))

    @cached_property
    def noise_share(self) -> float:
        """Share of the mean squared error, summed over the points, that is spread and not bias; nan if unknown.

        Of points with two detections or more. With S the spread (std²) and k detections, the square of the mean error
        is on average the true bias² + S/k; with S/k taken off, bias² + S is exactly the second moment's trace, so that
        the share is ΣS / Σtr. It can exceed 1 by chance where there is no bias; it is then 1.
        """
        enough = self.detections >= 2
        total = float((self.rms_m[enough] ** 2).sum())
        return min(float((self.std_m[enough] ** 2).sum()) / total, 1.0) if total > 0 else np.nan

    @cached_property
    def pooled_rms_m(self) -> float:
        """m, root mean square over the detected points, each with the same weight; nan if there is none.

        It rewards a configuration that loses its difficult points: compare it on common points only.
        """
        known = self.rms_m[self.detections > 0]
        return float(np.sqrt((known**2).mean())) if len(known) else np.nan

    @cached_property
    def median_rms_m(self) -> float:
        """m, median of the RMS over all points, where a point that was never triangulated has ∞."""
        return float(np.median(np.where(self.detections > 0, self.rms_m, np.inf)))

    @cached_property
    def inverse_sigma(self) -> Floats:
        """1/m, (N,), what each point adds to the measured PSS: detection rate over σ, less the bias of 1/σ̂."""
        return measured_inverse_sigma(self.sigma_m, self.detection_rate, self.detections)

    def pss(self) -> float:
        """1/m, measured PSS of the single-frame kind: Eq. 10 with the measured √λmax."""
        return measured_pss(self.sigma_m, self.detection_rate, self.detections)

    def nees(self, covariance_m2: ArrayLike) -> Floats:
        """(N,), mean of eᵀC⁻¹e over each point's trials; 3 where the covariance C, (N, 3, 3) in m², is right.

        nan for a point without detection or without a finite covariance.
        """
        covariance = np.asarray(covariance_m2, dtype=np.float64)
        if covariance.shape != (self.errors_m.shape[1], 3, 3):
            raise ShapeError(f"covariance_m2 {covariance.shape}; allowed is {(self.errors_m.shape[1], 3, 3)}")
        moment, nees = self.second_moment_m2, np.full(len(covariance), np.nan)
        known = (self.detections > 0) & np.isfinite(covariance).all(axis=(1, 2))
        # The mean of eᵀC⁻¹e is tr(C⁻¹ E[eeᵀ]).
        nees[known] = np.trace(np.linalg.solve(covariance[known], moment[known]), axis1=1, axis2=2)
        return nees

    def share_under(self, threshold_m: float) -> float:
        """Share of all trials of all points with an error below `threshold_m` (m); not triangulated is not below."""
        return float((np.linalg.norm(self.errors_m, axis=2) < threshold_m).mean())


def _over(total: Floats, count: ArrayLike) -> Floats:
    """`total` / `count`, nan where the count is not positive."""
    count = np.asarray(count)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def inverse_sigma_bias(dof: ArrayLike) -> Floats:
    """E[1/σ̂] · σ for σ̂² the mean of `dof` = k squares of a zero-mean normal error: √(k/2) Γ((k−1)/2) / Γ(k/2).

    1.040 for k = 20, 1.084 for 10, √π for 2, 1 for ∞; no mean, hence ∞, for k ≤ 1. It is exact for one error component,
    and close where one direction dominates: with errors ten times (three times) as long in one direction as in the
    others, 1/σ comes out 10 % (30 %) too small from two trials, 2 % (15 %) from three, 0.4 % (5.7 %) from five, 0.1 %
    (1.9 %) from ten and below 0.1 % (0.8 %) from 20; with errors as long in all directions, 36, 27 and 20 % from 5, 10
    and 20. What a prediction gives after as many trials is drawn by `validate.stats.small_samples`. A
    bias that every trial repeats makes σ̂ steadier than that: where the bias dominates, dividing by this makes 1/σ too
    small, by 4 % at k = 20.
    """
    k = np.asarray(dof, dtype=np.float64)
    usable = (k > 1) & np.isfinite(k)
    safe = np.where(usable, k, 2.0)
    factor = np.exp(gammaln((safe - 1) / 2) - gammaln(safe / 2) + np.log(safe / 2) / 2)
    return np.where(usable, factor, np.where(k > 1, 1.0, np.inf))


def measured_inverse_sigma(sigma_m: ArrayLike, detection_rate: ArrayLike, dof: ArrayLike | None = None) -> Floats:
    """1/m, (N,), detection rate over measured σ of each point: the terms of Eq. 10's sum.

    Args:
        sigma_m: m, measured √λmax, (N,); nan where the point was never triangulated, which adds zero.
        detection_rate: (N,) or one for all, in [0, 1].
        dof: trials that each second moment was taken over, (N,) or one for all; 1/σ̂ is divided by its bias, and a point
            with fewer than `FEWEST_TRIALS` adds zero. None (or ∞): no correction, as for a filter's long record.
    """
    sigma, rate = np.asarray(sigma_m, dtype=np.float64), np.asarray(detection_rate, dtype=np.float64)
    k = np.broadcast_to(np.inf if dof is None else np.asarray(dof, dtype=np.float64), sigma.shape)
    if not ((rate >= 0) & (rate <= 1)).all():
        raise RangeError(f"detection_rate from {rate.min():.6g} to {rate.max():.6g}; allowed: 0 to 1")
    counts = np.isfinite(sigma) & (k >= FEWEST_TRIALS)
    if not (sigma[counts] > 0).all():
        raise RangeError("sigma_m holds a measured σ of 0 or less; allowed: above 0, or nan")
    return np.where(counts, rate / np.where(counts, sigma * inverse_sigma_bias(k), 1.0), 0.0)


def measured_pss(sigma_m: ArrayLike, detection_rate: ArrayLike, dof: ArrayLike | None = None) -> float:
    """1/m, Eq. 10 with measured σ: the mean over all points of `measured_inverse_sigma`, which has the arguments."""
    return float(measured_inverse_sigma(sigma_m, detection_rate, dof).mean())


def check_trials(trials: object, given: str) -> None:
    """Refuse fewer trials of each view than have a spread.

    Args:
        given: the number as the user passed it, such as "--trials 1" or "trials = 1".

    Raises:
        RangeError: fewer than `FEWEST_TRIALS`, or no number.
    """
    if number(trials, "trials") < FEWEST_TRIALS:
        raise RangeError(f"{given}; allowed: {FEWEST_TRIALS} or more (one has no spread)")
