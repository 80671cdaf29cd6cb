"""Surrogates of a walking person in the metric: a cylinder as in the paper, a box, its mesh, or its markers."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from pss import Box
from pss.hints import Floats
from pss.surrogates import Cylinder, Mesh, Surrogate, on_box, on_cylinder, on_mesh
from render.world.state import SceneState
from validate.schedule.state import Avatar

__all__ = ["CYLINDER_RADIUS_M", "avatar_like"]


# Of a person without the arms; the paper specifies only "cylinders".
CYLINDER_RADIUS_M = 0.25
POINTS = 40


def avatar_like(kind: str, state: SceneState, name: str, middle_m: Floats) -> Avatar:
    """The surrogate of the person called `name`, about its middle.

    Args:
        kind: one of `scenes.steps.schedule_file.SURROGATES`.
        state: in which it stands, at `middle_m`, m, (3,).
    """
    (mesh,) = (item.shape for item in state.objects if item.shape.name == name)
    assert isinstance(mesh, Mesh)
    own = mesh.moved(tuple((-np.asarray(middle_m)).tolist()))
    low, high = own.vertices_m.min(axis=0), own.vertices_m.max(axis=0)
    match kind:
        case "cylinder":
            height_m = float(2 * max(abs(low[2]), abs(high[2])))
            cylinder = Cylinder(name, (0.0, 0.0, 0.0), CYLINDER_RADIUS_M, height_m)
            return Avatar(on_cylinder(cylinder, POINTS, caps=False), CYLINDER_RADIUS_M, height_m)
        case "box":
            box = Box(name, tuple(low.tolist()), tuple(high.tolist()))
            return Avatar(on_box(box, POINTS), solid=box)
        case "mesh":
            # The same points for the same body: they are its own, not a run's.
            return Avatar(on_mesh(own, POINTS, rng=Generator(np.random.PCG64(0))), solid=own)
        case _:
            worn = [marker for marker in state.markers if marker.object_name == name]
            points = np.array([marker.centre_m for marker in worn]) - middle_m
            return Avatar(Surrogate(points, np.array([marker.normal for marker in worn]), np.array(name)), solid=own)
