"""Sample moments of few trials under a correct covariance: their axes and 1/σ.

The moment of n draws from C is n⁻¹ times a Wishart matrix. Its ellipsoid is longer than C's: after 20 draws
from one of 3 to 1 to 1, the longest axis is 3.7 times the shortest in the median. So a measured axis ratio is compared
with that of such a moment. Source: Bartlett's decomposition (Muirhead 1982, Theorem 3.2.14).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats
from validate.stats.measured_errors import inverse_sigma_bias

__all__ = ["DRAWS", "AfterTrials", "after_trials"]


# Of each cell, of which there are tens of thousands.
DRAWS = 4


@dataclass(frozen=True, eq=False)
class AfterTrials:
    """Of sample moments of M cells in each of D draws, (D, M) each.

    Attributes:
        axis_ratio: longest axis over shortest.
        axis_angle_deg: between the longest axis and that of the covariance.
        inverse_sigma: 1/m, 1/√λmax less the bias that measured values are freed of (`inverse_sigma_bias`).
    """

    axis_ratio: Floats
    axis_angle_deg: Floats
    inverse_sigma: Floats


def after_trials(
    covariance: Floats, trials: NDArray[np.int64], rng: np.random.Generator, draws: int = DRAWS
) -> AfterTrials:
    """Draw moments of `trials` (M,), 3 or more, errors each of covariance (M, 3, 3) m²."""
    n = np.asarray(trials)
    # In the axes of C, smallest first: nothing here depends on the direction.
    root = np.sqrt(np.linalg.eigvalsh(covariance))
    lower = np.zeros((draws, len(n), 3, 3))
    for i in range(3):
        lower[..., i, i] = np.sqrt(rng.chisquare(n - i, size=(draws, len(n))))
        lower[..., i, :i] = rng.standard_normal((draws, len(n), i))
    drawn = root[..., None] * lower
    values, axes = np.linalg.eigh(drawn @ drawn.mT / n[:, None, None])
    longest = np.sqrt(values[..., 2])
    return AfterTrials(
        longest / np.sqrt(np.maximum(values[..., 0], np.finfo(float).tiny)),
        np.degrees(np.arccos(np.clip(np.abs(axes[..., 2, 2]), 0, 1))),
        1 / (longest * inverse_sigma_bias(n)),
    )
