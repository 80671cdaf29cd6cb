"""Gait of a person: joint angles over the cycle, and stride length as a function of speed.

A cycle is a stride, two steps: it begins as the right heel strikes, and the left side follows half a cycle later.
Angles are in the vertical plane of the walk. They are rounded readings of published curves of adults at their own
pace: the leg after Perry and Burnfield, "Gait Analysis" (2010), and Winter, "The Biomechanics and Motor Control of
Human Gait" (1991); the arm after Murray, Sepic and Barnard, "Patterns of sagittal rotation of the upper limbs in
walking" (1967).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

__all__ = ["NATURAL_STRIDE", "Joints", "joints", "phase_at", "stride_of_speed"]


# The stride of the curves, in body heights: for other strides all angles are scaled in proportion.
NATURAL_STRIDE = 0.8
# The ratio of step length and step rate is about the same at all speeds of a walk (Sekiya and Nagasaki 1998).
WALK_RATIO_M_PER_STEPS_PER_MIN = 0.0064
# The subjects' height; the walk scales with height (equal Froude numbers).
REFERENCE_HEIGHT_M = 1.7

# Degrees at each twentieth of the cycle. The thigh against the vertical, which includes the pelvis's tilt and rotation.
THIGH_DEG = (22, 21, 20, 16, 11, 5, -1, -7, -12, -16, -18, -17, -11, -1, 9, 17, 22, 25, 25, 23)
KNEE_DEG = (5, 10, 16, 18, 16, 12, 8, 6, 5, 7, 12, 22, 37, 52, 60, 58, 47, 31, 15, 5)
ANKLE_DEG = (0, -5, -4, 0, 3, 5, 7, 8, 10, 10, 6, -5, -17, -16, -9, -3, 0, 1, 1, 1)
# The arm swings from one end to the other and back: farthest back as the heel of its own side strikes.
SHOULDER_BACK_DEG, SHOULDER_FORTH_DEG = -24.0, 10.0
ELBOW_BACK_DEG, ELBOW_FORTH_DEG = 16.0, 34.0
# Largest bend of the toes while the heel is raised, so that they stay on the floor.
MOST_TOES_DEG = 40.0


@dataclass(frozen=True)
class Joints:
    """Degrees, the joints of one side: positive forwards, and for knee and elbow in their direction of bending.

    `thigh_deg` and `upper_arm_deg` are against the vertical, `ankle_deg` and `toes_deg` upwards.
    """

    thigh_deg: float
    knee_deg: float
    ankle_deg: float
    toes_deg: float
    upper_arm_deg: float
    elbow_deg: float


def joints(phase: float, stride: float) -> Joints:
    """The right side at a phase of its cycle, 0 to 1.

    Args:
        stride: in body heights; 0 when standing still, where the phase has no effect.
    """
    gain = stride / NATURAL_STRIDE
    thigh, knee, ankle = (gain * _periodic(values, phase) for values in (THIGH_DEG, KNEE_DEG, ANKLE_DEG))
    forth = (1 - math.cos(2 * math.pi * phase)) / 2
    return Joints(
        thigh_deg=thigh,
        knee_deg=knee,
        ankle_deg=ankle,
        toes_deg=min(max(-(thigh - knee + ankle), 0.0), MOST_TOES_DEG),
        upper_arm_deg=gain * (SHOULDER_BACK_DEG + forth * (SHOULDER_FORTH_DEG - SHOULDER_BACK_DEG)),
        elbow_deg=gain * (ELBOW_BACK_DEG + forth * (ELBOW_FORTH_DEG - ELBOW_BACK_DEG)),
    )


def _periodic(values: tuple[int, ...], phase: float) -> float:
    """The trigonometric interpolation of values at equal steps of a cycle."""
    spectrum = np.fft.rfft(values) / len(values)
    # All frequencies but the mean and the highest count twice, the negative one's being the conjugate.
    spectrum[1 : (len(values) + 1) // 2] *= 2
    turns = np.exp(2j * math.pi * phase * np.arange(len(spectrum)))
    return float((spectrum * turns).real.sum())


def stride_of_speed(speed_m_per_s: float, height_m: float) -> float:
    """Stride length in metres of a person of this height, at a speed in m/s; 0 at rest.

    Speed is step length times step rate, and their ratio is given: the length grows with the root of the speed.
    """
    scale = height_m / REFERENCE_HEIGHT_M
    speed_at_reference = speed_m_per_s / math.sqrt(scale)
    return 2 * scale * math.sqrt(60 * WALK_RATIO_M_PER_STEPS_PER_MIN * speed_at_reference)


def phase_at(distance_m: float, stride_m: float) -> float:
    """The phase, 0 to 1, at `distance_m` of a walk that has phase 0 at 0 (also for negative distances)."""
    return distance_m / stride_m % 1.0 if stride_m > 0 else 0.0
