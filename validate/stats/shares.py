"""Intervals of a share, which ends at 0 and at 1 and may have no spread at all."""

from __future__ import annotations

from scipy.stats import binomtest

__all__ = ["share_interval"]

COVERAGE = 0.95


def share_interval(share: float, low: float, high: float, views: int) -> tuple[float, float]:
    """The ends of an interval of a share, within 0 to 1; with no spread at 0 or at 1, those of Clopper and Pearson.

    Where none or all are found every resample has the same share, and an interval from them has no length. The exact
    binomial one takes its place, with the views as trials: markers of one view share its blur and its light.

    Args:
        share: what was found, 0 to 1.
        low, high: ends that an interval from resamples has.
        views: with any marker that counts.
    """
    if views > 0 and share in (0.0, 1.0):
        exact = binomtest(views if share else 0, views).proportion_ci(COVERAGE, method="exact")
        return float(exact.low), float(exact.high)
    return min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
