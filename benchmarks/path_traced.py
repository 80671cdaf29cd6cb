"""Irradiance at the room's markers by radiosity beside a path-traced reference: `python benchmarks/path_traced.py`.

The reference shares the scene's geometry, albedos and lamps with `render.light.radiosity`, and nothing of its method:
Mitsuba's path integrator in the room with diffuse walls and lamps that shine and hide, and neither patches nor meshes
of tiles.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import scenes
from pss import Sphere
from render import backend
from render.light.radiosity import LIFT_M, solve_light
from render.world.geometry import Surface, Tile, lamps, surfaces
from render.world.state import SceneState

__all__ = ["path_traced_irradiance", "path_traced_scene"]

Floats = NDArray[np.float64]

# Where irradiance is asked for lies a white square: small beside whatever it might light or hide.
TARGET_M = 1e-4
# Rays start this far before their target, nearer than anything that might stand between.
START_M = 5e-5
# The scatter of so many independent parts says how noisy their mean is.
PARTS = 16


def path_traced_scene(state: SceneState, points_m: Floats, normals: Floats, mi: Any) -> Any:
    """The true scene without markers: diffuse surfaces, lamps, and a white target at each of `points_m` (N, 3)."""
    shapes: dict[str, Any] = {"type": "scene"}
    for number, surface in enumerate([*surfaces(state), *lamps(state)]):
        for part, shape in enumerate(_shapes(surface, mi)):
            shapes[f"surface_{number}_{part}"] = shape | _material(surface.albedo, surface.radiance)
    for number, (point, normal) in enumerate(zip(points_m, normals, strict=True)):
        across = np.linalg.svd(normal[None])[2][1]
        edges = TARGET_M * across, TARGET_M * np.cross(normal, across)
        tile = Tile(point - (edges[0] + edges[1]) / 2, *edges)
        shapes[f"target_{number}"] = _rectangle(tile, mi) | _material(1.0)
    return mi.load_dict(shapes)


def path_traced_irradiance(
    state: SceneState, points_m: Floats, normals: Floats, mi: Any, samples: int, seed: int = 0
) -> tuple[Floats, Floats]:
    """W/m² at `points_m` (N, 3) on surfaces with unit `normals` (N, 3), and its standard error; (N,) each.

    A white diffuse target sends back irradiance/π in every direction, and Mitsuba's integrator gives the radiance of
    one ray that looks at it. `samples` paths a point, in `PARTS` parts.
    """
    import drjit as dr

    lifted = points_m + LIFT_M * normals
    scene = path_traced_scene(state, lifted, normals, mi)
    integrator = mi.load_dict({"type": "path", "max_depth": -1})
    each = samples // PARTS
    starts, ways = lifted + START_M * normals, -normals
    parts = []
    for part in range(PARTS):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed * PARTS + part, len(points_m) * each)
        point = dr.arange(mi.UInt32, len(points_m) * each) // each
        rays = mi.Ray3f(*(dr.gather(mi.Point3f, mi.Point3f(*x.T), point) for x in (starts, ways)))
        radiance, _, _ = integrator.sample(scene, sampler, rays)
        parts.append(np.pi * dr.block_sum(radiance[0], each).numpy().astype(float) / each)
    return np.mean(parts, axis=0), np.std(parts, axis=0, ddof=1) / np.sqrt(PARTS)


def _shapes(surface: Surface, mi: Any) -> list[dict[str, Any]]:
    if isinstance(surface.shape, Sphere):
        return [{"type": "sphere", "center": list(surface.shape.centre_m), "radius": surface.shape.radius_m}]
    if not isinstance(surface.shape, tuple):
        raise NotImplementedError(f"{surface.name} is a mesh; the reference knows tiles and spheres")
    return [_rectangle(tile, mi) for tile in surface.shape]


def _rectangle(tile: Tile, mi: Any) -> dict[str, Any]:
    """Mitsuba's rectangle, which spans −1 to 1 along its x and y and looks along its z."""
    place = np.eye(4)
    place[:3, :3] = np.column_stack([tile.edge_u_m / 2, tile.edge_v_m / 2, tile.normal])
    place[:3, 3] = tile.corner_m + (tile.edge_u_m + tile.edge_v_m) / 2
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f(place)}


def _material(albedo: float, radiance: float = 0.0) -> dict[str, Any]:
    material: dict[str, Any] = {
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}},
    }
    if radiance:
        material["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
    return material


def main() -> None:
    """Print how far radiosity is from the reference."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=1 << 18, help="paths a marker")
    options = parser.parse_args()
    mi = backend.start(backend.choose())
    state = scenes.load(Path(__file__).resolve().parents[1] / "scenes" / "room.toml").state
    points, normals = state.points_m, state.normals
    begin = time.perf_counter()
    solved = solve_light(state)
    between = time.perf_counter()
    radiosity = solved.irradiance(points, normals)
    seconds = between - begin, time.perf_counter() - between
    begin = time.perf_counter()
    reference, error = path_traced_irradiance(state, points, normals, mi, options.samples)
    print(f"radiosity {seconds[0]:.1f} s and {seconds[1]:.2f} s for the markers; ", end="")
    print(f"reference {time.perf_counter() - begin:.0f} s ({options.samples} paths a marker)\n")
    print("| markers | | RMS | mean | largest | noise of the reference |\n|---|---|---|---|---|---|")
    owners = np.array([marker.object_name for marker in state.markers])
    for name in ["all", *dict.fromkeys(owners)]:
        chosen = (owners == name) | (name == "all")
        off = (radiosity / reference - 1)[chosen]
        noise = np.sqrt(np.mean((error / reference)[chosen] ** 2))
        largest = off[np.abs(off).argmax()]
        print(
            f"| {name} | {chosen.sum()} | {np.sqrt(np.mean(off**2)):.2%} | {off.mean():+.2%} | {largest:+.2%} "
            f"| {noise:.2%} |"
        )


if __name__ == "__main__":
    main()
