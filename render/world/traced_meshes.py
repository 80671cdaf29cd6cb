"""Meshes as occluders, traced by Mitsuba: the results of `pss.surrogates.Mesh.blocks`, about eighty times faster.

Radiosity tests tens of millions of lines of sight for a scene with people in it; the metric tests thousands.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pss.hints import Bools, Floats
from pss.surrogates import Mesh, Shape

__all__ = ["TracedMeshes", "joined_meshes", "with_traced_meshes"]


# Rays of several threads would wait for each other inside Dr.Jit, which uses all cores by itself.
ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True, eq=False)
class TracedMeshes:
    """Triangles as an occluder, with the interface of `Shape`; in single precision.

    Attributes:
        mesh: the mesh that blocks.
        mi: Mitsuba, with a variant that traces many rays at once.
    """

    mesh: Mesh
    mi: Any
    _scene: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        mi, mesh = self.mi, self.mesh
        triangles = mi.Mesh(mesh.name, len(mesh.vertices_m), len(mesh.faces))
        parameters = mi.traverse(triangles)
        parameters["vertex_positions"] = mesh.vertices_m.ravel().astype(np.float32)
        parameters["faces"] = mesh.faces.ravel().astype(np.uint32)
        parameters.update()
        # Without it one in twelve rays aimed at the seam between two triangles passes through; the metric's own search
        # is watertight.
        scene = {"type": "scene", "embree_use_robust_intersections": True, "mesh": triangles}
        object.__setattr__(self, "_scene", mi.load_dict(scene))

    @property
    def name(self) -> str:
        """The mesh's name."""
        return self.mesh.name

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments, (..., 3) each, cross the surface; shape (...)."""
        mi = self.mi
        starts, ends = np.broadcast_arrays(starts_m, ends_m)
        begin, towards = (part.reshape(-1, 3).T.astype(np.float32) for part in (starts, ends - starts))
        if not begin.size:
            return np.zeros(starts.shape[:-1], dtype=bool)
        with ONE_AT_A_TIME:
            ray = mi.Ray3f(mi.Point3f(*begin), mi.Vector3f(*towards), maxt=1.0, time=0.0, wavelengths=[])
            crossed = self._scene.ray_test(ray).numpy()
        return np.asarray(crossed, dtype=bool).reshape(starts.shape[:-1])


def joined_meshes(shapes: Sequence[Shape]) -> tuple[Shape, ...]:
    """The same occluders with all meshes as one: one search for each ray instead of one for each mesh."""
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    if len(meshes) < 2:
        return tuple(shapes)
    first = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + begin for mesh, begin in zip(meshes, first, strict=False)])
    joined = Mesh("meshes", np.concatenate([mesh.vertices_m for mesh in meshes]), faces)
    return (*(shape for shape in shapes if not isinstance(shape, Mesh)), joined)


def with_traced_meshes(shapes: Sequence[Shape], mi: Any | None) -> tuple[Shape, ...]:
    """The same occluders, with the meshes as one that Mitsuba traces.

    Args:
        mi: Mitsuba; with None, or a variant that traces one ray at a time, the metric's own search is used.
    """
    joined = joined_meshes(shapes)
    if mi is None or mi.variant().startswith("scalar"):
        return joined
    return tuple(TracedMeshes(shape, mi) if isinstance(shape, Mesh) else shape for shape in joined)
