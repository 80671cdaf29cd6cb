"""Colours and axes that the figures of runs share."""

from __future__ import annotations

import numpy as np
from matplotlib.axis import Axis
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from validate.stats.log_ticks import round_numbers

__all__ = ["TITLE_WIDTH", "write_round_numbers"]

# Characters of a title's line.
TITLE_WIDTH = 90
MOST_TICKS, WIDER = 7, 1.1


def write_round_numbers(axis: Axis, values: NDArray[np.float64]) -> None:
    """Give a logarithmic axis ticks with their whole numbers, for the range of some values, two at the least."""
    low, high = float(values.min()), float(values.max())
    while len(ticks := round_numbers(low, high, MOST_TICKS)) < 2:
        low, high = low / WIDER, high * WIDER
    axis.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axis.set_minor_formatter(NullFormatter())
