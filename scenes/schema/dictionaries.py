"""OpenCV's predefined dictionaries, ArUco's and AprilTag's, as far as a scene needs them without OpenCV."""

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
} | {
    "DICT_ARUCO_ORIGINAL": Dictionary(modules=7, ids=1024),
    "DICT_ARUCO_MIP_36h12": Dictionary(modules=8, ids=250),
    "DICT_APRILTAG_16h5": Dictionary(modules=6, ids=30),
    "DICT_APRILTAG_25h9": Dictionary(modules=7, ids=35),
    "DICT_APRILTAG_36h10": Dictionary(modules=8, ids=2320),
    "DICT_APRILTAG_36h11": Dictionary(modules=8, ids=587),
}
"""All that OpenCV has, by its names; plates are printed from OpenCV's own bits, the ones that it decodes."""
