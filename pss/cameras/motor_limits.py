"""The limits of a pan-tilt-zoom camera's motors: ranges, speeds and steps, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from pss.cameras.camera import MAX_ABS_TILT_DEG
from pss.errors import RangeError

__all__ = ["FULL_TURN_DEG", "SLACK_STEPS", "PTZLimits", "number", "refuse"]

# Fraction of a step within which a value counts as on the step.
SLACK_STEPS = 1e-6
FULL_TURN_DEG = 360.0


@dataclass(frozen=True)
class PTZLimits:
    """Ranges, speeds and steps of a camera's motors. None or infinity means no limit.

    Attributes:
        pan_range_deg: degrees, (lowest, highest) between mechanical stops; may exceed a full turn. None: endless, and a
            full turn must be a whole number of steps.
        tilt_range_deg: degrees, (lowest, highest), in addition to the camera's ±90°.
        zoom_range: (lowest, highest) of the paper's multiplier, in addition to the camera's `max_zoom`.
        pan_speed_deg_per_s, tilt_speed_deg_per_s: degrees/s.
        zoom_factor_per_s: largest factor by which the zoom grows or shrinks in a second, above 1.
        focus_speed_dioptre_per_s: dioptres/s.
        pan_step_deg, tilt_step_deg: degrees, one motor step.
        zoom_step: relative; 0.01 for steps of 1 %.
        focus_step_dioptre: dioptres; the farthest focus is one step from infinity.

    Raises:
        RangeError: a value out of range; the message has the value and what is allowed.
    """

    pan_range_deg: tuple[float, float] | None = None
    tilt_range_deg: tuple[float, float] | None = None
    zoom_range: tuple[float, float | None] = (1.0, None)
    pan_speed_deg_per_s: float | None = None
    tilt_speed_deg_per_s: float | None = None
    zoom_factor_per_s: float | None = None
    focus_speed_dioptre_per_s: float | None = None
    pan_step_deg: float | None = 0.01
    tilt_step_deg: float | None = 0.01
    zoom_step: float | None = 0.001
    focus_step_dioptre: float | None = 0.001

    def __post_init__(self) -> None:
        for name in ("pan_range_deg", "tilt_range_deg"):
            object.__setattr__(self, name, _range(name, getattr(self, name)))
        low, high = _pair("zoom_range", self.zoom_range)
        if not 1 <= low <= high or math.isinf(low):
            refuse("zoom_range", self.zoom_range, "(lowest, highest) with 1 <= lowest <= highest, or highest None")
        object.__setattr__(self, "zoom_range", (low, high if math.isfinite(high) else None))
        for name in ("pan_speed_deg_per_s", "tilt_speed_deg_per_s", "focus_speed_dioptre_per_s", "zoom_factor_per_s"):
            least = 1.0 if name == "zoom_factor_per_s" else 0.0
            value = number(name, getattr(self, name))
            if not value > least:
                refuse(name, getattr(self, name), f"above {least:g}, or None for no limit")
            object.__setattr__(self, name, value if math.isfinite(value) else None)
        for name in ("pan_step_deg", "tilt_step_deg", "zoom_step", "focus_step_dioptre"):
            if getattr(self, name) is not None:
                step = number(name, getattr(self, name))
                if not 0 < step < math.inf:
                    refuse(name, getattr(self, name), "above 0, or None for no steps")
                object.__setattr__(self, name, step)
        if self.pan_range_deg is None and self.pan_step_deg is not None:
            turn = FULL_TURN_DEG / self.pan_step_deg
            if turn < 1 or abs(turn - round(turn)) > SLACK_STEPS:
                refuse("pan_step_deg", self.pan_step_deg, "a whole part of 360, as there is no pan_range_deg")


def number(name: str, value: object) -> float:
    """`value` as a float, with infinity for None.

    Raises:
        RangeError: it is not a number, or nan.
    """
    if value is None:
        return math.inf
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating) or math.isnan(value):
        refuse(name, value, "a number")
    return float(value)


def _pair(name: str, value: object) -> tuple[float, float]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        refuse(name, value, "two numbers (lowest, highest)")
    return number(name, value[0]), number(name, value[1])


def _range(name: str, value: object) -> tuple[float, float] | None:
    """Degrees, (lowest, highest); None for an endless range."""
    if value is None:
        return None
    low, high = _pair(name, value)
    if (low, high) == (-math.inf, math.inf):
        return None
    if not -math.inf < low <= high < math.inf:
        refuse(name, value, "(lowest, highest) in degrees, lowest <= highest, or None for no limit")
    if name == "tilt_range_deg" and (low > MAX_ABS_TILT_DEG or high < -MAX_ABS_TILT_DEG):
        refuse(name, value, f"a range that reaches into ±{MAX_ABS_TILT_DEG:g}°")
    return low, high


def refuse(name: str, value: object, allowed: str) -> NoReturn:
    """Raise `RangeError` with the value and what is allowed, in one line."""
    raise RangeError(f"{name} = {value!r}; allowed: {allowed}")
