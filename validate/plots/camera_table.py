"""The table of a check's drawing: a line for each camera, beside the plan or, of many cameras, in blocks below it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from validate.plots.names_beside import shortened
from validate.prediction.foresight import Foreseen
from validate.runs.palette import CATEGORIES

__all__ = ["MOST_BESIDE", "camera_colour", "draw_below", "draw_beside", "height_below_in"]

MOST_BESIDE = 14
"""Cameras; the lines of more are under the drawing."""
BLOCKS = 3
HEAD = (
    ("camera", "view", "focus", "sees", "finds", "module", "blur"),
    ("", "deg", "m", "markers", "most likely", "px", "px"),
)
# Right ends of the columns, as a share of a block.
RIGHT = (0.21, 0.30, 0.41, 0.57, 0.78, 0.91, 1.0)
# Of the axes' height: a line beside the plan, and the most that all may take.
LINE_SHARE, ALL_SHARE = 0.055, 0.72
LINE_IN = 0.19
GAP_SHARE = 0.06
# Characters of a camera's name, of which one of a wide script counts two.
LONGEST = 13


def camera_colour(number: int) -> str:
    """The colour of the camera of this number, in drawing and table."""
    return CATEGORIES[number % len(CATEGORIES)]


def height_below_in(cameras: int) -> float:
    """Inches that the table of so many cameras takes below the drawing; 0 where it is beside the plan."""
    return 0.0 if cameras <= MOST_BESIDE else LINE_IN * (math.ceil(cameras / BLOCKS) + len(HEAD) + 1)


def draw_beside(axes: Axes, seen: Foreseen) -> float:
    """Write the table at the top of axes without ticks; returns the remaining share of their height, from 0 to 1."""
    lines = len(HEAD) + len(seen.scene.cameras)
    step = min(LINE_SHARE, ALL_SHARE / lines)
    _block(axes, seen, range(len(seen.scene.cameras)), (0.0, 1.0), step, 10.0)
    return 1 - step * (lines + 0.5)


def draw_below(axes: Axes, seen: Foreseen) -> None:
    """Write the table in blocks beside each other over the whole of axes without ticks."""
    count = len(seen.scene.cameras)
    lines = math.ceil(count / BLOCKS)
    step = 1 / (lines + len(HEAD) + 1)
    width = (1 - GAP_SHARE * (BLOCKS - 1)) / BLOCKS
    for block in range(BLOCKS):
        numbers = range(block * lines, min((block + 1) * lines, count))
        if numbers:
            left = block * (width + GAP_SHARE)
            _block(axes, seen, numbers, (left, left + width), step, 9.0)


def _block(
    axes: Axes, seen: Foreseen, numbers: Sequence[int], between: tuple[float, float], step: float, size_pt: float
) -> None:
    left, right = between
    for line, row in enumerate([*HEAD, *(_row(seen, number) for number in numbers)]):
        for column, (end, word) in enumerate(zip(RIGHT, row, strict=True)):
            style = {"color": "0.45", "fontsize": 7.5} if line < len(HEAD) else {"fontsize": size_pt}
            if line >= len(HEAD) and column == 0:
                style |= {"color": camera_colour(numbers[line - len(HEAD)]), "weight": "bold"}
            x = left + end * (right - left)
            axes.text(x, 1 - step * line, word, ha="right", va="top", transform=axes.transAxes, **style)


def _row(seen: Foreseen, number: int) -> tuple[str, ...]:
    camera, of = seen.scene.cameras[number], seen.visible[number]
    middle = [f"{np.median(values[number][of]):.1f}" if of.any() else "–" for values in (seen.module_px, seen.blur_px)]
    return (
        shortened(camera.name, LONGEST), f"{camera.horizontal_fov_deg:.0f}", f"{camera.focus_distance_m:g}",
        f"{of.sum()}", f"{seen.legible[number].sum()}", *middle,
    )  # fmt: skip
