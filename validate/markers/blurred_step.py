"""A step from 0 to 1 along one axis of a marker, blurred by a pixel's square and the disc of a lens, in closed form.

Projected onto the axis, the disc is a half ellipse and the square is the convolution of two boxes. The half ellipse's
integrals are known; convolving with a box is a difference of the next integral. So a step is a second difference of
the disc's third integral, its slope one of the second, and so on.
"""

from __future__ import annotations

import math

import numpy as np

from pss.hints import AnyFloats

__all__ = ["DIAMETERS_PER_SIGMA", "blurred_steps", "reach"]


# A disc of diameter cc has the variance cc²/16 along any axis.
DIAMETERS_PER_SIGMA = 4.0
# Narrower than this share of the wider one, the second box is taken to be as wide as that: its differences would be
# lost in rounding, and what it adds to the blur's variance is 1e-9 px² at most.
NARROWEST_BOX = 1e-4
# Modules, taken for the radius of a smaller disc.
SMALLEST_RADIUS = 1e-12


def reach(per_px: AnyFloats, blur_px2: float) -> float:
    """Modules from its middle to where the kernel ends along an axis.

    Args:
        per_px: modules along the axis for a px along the image's x and y, (2,).
        blur_px2: px², variance of the lens's disc along any axis.
    """
    return float(np.abs(per_px).sum()) / 2 + DIAMETERS_PER_SIGMA / 2 * math.sqrt(blur_px2) * math.hypot(*per_px)


def blurred_steps(places: AnyFloats, to_modules: AnyFloats, blurs_px2: AnyFloats) -> AnyFloats:
    """Steps at 0, their slope per module and second derivative per module², at `places` along two axes.

    (blurs, 3, 2, ...).

    Args:
        places: modules, (2, ...).
        to_modules: modules along u and v for a px along the image's x and y, (2, 2).
        blurs_px2: px², variances of the lens's disc along any axis, (blurs,).
    """
    boxes = np.abs(to_modules)
    wide = boxes.max(axis=1)
    narrow = np.maximum(boxes.min(axis=1), NARROWEST_BOX * wide)
    ends = np.array([(wide + narrow) / 2, (wide - narrow) / 2])
    shifts = np.concatenate([ends, -ends[::-1]])
    diameters = DIAMETERS_PER_SIGMA * np.sqrt(blurs_px2)[:, None] * np.hypot(*to_modules.T)
    axes = (1,) * (places.ndim - 1)
    radii = np.maximum(diameters / 2, SMALLEST_RADIUS).reshape(-1, 1, 2, *axes)
    integrals = _disc_integrals(places + shifts.reshape(4, 2, *axes), radii)
    differences = integrals[:, :, 0] - integrals[:, :, 1] - integrals[:, :, 2] + integrals[:, :, 3]
    return np.asarray(np.moveaxis(differences, 1, 0) / (wide * narrow).reshape(2, *axes))


def _disc_integrals(x: AnyFloats, radius: AnyFloats) -> AnyFloats:
    """The third, second and first integral of a disc of area 1, projected onto an axis, from −∞ to `x`; (3, ...)."""
    t = x / radius
    inside = np.clip(t, -1, 1)
    square = inside * inside
    chord = np.sqrt(1 - square)
    # From −1 on, in radii: ∫ 2/π √(1 − t²) dt, and that integrated once and twice more.
    angle = np.arcsin(inside)
    angle /= math.pi
    chord /= math.pi
    straight = inside * chord
    first = straight + angle
    first += 0.5
    second = inside * (angle + 0.5) + chord * (2 + square) / 3
    third = (square + 0.25) / 4 + straight * (13 + 2 * square) / 24 + angle * (0.125 + square / 2)
    # To the right of the disc the integrals go on as a straight line and a parabola.
    beyond = np.maximum(t - 1, 0)
    third += beyond * (second + beyond / 2)
    second += beyond
    return np.asarray([radius**2 * third, radius * second, first])
