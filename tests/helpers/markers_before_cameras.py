"""Many markers before cameras of all zooms and focus distances."""

from __future__ import annotations

import dataclasses

import numpy as np

from pss import Appearance, PTZCamera
from pss.cameras.views import Views


def world(seed: int) -> Views:
    """Markers at 2 to 12 m before 12 cameras of all zooms and focus distances."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1, 1, 200), rng.uniform(2, 12, 200), rng.uniform(0.8, 2.2, 200)])
    camera = PTZCamera((0.0, 0.0, 1.5), 0.0, 0.0, zoom=1.0, focus_distance_m=4.0)
    cameras = [
        dataclasses.replace(camera, zoom=rng.uniform(1, 5), focus_distance_m=float(np.exp(rng.uniform(0.3, 2.5))))
        for _ in range(12)
    ]
    return Views(cameras, points, np.tile((0.0, -1.0, 0.0), (200, 1)), Appearance(0.02, 1.0, 0.1))
