"""Where the stars of a figure's curves stand: over each other where they would cover each other."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["STEP", "star_heights"]

# Of the axis: stars that are nearer to each other than this would touch.
NEAR_SHARE = 0.05
STEP = 0.075
"""Of the curves' largest value, 1: a star and a gap."""


def star_heights(places: Sequence[float | None], span: float) -> list[float | None]:
    """The height of each star over its place, from 1 upwards; None for those without a place.

    Args:
        places: along the axis, one a curve.
        span: the axis's length in the places' unit; 0 for a single step.
    """
    levels: list[int | None] = []
    for place in places:
        if place is None:
            levels.append(None)
            continue
        before = zip(places, levels, strict=False)
        taken = {level for other, level in before if other is not None and abs(other - place) <= NEAR_SHARE * span}
        levels.append(next(level for level in range(len(places)) if level not in taken))
    return [None if level is None else 1 + STEP * level for level in levels]
