"""Rank statistics over configurations, and intervals that account for what the configurations share.

Two configurations with a camera in common, and all configurations at the same point, err together; resampling the
configurations as if each were new gives intervals far too short. So chance is put where it enters: a sweep, whose steps
are fixed, draws random weights of its trials and points, and every configuration takes its weight from those. Source:
the Bayesian bootstrap (Rubin 1981) with product weights for crossed factors (Owen & Eckles 2012). A bank, whose
configurations are combinations of views, leaves out cameras, views and points (`validate.stats.crossed`).
"""

from __future__ import annotations

import numpy as np
import scipy.stats
from numpy.typing import ArrayLike, NDArray

from pss.errors import RangeError, ShapeError
from pss.hints import Floats

__all__ = [
    "FEWEST_RESAMPLED",
    "interval",
    "interval_with",
    "kendall",
    "mid_ranks",
    "oracle_regret",
    "pearson_log",
    "regret",
    "sample_interval",
    "weighted_spearman",
]


LEVEL = 0.95
# Sums of the same terms in another order differ by roundings; such values must stay tied (a count of visible points has
# many ties). Relative, far above the rounding of a sum of a few hundred terms.
TIED = 1e-12
# Of two trials a resample shows too little of the chance: 95 % intervals of measured PSS covered 44 % in a simulation
# of 17 points, of three trials 93 % (with a common error of all points 53 % and 78 %).
FEWEST_RESAMPLED = 3


def mid_ranks(values: Floats, weights: Floats) -> Floats:
    """Weighted mid-ranks along the last axis of (..., K): the weight below a value, and half of that tied with it."""
    order = np.argsort(values, axis=-1)
    ordered, weight = np.take_along_axis(values, order, -1), np.take_along_axis(weights, order, -1)
    up_to = np.cumsum(weight, axis=-1)
    rises = _rises(ordered)
    edge = np.ones((*rises.shape[:-1], 1), dtype=bool)
    # Within a group of ties: the weight before its first member and up to its last one.
    before = np.maximum.accumulate(np.where(np.concatenate([edge, rises], -1), up_to - weight, -np.inf), axis=-1)
    through = np.where(np.concatenate([rises, edge], -1), up_to, np.inf)[..., ::-1]
    through = np.minimum.accumulate(through, axis=-1)[..., ::-1]
    ranks = np.empty_like(up_to)
    np.put_along_axis(ranks, order, (before + through) / 2, -1)
    return ranks


def _rises(ordered: Floats) -> NDArray[np.bool_]:
    """Whether each value but the first of (..., K), sorted, is above the one before it: the others are ties."""
    with np.errstate(invalid="ignore"):  # ∞ − ∞: not above, hence tied
        rises = np.diff(ordered, axis=-1) > TIED * np.maximum(np.abs(ordered[..., 1:]), np.abs(ordered[..., :-1]))
    # ∞ × TIED is ∞, and nothing rises above that: the step to or from an infinite value is one for itself.
    return np.asarray(rises | (np.isinf(ordered[..., 1:]) != np.isinf(ordered[..., :-1])))


def tie_groups(values: Floats) -> NDArray[np.int64]:
    """The place of each of (K,) values among the different ones, from 0: what `mid_ranks` takes to be tied is one."""
    order = np.argsort(values)
    ordered = values[order]
    groups = np.empty(len(values), dtype=np.int64)
    groups[order] = np.concatenate([[0], np.cumsum(_rises(ordered))])
    return groups


def spearman_of_groups(x: NDArray[np.int64], y: NDArray[np.int64], weights: Floats) -> float:
    """`weighted_spearman` of (K,) values whose `tie_groups` are x and y: nothing is sorted again for other weights."""
    share = weights / weights.sum()

    def centred(groups: NDArray[np.int64]) -> Floats:
        of_group = np.bincount(groups, share)
        return np.asarray((np.cumsum(of_group) - of_group / 2 - 0.5)[groups])

    a, b = centred(x), centred(y)
    spread = (share * a * a).sum(), (share * b * b).sum()
    if min(spread) < TIED:
        return float("nan")
    return float(np.clip((share * a * b).sum() / np.sqrt(spread[0] * spread[1]), -1.0, 1.0))


