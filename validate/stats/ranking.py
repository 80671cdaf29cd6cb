"""How well numbers rank configurations of one camera count, with intervals over cameras, views and points.

All numbers are judged on the same resamples, so that differences between two of them keep their pairing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss.hints import Floats
from validate.stats.crossed import Judged, Resamples, with_interval
from validate.stats.intervals import TIED, mid_ranks

__all__ = ["Judged", "Ranked", "Resamples", "judge_against", "partial", "top_hits", "with_interval"]


@dataclass(frozen=True, eq=False)
class Ranked:
    """Standardised ranks of K configurations as they are (K,), and on each resample (B, K): their products are ρ."""

    own: Floats
    samples: Floats
    resamples: Resamples

    @classmethod
    def of(cls, values: Floats, resamples: Resamples) -> Ranked:
        """Rank a number (K,), or a mean over points given by its terms (K, N). Ranked once, compared with many."""
        plain = values.mean(axis=1) if values.ndim == 2 else values
        own = _standardised(plain, np.ones(len(plain)))
        return cls(own, _standardised(resamples.of(values), resamples.views), resamples)

    def against(self, other: Ranked, sign: int = 1) -> Judged:
        """Spearman's ρ; `sign` is −1 where the one is better when higher and the other when lower."""
        rho = sign * float((self.own * other.own).sum())
        return self.resamples.judged(rho, sign * np.einsum("bk,bk->b", self.samples, other.samples), 1.0)


def _standardised(values: Floats, weights: Floats) -> Floats:
    """√weight times weighted mid-ranks about their mean, of unit length along the last axis; nan if all are tied."""
    share = weights / weights.sum(axis=-1, keepdims=True)
    values = np.broadcast_to(values, np.broadcast_shapes(values.shape, share.shape))
    # Mid-ranks of shares average exactly one half.
    ranks = np.sqrt(share) * (mid_ranks(values, share) - 0.5)
    length = np.sqrt((ranks**2).sum(axis=-1, keepdims=True))
    return np.where(length > TIED, ranks / np.maximum(length, TIED), np.nan)


def judge_against(metric: Floats, measure: Floats, resamples: Resamples, sign: int = 1) -> Judged:
    """Spearman's ρ of a metric with a measure, each (K,) or the terms of a mean over points (K, N)."""
    return Ranked.of(metric, resamples).against(Ranked.of(measure, resamples), sign)


def partial(xy: Judged, xz: Judged, yz: Judged) -> Judged:
    """Partial rank correlation of x and y given z."""

    def of(a: ArrayLike, b: ArrayLike, c: ArrayLike) -> Floats:
        a, b, c = (np.asarray(value, dtype=float) for value in (a, b, c))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((a - b * c) / np.sqrt((1 - b**2) * (1 - c**2)))

    samples = np.asarray(of(xy.samples, xz.samples, yz.samples))
    return xy.resamples.judged(float(of(xy.estimate, xz.estimate, yz.estimate)), samples, 1.0)


def top_hits(score: Floats, measured: Floats, share: float) -> float:
    """Share of the best `share` of configurations by measurement that are among the best by the score (ties shared)."""
    count = max(1, round(share * len(score)))
    known = np.where(np.isnan(score), -np.inf, score)
    best = np.argsort(measured)[::-1][:count]
    limit = np.sort(known)[::-1][count - 1]
    above, tied = known > limit, known == limit
    weight = above + tied * ((count - above.sum()) / max(tied.sum(), 1))
    return float(weight[best].sum() / count)
