"""Numbers to write beside a logarithmic axis: round ones, in the range, and few enough to be read."""

from __future__ import annotations

__all__ = ["round_numbers"]

# In each decade, from fine to coarse; the first that gives few enough is taken.
DIGITS = (
    (1, 1.1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9),
    (1, 1.5, 2, 3, 4, 5, 7),
    (1, 2, 3, 5),
    (1, 2, 5),
    (1, 3),
    (1,),
)
DECADES = 12


def round_numbers(low: float, high: float, most: int = 8) -> list[float]:
    """Round numbers from `low` to `high`, both above 0, at most `most` of them."""
    for digits in DIGITS:
        every = sorted(float(f"{digit}e{power}") for power in range(-DECADES, DECADES + 1) for digit in digits)
        ticks = [tick for tick in every if low <= tick <= high]
        if len(ticks) <= most:
            return ticks
    return ticks[:: 1 + len(ticks) // most]
