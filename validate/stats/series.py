"""Intervals of statistics over the steps of one walk, which are few and alike from step to step.

A block bootstrap of 21 steps with blocks of a few steps covers 0.67 to 0.91 where 0.95 is meant: what varies more
slowly than a block is cut apart and taken for chance. Here the variance of a mean over the steps is read off its
slowest variations instead: the mean square of the series' first ν cosine coefficients, with Student's t for ν degrees
of freedom (Müller 2007; Lazarus, Lewis, Stock & Watson 2018, "HAR inference"). With all K − 1 cosines of K steps it is
Student's interval of independent values; with few of them it holds for correlated ones, and is as wide as so few
independent pieces of a walk make it.

How many is fixed beforehand by the number of steps: an estimate of the correlation from 21 steps would be too uncertain
to choose by (simulated coverage 0.87 to 0.92 for an autocorrelation of 0.8 to 0.9). All strategies of a step keep
together, since they share the walk.

The population is a long walk of the same kind under the same strategies: intervals are about which steps were seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.stats
from numpy.typing import ArrayLike

from pss.errors import ShapeError
from pss.hints import Floats
from validate.stats.intervals import weighted_spearman

__all__ = [
    "cosine_count",
    "half_width",
    "median_interval",
    "spearman_difference_interval",
    "spearman_interval",
    "step_correlation",
]


LEVEL = 0.95
# Steps that half a period of the fastest cosine must span: with 21 steps and two cosines, simulated 95 % intervals
# cover 0.93 to 0.97 up to a correlation of 0.8 from step to step, whose integrated autocorrelation time is 9 steps.
CORRELATED_STEPS = 10
FEWEST_COSINES = 2
# Fisher's z of ρ = 1 is infinite: ρ counts as this at most.
HIGHEST_RHO = 1 - 1e-7
# Of z; pseudo-values that are all alike differ by roundings.
NO_SPREAD = 1e-9


def cosine_count(steps: int) -> int:
    """ν, how many of the slowest cosines of K steps are used: 2 for 21 steps, K/10 for many."""
    return min(max(FEWEST_COSINES, steps // CORRELATED_STEPS), steps - 1)


def half_width(series: ArrayLike, cosines: int | None = None) -> Floats:
    """Half of the 95 % interval of the mean of a correlated series along the last axis of (..., K); nan for one step.

    Args:
        cosines: ν; None for `cosine_count`.
    """
    values = np.asarray(series, dtype=np.float64)
    steps = values.shape[-1]
    count = cosine_count(steps) if cosines is None else cosines
    if count < 1:
        return np.full(values.shape[:-1], np.nan)[()]
    place = (np.arange(steps) + 0.5) / steps
    basis = np.sqrt(2 / steps) * np.cos(np.pi * np.outer(np.arange(1, count + 1), place))
    variance = ((values @ basis.T) ** 2).mean(axis=-1) / steps
    return np.asarray(scipy.stats.t.ppf((1 + LEVEL) / 2, count) * np.sqrt(variance))[()]


def spearman_interval(x: ArrayLike, y: ArrayLike) -> tuple[float, float, float]:
    """Spearman's ρ over R runs and K steps, (R, K) each, and its 95 % interval over the steps.

    By the jackknife's pseudo-values of Fisher's z, each step left out with all of its runs.

    Returns:
        ρ and the interval's ends, which hold it; ends are nan where leaving out a step leaves no ρ, or changes nothing.
    """
    found = _jackknifed(*_pair(x, y))
    return found.rho, found.low, found.high


def spearman_difference_interval(x: ArrayLike, other: ArrayLike, y: ArrayLike) -> tuple[float, float, float]:
    """ρ(x, y) − ρ(other, y), of the same steps, and its 95 % interval; arguments and nan as in `spearman_interval`.

    From the two intervals of ρ and the correlation of their pseudo-values (Zou 2007, "Toward using confidence intervals
    to compare correlations"): the plain jackknife of the difference covers 0.89 at a correlation of 0.8 between steps.
    """
    x, y = _pair(x, y)
    other, _ = _pair(other, y)
    one, two = _jackknifed(x, y), _jackknifed(other, y)
    difference = one.rho - two.rho
    if np.isnan([one.low, two.low]).any():
        return difference, np.nan, np.nan
    shared = float(np.corrcoef(one.pseudo_values, two.pseudo_values)[0, 1])

    def length(a: float, b: float) -> float:
        return float(np.sqrt(max(a * a + b * b - 2 * shared * a * b, 0.0)))

    below = length(one.rho - one.low, two.high - two.rho)
    above = length(one.high - one.rho, two.rho - two.low)
    return difference, difference - below, difference + above


def median_interval(values: ArrayLike) -> tuple[float, float, float]:
    """The median of values ≥ 0 over R runs and K steps, (R, K), nan left out, and its 95 % interval over the steps.

    The interval of the share below the median, read off the values' own distribution (Woodruff 1952): the ends are
    values themselves, ∞ among them. Where the share's interval reaches 0 and 1 they are the smallest and largest.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 2:
        raise ShapeError(f"values {values.shape}; allowed: (R, K)")
    known = ~np.isnan(values)
    if not known.any():
        return np.nan, np.nan, np.nan
    ordered = np.sort(values[known])
    last = len(ordered) - 1
    median = float((ordered[last // 2] + ordered[last - last // 2]) / 2)
    below = np.where(known, (values <= median).astype(float) - (values[known] <= median).mean(), 0.0)
    # A step's part in the share: what is not known adds nothing, as the sum is over those that are.
    half = half_width(below.sum(axis=0) * values.shape[1] / known.sum())
    if np.isnan(half):
        return median, np.nan, np.nan
    low, high = (last * np.clip(0.5 + side * half, 0.0, 1.0) for side in (-1, 1))
    return median, float(ordered[int(np.floor(low))]), float(ordered[int(np.ceil(high))])


def step_correlation(x: ArrayLike, y: ArrayLike) -> float:
    """Correlation from step to step of what decides ρ(x, y): of the ranks' products, their small-sample bias added.

    A single series of a few tens of steps estimates it to ± 0.2; intervals do not depend on it. nan if it has no
    spread.
    """
    x, y = _pair(x, y)
    steps = x.shape[1]
    ranks = [scipy.stats.rankdata(part).reshape(part.shape) for part in (x, y)]
    centred = [part - part.mean() for part in ranks]
    series = (centred[0] * centred[1]).sum(axis=0)
    series = series - series.mean()
    total = float((series**2).sum())
    if steps < 4 or total == 0:
        return np.nan
    lagged = float((series[1:] * series[:-1]).sum()) / total
    return float(np.clip((lagged + 1 / steps) / (1 - 3 / steps), -1.0, 1.0))


def _pair(x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
    a, b = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if a.ndim != 2 or a.shape != b.shape:
        raise ShapeError(f"x {a.shape} and y {b.shape}; allowed: two alike, (R, K)")
    return a, b


def _rho(x: Floats, y: Floats) -> float:
    return float(weighted_spearman(x.ravel(), y.ravel()))


@dataclass(frozen=True, eq=False)
class _Jackknifed:
    """ρ, its interval, and the pseudo-values of Fisher's z, (K,)."""

    rho: float
    low: float
    high: float
    pseudo_values: Floats


def _jackknifed(x: Floats, y: Floats) -> _Jackknifed:
    """Of (R, K) each; without an interval where a step left out leaves no ρ, or changes nothing."""
    steps, rho = x.shape[1], _rho(x, y)
    if steps < 3:
        return _Jackknifed(rho, np.nan, np.nan, np.full(steps, np.nan))
    without = np.array([_rho(np.delete(x, step, axis=1), np.delete(y, step, axis=1)) for step in range(steps)])
    whole, others = (np.arctanh(np.clip(values, -HIGHEST_RHO, HIGHEST_RHO)) for values in (rho, without))
    pseudo_values = steps * whole - (steps - 1) * others
    half = float(half_width(pseudo_values))
    if not half > NO_SPREAD:
        return _Jackknifed(rho, np.nan, np.nan, pseudo_values)
    low, high = np.tanh([whole - half, whole + half]).tolist()
    return _Jackknifed(rho, min(low, rho), max(high, rho), pseudo_values)
