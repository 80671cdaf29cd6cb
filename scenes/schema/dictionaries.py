"""OpenCV's predefined dictionaries, ArUco's and AprilTag's, without importing OpenCV."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["DICTIONARIES", "Dictionary"]


@dataclass(frozen=True)
class Dictionary:
    """Side of a marker in modules, including its black border of one module, and the number of ids."""

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
"""All of OpenCV's, by their names; plates are printed from OpenCV's own bits, the ones that it decodes."""
