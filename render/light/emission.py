"""Radiance of the surfaces of a baked scene towards a camera, by direct look-up.

Mitsuba's emitters are called through pointers, and Dr.Jit compiles such a call for the emitters of all scenes in
memory. A look-up by triangle number yields the same light in half the time, for any number of scenes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["Emission"]


class Emission:
    """Radiance of the first surfaces that rays hit in a scene of `render.light.lit_scene.load_scene`."""

    def __init__(self, scene: Any, mi: Any) -> None:
        self.scene, self.mi = scene, mi
        self.parts = {shape.id(): (mi.ShapePtr(shape), _Part(shape, mi)) for shape in scene.shapes()}

    def radiance(self, ray: Any, missed: Any, ring: Any | None = None) -> Any:
        """W/(m² sr) along each ray; `missed` where nothing, or a back, is hit.

        In a closed room such a ray has passed through the seam between two triangles: one in a million does.

        Args:
            ring: function from hit positions and normals to W/m² for each W/m² that the scene was baked at.
        """
        import drjit as dr

        mi = self.mi
        hit = self.scene.ray_intersect_preliminary(ray, True)
        found, normal = mi.Float(0), mi.Normal3f(0)
        for pointer, part in self.parts.values():
            here = hit.is_valid() & (hit.shape == pointer)
            found = dr.select(here, part.radiance(hit.prim_index, hit.prim_uv, here), found)
            normal = dr.select(here, dr.gather(mi.Normal3f, part.normals, hit.prim_index, here), normal)
        if ring is not None:
            found = found * ring(ray(hit.t), normal)
        return dr.select(dr.dot(normal, ray.d) < 0, found, missed)


class _Part:
    """The triangles of one shape: a radiance at each vertex, or an atlas of texels."""

    def __init__(self, shape: Any, mi: Any) -> None:
        import drjit as dr

        self.mi = mi
        parameters = mi.traverse(shape)
        self.faces = parameters["faces"]
        corners = parameters["vertex_positions"].numpy().reshape(-1, 3)[self.faces.numpy().reshape(-1, 3)]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float32).tiny)
        self.normals = mi.Float(normals.astype(np.float32).ravel())
        self.of_vertices = "vertex_radiance" in parameters
        if self.of_vertices:
            self.light = parameters["vertex_radiance"]
        else:
            self.uv = parameters["vertex_texcoords"]
            atlas = parameters["emitter.radiance.data"]
            rows, columns = atlas.shape[:2]
            self.light = mi.Float(atlas.array)
            # Data, not constants, so that another atlas needs no new compilation.
            self.rows, self.columns = (dr.opaque(mi.UInt32, int(n)) for n in (rows, columns))

    def radiance(self, triangle: Any, inside: Any, active: Any) -> Any:
        """Radiance at barycentric coordinates `inside` (of the second and third corner) of each `triangle`."""
        import drjit as dr

        mi = self.mi
        corners = dr.gather(mi.Vector3u, self.faces, triangle, active)
        first = 1 - inside.x - inside.y
        if self.of_vertices:
            a, b, c = (dr.gather(mi.Float, self.light, corner, active) for corner in corners)
            return first * a + inside.x * b + inside.y * c
        a, b, c = (dr.gather(mi.Point2f, self.uv, corner, active) for corner in corners)
        uv = first * a + inside.x * b + inside.y * c
        column = dr.minimum(mi.UInt32(dr.maximum(uv.x, 0) * mi.Float(self.columns)), self.columns - 1)
        row = dr.minimum(mi.UInt32(dr.maximum(uv.y, 0) * mi.Float(self.rows)), self.rows - 1)
        return dr.gather(mi.Float, self.light, row * self.columns + column, active)
