"""What is derived from a result is computed once and kept in it: tables, console, figures and report format the same.

A result never changes, so that whatever was derived from it stays right.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["derived"]

F = TypeVar("F", bound=Callable[..., Any])
KEPT = "_derived"


def derived(compute: F) -> F:
    """Have a function of a result, and of hashable arguments, computed once for each result.

    Args:
        compute: its first argument is the result, which keeps the returned value as long as it lives.
    """
    signature = inspect.signature(compute)

    @functools.wraps(compute)
    def kept(*arguments: Any, **named: Any) -> Any:
        bound = signature.bind(*arguments, **named)
        bound.apply_defaults()
        result, *others = bound.arguments.values()
        known = vars(result).setdefault(KEPT, {})
        key = (compute.__module__, compute.__qualname__, *others)
        if key not in known:
            known[key] = compute(*arguments, **named)
        return known[key]

    return kept  # type: ignore[return-value]
