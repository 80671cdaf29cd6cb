"""Light in a diffuse room: irradiance by radiosity, solved once per scene state and then looked up by every view.

Because views do not sample the light, shading and soft shadows add no noise to the images that a detector could mistake
for sensor noise. Lambert's formula is exact for the form factor from a point to a polygon; occlusion is tested with the
same shapes as in the metric. Approximations: a patch is hidden as a whole or not at all (by its centre); each patch has
one radiosity; lamps occlude nothing, and in exchange the ceiling above them reflects nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from pss.hints import Floats
from pss.surrogates import Shape, any_blocks
from render.light.patches import scene_patches
from render.world.state import SceneState
from render.world.traced_meshes import with_traced_meshes

__all__ = ["Radiosity", "UnitLight", "form_factors", "solve_light", "solve_radiosity"]


# Receivers are lifted off their surface, since from a point in its own plane or corner a polygon has no solid angle.
LIFT_M = 1e-3
# A few hundred thousand pairs of receiver and patch, whose arrays nearly fit the processor's cache.
RECEIVERS_AT_ONCE = 128


@dataclass(frozen=True)
class Radiosity:
    """The solved light of a scene state.

    Attributes:
        corners_m: m, the patches, (P, 4, 3); a triangle repeats its last corner.
        centres_m: m, the points on the true surfaces that represent the patches, (P, 3).
        normals: unit normals of the patches, (P, 3).
        radiosity: W/m² of each patch, (P,).
        occluders: the shapes that cast shadows.
    """

    corners_m: Floats
    centres_m: Floats
    normals: Floats
    radiosity: Floats
    occluders: tuple[Shape, ...]

    def irradiance(self, points_m: Floats, normals: Floats) -> Floats:
        """W/m² at `points_m` (N, 3) on surfaces with unit `normals` (N, 3); shape (N,)."""
        patches = self.corners_m, self.centres_m, self.normals

        def arriving(part: slice) -> Floats:
            return _seen_form_factors(points_m[part], normals[part], *patches, self.occluders) @ self.radiosity

        return _in_parts(arriving, len(points_m)) if len(points_m) else np.zeros(0)


@dataclass(frozen=True)
class UnitLight:
    """One W/m² on every surface: under ring lights each view scales it by its camera's light."""

    def irradiance(self, points_m: Floats, normals: Floats) -> Floats:
        """W/m² at `points_m` (N, 3): ones, (N,)."""
        return np.ones(len(points_m))


def solve_light(state: SceneState, mi: Any | None = None) -> Radiosity | UnitLight:
    """The source of irradiance: the inter-reflection of the lamps' light, or ones under ring lights.

    Args:
        mi: Mitsuba, for occlusion by meshes; None uses the metric's own meshes, which is much slower.
    """
    return UnitLight() if state.light.ring_w_per_sr > 0 else solve_radiosity(state, mi)


def solve_radiosity(state: SceneState, mi: Any | None = None) -> Radiosity:
    """Solve the inter-reflection of the scene's surfaces: B = M + ρ F B over its patches; `mi` as in `solve_light`."""
    patches = scene_patches(state)
    corners, centres, normals = patches.corners_m, patches.centres_m, patches.normals
    occluders = with_traced_meshes(state.occluders, mi)

    def factors(part: slice) -> Floats:
        return _seen_form_factors(centres[part], normals[part], corners, centres, normals, occluders)

    received = _in_parts(factors, len(centres))
    radiosity = np.linalg.solve(np.eye(len(centres)) - patches.albedo[:, None] * received, patches.emitted)
    return Radiosity(corners, centres, normals, radiosity, occluders)


def form_factors(points_m: Floats, normals: Floats, corners_m: Floats) -> Floats:
    """Share of a Lambertian receiver's irradiance from a polygon without occlusion, by Lambert's formula; (M,).

    Args:
        points_m, normals: receivers, (M, 3) each.
        corners_m: m, each receiver's polygon (M, 4, 3), counter-clockwise as seen from its bright side.
    """
    starts = np.ascontiguousarray((corners_m - points_m[:, None]).transpose(2, 1, 0))
    return _of_rays(starts, np.ascontiguousarray(normals.T))


