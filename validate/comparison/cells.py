"""Numbers of matched rows as text: a value, its interval, and a star where a difference is significant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pss.hints import ReadOnlyRow
from validate.runs.numbers import value_text

__all__ = ["cell", "cells"]


def cells(row: ReadOnlyRow, labels: Sequence[str], what: str) -> Iterator[str]:
    """The cells of the sides in order: of each but the first also its ratio or difference (`what`) to the first."""
    for number, label in enumerate(labels):
        yield cell(row, label)
        if number:
            yield cell(row, f"{label}_{what}") + (" *" if row.get(f"{label}_apart") == "yes" else "")


def cell(row: ReadOnlyRow, name: str) -> str:
    """A column with its interval, "0.71 [0.6, 0.83]"; "" for nan."""
    value, low, high = (row.get(key, math.nan) for key in (name, f"{name}_ci_low", f"{name}_ci_high"))
    assert isinstance(value, float)
    return value_text((value, low, high) if isinstance(low, float) and isinstance(high, float) else (value,))
