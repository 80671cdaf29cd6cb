"""What a camera of the metric would see: Mitsuba renders the scene through a thin lens, a sensor adds its noise.

`view` is the way in. Imports `pss` for cameras and shapes, and nothing of `scenes` or `validate`.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from render.viewing import View, view

__all__ = ["View", "view"]


def __getattr__(name: str) -> object:
    """Load what renders at its first use: it takes a second, which most modules of this package do not need."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("render.viewing"), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