def _of_rays(starts: Floats, normals: Floats) -> Floats:
    """Form factors (M,) of quadrilaterals with corners (3, 4, M) from receivers at 0 with unit normals (3, M).

    Components come first: three long arrays are faster than many short vectors.
    """
    heights = (starts * normals[:, None]).sum(axis=0)
    factors = _lambert(starts, np.roll(starts, -1, axis=1), normals)
    cut = np.flatnonzero((heights < 0).any(axis=0))
    begins = starts[:, :, cut].transpose(2, 1, 0)
    risen = _above_horizon(begins, np.roll(begins, -1, axis=1), heights[:, cut].T)
    factors[cut] = _lambert(*(edges.transpose(2, 1, 0) for edges in risen), normals[:, cut])
    return factors


def _lambert(starts: Floats, ends: Floats, normals: Floats) -> Floats:
    """Form factors of polygons by edges, (3, K, M) from the receiver: Σ angle · (normal of its plane · n)/2π."""
    (a, b, c), (d, e, f) = starts, ends
    x, y, z = b * f - c * e, c * d - a * f, a * e - b * d
    sine = np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(sine, a * d + b * e + c * f)
    # An edge without length, such as a repeated corner, has no angle and no direction: it contributes nothing.
    along_normal = (x * normals[0] + y * normals[1] + z * normals[2]) / np.maximum(sine, 1e-300)
    return np.asarray(-(angle * along_normal).sum(axis=0) / (2 * np.pi))


def _above_horizon(starts: Floats, ends: Floats, heights: Floats) -> tuple[Floats, Floats]:
    """The edges (M, K + 1, 3) of the part above the receiver's horizon of convex polygons with edges (M, K, 3)."""
    following = np.roll(heights, -1, axis=1)
    sets, rises = (heights >= 0) & (following < 0), (heights < 0) & (following >= 0)
    share = heights / np.where(sets | rises, heights - following, 1.0)
    crossings = starts + share[..., None] * (ends - starts)
    from_start = np.where((heights >= 0)[..., None], starts, crossings)
    to_end = np.where((following >= 0)[..., None], ends, crossings)
    below = (heights < 0) & (following < 0)
    to_end = np.where(below[..., None], from_start, to_end)
    # The edge along the horizon, from where the polygon sets to where it rises again.
    setting, rising = ((mask[..., None] * crossings).sum(axis=1, keepdims=True) for mask in (sets, rises))
    return np.concatenate([from_start, setting], axis=1), np.concatenate([to_end, rising], axis=1)


def _seen_form_factors(
    points_m: Floats,
    normals: Floats,
    corners_m: Floats,
    centres_m: Floats,
    patch_normals: Floats,
    occluders: tuple[Shape, ...],
) -> Floats:
    """Form factors (N, P) from receivers (N, 3) to the patches visible to them."""
    receivers = points_m + LIFT_M * normals
    in_front_of_patch = receivers @ patch_normals.T > (corners_m[:, 0] * patch_normals).sum(axis=-1)
    highest_corner = np.einsum("ni,pki->npk", normals, corners_m).max(axis=-1)
    above_horizon = highest_corner > (receivers * normals).sum(axis=-1)[:, None]
    receiver, patch = np.nonzero(in_front_of_patch & above_horizon)
    ends = (centres_m + LIFT_M * patch_normals)[patch]
    clear = ~any_blocks(occluders, receivers[receiver], ends)
    receiver, patch = receiver[clear], patch[clear]
    factors = np.zeros((len(points_m), len(corners_m)))
    starts = corners_m.transpose(2, 1, 0)[:, :, patch] - receivers.T[:, None, receiver]
    factors[receiver, patch] = np.maximum(_of_rays(starts, normals.T[:, receiver]), 0.0)
    return factors


def _in_parts(compute: Callable[[slice], Floats], count: int) -> Floats:
    """Joined results of `compute` for slices of `count` receivers; in threads, as numpy releases the GIL."""
    parts = [slice(start, start + RECEIVERS_AT_ONCE) for start in range(0, count, RECEIVERS_AT_ONCE)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return np.concatenate(list(pool.map(compute, parts)))
