"""Radial distortion of a lens: OpenCV's k₁ and k₂, which multiply a point's slope by 1 + k₁r² + k₂r⁴.

r is the slope x/z, y/z of a point in the camera's frame, so that the focal length is that of the undistorted pinhole.
"""

from __future__ import annotations

import math

import numpy as np

from pss.errors import RangeError
from pss.hints import Floats

__all__ = ["fold_radius", "furthest_radius", "stretch", "undistorted"]


# At the fold the radius is a double root, where Newton's method only halves the error: about 26 steps to rounding.
MOST_STEPS = 60
# Slopes; 1e-9 px at a focal length of 1,000 px.
CONVERGED = 1e-12
# Without a fold, distortion reduces a slope to 4/9 of it at the least: k₁² < 20/9 k₂, or both above 0.
MOST_DRAWN_IN = 9 / 4


def stretch(squared_radius: Floats, k1: Floats | float, k2: Floats | float) -> tuple[Floats, Floats]:
    """Factor 1 + k₁r² + k₂r⁴ and its derivative by r², both of the shape of `squared_radius`."""
    return 1 + squared_radius * (k1 + k2 * squared_radius), k1 + 2 * k2 * squared_radius


def fold_radius(k1: float, k2: float) -> float:
    """Slope at which the distorted radius stops growing with the undistorted one; ∞ without such a slope.

    Beyond it the polynomial folds the image back onto itself: such points are not visible.
    """
    # d/dr (r + k₁r³ + k₂r⁵) = 1 + 3k₁s + 5k₂s² with s = r²: its smallest positive root.
    roots = np.roots([5 * k2, 3 * k1, 1.0]) if k2 != 0 else np.roots([3 * k1, 1.0])
    positive = [root.real for root in roots if abs(root.imag) < 1e-12 * (1 + abs(root)) and root.real > 0]
    return math.sqrt(min(positive)) if positive else math.inf


def furthest_radius(k1: float, k2: float) -> float:
    """Distorted radius of the fold, beyond which the lens images nothing; ∞ without a fold."""
    fold = fold_radius(k1, k2)
    return fold * float(stretch(np.array(fold**2), k1, k2)[0]) if math.isfinite(fold) else math.inf


def undistorted(slopes: Floats, k1: float, k2: float) -> Floats:
    """Undistorted slopes (..., 2) of the points at the distorted `slopes` (..., 2), by Newton's method with bisection.

    Raises:
        RangeError: a slope beyond the fold, where no point is imaged.
    """
    if k1 == 0 and k2 == 0:
        return slopes
    radius = np.linalg.norm(slopes, axis=-1)
    fold, furthest = fold_radius(k1, k2), furthest_radius(k1, k2)
    if (radius > furthest).any():
        raise RangeError(f"a pixel lies {radius.max():.4g} focal lengths off the axis; allowed: up to {furthest:.4g}")
    true = np.minimum(radius, fold)
    low, high = np.zeros_like(radius), np.minimum(MOST_DRAWN_IN * radius, fold)
    for _ in range(MOST_STEPS):
        factor, derivative = stretch(true**2, k1, k2)
        excess, slope = true * factor - radius, factor + 2 * true**2 * derivative
        low, high = np.where(excess < 0, true, low), np.where(excess > 0, true, high)
        step = true - excess / np.where(slope > 0, slope, 1.0)
        # Where Newton's step would leave the interval, bisect it instead.
        step = np.where((slope > 0) & (step >= low) & (step <= high), step, (low + high) / 2)
        step = np.where(excess == 0, true, step)
        change, true = np.abs(step - true), step
        if not (change > CONVERGED).any():
            break
    return np.asarray(slopes * (true / np.where(radius > 0, radius, 1.0))[..., None])