def weighted_spearman(x: ArrayLike, y: ArrayLike, weights: ArrayLike | None = None) -> Floats:
    """Spearman's ρ along the last axis: the weighted Pearson correlation of weighted mid-ranks.

    With whole numbers as weights it is Spearman's ρ of the data with each pair repeated so often.

    Args:
        x, y, weights: (..., K), broadcast against each other; weights ≥ 0, all 1 if None. ±∞ is a value like any other.

    Returns:
        (...), nan where x, y or the weights hold nan, or where x or y is constant (over the pairs with weight).
    """
    weights = 1.0 if weights is None else weights
    x, y, w = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x, y, weights)))
    if (w < 0).any():
        raise RangeError(f"weights down to {w.min():.6g}; allowed: 0 and above")
    if x.shape[-1] < 2:
        return np.full(x.shape[:-1], np.nan)[()]
    unknown = (np.isnan(x) | np.isnan(y) | np.isnan(w)).any(axis=-1)
    w = np.where(unknown[..., None], 1.0, w)
    total = w.sum(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = w / total
        a, b = mid_ranks(x, share), mid_ranks(y, share)
        # Mid-ranks of shares average exactly one half.
        a, b = a - 0.5, b - 0.5
        spread = (share * a * a).sum(axis=-1), (share * b * b).sum(axis=-1)
        rho = (share * a * b).sum(axis=-1) / np.sqrt(spread[0] * spread[1])
    # Two groups of ties with shares p and 1 − p spread by p(1 − p)/4; a spread of roundings is none.
    constant = (spread[0] < TIED) | (spread[1] < TIED)
    return np.where(unknown | constant, np.nan, np.clip(rho, -1.0, 1.0))[()]


def kendall(x: ArrayLike, y: ArrayLike) -> float:
    """Kendall's τ-b of two (K,), nan with nan or with a constant among them."""
    x, y = _pair(x, y)
    return np.nan if np.isnan(x).any() or np.isnan(y).any() else float(scipy.stats.kendalltau(x, y).statistic)


def pearson_log(x: ArrayLike, y: ArrayLike) -> float:
    """Pearson's correlation of the logarithms of two (K,); nan with a value ≤ 0 or not finite, or a constant."""
    x, y = _pair(x, y)
    if len(x) < 2 or not all(((a > 0) & np.isfinite(a)).all() and np.ptp(a) > TIED * a.max() for a in (x, y)):
        return np.nan
    return float(np.corrcoef(np.log(x), np.log(y))[0, 1])


def _pair(x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape:
        raise ShapeError(f"x {x.shape} and y {y.shape}; allowed are two alike, (K,)")
    return x, y


def interval(samples: ArrayLike, level: float = LEVEL) -> tuple[Floats, Floats]:
    """Percentile interval (low, high), each (...), of samples (B, ...) along the first axis; nan if a sample is."""
    if not 0 < level < 1:
        raise RangeError(f"level = {level!r}; allowed: between 0 and 1")
    low, high = np.quantile(np.asarray(samples, dtype=np.float64), [(1 - level) / 2, (1 + level) / 2], axis=0)
    return low, high


def interval_with(estimate: float, samples: ArrayLike, level: float = LEVEL) -> tuple[float, float]:
    """As `interval` of samples (B,), and never beside the estimate; nan if the estimate or a sample is.

    Resamples of a correlation near ±1 all lie on one side of it: an end that would leave it out goes as far as it.
    """
    low, high = (float(end) for end in interval(samples, level))
    if np.isnan(estimate) or np.isnan(low):
        return float("nan"), float("nan")
    return min(low, estimate), max(high, estimate)


def sample_interval(samples: ArrayLike, level: float = LEVEL) -> tuple[Floats, Floats]:
    """As `interval`, with ends that are samples themselves: for those of which some are infinite."""
    ends = [(1 - level) / 2, (1 + level) / 2]
    low, high = np.quantile(np.asarray(samples, dtype=np.float64), ends, axis=0, method="inverted_cdf")
    return low, high


def regret(
    score: ArrayLike, measured_half_a: ArrayLike, measured_half_b: ArrayLike, higher_is_better: bool = True
) -> float:
    """Share of the best measured value that is lost by choosing the configuration with the best score.

    1 − measured(chosen) / max measured, averaged over the two halves of the trials. Where several configurations share
    the best score it is their average. The best measured value is itself picked from noisy ones, so even a perfect
    choice has a regret above 0: `oracle_regret` is printed beside it.

    Args:
        score: (K,); nan is never chosen.
        measured_half_a, measured_half_b: (K,), from each half; higher is better.

    Returns:
        nan if no score is known, or a half's best is not positive.
    """
    score, half_a = _pair(score, measured_half_a)
    _, half_b = _pair(score, measured_half_b)
    known = ~np.isnan(score)
    if not known.any():
        return np.nan
    signed = np.where(known, score if higher_is_better else -score, -np.inf)
    best = signed.max()
    chosen = known & (signed >= best - (TIED * abs(best) if np.isfinite(best) else 0.0))
    return (_lost(chosen, half_a) + _lost(chosen, half_b)) / 2


def oracle_regret(measured_half_a: ArrayLike, measured_half_b: ArrayLike) -> float:
    """Regret of choosing by the measurement itself: by one half, scored on the other, averaged over both ways."""
    half_a, half_b = _pair(measured_half_a, measured_half_b)
    return (_lost(half_a == half_a.max(), half_b) + _lost(half_b == half_b.max(), half_a)) / 2


def _lost(chosen: NDArray[np.bool_], measured: Floats) -> float:
    best = measured.max()
    return float(1 - measured[chosen].mean() / best) if best > 0 else np.nan
