"""Argument checks that the shapes share, and the rotation about world z that poses them."""

from __future__ import annotations

import math

import numpy as np

from pss.errors import RangeError
from pss.hints import Floats
from pss.inputs import number, place

__all__ = ["check_count", "check_positive", "set_places", "turn_about_z"]


def check_positive(owner: str, **sizes: float) -> None:
    """`RangeError` unless each size is above 0, in metres."""
    for name, value in sizes.items():
        if not 0 < number(value, f"{owner}.{name}", "above 0, in metres") < math.inf:
            raise RangeError(f"{owner}.{name} = {value!r}; allowed: above 0, in metres")


def set_places(shape: object, *names: str) -> None:
    """Convert these fields of a frozen dataclass to three floats each, or raise `ShapeError` or `RangeError`."""
    for name in names:
        object.__setattr__(shape, name, place(getattr(shape, name), f"{type(shape).__name__}.{name}"))


def check_count(**counts: int) -> None:
    """`RangeError` unless each is 1 or more."""
    for name, count in counts.items():
        if count < 1:
            raise RangeError(f"{name} = {count!r}; allowed: 1 or more")


def turn_about_z(vectors: Floats, turn_deg: float) -> Floats:
    """`vectors` (..., 3) rotated about world z as cameras pan: 90 degrees take +y to +x."""
    if not math.isfinite(turn_deg):
        raise RangeError(f"turn_deg = {turn_deg!r}; allowed: finite degrees")
    sine, cosine = math.sin(math.radians(turn_deg)), math.cos(math.radians(turn_deg))
    return np.asarray(vectors @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
