"""A walking person: one mesh of closed parts, posed by height, stride, phase of the walk, position and heading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pss.surrogates import Mesh
from render.world.state import Motion
from scenes.people.body import PARTS, Frame, frames, part

__all__ = ["Stance", "avatar_frames", "avatar_mesh", "cylinder_radius_m", "walking"]


# Largest distance of a suit's plates beyond hands and feet.
SUIT_M = 0.02


@dataclass(frozen=True)
class Stance:
    """The parameters of an avatar's mesh and markers.

    Attributes:
        name: of the avatar.
        height_m: m, standing upright.
        stride_m: m, two steps; 0 when standing still.
        phase: of the walk, 0 to 1 from one strike of the right heel to the next.
        position_m: m, [x, y], of the middle between the hips.
        heading_deg: walking direction, as a camera pans: 0 is +y, 90 is +x.
    """

    name: str
    height_m: float
    stride_m: float
    phase: float
    position_m: tuple[float, float]
    heading_deg: float


@lru_cache(maxsize=64)
def avatar_frames(stance: Stance) -> dict[str, Frame]:
    """The frame of each part of the body in the world, by name."""
    return frames(stance.height_m, stance.stride_m, stance.phase, stance.position_m, stance.heading_deg)


@lru_cache(maxsize=64)
def avatar_mesh(stance: Stance) -> Mesh:
    """The surface of the whole body: every part a closed piece, with the lowest point on the floor."""
    at, vertices, faces, count = avatar_frames(stance), [], [], 0
    for name in PARTS:
        own, frame = part(name, stance.height_m), at[name]
        vertices.append(frame.place(own.vertices_m))
        # A mirror image has the opposite winding.
        faces.append(count + (own.faces if np.linalg.det(frame.axes) > 0 else own.faces[:, ::-1]))
        count += len(own.vertices_m)
    return Mesh(stance.name, np.concatenate(vertices), np.concatenate(faces))


def cylinder_radius_m(stance: Stance) -> float:
    """Metres, radius of the upright cylinder about the avatar's position that contains it, with its suit."""
    return SUIT_M + float(np.linalg.norm(avatar_mesh(stance).vertices_m[:, :2] - stance.position_m, axis=1).max())


def walking(stance: Stance, speed_m_per_s: float) -> Motion | None:
    """The motion of the body as a whole at this speed; None at rest. The swing of the limbs is neglected."""
    if speed_m_per_s == 0:
        return None
    heading = math.radians(stance.heading_deg)
    return Motion((speed_m_per_s * math.sin(heading), speed_m_per_s * math.cos(heading), 0.0))
