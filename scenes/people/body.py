"""A person's body in parts: closed surfaces, and their poses at a moment of the walk.

The frame of a part has its origin at the joint nearest to the middle of the body; for a person standing upright, x is
to the right, y forwards and z up. Lengths are shares of the body's height after Drillis and Contini (1966), as in
Winter, "Biomechanics and Motor Control of Human Movement", figure 4.1; girths are those of a slim adult in a suit. The
left side is the right one's mirror image, half a cycle later.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pss.hints import Floats, Integers
from pss.surrogates import Mesh
from scenes.people.gait import joints

__all__ = ["PARTS", "Frame", "frames", "part"]


# ---- proportions, in body heights ------------------------------------------------------------------------------------

ANKLE, SHANK, THIGH = 0.039, 0.246, 0.245
HIP, SHOULDER, CHIN = ANKLE + SHANK + THIGH, 0.805, 0.865
UPPER_ARM, FOREARM = 0.186, 0.146
# Half the distance between the hip joints, and between the shoulder joints.
HIP_OUT, SHOULDER_OUT = 0.050, 0.117
# Foot length is 0.152: the part behind the ankle, and in front of it up to the ball and the tip of the toes.
HEEL, BALL, TOES = 0.042, 0.068, 0.110
# The ball's hinge above the sole.
BALL_UP = 0.008
# Arms hang clear of the body.
ABDUCTION_DEG = 11.0

# Sections along a part: position along it, half the width, half the depth, and the middle's offset along the depth.
Section = tuple[float, float, float, float]
HEAD: tuple[Section, ...] = (
    (0.000, 0.000, 0.000, 0.018),
    (0.006, 0.024, 0.026, 0.016),
    (0.030, 0.037, 0.046, 0.008),
    (0.060, 0.044, 0.056, 0.003),
    (0.090, 0.045, 0.058, 0.000),
    (0.115, 0.040, 0.051, -0.001),
    (0.1325, 0.032, 0.039, -0.001),
    (0.135, 0.000, 0.000, -0.001),
)
NECK: tuple[Section, ...] = (
    (0.810, 0.000, 0.000, 0.0),
    (0.810, 0.038, 0.036, 0.0),
    (0.845, 0.031, 0.032, 0.002),
    (0.890, 0.031, 0.032, 0.006),
    (0.890, 0.000, 0.000, 0.006),
)
TORSO: tuple[Section, ...] = (
    (-0.055, 0.000, 0.000, 0.0),
    (-0.048, 0.040, 0.040, -0.002),
    (-0.015, 0.088, 0.062, -0.004),
    (0.030, 0.095, 0.064, -0.003),
    (0.100, 0.083, 0.058, 0.0),
    (0.170, 0.089, 0.062, 0.003),
    (0.230, 0.099, 0.066, 0.003),
    (0.270, 0.100, 0.063, 0.002),
    (0.295, 0.085, 0.051, 0.000),
    (0.312, 0.045, 0.034, -0.001),
    (0.316, 0.000, 0.000, -0.001),
)
HAND: tuple[Section, ...] = (
    (0.006, 0.000, 0.000, 0.0),
    (-0.004, 0.012, 0.016, 0.0),
    (-0.040, 0.014, 0.026, 0.002),
    (-0.075, 0.010, 0.022, 0.006),
    (-0.098, 0.004, 0.009, 0.008),
    (-0.100, 0.000, 0.000, 0.008),
)
# These two are horizontal: along the part is forwards, and depth is up.
FOOT: tuple[Section, ...] = (
    (-HEEL, 0.000, 0.000, 0.014 - ANKLE),
    (-HEEL, 0.013, 0.014, 0.014 - ANKLE),
    (-0.032, 0.020, 0.022, 0.022 - ANKLE),
    (0.008, 0.022, 0.026, 0.026 - ANKLE),
    (0.040, 0.026, 0.017, 0.017 - ANKLE),
    (BALL + 0.004, 0.028, 0.0105, 0.0105 - ANKLE),
    (BALL + 0.004, 0.000, 0.000, 0.0105 - ANKLE),
)
TOE: tuple[Section, ...] = (
    (-0.004, 0.000, 0.000, 0.010 - BALL_UP),
    (-0.004, 0.028, 0.010, 0.010 - BALL_UP),
    (0.022, 0.026, 0.008, 0.008 - BALL_UP),
    (TOES - BALL - 0.004, 0.016, 0.006, 0.006 - BALL_UP),
    (TOES - BALL, 0.000, 0.000, 0.006 - BALL_UP),
)


def _limb(length: float, *radii: tuple[float, float]) -> tuple[Section, ...]:
    """A limb hanging from its joint, with round ends: `radii` at shares of its length, from 0 to 1."""
    first, last = radii[0][1], radii[-1][1]
    lean = math.sqrt(0.5)
    return (
        (first, 0.0, 0.0, 0.0),
        (lean * first, lean * first, lean * first, 0.0),
        *((-share * length, radius, radius, 0.0) for share, radius in radii),
        (-length - lean * last, lean * last, lean * last, 0.0),
        (-length - last, 0.0, 0.0, 0.0),
    )


@dataclass(frozen=True)
class _Shape:
    """Sections, corners of each, their exponent (2: ellipses), and whether the part is horizontal."""

    sections: tuple[Section, ...]
    corners: int = 12
    exponent: float = 2.0
    lies: bool = False


# The suit flattens the limbs slightly, by its pads.
SHAPES = {
    "head": _Shape(HEAD, corners=16, exponent=2.2),
    "neck": _Shape(NECK),
    "torso": _Shape(TORSO, corners=20, exponent=2.6),
    "upper arm": _Shape(_limb(UPPER_ARM, (0.0, 0.032), (0.45, 0.030), (1.0, 0.026)), exponent=2.8),
    "forearm": _Shape(_limb(FOREARM, (0.0, 0.026), (0.3, 0.026), (1.0, 0.017)), exponent=2.2),
    "hand": _Shape(HAND, corners=8),
    "thigh": _Shape(_limb(THIGH, (0.0, 0.050), (0.4, 0.046), (1.0, 0.034)), exponent=2.8),
    "shin": _Shape(_limb(SHANK, (0.0, 0.033), (0.3, 0.034), (0.6, 0.030), (1.0, 0.021)), exponent=2.8),
    "foot": _Shape(FOOT, exponent=4.0, lies=True),
    "toes": _Shape(TOE, exponent=4.0, lies=True),
}
MIDDLE = ("head", "neck", "torso")
PAIRED = tuple(name for name in SHAPES if name not in MIDDLE)
PARTS = (*MIDDLE, *(f"{side} {name}" for side in ("right", "left") for name in PAIRED))
"""The names of all parts."""


@lru_cache(maxsize=64)
def part(name: str, height_m: float) -> Mesh:
    """The surface of one of `PARTS` in its own frame, in metres; the left side's equals the right one's."""
    shape = SHAPES[name.removeprefix("right ").removeprefix("left ")]
    vertices, faces = _loft(shape)
    return Mesh(name, height_m * vertices, faces)


def _loft(shape: _Shape) -> tuple[Floats, Integers]:
    """A closed surface through sections, the first and last of which are points: (V, 3) and (F, 3)."""
    n = shape.corners
    # Faces, not edges, face along the axes, where markers are placed.
    angles = 2 * math.pi * (np.arange(n) + 0.5) / n
    outline = np.column_stack([np.cos(angles), np.sin(angles)])
    outline = np.sign(outline) * np.abs(outline) ** (2 / shape.exponent)
    rings = [_ring(section, outline) for section in shape.sections[1:-1]]
    ends = [np.array([0.0, section[3], section[0]]) for section in (shape.sections[0], shape.sections[-1])]
    vertices = np.concatenate([*rings, ends])
    following = np.roll(np.arange(n), -1)
    faces = []
    for number in range(len(rings) - 1):
        a, b = number * n + np.arange(n), number * n + following
        faces += [np.column_stack([a, b, b + n]), np.column_stack([a, b + n, a + n])]
    first, last = len(rings) * n, len(rings) * n + 1
    top = (len(rings) - 1) * n
    faces += [
        np.column_stack([following, np.arange(n), np.full(n, first)]),
        np.column_stack([top + np.arange(n), top + following, np.full(n, last)]),
    ]
    wound = np.concatenate(faces)
    # Sections may be listed from either end, and a horizontal part has two axes swapped.
    if shape.lies:
        vertices = vertices[:, [0, 2, 1]]
    a, b, c = np.moveaxis(vertices[wound], 1, 0)
    return vertices, wound if (a * np.cross(b, c)).sum() > 0 else wound[:, ::-1]


def _ring(section: Section, outline: Floats) -> Floats:
    along, half_width, half_depth, middle = section
    across = outline * [half_width, half_depth] + [0.0, middle]
    return np.column_stack([across, np.full(len(outline), along)])


# ---- the pose --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Frame:
    """Pose of a part: `axes` (3, 3) rotate its directions to the world's, mirrored on the left; `origin_m` (3,)."""

    axes: Floats
    origin_m: Floats

    def place(self, points_m: Floats) -> Floats:
        """Metres, points of the part in the world, (..., 3)."""
        return np.asarray(points_m @ self.axes.T + self.origin_m)

    def turn(self, vector: Sequence[float] | Floats) -> Floats:
        """A direction of the part in the world, (3,)."""
        return np.asarray(self.axes @ np.asarray(vector))

    def within(self, outer: Frame) -> Frame:
        """This frame, given in the axes of `outer`, in the world."""
        return Frame(outer.axes @ self.axes, outer.place(self.origin_m))


