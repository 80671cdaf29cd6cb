"""Words in place of dots that a figure of rows cannot draw: an empty row would look forgotten."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from validate.pages.style import GREY

__all__ = ["NO_ORDER", "Sign", "empty_row_words"]

NO_ORDER = "undefined: the metric or the measure is equal at every step"
"""Why a row has no rank correlation."""
SMALL_PX, SMALLEST_PX = 11, 9


@dataclass(frozen=True)
class Sign:
    """A dot of a series: its row, its place on the axis of rows, and its value, nan if it has none."""

    series: str
    row: int
    place: float
    value: float


def empty_row_words(signs: Sequence[Sign], why: str, axis: str = "") -> list[dict[str, Any]]:
    """Plotly's annotations: `why` in each row without a dot, and a short word for each dot that other rows lack.

    Args:
        axis: the number of the axes, "" for the first.
    """
    found = []
    for row in sorted({sign.row for sign in signs}):
        of = [sign for sign in signs if sign.row == row]
        missing = [sign for sign in of if not np.isfinite(sign.value)]
        if len(missing) == len(of):
            found.append(_words(why, float(row), axis, SMALL_PX))
        else:
            found += [_words(f"{sign.series}: undefined", sign.place, axis, SMALLEST_PX) for sign in missing]
    return found


def _words(text: str, place: float, axis: str, size_px: int) -> dict[str, Any]:
    where = {"xref": f"x{axis} domain", "x": 0.5, "yref": f"y{axis}", "y": place, "showarrow": False}
    return where | {"text": text, "font": {"size": size_px, "color": GREY}}
