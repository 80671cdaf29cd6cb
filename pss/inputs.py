"""Conversion and checks of callers' arguments.

Accepted values are copied, so that later changes to the caller's arrays have no effect. Iterators are exhausted. Masked
values, ragged rows, text, complex numbers and None are refused, with the argument's name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pss.errors import RangeError, ShapeError
from pss.hints import Floats

__all__ = ["having", "labels", "members", "number", "numbers", "place", "plain", "row"]


# Largest length of a value in a message.
LONGEST_SHOWN = 60
# NumPy's kinds of numbers: booleans, integers, floats.
NUMBERS = "biuf"


def numbers(value: object, name: str, allowed: str = "numbers") -> Floats:
    """`value` as a new array of floats, of any shape; errors are those of `plain`."""
    array = plain(value, name, allowed)
    return array if array.dtype == float else array.astype(float)


def plain(value: object, name: str, allowed: str = "numbers") -> NDArray[Any]:
    """`value` as a new array of numbers of their own type, of any shape.

    Args:
        value: an array, nested lists or tuples, an iterator of such, or a number.
        allowed: what is allowed, for the message.

    Raises:
        RangeError: None, text, complex numbers, masked values, or anything else that is not a number.
        ShapeError: rows of different lengths.
    """
    if value is None or isinstance(value, str | bytes | dict | set | frozenset):
        _refuse(value, name, allowed)
    if isinstance(value, np.ndarray):
        _refuse_masked(value, name)
        array = np.array(value)
    else:
        array = _array_of(value, name, allowed)
    if array.dtype.kind not in NUMBERS:
        if array.dtype.kind != "O" or array.ndim == 0:
            _refuse(value, name, allowed)
        try:
            array = np.array(array, dtype=float)
        except (TypeError, ValueError):
            _refuse(value, name, allowed)
    return array


def _array_of(value: object, name: str, allowed: str) -> NDArray[Any]:
    """A new array from a list or another object, of any type."""
    if isinstance(value, list | tuple) and not any(isinstance(item, np.ma.MaskedArray) for item in value):
        try:
            array = np.array(value)
        except (TypeError, ValueError):
            pass  # the error is raised below
        else:
            if array.dtype.kind in NUMBERS:
                return array
    whole = _whole(value, name)
    try:
        return np.array(whole)
    except ValueError as error:
        if "inhomogeneous" not in str(error):
            _refuse(value, name, allowed)
        raise ShapeError(f"{name} has rows of different lengths; allowed: {allowed}") from None
    except TypeError:
        _refuse(value, name, allowed)


def _whole(value: object, name: str) -> object:
    """`value` with iterators exhausted, at any level, and without masks."""
    if isinstance(value, np.ndarray):
        _refuse_masked(value, name)
        return value
    iterator = isinstance(value, Iterable) and not hasattr(value, "__array__") and not hasattr(value, "__len__")
    if isinstance(value, list | tuple) or (iterator and isinstance(value, Iterable)):
        return [_whole(item, name) for item in value]
    return value


def _refuse_masked(value: NDArray[Any], name: str) -> None:
    if np.ma.isMaskedArray(value) and np.ma.is_masked(value):
        count = int(np.ma.getmaskarray(value).sum())
        raise RangeError(f"{name} has {count} masked values; allowed: none (leave those points out)")


def number(value: object, name: str, allowed: str = "a number") -> float:
    """`value` as a float; nan and infinity are accepted.

    Raises:
        RangeError: it is not a number.
    """
    if type(value) is float or type(value) is int:
        return float(value)
    array = numbers(value, name, allowed)
    if array.ndim:
        _refuse(value, name, allowed)
    return float(array)


def row(value: object, length: int, name: str, allowed: str) -> tuple[float, ...]:
    """`value` as a tuple of `length` floats.

    Raises:
        ShapeError: there are more or fewer.
        RangeError: one is not a number.
    """
    if isinstance(value, tuple) and len(value) == length and all(type(item) in (float, int) for item in value):
        return tuple(float(item) for item in value)
    array = numbers(value, name, allowed)
    if array.shape != (length,):
        count = f"{len(array)} numbers" if array.ndim == 1 else f"shape {array.shape}"
        raise ShapeError(f"{name} has {count}; allowed is {allowed}")
    return tuple(float(entry) for entry in array)


def place(value: object, name: str, allowed: str = "3 (x, y, z in metres)") -> tuple[float, float, float]:
    """`value` as three finite floats.

    Raises:
        ShapeError: there are not three.
        RangeError: one is not a finite number.
    """
    x, y, z = row(value, 3, name, allowed)
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise RangeError(f"{name} = {(x, y, z)}; allowed: finite metres")
    return x, y, z


def labels(value: object, name: str) -> NDArray[np.str_]:
    """`value` as a new array of text, of any shape.

    Raises:
        RangeError: None, or masked values.
    """
    if value is None:
        _refuse(value, name, "names")
    whole = _whole(value, name)
    try:
        return np.array(whole, dtype=np.str_)
    except ValueError:
        raise ShapeError(f"{name} has rows of different lengths; allowed: names") from None


def members(value: object, name: str, attribute: str, what: str) -> tuple[Any, ...]:
    """The items of a list, a tuple or any other iterable, each with `attribute`.

    Raises:
        RangeError: it is not iterable, such as a single item, or an item lacks the attribute.
    """
    if value is None or isinstance(value, str | bytes) or not isinstance(value, Iterable) or hasattr(value, attribute):
        _refuse(value, name, f"a list of {what}")
    found = tuple(value)
    for number, item in enumerate(found):
        if not hasattr(item, attribute):
            _refuse(item, f"{name}[{number}]", f"a list of {what}")
    return found


def having(value: object, attribute: str, name: str, allowed: str) -> None:
    """Refuse an argument without `attribute`, such as a name in place of the object.

    Raises:
        RangeError: with the value and what is allowed.
    """
    if not hasattr(value, attribute):
        _refuse(value, name, allowed)


def _refuse(value: object, name: str, allowed: str) -> NoReturn:
    kind = type(value).__name__
    if isinstance(value, np.ndarray):
        shown = f"an array of {value.dtype}"
    elif value is None:
        shown = "None"
    elif isinstance(value, Iterator) or len(repr(value)) > LONGEST_SHOWN:
        shown = f"of type {kind}"
    else:
        shown = f"{value!r} of type {kind}"
    raise RangeError(f"{name} is {shown}; allowed: {allowed}")
