"""Signs of a comparison's sides, and ticks of its axes of ratios."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from validate.pages.style import DASHES, SYMBOLS
from validate.runs.palette import CATEGORIES, INK
from validate.stats.log_ticks import round_numbers

__all__ = ["ratio_ticks", "side_style"]


def side_style(number: int) -> tuple[str, str, str]:
    """Colour, symbol and dash of a side; the first is a black circle, so that grey prints have it too."""
    if number == 0:
        return INK, "circle", "solid"
    return (
        CATEGORIES[(number - 1) % len(CATEGORIES)],
        SYMBOLS[(number - 1) % len(SYMBOLS)],
        DASHES[(number - 1) % len(DASHES)],
    )


def ratio_ticks(ratios: NDArray[np.float64]) -> list[float]:
    """Round numbers in the range of some ratios (any shape, nan ignored), few of them and always 1."""
    known = ratios[np.isfinite(ratios) & (ratios > 0)]
    low, high = float(known.min(initial=1.0)) / 1.02, float(known.max(initial=1.0)) * 1.02
    return round_numbers(low, high)
