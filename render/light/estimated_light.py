"""A fast estimate of the light on the markers, for checks and predictions before radiosity is solved.

The lamps' direct light is exact, including shadows. Light reflected by the room is assumed uniform, as in an
integrating sphere of the room's area and mean reflectance; objects reflect nothing.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pss import Appearance
from pss.hints import Floats
from render.light.lit_scene import appearance_of
from render.light.radiosity import Radiosity
from render.world.state import Panel, SceneState

__all__ = ["estimated_appearance", "estimated_irradiance"]


# Each part of a panel is visible or hidden as a whole, by its centre: this many parts along a side make soft shadows.
PARTS = 4


def estimated_appearance(state: SceneState) -> Appearance:
    """The markers' appearance in the estimated light."""
    return appearance_of(state, state.print.white_albedo / np.pi * estimated_irradiance(state))


def estimated_irradiance(state: SceneState) -> Floats:
    """W/m² on the markers, (N,); under ring lights 1, as in `render.light.radiosity.UnitLight`."""
    if state.light.ring_w_per_sr > 0:
        return np.ones(len(state.markers))
    exitance = np.pi * state.light.radiance_w_per_m2_sr
    corners = np.concatenate([_parts(panel, state.room.height_m) for panel in state.light.panels])
    lamps = Radiosity(
        corners,
        corners.mean(axis=1),
        np.tile([0.0, 0.0, -1.0], (len(corners), 1)),
        np.full(len(corners), exitance),
        state.occluders,
    )
    flux = exitance * sum(panel.size_m[0] * panel.size_m[1] for panel in state.light.panels)
    return lamps.irradiance(state.points_m, state.normals) + _sent_back(state, flux)


def _sent_back(state: SceneState, flux_w: float) -> float:
    """W/m², of light that was reflected at least once: Φ/A · ρ/(1 − ρ)."""
    room = state.room
    floor = room.width_m * room.length_m
    walls = 2 * room.height_m * (room.width_m + room.length_m)
    area = 2 * floor + walls
    mean = (floor * (room.floor_albedo + room.ceiling_albedo) + walls * room.wall_albedo) / area
    # In a room without absorption the light would grow without bound.
    mean = min(mean, 0.99)
    return flux_w / area * mean / (1 - mean)


def _parts(panel: Panel, height_m: float) -> Floats:
    """Metres, (PARTS², 4, 3): quadrilaterals, counter-clockwise as seen from below."""
    (x, y), (width, length) = panel.centre_m, panel.size_m
    edges_x = x + width * (np.arange(PARTS + 1) / PARTS - 0.5)
    edges_y = y + length * (np.arange(PARTS + 1) / PARTS - 0.5)
    return np.array(
        [
            [(left, low, height_m), (left, high, height_m), (right, high, height_m), (right, low, height_m)]
            for left, right in pairwise(edges_x)
            for low, high in pairwise(edges_y)
        ]
    )
