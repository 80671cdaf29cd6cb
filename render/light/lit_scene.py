"""The lit scene for Mitsuba: every surface emits the light that it reflects.

All surfaces are diffuse, so that their radiance towards a camera follows from the irradiance: albedo·E/π. Mitsuba gets
surfaces that emit this radiance. One ray then yields the exact radiance of the surface it hits, with any integrator and
variant of Mitsuba, and the only sampling noise left is that of pixel area and lens.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pss import Appearance
from pss.hints import Floats
from render.light.radiosity import Radiosity, UnitLight
from render.world.geometry import THICKNESS_M, Surface, lamps, plate_corners, surfaces
from render.world.marker_print import pattern, plate_texture
from render.world.state import SceneState

__all__ = ["GlowMeshes", "appearance", "appearance_of", "bake", "load_scene"]


@dataclass(frozen=True, eq=False)
class GlowMeshes:
    """The baked scene as arrays, for storage and transfer.

    Attributes:
        vertices_m, faces: surfaces, (V, 3) and (F, 3).
        radiance: W/(m² sr) at the vertices, (V,).
        plates_m: m, corners of the markers' plates (N, 4, 3): top left, top right, bottom right, bottom left.
        textures: W/(m² sr) of the plates, (N, T, T).
        marker_ids: (N,).
        vertex_objects, plate_objects: numbers of their objects, (V,) and (N,); −1 for the room or a lamp.
    """

    vertices_m: Floats
    faces: NDArray[np.int64]
    radiance: Floats
    plates_m: Floats
    textures: NDArray[np.float32]
    marker_ids: NDArray[np.int64]
    vertex_objects: NDArray[np.int64]
    plate_objects: NDArray[np.int64]


def bake(state: SceneState, light: Radiosity | UnitLight) -> GlowMeshes:
    """Look up the irradiance on all surfaces and plates of `state`."""
    vertices, faces, radiance, owners, count = [], [], [], [], 0
    for surface in [*surfaces(state), *lamps(state)]:
        points, _, triangles = surface.triangles()
        vertices.append(points)
        faces.append(triangles + count)
        radiance.append(_leaving(surface, len(points), light))
        owners.append(np.full(len(points), surface.object_number))
        count += len(points)
    plates, textures, plate_owners = [], [], []
    numbers = {item.shape.name: number for number, item in enumerate(state.objects)}
    for marker in state.markers:
        modules = len(pattern(state.print.dictionary, marker.id)) + 2 * state.print.quiet_zone_modules
        corners = plate_corners(marker, modules)
        corner_irradiance = light.irradiance(corners, np.tile(marker.normal, (4, 1)))
        plates.append(corners)
        # The back, visible to cameras beside the ball if a plate stands off: paper, lit by the light behind it.
        back, behind = corners[::-1] - THICKNESS_M * np.array(marker.normal), -np.tile(marker.normal, (4, 1))
        vertices.append(back)
        faces.append(np.array([[0, 2, 1], [0, 3, 2]]) + count)
        radiance.append(state.print.white_albedo / np.pi * light.irradiance(back, behind))
        plate_owners.append(numbers.get(marker.object_name, -1))
        owners.append(np.full(len(back), plate_owners[-1]))
        count += len(back)
        textures.append(plate_texture(state.print, marker.id, corner_irradiance))
    texels = len(textures[0]) if textures else 1
    return GlowMeshes(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.concatenate(radiance),
        np.array(plates).reshape(-1, 4, 3),
        np.array(textures, dtype=np.float32).reshape(-1, texels, texels),
        np.array([marker.id for marker in state.markers], dtype=np.int64),
        np.concatenate(owners),
        np.array(plate_owners, dtype=np.int64),
    )


def appearance(state: SceneState, meshes: GlowMeshes) -> Appearance:
    """The markers' appearance for the prediction: from the light on them, not from any view.

    A plate's four corner texels are paper, so that their mean is the white at its centre.
    """
    return appearance_of(state, meshes.textures[:, [0, 0, -1, -1], [0, -1, 0, -1]].mean(axis=1, dtype=float))


def appearance_of(state: SceneState, white: Floats) -> Appearance:
    """Appearance of markers with these white radiances, W/(m² sr), (N,); under ring lights those at 1 W/m²."""
    if state.light.ring_w_per_sr > 0:  # baked at 1 W/m²; the ring makes I/D² at D = 1 m
        white = white * state.light.ring_w_per_sr
    return Appearance(
        module_m=np.array([marker.module_m for marker in state.markers]),
        white_w_per_m2_sr=white,
        black_w_per_m2_sr=white * (state.print.black_albedo / state.print.white_albedo),
        along=np.array([marker.right for marker in state.markers]),
        modules=len(pattern(state.print.dictionary, state.markers[0].id)),
        ring_light=state.light.ring_w_per_sr > 0,
        velocity_m_per_s=_marker_velocities(state),
    )


def _marker_velocities(state: SceneState) -> Floats | None:
    """m/s, (N, 3), of the markers at the middle of the exposure, as their objects move; None if all are at rest."""
    motions = {item.shape.name: item.motion for item in state.objects}
    of_markers = [motions.get(marker.object_name) for marker in state.markers]
    if not any(of_markers):
        return None
    velocities = np.zeros((len(state.markers), 3))
    for number, (marker, motion) in enumerate(zip(state.markers, of_markers, strict=True)):
        if motion is not None:
            from_axis_m = np.array(marker.centre_m) - motion.about_m
            turning = np.cross(np.radians(motion.turn_rate_deg_per_s), from_axis_m)
            velocities[number] = motion.velocity_m_per_s + turning
    return velocities


def _leaving(surface: Surface, vertices: int, light: Radiosity) -> Floats:
    if surface.radiance:
        return np.full(vertices, surface.radiance)
    return surface.albedo / np.pi * surface.lit_by(light.irradiance)


def load_scene(meshes: GlowMeshes, mi: Any) -> Any:
    """Mitsuba's scene of `meshes`: the shape "surfaces", and "plates" if there are markers."""
    shapes: dict[str, Any] = {
        "type": "scene",
        # Rays through seams between triangles are traced again where many are traced at once (`render.lens.sampling`, a
        # fifth less time than this); single rays are not.
        "embree_use_robust_intersections": mi.variant().startswith("scalar"),
        "integrator": {"type": "path", "max_depth": 1},
        "surfaces": _mesh(
            mi,
            "surfaces",
            meshes.vertices_m,
            meshes.faces,
            {"type": "mesh_attribute", "name": "vertex_radiance"},
            radiance=meshes.radiance,
        ),
    }
    if len(meshes.marker_ids):
        shapes["plates"] = _plates(meshes, mi)
    return mi.load_dict(shapes)


