"""Exponents of σ: log σ² = c + 2 Σ βᵢ log factorᵢ, over the steps of one series or over random combinations.

In a series each pose has a constant of its own, since all levels share the poses, and the interval is over poses
(delete-one jackknife with Student's t: there are few). Over combinations, each with a pose of its own, renders are
resampled with replacement (percentiles of the bootstrap).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.stats
from numpy.typing import NDArray
from scipy.special import digamma

from pss.hints import Floats
from validate.pixel_noise.estimates import LEVEL, Estimate

__all__ = ["PowerLaw", "joint_exponents", "log_variance", "series_exponent", "slopes"]


RESAMPLES = 2000
# Of a resample's normal equations: beyond it, the sample cannot separate the factors.
LARGEST_CONDITION = 1e10


def log_variance(variance: Floats, freedom: NDArray[np.int64]) -> Floats:
    """log σ² (N,) without bias, from estimates of so many degrees of freedom: E log s² = log σ² + ψ(ν/2) − log(ν/2)."""
    half = np.maximum(freedom, 1) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(freedom > 0, np.log(variance) - digamma(half) + np.log(half), np.nan)


def slopes(log_variances: Floats, logs: Floats, groups: NDArray[np.int64]) -> Floats:
    """Exponents of σ, (F,), by least squares of log σ² (N,) on `logs` (N, F), each group with its own constant.

    nan where the data cannot separate the factors.
    """
    x, y = _within(logs, groups), _within(log_variances[:, None], groups)[:, 0]
    if len(y) == 0 or np.linalg.matrix_rank(x) < x.shape[1]:
        return np.full(logs.shape[1], np.nan)
    return np.linalg.lstsq(x, y, rcond=None)[0] / 2


def _within(values: Floats, groups: NDArray[np.int64]) -> Floats:
    """(N, F) less the means over each group."""
    _, number = np.unique(groups, return_inverse=True)
    count = np.bincount(number)
    means = np.stack([np.bincount(number, column) / count for column in values.T], axis=-1)
    return values - means[number]


def series_exponent(log_variances: Floats, logs: Floats, poses: NDArray[np.int64]) -> Estimate:
    """Exponent of σ against one factor, log σ² and log factor both (N,), interval over the poses (N,)."""
    known = np.isfinite(log_variances) & np.isfinite(logs)
    y, x, groups = log_variances[known], logs[known, None], poses[known]
    value = float(slopes(y, x, groups)[0])
    # A pose seen at one level alone has no information on a trend.
    names = [name for name in np.unique(groups) if np.ptp(x[groups == name]) > 0]
    if len(names) < 2:
        return Estimate(value, math.nan, math.nan)
    left_out = np.array([slopes(y[groups != name], x[groups != name], groups[groups != name])[0] for name in names])
    error = math.sqrt((len(names) - 1) / len(names) * ((left_out - left_out.mean()) ** 2).sum())
    half = scipy.stats.t.ppf((1 + LEVEL) / 2, len(names) - 1) * error
    return Estimate(value, value - half, value + half)


@dataclass(frozen=True)
class PowerLaw:
    """σ ≈ `constant_px` · Π factorᵢ^βᵢ over N renders, which scatter about it by a factor of `scatter` (σ)."""

    constant_px: float
    exponents: tuple[Estimate, ...]
    scatter: float
    renders: int


def joint_exponents(log_variances: Floats, logs: Floats, rng: np.random.Generator) -> PowerLaw:
    """Exponents of σ against all factors together, log σ² (N,) on logs (N, F), intervals over renders."""
    known = np.isfinite(log_variances) & np.isfinite(logs).all(axis=1)
    y, x = log_variances[known], logs[known]
    together = np.zeros(len(y), dtype=np.int64)
    values = slopes(y, x, together)
    if np.isnan(values).any():
        return PowerLaw(math.nan, tuple(Estimate(math.nan, math.nan, math.nan) for _ in values), math.nan, len(y))
    resampled = _resampled(y, x, rng)
    low, high = np.nanquantile(resampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
    rest = y / 2 - x @ values
    exponents = tuple(Estimate(*map(float, each)) for each in zip(values, low, high, strict=True))
    freedom = max(1, len(y) - len(values) - 1)
    scatter = math.exp(math.sqrt(((rest - rest.mean()) ** 2).sum() / freedom))
    return PowerLaw(math.exp(rest.mean()), exponents, scatter, len(y))


def _resampled(y: Floats, x: Floats, rng: np.random.Generator) -> Floats:
    """Exponents of σ, (B, F), of renders drawn with replacement: normal equations under how often each was drawn."""
    counts = rng.multinomial(len(y), np.full(len(y), 1 / len(y)), size=RESAMPLES).astype(float)
    # About the mean of all, so that the equations are well conditioned.
    design = np.column_stack([np.ones(len(y)), x - x.mean(axis=0)])
    size = design.shape[1]
    products = (design[:, :, None] * design[:, None, :]).reshape(len(y), -1)
    normal = (counts @ products).reshape(-1, size, size)
    right = counts @ (design * (y - y.mean())[:, None])
    distinct = np.linalg.cond(normal) < LARGEST_CONDITION
    found = np.full((RESAMPLES, size - 1), np.nan)
    found[distinct] = np.linalg.solve(normal[distinct], right[distinct, :, None])[:, 1:, 0] / 2
    return found
