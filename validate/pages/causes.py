"""Causes why a marker is not found in a view: computed for each marker that a page shows as never found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from pss import PTZCamera
from pss.surrogates import any_blocks
from render.world.marker_print import pattern
from render.world.state import Marker, SceneState
from validate.prediction.foresight import LARGEST_BLUR_MODULES, SMALLEST_MODULE_PX

__all__ = ["CAUSES", "causes", "in_words"]

CUT, COVERED, SMALL, BLURRED = "cut by the image’s edge", "behind an object in part", "small", "blurred"
CAUSES = (CUT, COVERED, SMALL, BLURRED)
# Modules of the white around the border that must be in view for an outline.
MARGIN_MODULES = 0.5
# m before the plate, so that what carries it does not cover it.
CLEARANCE_M = 1e-3
# Along each side of the border, where lines of sight end.
PLACES = (-1, 0, 1)


def causes(marker: Marker, camera: PTZCamera, state: SceneState) -> tuple[str, ...]:
    """Which of `CAUSES` hold for a marker in a camera's image; empty if none does."""
    modules = len(pattern(state.print.dictionary, marker.id))
    half_m = marker.module_m * modules / 2
    centre, right, up = np.array(marker.centre_m), marker.right, np.array(marker.up)

    def places(reach_m: float, squares: list[tuple[float, float]]) -> np.ndarray:
        return np.array([centre + reach_m * (u * right + v * up) for u, v in squares])

    corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
    found = []
    if not camera.in_frustum(places(half_m + MARGIN_MODULES * marker.module_m, corners)).all():
        found.append(CUT)
    around = [(float(u), float(v)) for u in PLACES for v in PLACES if max(abs(u), abs(v)) == 1]
    ends = places(half_m, around) + CLEARANCE_M * np.array(marker.normal)
    if any_blocks(state.occluders, np.broadcast_to(camera.position_m, ends.shape), ends).any():
        found.append(COVERED)
    quad, _ = camera.project(places(half_m, corners))
    first, second = quad[2] - quad[0], quad[3] - quad[1]
    area = abs(first[0] * second[1] - first[1] * second[0]) / 2
    module_px = area / np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1).max() / modules
    if not module_px >= SMALLEST_MODULE_PX:
        found.append(SMALL)
    if not float(camera.circle_of_confusion_px(centre)) <= LARGEST_BLUR_MODULES * module_px:
        found.append(BLURRED)
    return tuple(found)


def in_words(shown: Iterable[tuple[str, ...]]) -> str:
    """A sentence on the markers of a page that were never found, by what stands against each."""
    every = list(shown)
    if not every:
        return ""
    counts = Counter(cause for found in every for cause in found)
    parts = [f"{counts[cause]} {cause}" for cause in CAUSES if counts[cause]]
    none = sum(not found for found in every)
    if none:
        parts.append(f"{none} neither cut, covered, small nor blurred")
    return (
        f"Of the {len(every)} shown that were never found: {', '.join(parts)}. “Small” is under {SMALLEST_MODULE_PX:g} "
        f"px a module, “blurred” over {LARGEST_BLUR_MODULES:g} modules; several may hold for one marker."
    )
