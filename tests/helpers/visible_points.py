"""Which points cameras see, from lists of cameras, points and shapes."""

from __future__ import annotations

import numpy as np

from pss.cameras.views import Views
from pss.visibility.points import visible_in

__all__ = ["visible_points"]


def visible_points(cameras, points_m, normals, occluder=()):
    """Whether each camera sees each point, (C, N), by field of view and occlusion."""
    return visible_in(Views(list(cameras), np.asarray(points_m), np.asarray(normals)), tuple(occluder))
