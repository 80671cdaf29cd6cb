"""Which camera sees which point: the field of view, the point's own surface, and what stands in between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pss.camera import PTZCamera
from pss.surrogates import Shape, any_blocks

__all__ = ["visible_points"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# A line of sight ends this far in front of its point, so that the surface that bears the point does not hide it.
CLEARANCE_M = 1e-4


def visible_points(
    cameras: Sequence[PTZCamera], points_m: Floats, normals: Floats, occluder: Sequence[Shape] = ()
) -> Bools:
    """Whether each camera sees each point (section 4.1, field of view and occlusion).

    Args:
        points_m: m, (N, 3).
        normals: unit outward normals, (N, 3); a point whose surface looks away is hidden by its own object.
        occluder: shapes that block lines of sight, the objects that bear the points among them.

    Returns:
        (C, N) booleans.
    """
    seen = np.zeros((len(cameras), len(points_m)), dtype=bool)
    for row, camera in zip(seen, cameras, strict=True):
        inside = np.flatnonzero(camera.in_frustum(points_m))
        facing = inside[camera.cos_incidence(points_m[inside], normals[inside]) > 0]
        ends = points_m[facing] + CLEARANCE_M * normals[facing]
        starts = np.broadcast_to(np.array(camera.position_m), ends.shape)
        row[facing] = ~any_blocks(occluder, starts, ends)
    return seen
