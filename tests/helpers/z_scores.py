"""A bound for many Z-scores at once."""

from __future__ import annotations

import scipy.constants
import scipy.stats

# Chance that a family of Z-tests fails by itself; it is shared out among its members (Šidák). Seeds are fixed, so that
# a pass stays a pass.
FAMILY_WISE = 1e-3


def largest_z(family: int) -> float:
    """Two-sided bound that a family of independent Z-scores passes together with probability 1 − FAMILY_WISE."""
    alone = 1 - (1 - FAMILY_WISE) ** (1 / family)
    return float(scipy.stats.norm.isf(alone / 2))
