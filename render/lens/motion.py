"""Motion during the exposure: the scene at instants spread evenly over the exposure time.

A scene file describes the state at the middle of the exposure. Light is solved for that moment and moves with the
surfaces: over the centimetres of an exposure, shading does not change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pss import PTZCamera
from pss.hints import Floats, Images
from render.lens.sampling import PixelSampler
from render.light.lit_scene import GlowMeshes
from render.world.state import Motion, SceneState

__all__ = ["instants", "moved", "over_shutter", "travel_px"]


# Error allowed for n instants instead of a continuous exposure, as a share of an edge's contrast. The light of an edge
# crossing a pixel is a ramp; midpoints of n equal parts are exact except at its kinks: L px of motion cost L/(8 n²).
SHARE_OF_CONTRAST = 0.002
MOST_INSTANTS = 64


def moved(meshes: GlowMeshes, state: SceneState, seconds: float) -> GlowMeshes:
    """The baked scene `seconds` after the middle of the exposure (before it if negative)."""
    vertices, plates = meshes.vertices_m.copy(), meshes.plates_m.copy()
    for number, item in enumerate(state.objects):
        if item.motion is not None:
            of_vertices, of_plates = meshes.vertex_objects == number, meshes.plate_objects == number
            vertices[of_vertices] = _carried(vertices[of_vertices], item.motion, seconds)
            plates[of_plates] = _carried(plates[of_plates], item.motion, seconds)
    return replace(meshes, vertices_m=vertices, plates_m=plates)


def _carried(points_m: Floats, motion: Motion, seconds: float) -> Floats:
    about = np.array(motion.about_m)
    turn = Rotation.from_rotvec(np.radians(motion.turn_rate_deg_per_s) * seconds)
    turned = turn.apply((points_m - about).reshape(-1, 3)).reshape(points_m.shape)
    return turned + about + np.array(motion.velocity_m_per_s) * seconds


def travel_px(meshes: GlowMeshes, state: SceneState, camera: PTZCamera, exposure_s: float) -> float:
    """The longest path in px of any vertex in front of the camera during the exposure."""
    longest = 0.0
    ends = [moved(meshes, state, sign * exposure_s / 2) for sign in (-1, 1)]
    for name in ("vertices_m", "plates_m"):
        points = [getattr(end, name).reshape(-1, 3) for end in ends]
        moving = (points[0] != points[1]).any(axis=1)
        (first, near), (last, far) = (camera.project(part[moving]) for part in points)
        # Surfaces right beside the lens move without bound and only fill the image with blur.
        seen = np.minimum(near, far) > camera.focal_length_m
        longest = max(longest, float(np.linalg.norm(last - first, axis=-1)[seen].max(initial=0.0)))
    return longest


def instants(travel: float, exposure_s: float) -> Floats:
    """Times in s from the middle of the exposure: midpoints of equal parts, as many as a power of two.

    Args:
        travel: px, from `travel_px`.
    """
    needed = math.sqrt(travel / (8 * SHARE_OF_CONTRAST))
    count = 2 ** math.ceil(math.log2(min(max(needed, 1.0), MOST_INSTANTS)))
    return ((np.arange(count) + 0.5) / count - 0.5) * exposure_s


def over_shutter(samplers: Sequence[PixelSampler]) -> PixelSampler:
    """One sampler for several instants, as many as a power of two: each pixel's samples are divided evenly among them.

    With fewer samples than instants, a pixel's samples are at as many instants, equally spaced from a random first one.
    """

    def sampler(pixels: NDArray[np.uint32], count: int, rng: np.random.Generator) -> tuple[Images]:
        used = min(count, len(samplers))
        step = len(samplers) // used
        first = int(rng.integers(step))
        share = count // used
        mean = np.zeros(len(pixels))
        square = np.zeros(len(pixels))
        for instant in samplers[first::step]:
            part, variance = instant(pixels, share, rng)
            mean += part
            # Back to the mean of the squares: the variance has Bessel's correction.
            square += variance * ((share - 1) / share) + part.astype(float) ** 2
        mean, square = mean / used, square / used
        variance = np.maximum(square - mean**2, 0.0) * (count / max(count - 1, 1))
        return mean.astype(np.float32), variance.astype(np.float32)

    return sampler
