"""Surrogates: the shapes in a scene, the points of interest on them, and the occlusion of lines of sight.

Prediction and rendering use the same objects. `Shape` is the interface of an occluder; a `Surrogate` is a set of points
of interest with normals, chosen by any of the paper's models (section 3.4).
"""

from pss.surrogates.mesh import Mesh
from pss.surrogates.orders import balanced_order, farthest_point_order
from pss.surrogates.points import Surrogate, box_corners, convex_hull, dense_cloud, single_point
from pss.surrogates.round_solids import Capsule, Cylinder
from pss.surrogates.shapes import Box, Rectangle, Shape, Sphere, any_blocks
from pss.surrogates.spread import (
    SamplingMethod,
    grid_on_rectangle,
    on_box,
    on_capsule,
    on_cylinder,
    on_mesh,
    on_rectangle,
    on_sphere,
)
from pss.surrogates.subsample import (
    Subsample,
    relative_standard_error,
    subsample_adaptively,
    subsample_to_budget,
    subsample_to_tolerance,
)

__all__ = [
    "Box",
    "Capsule",
    "Cylinder",
    "Mesh",
    "Rectangle",
    "SamplingMethod",
    "Shape",
    "Sphere",
    "Subsample",
    "Surrogate",
    "any_blocks",
    "balanced_order",
    "box_corners",
    "convex_hull",
    "dense_cloud",
    "farthest_point_order",
    "grid_on_rectangle",
    "on_box",
    "on_capsule",
    "on_cylinder",
    "on_mesh",
    "on_rectangle",
    "on_sphere",
    "relative_standard_error",
    "single_point",
    "subsample_adaptively",
    "subsample_to_budget",
    "subsample_to_tolerance",
]
