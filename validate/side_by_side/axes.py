"""Signs of a comparison's sides, and ticks of its axes of ratios."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from validate.report.style import COLOURS, DASHES, INK, SYMBOLS

__all__ = ["ratio_ticks", "side_style"]

# Ticks of an axis of ratios, from fine to coarse, in each decade; the first that gives few enough is taken.
TICKS = (
    (1, 1.1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9),
    (1, 1.5, 2, 3, 4, 5, 7),
    (1, 2, 3, 5),
    (1, 2, 5),
    (1, 3),
    (1,),
)
MOST_TICKS = 8
DECADES = 12


def side_style(number: int) -> tuple[str, str, str]:
    """Colour, symbol and dash of a side; the first is a black circle, so that grey prints have it too."""
    if number == 0:
        return INK, "circle", "solid"
    return (
        COLOURS[(number - 1) % len(COLOURS)],
        SYMBOLS[(number - 1) % len(SYMBOLS)],
        DASHES[(number - 1) % len(DASHES)],
    )


def ratio_ticks(ratios: NDArray[np.float64]) -> list[float]:
    """Round numbers in the range of some ratios (any shape, nan ignored), at most `MOST_TICKS` of them and always 1."""
    known = ratios[np.isfinite(ratios) & (ratios > 0)]
    low, high = float(known.min(initial=1.0)) / 1.02, float(known.max(initial=1.0)) * 1.02
    for digits in TICKS:
        every = sorted(float(f"{digit}e{power}") for power in range(-DECADES, DECADES + 1) for digit in digits)
        ticks = [tick for tick in every if low <= tick <= high]
        if len(ticks) <= MOST_TICKS:
            break
    return ticks[:: 1 + len(ticks) // MOST_TICKS] if len(ticks) > MOST_TICKS else ticks
