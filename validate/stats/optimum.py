"""Which step of a sweep is best, if any is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["FLAT", "NO_OPTIMUM", "optimum"]

NO_OPTIMUM = "none"
"""What tables print where no step is best."""
FLAT = "flat"
"""Printed where no step is distinguishable from another (`validate.sweeps.optima`)."""


def optimum(values: ArrayLike) -> int | None:
    """Index of the largest of (S,) values of PSS in 1/m, the first of equal ones.

    None where none is above 0: at steps that resolve no point, one is as good as the other. nan does not count.
    """
    known = np.nan_to_num(np.asarray(values, dtype=np.float64), nan=0.0)
    return int(known.argmax()) if (known > 0).any() else None