def _plates(meshes: GlowMeshes, mi: Any) -> Any:
    """All plates as one mesh with one atlas: two triangles a plate, in the order of the markers."""
    count, texels = len(meshes.marker_ids), meshes.textures.shape[-1]
    columns = int(np.ceil(np.sqrt(count)))
    rows = -(-count // columns)
    atlas = np.zeros((rows * texels, columns * texels, 1), dtype=np.float32)
    uv = np.empty((count, 4, 2))
    for number, texture in enumerate(meshes.textures):
        row, column = divmod(number, columns)
        atlas[row * texels : (row + 1) * texels, column * texels : (column + 1) * texels, 0] = texture
        left, right, top, bottom = column, column + 1, row, row + 1
        uv[number] = [(left, top), (right, top), (right, bottom), (left, bottom)]
    uv /= (columns, rows)
    first = 4 * np.arange(count)[:, None]
    # Counter-clockwise from the front: top left, bottom left, bottom right, top right.
    faces = np.concatenate([first + [0, 3, 2], first + [0, 2, 1]], axis=1).reshape(-1, 3)
    radiance = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(atlas),
        "raw": True,
        "filter_type": "nearest",
        "wrap_mode": "clamp",
    }
    return _mesh(mi, "plates", meshes.plates_m.reshape(-1, 3), faces, radiance, uv=uv.reshape(-1, 2))


def _mesh(
    mi: Any,
    name: str,
    vertices_m: Floats,
    faces: NDArray[np.int64],
    emission: dict[str, Any],
    radiance: Floats | None = None,
    uv: Floats | None = None,
) -> Any:
    properties = mi.Properties()
    properties["emitter"] = mi.load_dict({"type": "area", "radiance": emission})
    properties["bsdf"] = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}})
    mesh = mi.Mesh(name, len(vertices_m), len(faces), properties, False, uv is not None)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(vertices_m).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    if uv is not None:
        parameters["vertex_texcoords"] = np.ravel(uv).astype(np.float32)
    parameters.update()
    if radiance is not None:
        mesh.add_attribute("vertex_radiance", 1, radiance.astype(np.float32))
    return mesh
