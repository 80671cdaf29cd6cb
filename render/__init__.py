"""Rendering of what the metric's cameras see: Mitsuba renders the scene through a thin lens, a sensor adds its noise.

The entry point is `view`. Imports `pss` for cameras and shapes, and nothing of `scenes` or `validate`.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from render.viewing import View, view

__all__ = ["View", "view"]


def __getattr__(name: str) -> object:
    """Import the renderer on first use: it takes a second, and most modules of this package do not need it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("render.viewing"), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
