"""JSON as all programs read it: numbers that JSON does not have (nan, ±inf) are written as null.

Python's own writer puts NaN and Infinity, which no other reader has to accept.
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
        TypeError: something that JSON has no form for.
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
        # A key that is no number is a word in JSON, as Python writes it.
        return {key: _with_nulls(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_with_nulls(item) for item in value]
    return value