MIRROR = Frame(np.diag([-1.0, 1.0, 1.0]), np.zeros(3))


def frames(
    height_m: float, stride_m: float, phase: float, position_m: tuple[float, float], heading_deg: float
) -> dict[str, Frame]:
    """Frames of all `PARTS` of a person at [x, y] with a heading as a camera pans, the lowest point on the floor."""
    stride = stride_m / height_m
    hung = {
        f"{side} {name}": frame.within(mirror)
        for side, later, mirror in (("right", 0.0, Frame(np.eye(3), np.zeros(3))), ("left", 0.5, MIRROR))
        for name, frame in _side(height_m, stride, phase + later).items()
    }
    # The height of the hips follows from the lowest point of the feet.
    lowest = min(hung[name].place(part(name, height_m).vertices_m)[:, 2].min() for name in hung if _on_floor(name))
    sine, cosine = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
    world = Frame(
        np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]), np.array([*position_m, -lowest])
    )
    upright = {"head": CHIN - HIP, "neck": -HIP, "torso": 0.0}
    hung |= {name: Frame(np.eye(3), np.array([0.0, 0.0, up * height_m])) for name, up in upright.items()}
    return {name: hung[name].within(world) for name in PARTS}


def _on_floor(name: str) -> bool:
    return name.endswith((" foot", " toes"))


