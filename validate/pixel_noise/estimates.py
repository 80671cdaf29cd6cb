"""Bias, spread and detection rate of one combination of factors, from several poses with several captures each.

Poses differ in more than their noise: intervals are over poses (renders), not over captures as if each were new.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from pss.hints import Floats

__all__ = ["Estimate", "PoseSpread", "bias", "detection_rate", "percentile_error", "spread"]


LEVEL = 0.95


@dataclass(frozen=True)
class Estimate:
    """A value with the ends of its 95 % interval; nan where nothing is known."""

    value: float
    low: float
    high: float


NOTHING = Estimate(math.nan, math.nan, math.nan)


@dataclass(frozen=True, eq=False)
class PoseSpread:
    """Statistics of the captures of each of P poses, axes taken together.

    Attributes:
        counts: (P,), captures in which the marker was found.
        mean_px: px, (P, 2), mean residual; nan where there is none.
        squares_px2: px², (P,), sum of squared deviations from that mean, over both axes.
    """

    counts: NDArray[np.int64]
    mean_px: Floats
    squares_px2: Floats

    @classmethod
    def of(cls, residuals_px: Floats) -> PoseSpread:
        """From residuals (P, T, 2), nan where the marker was not found."""
        found = np.isfinite(residuals_px[..., 0])
        counts = found.sum(axis=1)
        known = np.where(found[..., None], residuals_px, 0.0)
        mean = known.sum(axis=1) / np.maximum(counts, 1)[:, None]
        squares = (np.where(found[..., None], known - mean[:, None], 0.0) ** 2).sum(axis=(1, 2))
        return cls(counts, np.where(counts[:, None] > 0, mean, np.nan), squares)

    @property
    def freedom(self) -> NDArray[np.int64]:
        """(P,), degrees of freedom of `squares_px2`: two axes."""
        return 2 * np.maximum(self.counts - 1, 0)

    @property
    def variance_px2(self) -> Floats:
        """px², (P,), of one axis; nan below two captures."""
        return np.where(self.freedom > 0, self.squares_px2 / np.maximum(self.freedom, 1), np.nan)


def spread(poses: PoseSpread) -> Estimate:
    """px, σ of one axis within a pose, pooled over poses; the interval accounts for differences between poses.

    The pooled variance is a ratio of sums over poses; its error is taken from how the poses' own terms scatter, with
    Student's t, on the logarithm. From one pose it is that of χ².
    """
    freedom, squares = poses.freedom, poses.squares_px2
    used = freedom > 0
    total, count = int(freedom.sum()), int(used.sum())
    if count == 0 or squares.sum() == 0:
        return NOTHING
    variance = squares.sum() / total
    if count == 1:
        low, high = (total / scipy.stats.chi2.ppf(share, total) for share in ((1 + LEVEL) / 2, (1 - LEVEL) / 2))
    else:
        terms = (squares - variance * freedom)[used]
        error = math.sqrt(count / (count - 1) * (terms**2).sum()) / total / variance
        half = scipy.stats.t.ppf((1 + LEVEL) / 2, count - 1) * error
        low, high = math.exp(-half), math.exp(half)
    return Estimate(math.sqrt(variance), math.sqrt(variance * low), math.sqrt(variance * high))


def bias(poses: PoseSpread) -> Estimate:
    """px, RMS over poses of one axis of the mean residual, less the contribution of noise to a mean of few captures.

    If biases are Gaussian over poses, the mean of squares follows χ²; its interval, less the noise's part, is this one.
    """
    used = poses.freedom > 0
    count = int(used.sum())
    if count == 0:
        return NOTHING
    mean_square = float((poses.mean_px[used] ** 2).mean())
    pooled = poses.squares_px2.sum() / poses.freedom.sum()
    from_noise = float((pooled / poses.counts[used]).mean())
    freedom = 2 * count
    ends = (freedom / scipy.stats.chi2.ppf(share, freedom) for share in ((1 + LEVEL) / 2, (1 - LEVEL) / 2))
    value, low, high = (math.sqrt(max(mean_square * scale - from_noise, 0.0)) for scale in (1.0, *ends))
    return Estimate(value, low, high)


def detection_rate(residuals_px: Floats) -> Estimate:
    """Share (0 to 1) of captures with a centre, from residuals (P, T, 2).

    Wilson's interval with the poses as the sample: captures of one pose stand or fall together.
    """
    rate = float(np.isfinite(residuals_px[..., 0]).mean())
    count, z = len(residuals_px), scipy.stats.norm.ppf((1 + LEVEL) / 2)
    middle = (rate + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * math.sqrt(rate * (1 - rate) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return Estimate(rate, max(0.0, middle - half), min(1.0, middle + half))


def percentile_error(residuals_px: Floats, percent: float = 95.0) -> float:
    """px, percentile of the distance between found and true centre, of residuals (P, T, 2); nan where none is found."""
    distance = np.linalg.norm(residuals_px, axis=-1)
    found = distance[np.isfinite(distance)]
    return float(np.percentile(found, percent)) if found.size else math.nan
