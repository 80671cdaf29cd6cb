"""Sub-pixel phase: one view rendered at several slightly turned settings, its trials shared among them.

A detector's frozen bias depends on where in a pixel an edge falls. Turned by a pixel or two, a camera sees the same
scene at other phases, so that this bias shows as the spread that it is for a camera that moves. A detection is carried
back to the view's own setting by the turn itself, which is known as the setting is: a lens centre that stays makes that
exact, and nothing of the scene is used.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera
from pss.hints import Floats
from validate.markers.view_measurement import ViewMeasurement

__all__ = ["carried_back", "joined", "turned"]


# Pixels, on either side: several periods of the pixel grid, and nothing else changes.
LARGEST_TURN_PX = 2.0


def turned(camera: PTZCamera, count: int, rng: np.random.Generator) -> list[PTZCamera]:
    """`count` settings of `camera`, panned and tilted by up to `LARGEST_TURN_PX`."""
    turns = rng.uniform(-LARGEST_TURN_PX, LARGEST_TURN_PX, size=(count, 2))
    per_px = math.degrees(1 / camera.focal_px)
    # A pan moves the image by its angle times cos(tilt).
    pan_px = per_px / max(math.cos(math.radians(camera.tilt_deg)), 0.1)
    return [
        dataclasses.replace(camera, pan_deg=camera.pan_deg + x * pan_px, tilt_deg=camera.tilt_deg + y * per_px)
        for x, y in turns.tolist()
    ]


def carried_back(pixels: Floats, seen_by: PTZCamera, camera: PTZCamera) -> Floats:
    """Pixels (..., 2) of `camera` that look where `pixels` (..., 2) of `seen_by`, at the same place, look."""
    carried = np.full(np.shape(pixels), np.nan)
    known = np.isfinite(pixels).all(axis=-1)
    straight = seen_by.undistorted_px(pixels[known])
    to_rays = np.linalg.inv(seen_by.intrinsic_matrix).T
    rays = np.concatenate([straight, np.ones((len(straight), 1))], axis=-1) @ to_rays @ seen_by.rotation
    carried[known] = camera.project(np.array(camera.position_m) + rays)[0]
    return carried


def joined(camera: PTZCamera, seen_by: Sequence[PTZCamera], measured: Sequence[ViewMeasurement]) -> ViewMeasurement:
    """The trials of all turned settings as those of `camera`, in turn: halves of the trials share the phases."""
    pixels = [carried_back(part.pixels, other, camera) for other, part in zip(seen_by, measured, strict=True)]
    order = _interleaved(len(pixels), len(pixels[0]))
    return ViewMeasurement(
        np.concatenate(pixels)[order],
        np.concatenate([part.covariance for part in measured])[order],
        sum(part.unexpected_ids for part in measured),
        sum(part.seconds for part in measured),
    )


def _interleaved(settings: int, trials: int) -> NDArray[np.int64]:
    """Indices into all trials, setting by setting, in an order whose even and odd places go through all settings."""
    number = np.arange(settings * trials).reshape(settings, trials)
    return number.T.ravel() if settings % 2 else np.concatenate([np.roll(row, k) for k, row in enumerate(number.T)])