def _side(height_m: float, stride: float, phase: float) -> dict[str, Frame]:
    """The frames of the right side's parts, from the middle between the hips."""
    at = joints(phase, stride)

    def hinged(on: Frame, at_shares: tuple[float, float, float], turn: Floats) -> Frame:
        return Frame(turn, height_m * np.array(at_shares)).within(on)

    body = Frame(np.eye(3), np.zeros(3))
    thigh = hinged(body, (HIP_OUT, 0.0, 0.0), _forwards(at.thigh_deg))
    shin = hinged(thigh, (0.0, 0.0, -THIGH), _forwards(-at.knee_deg))
    foot = hinged(shin, (0.0, 0.0, -SHANK), _forwards(at.ankle_deg))
    toes = hinged(foot, (0.0, BALL, BALL_UP - ANKLE), _forwards(at.toes_deg))
    swing = _forwards(at.upper_arm_deg) @ _outwards(ABDUCTION_DEG)
    upper_arm = hinged(body, (SHOULDER_OUT, 0.0, SHOULDER - HIP), swing)
    forearm = hinged(upper_arm, (0.0, 0.0, -UPPER_ARM), _outwards(-ABDUCTION_DEG / 2) @ _forwards(at.elbow_deg))
    hand = hinged(forearm, (0.0, 0.0, -FOREARM), np.eye(3))
    of_side = (upper_arm, forearm, hand, thigh, shin, foot, toes)
    return dict(zip(("upper arm", "forearm", "hand", "thigh", "shin", "foot", "toes"), of_side, strict=True))


def _forwards(angle_deg: float) -> Floats:
    """Rotation that swings a hanging part forwards, (3, 3)."""
    sine, cosine = math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])


def _outwards(angle_deg: float) -> Floats:
    """Rotation that swings a hanging part to the right, (3, 3)."""
    sine, cosine = math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))
    return np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
