"""Fewer points of interest for the same PSS: prefixes of a balanced order, and their error.

PSS is a mean over points of 1/σ, where unobservable ones count 0 (Eq. 10). The mean over a part of the points estimates
it, with a known error. Each function states which bound is certain and which holds with a given confidence.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri, stdtrit

from pss.errors import RangeError, ShapeError
from pss.hints import Floats, Integers
from pss.inputs import numbers
from pss.surrogates.orders import as_cloud, balanced_order
from pss.surrogates.points import Surrogate

__all__ = [
    "Subsample",
    "relative_standard_error",
    "subsample_adaptively",
    "subsample_to_budget",
    "subsample_to_tolerance",
]


# Fewer points than this are too few to estimate their own standard error.
FIRST_POINTS = 32
# The nearest alone is too close to represent a point of the same stratum.
NEIGHBOURS = 3
# Sizes tried grow by this factor, stopping at each power of two, where strata are complete.
GROWTH = 1.25


@dataclass(frozen=True, eq=False)
class Subsample:
    """A part of a surrogate that represents all of it.

    Attributes:
        surrogate: its M points.
        indices: of its points in the whole surrogate, (M,), in the order in which they were taken.
        relative_error: the largest |mean over the part / mean over all − 1| of the given settings; nan if there are
            none.
        relative_bound: upper bound of that error for another setting, with the requested confidence; nan if unknown, 0
            if the part is the whole.
    """

    surrogate: Surrogate
    indices: Integers
    relative_error: float
    relative_bound: float

    def __len__(self) -> int:
        return len(self.indices)


def relative_standard_error(points_m: ArrayLike, inverse_sigma: ArrayLike, whole: int) -> Floats:
    """Relative standard error of the mean over the first M points in balanced order.

    Such points are one of each stratum, and the variance of the mean is that within strata. It is estimated from
    differences between neighbours, which are slightly farther apart than two points of a stratum, so that the estimate
    is conservative. This holds for runs of 2, 4, 8, … points: M is split into such runs, and the remainder, too small
    for neighbours, counts as drawn at random.

    Args:
        points_m: m, the M points in their order, (M, 3).
        inverse_sigma: 1/m, (M,) or (K, M) for K settings; 0 at unobservable points.
        whole: number of points of which the M are a prefix.

    Returns:
        (K,), or (1,); 0 where the M are the whole, else ∞ where all are unobservable or there is only one.
    """
    points = as_cloud(points_m)
    values, count = _as_settings(inverse_sigma, len(points)), len(points)
    if count > whole:
        raise RangeError(f"whole = {whole!r}; allowed: {count} or more, as many as there are points")
    if count == whole:
        return np.zeros(len(values))
    if count == 1:
        return np.full(len(values), np.inf)
    variance, begin = np.zeros(len(values)), 0
    while count - begin >= FIRST_POINTS:
        run = slice(begin, begin + 2 ** ((count - begin).bit_length() - 1))
        size = run.stop - begin
        variance += size * (1 - size / whole) * _variance_between_neighbours(points[run], values[:, run])
        begin = run.stop
    variance += (count - begin) * values.var(axis=1, ddof=1)
    mean, error = values.mean(axis=1), np.sqrt(variance) / count
    return np.where(mean > 0, error / np.where(mean > 0, mean, 1.0), np.inf)


def _variance_between_neighbours(points: Floats, values: Floats) -> Floats:
    """Half the mean square of the differences of `values`, (K, M), between each of `points` and its nearest; (K,)."""
    from scipy.spatial import cKDTree

    # The first is the point itself or a coincident one, whose difference of 0 is then counted twice.
    _, nearest = cKDTree(points).query(points, k=range(2, NEIGHBOURS + 2))
    differences = values[:, np.asarray(nearest)] - values[:, :, None]
    return np.asarray((differences**2).mean(axis=(1, 2)) / 2)


def subsample_to_tolerance(
    surrogate: Surrogate, inverse_sigma: ArrayLike, tolerance: float, *, confidence: float = 0.95
) -> Subsample:
    """The fewest points, in balanced order, whose mean 1/σ is within `tolerance` of that of all, for known settings.

    Certain: each of the given settings keeps the tolerance, and would with any larger prefix. Likely: another setting,
    drawn like these, keeps it with probability `confidence`. For this, one of two bounds must be below the tolerance:
    Student's on the errors of the K settings, which assumes them normal and is useful from about ten settings on; or
    the largest of these errors plus the normal quantile of their standard error, estimated from differences between
    neighbours.

    Args:
        inverse_sigma: 1/m at all N points, (N,) or (K, N) for K settings, such as neighbouring ones; 0 where
            unobservable.
        tolerance: relative to the mean over all points.

    Raises:
        RangeError: no setting observes any point, or a number is out of range.
    """
    quantile = _checked_quantile(tolerance, confidence)
    order = balanced_order(surrogate.points_m)
    values = _as_settings(inverse_sigma, len(surrogate))[:, order]
    values = values[values.any(axis=1)]
    if len(values) == 0:
        raise RangeError("inverse_sigma is 0 everywhere; allowed: at least one setting that observes a point")
    whole = values.mean(axis=1, keepdims=True)
    errors = np.abs(np.cumsum(values, axis=1) / np.arange(1, len(order) + 1) / whole - 1)
    errors[:, -1] = 0.0
    # What a prefix gets right by chance, a longer one gets wrong again: the largest error from there on counts.
    worst, spread = (_largest_from_here_on(e) for e in (errors.max(axis=0), np.sqrt((errors**2).mean(axis=0))))
    bound = float(stdtrit(len(values), (1 + confidence) / 2)) * spread
    fewest, by_errors = (int((kept <= tolerance).argmax()) + 1 for kept in (worst, np.maximum(worst, bound)))
    size = max(fewest, FIRST_POINTS)
    while size < by_errors:
        error = relative_standard_error(surrogate.points_m[order[:size]], values[:, :size], len(order))
        by_neighbours = float(worst[size - 1] + quantile * error.max())
        if by_neighbours <= tolerance:
            return _cut(surrogate, order, size, float(errors[:, size - 1].max()), by_neighbours)
        size = min(math.ceil(GROWTH * size), 2 ** size.bit_length())
    return _cut(surrogate, order, by_errors, float(errors[:, by_errors - 1].max()), float(bound[by_errors - 1]))


def subsample_to_budget(surrogate: Surrogate, seconds_per_point: float, budget_s: float) -> Subsample:
    """As many points, in balanced order, as can be evaluated in `budget_s` seconds; their error is unknown.

    Raises:
        RangeError: a time is not above 0, or the budget is too short for one point.
    """
    for name, value in (("seconds_per_point", seconds_per_point), ("budget_s", budget_s)):
        if not 0 < value < math.inf:
            raise RangeError(f"{name} = {value!r}; allowed: above 0, in seconds")
    # Times are decimal fractions: a budget of 0.3 must suffice for three points of 0.1 each.
    affordable = math.floor(min(budget_s / seconds_per_point * (1 + 1e-12), len(surrogate)))
    if affordable < 1:
        raise RangeError(f"budget_s = {budget_s!r}; allowed: {seconds_per_point!r} s or more, the time of one point")
    return _cut(surrogate, balanced_order(surrogate.points_m), affordable, math.nan, math.nan)


def subsample_adaptively(
    surrogate: Surrogate,
    inverse_sigma_at: Callable[[Surrogate], ArrayLike],
    tolerance: float,
    *,
    confidence: float = 0.95,
    budget_s: float | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> Subsample:
    """Evaluate more and more points, in balanced order, until their mean 1/σ is likely to be within `tolerance`.

    No point is evaluated twice, and all of them only if fewer do not suffice. The tolerance is kept with the given
    confidence, never with certainty: `relative_bound` is the largest standard error of the settings times the normal
    quantile of `confidence`, and exceeds the tolerance if time ran out first.

    Args:
        inverse_sigma_at: from M points to 1/m, (M,), or (K, M) for K settings, 0 where unobservable.
        tolerance: relative to the mean over all points.
        budget_s: seconds for all evaluations; kept as far as the time of the first ones predicts the next. The first 32
            points are evaluated in any case.
        clock: function that returns seconds from any origin.
    """
    quantile = _checked_quantile(tolerance, confidence)
    if budget_s is not None and not 0 < budget_s < math.inf:
        raise RangeError(f"budget_s = {budget_s!r}; allowed: above 0, in seconds, or None")
    order, begin = balanced_order(surrogate.points_m), clock()
    parts: list[Floats] = []
    size, target = 0, min(FIRST_POINTS, len(order))
    while True:
        parts.append(_as_settings(inverse_sigma_at(surrogate.take(order[size:target])), target - size))
        if len({len(part) for part in parts}) > 1:
            raise ShapeError(f"inverse_sigma_at gave {[len(part) for part in parts]} settings; allowed: always as many")
        size = target
        errors = relative_standard_error(surrogate.points_m[order[:size]], np.concatenate(parts, axis=1), len(order))
        bound = quantile * float(errors.max())
        # Few tests of the error, so that chance does not stop too early, and each at complete strata.
        target = min(len(order), 2 * size)
        if budget_s is not None:
            spent = clock() - begin
            affordable = size + size * (budget_s - spent) / spent if spent > 0 else math.inf
            target = math.floor(min(target, max(affordable, size)))
        if bound <= tolerance or target == size:
            return _cut(surrogate, order, size, 0.0 if size == len(order) else math.nan, bound)


def _cut(surrogate: Surrogate, order: Integers, size: int, relative_error: float, relative_bound: float) -> Subsample:
    whole = size == len(order)
    indices = order[:size]
    indices.flags.writeable = False
    return Subsample(surrogate.take(indices), indices, *((0.0, 0.0) if whole else (relative_error, relative_bound)))


def _largest_from_here_on(values: Floats) -> Floats:
    return np.asarray(np.maximum.accumulate(values[::-1])[::-1])


def _checked_quantile(tolerance: float, confidence: float) -> float:
    """Half-width, in standard deviations, of the central interval of a normal distribution with this probability."""
    for name, value in (("tolerance", tolerance), ("confidence", confidence)):
        if not 0 < value < 1:
            raise RangeError(f"{name} = {value!r}; allowed: above 0 and below 1")
    return float(ndtri((1 + confidence) / 2))


def _as_settings(inverse_sigma: ArrayLike, count: int) -> Floats:
    """`inverse_sigma` as (K, `count`)."""
    values = numbers(inverse_sigma, "inverse_sigma", f"({count},) or (K, {count})")
    if values.ndim not in (1, 2) or values.shape[-1] != count or values.size == 0:
        raise ShapeError(f"inverse_sigma has shape {values.shape}; allowed is ({count},) or (K, {count})")
    if not (np.isfinite(values) & (values >= 0)).all():
        raise RangeError(
            "inverse_sigma has a value that is not finite or below 0; allowed: 0 /m (unobservable) and above"
        )
    return np.atleast_2d(values)
