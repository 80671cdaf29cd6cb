"""How well numbers rank configurations of one camera count, with intervals over views crossed with points.

All numbers are judged on the same resamples, so that differences between two of them keep their pairing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from validate.intervals import CROSSED_SPREAD, TIED, interval, mid_ranks

__all__ = ["Judged", "Ranked", "Resamples", "judge_against", "partial", "regrets", "top_hits", "with_interval"]

Floats = NDArray[np.float64]

RESAMPLES = 200


@dataclass(frozen=True, eq=False)
class Resamples:
    """Random weights: `views` of each configuration (B, K), products of its views' weights; `points` (B, N)."""

    views: Floats
    points: Floats

    @classmethod
    def of_configurations(cls, views: ArrayLike, points: int, cameras: Sequence[str] | None = None) -> Resamples:
        """Resamples for configurations `views` (K, c), indices of views, and so many points.

        Args:
            views: (K, c), of each configuration the views it is made of.
            points: N.
            cameras: the camera of each view, (V,), whose views share what is peculiar to it; None: a view shares
                nothing with another.
        """
        rng, count = np.random.default_rng(0), RESAMPLES
        chosen = np.asarray(views)
        names, index = np.unique(chosen, return_inverse=True)
        shape = CROSSED_SPREAD**-2
        of_views = rng.gamma(shape, 1 / shape, size=(count, len(names)))
        if cameras is not None:
            _, camera = np.unique(np.asarray(cameras)[names], return_inverse=True)
            of_views *= rng.gamma(shape, 1 / shape, size=(count, camera.max() + 1))[:, camera]
        of_points = rng.gamma(shape, 1 / shape, size=(count, points))
        return cls(of_views[:, index.reshape(chosen.shape)].prod(axis=-1), of_points)

    def judged(self, estimate: float, samples: Floats, bound: float = np.inf) -> Judged:
        """A statistic, and itself on each of these resamples (B,)."""
        return Judged(estimate, samples, bound)

    def of(self, values: Floats) -> Floats:
        """The yardstick or metric on each resample, (B, K): a mean over points (K, N), or a number as it is (K,)."""
        return self.points @ values.T if values.ndim == 2 else np.broadcast_to(values, (len(self.points), len(values)))


@dataclass(frozen=True, eq=False)
class Judged:
    """A statistic, itself on each resample (B,), and its 95 % interval; no statistic lies beyond ± `bound`."""

    estimate: float
    samples: Floats
    bound: float = np.inf

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval; nan where the statistic is not defined."""
        if not np.isfinite(self.estimate) or not np.isfinite(self.samples).any():
            return float("nan"), float("nan")
        known = self.samples[np.isfinite(self.samples)]
        ends = interval((known - known.mean()) / CROSSED_SPREAD + self.estimate)
        low, high = (float(np.clip(end, -self.bound, self.bound)) for end in ends)
        return low, high

    def minus(self, other: Judged) -> Judged:
        """The difference, on the same resamples."""
        return Judged(self.estimate - other.estimate, self.samples - other.samples, self.bound + other.bound)


@dataclass(frozen=True, eq=False)
class Ranked:
    """Standardised ranks of K configurations as they are (K,), and on each resample (B, K): their products are ρ."""

    own: Floats
    samples: Floats

    @classmethod
    def of(cls, values: Floats, resamples: Resamples) -> Ranked:
        """Rank a number (K,), or a mean over points given by its terms (K, N). Ranked once, compared with many."""
        plain = values.mean(axis=1) if values.ndim == 2 else values
        return cls(_standardised(plain, np.ones(len(plain))), _standardised(resamples.of(values), resamples.views))

    def against(self, other: Ranked, sign: int = 1) -> Judged:
        """Spearman's ρ; `sign` is −1 where the one is better when higher and the other when lower."""
        return Judged(
            sign * float((self.own * other.own).sum()), sign * np.einsum("bk,bk->b", self.samples, other.samples), 1.0
        )


def _standardised(values: Floats, weights: Floats) -> Floats:
    """√weight times weighted mid-ranks about their mean, of unit length along the last axis; nan if all are tied."""
    share = weights / weights.sum(axis=-1, keepdims=True)
    values = np.broadcast_to(values, np.broadcast_shapes(values.shape, share.shape))
    # Mid-ranks of shares average exactly one half.
    ranks = np.sqrt(share) * (mid_ranks(values, share) - 0.5)
    length = np.sqrt((ranks**2).sum(axis=-1, keepdims=True))
    return np.where(length > TIED, ranks / np.maximum(length, TIED), np.nan)


def judge_against(metric: Floats, yardstick: Floats, resamples: Resamples, sign: int = 1) -> Judged:
    """Spearman's ρ of a metric with a yardstick, each (K,) or the terms of a mean over points (K, N)."""
    return Ranked.of(metric, resamples).against(Ranked.of(yardstick, resamples), sign)


def partial(xy: Judged, xz: Judged, yz: Judged) -> Judged:
    """Partial rank correlation of x and y given z."""

    def of(a: ArrayLike, b: ArrayLike, c: ArrayLike) -> Floats:
        a, b, c = (np.asarray(value, dtype=float) for value in (a, b, c))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((a - b * c) / np.sqrt((1 - b**2) * (1 - c**2)))

    samples = np.asarray(of(xy.samples, xz.samples, yz.samples))
    return Judged(float(of(xy.estimate, xz.estimate, yz.estimate)), samples, 1.0)


@lru_cache(maxsize=32)
def choices(count: int, size: int, draws: int) -> NDArray[np.int64]:
    """`draws` random choices of `size` different ones of `count`, (draws, size); the same for all metrics."""
    rng = np.random.default_rng(size)
    return np.array([rng.choice(count, size=size, replace=False) for _ in range(draws)])


def regrets(score: Floats, halves: Sequence[Floats], size: int, draws: int = 1000) -> tuple[Floats, Floats]:
    """Regret of choosing one of `size` configurations, (draws,), and that of the oracle, who has the other half.

    1 − measured(chosen)/max measured on one half of the trials, averaged over the halves. A metric that gives several
    the best score is charged their average.

    Args:
        score: (K,), higher is better; nan is never chosen.
        halves: measured yardstick on each half of the trials, (K,) each, higher is better.
    """
    known = np.where(np.isnan(score), -np.inf, score)
    chosen = choices(len(score), min(size, len(score)), draws)

    def lost(by: Floats, measured: Floats) -> Floats:
        values, seen = by[chosen], measured[chosen]
        best = values == values.max(axis=1, keepdims=True)
        most = seen.max(axis=1)
        got = (seen * best).sum(axis=1) / best.sum(axis=1)
        return np.where(most > 0, 1 - got / np.where(most > 0, most, 1), 0.0)

    a, b = halves
    return (lost(known, a) + lost(known, b)) / 2, (lost(a, b) + lost(b, a)) / 2


def top_hits(score: Floats, measured: Floats, share: float) -> float:
    """Share of the best `share` of configurations by measurement that are among the best by the score (ties shared)."""
    count = max(1, round(share * len(score)))
    known = np.where(np.isnan(score), -np.inf, score)
    best = np.argsort(measured)[::-1][:count]
    limit = np.sort(known)[::-1][count - 1]
    above, tied = known > limit, known == limit
    weight = above + tied * ((count - above.sum()) / max(tied.sum(), 1))
    return float(weight[best].sum() / count)


def with_interval(name: str, judged: Judged) -> dict[str, object]:
    """Columns of a statistic: its name, and the ends of its interval."""
    low, high = judged.interval
    return {name: judged.estimate, f"{name}_ci_low": low, f"{name}_ci_high": high}
