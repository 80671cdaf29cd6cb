"""The keys of an object that moves during the exposure."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from pss import Box, Rectangle, Sphere
from pss.surrogates import Mesh
from render.world.state import Motion
from scenes.reading.quantities import Point
from scenes.reading.spec import Number, Spec

__all__ = ["MovingSpec", "motion_of"]

Velocity = Annotated[tuple[Number, Number, Number], Field(description="[x, y, z], in metres per second")]
Spin = Annotated[Number, Field(description="a number, in degrees per second, as a camera pans")]


class MovingSpec(Spec):
    """An object that may move: its other keys state its position at the middle of the exposure."""

    velocity_m_per_s: Velocity = (0.0, 0.0, 0.0)
    spin_deg_per_s: Spin = 0.0


def motion_of(spec: MovingSpec, shape: Rectangle | Sphere | Box | Mesh, origin_m: Point | None = None) -> Motion | None:
    """The motion of an object with the table `spec`; None at rest.

    Args:
        origin_m: m, (3,), a mesh's own origin, about which it rotates; the other shapes rotate about their centre.
    """
    if not any(spec.velocity_m_per_s) and spec.spin_deg_per_s == 0:
        return None
    if isinstance(shape, Box):
        middle = (np.array(shape.lowest_m) + shape.highest_m) / 2
    elif isinstance(shape, Mesh):
        middle = np.array(origin_m if origin_m is not None else shape.vertices_m.mean(axis=0))
    else:
        middle = np.array(shape.centre_m)
    x, y, z = middle.tolist()
    # Pan is positive from +y to +x, opposite to the right-hand rule about z.
    return Motion(spec.velocity_m_per_s, (0.0, 0.0, -spec.spin_deg_per_s), (x, y, z))
