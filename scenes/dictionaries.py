"""The predefined ArUco dictionaries of OpenCV, as far as a scene needs them: this package does without OpenCV."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["DICTIONARIES", "Dictionary"]


@dataclass(frozen=True)
class Dictionary:
    """Side of a marker in modules, with its black border of one module all around; and how many ids there are."""

    modules: int
    ids: int


DICTIONARIES = {
    f"DICT_{bits}X{bits}_{ids}": Dictionary(modules=bits + 2, ids=ids)
    for bits in (4, 5, 6, 7)
    for ids in (50, 100, 250, 1000)
}
