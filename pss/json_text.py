"""Strictly valid JSON: numbers that JSON lacks (nan, ±inf) are written as null.

Python's own writer emits NaN and Infinity, which other readers need not accept.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

__all__ = ["as_json", "json_text"]


def json_text(value: object, **options: Any) -> str:
    """JSON text of plain data; nan and ±inf become null.

    Args:
        options: of `json.dumps`, such as `indent`.

    Raises:
        TypeError: a value that has no JSON form.
    """
    try:
        return json.dumps(value, allow_nan=False, **options)
    except ValueError:
        return json.dumps(_with_nulls(value), allow_nan=False, **options)


def as_json(value: object) -> Any:
    """Plain data as it comes back from JSON."""
    return json.loads(json_text(value))


def _with_nulls(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        # A non-string key becomes a string in JSON, as in Python's own writer.
        return {key: _with_nulls(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_with_nulls(item) for item in value]
    return value
