"""Motion during the exposure: the scene at instants spread evenly over the shutter's time.

The middle of the exposure is the time at which a scene state is as its file says. Light is solved for that moment and
moves along with what it lies on: over the centimetres of an exposure shading does not change.
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


# What n instants in place of the whole exposure may cost, in shares of an edge's contrast. As an edge crosses a pixel,
# its light is a ramp; the middles of n equal parts are exact but at its two kinks: a way of L px costs L/(8 n²).
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
    """The longest way in px that any vertex in front of the camera goes in its image during the exposure."""
    longest = 0.0
    ends = [moved(meshes, state, sign * exposure_s / 2) for sign in (-1, 1)]
    for name in ("vertices_m", "plates_m"):
        points = [getattr(end, name).reshape(-1, 3) for end in ends]
        moving = (points[0] != points[1]).any(axis=1)
        (first, near), (last, far) = (camera.project(part[moving]) for part in points)
        # What lies right beside the lens moves without bound and fills the image with nothing but blur.
        seen = np.minimum(near, far) > camera.focal_length_m
        longest = max(longest, float(np.linalg.norm(last - first, axis=-1)[seen].max(initial=0.0)))
    return longest


def instants(travel: float, exposure_s: float) -> Floats:
    """Times in s from the middle of the exposure, a power of two of them: the middles of equal parts of the exposure.

    Args:
        travel: px, from `travel_px`.
    """
    wanted = math.sqrt(travel / (8 * SHARE_OF_CONTRAST))
    count = 2 ** math.ceil(math.log2(min(max(wanted, 1.0), MOST_INSTANTS)))
    return ((np.arange(count) + 0.5) / count - 0.5) * exposure_s


def over_shutter(samplers: Sequence[PixelSampler]) -> PixelSampler:
    """One sampler of several instants, a power of two of them: a pixel's samples are shared out evenly among them.

    With fewer samples than instants, a pixel's samples lie at as many instants, in even steps from a random first.
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
            # Back to the mean of the squares: the variance is corrected for a sample's size.
            square += variance * ((share - 1) / share) + part.astype(float) ** 2
        mean, square = mean / used, square / used
        variance = np.maximum(square - mean**2, 0.0) * (count / max(count - 1, 1))
        return mean.astype(np.float32), variance.astype(np.float32)

    return sampler
