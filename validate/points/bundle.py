"""Maximum-likelihood fit of points to their detections in several views, by Levenberg–Marquardt."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import cv2
import numpy as np

from pss.cameras.camera import PTZCamera
from pss.cameras.parameters import Cameras
from pss.cameras.views import Views
from pss.hints import Bools, Floats, Integers

__all__ = ["NEAREST_M", "Bundle"]


# A point in front of a camera has a depth in this range; between them no power in this module overflows.
NEAREST_M, FARTHEST_M = 1e-3, 1e6
# What a view adds to χ² if the point is outside that range: worse than any residual on a sensor, but finite, so that a
# point behind one view is better than a point behind two.
OUT_OF_SIGHT_CHI2 = 1e18
# A step with a smaller expected decrease, relative to 1 + χ², is the last one: 1e-6 standard deviations where χ² is of
# order one.
SMALLEST_GAIN = 1e-12
MAX_ITERATIONS = 40
# Levenberg–Marquardt damping, relative to the mean eigenvalue; so small a start makes the first step Gauss–Newton's.
FIRST_DAMPING, DAMPING_UP, DAMPING_DOWN = 1e-9, 100.0, 0.1
# Keeps the normal matrix regular for a point that no view sees.
TINY = 1e-300


class Bundle:
    """M points (of all trials) as C views saw them.

    The methods take S problems: `item` (S,) is the index among the M points, `used` (C, S) which views of it, so that
    one point can be solved with several choices of views at once.
    """

    def __init__(self, cameras: Sequence[PTZCamera], pixels: Floats, weight: Floats) -> None:
        self.cameras, self.pixels, self.weight = cameras, pixels, weight
        self.projection = [camera.projection_matrix for camera in cameras]
        # Computed once: the search projects ten times.
        self.arrays = [Cameras([camera]) for camera in cameras]
        # The linear start and the angles between rays are those of lenses without distortion.
        self.straight = np.stack([camera.undistorted_px(of) for camera, of in zip(cameras, pixels, strict=True)])
        homogeneous = np.concatenate([self.straight, np.ones_like(pixels[..., :1])], axis=-1)
        rays = homogeneous @ np.stack([np.linalg.inv(matrix[:, :3]).T for matrix in self.projection])
        self.rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)  # (C, M, 3), unit, world
        self.pairs = np.array(list(combinations(range(len(cameras)), 2)), dtype=int).reshape(-1, 2)
        # As lines: beyond a right angle a wider angle makes the crossing worse again.
        self.abs_cosine = np.abs((self.rays[self.pairs[:, 0]] * self.rays[self.pairs[:, 1]]).sum(axis=-1))  # (pairs, M)

    def linear(self, item: Integers, used: Bools) -> Floats:
        """m, `cv2.triangulatePoints` over the pair of views with the widest angle between their rays, (S, 3)."""
        points = np.full((len(item), 3), np.nan)
        if not item.size:
            return points
        both = used[self.pairs[:, 0]] & used[self.pairs[:, 1]]
        widest = np.where(both, self.abs_cosine[:, item], np.inf).argmin(axis=0)
        for pair in np.unique(widest):
            rows = np.flatnonzero(widest == pair)
            a, b = self.pairs[pair]
            pixels = (np.ascontiguousarray(self.straight[view, item[rows]].T) for view in (a, b))
            x, y, z, w = cv2.triangulatePoints(self.projection[a], self.projection[b], *pixels)
            with np.errstate(divide="ignore", invalid="ignore"):  # parallel rays meet at infinity
                points[rows] = (np.stack([x, y, z]) / w).T
        return points

    def fit(self, item: Integers, used: Bools) -> tuple[Floats, Floats, Floats]:
        """By Levenberg–Marquardt: m, the points of least χ², (S, 3); that χ², (S,); 1/m², Σ HᵀR⁻¹H there, (S, 3, 3)."""
        points = self._start(item, used)
        chi2, information, gradient = self.normal_equations(points, item, used)
        damping = np.full(len(item), FIRST_DAMPING)
        active = np.arange(len(item))
        for _ in range(MAX_ITERATIONS):
            if not active.size:
                break
            normal = information[active]
            scale = damping[active] * np.trace(normal, axis1=-2, axis2=-1) / 3 + TINY
            step = np.linalg.solve(normal + scale[:, None, None] * np.eye(3), gradient[active][..., None])[..., 0]
            candidate = points[active] + step
            new_chi2, new_information, new_gradient = self.normal_equations(candidate, item[active], used[:, active])
            better = new_chi2 < chi2[active]
            # By what the step was to lower χ²; a damping raised beyond measure ends the search as well.
            going = (step * gradient[active]).sum(axis=-1) > SMALLEST_GAIN * (1 + chi2[active])
            taken = active[better]
            points[taken], chi2[taken] = candidate[better], new_chi2[better]
            information[taken], gradient[taken] = new_information[better], new_gradient[better]
            damping[active] *= np.where(better, DAMPING_DOWN, DAMPING_UP)
            active = active[going]
        return points, chi2, information

    def leave_one_out(self, item: Integers, used: Bools) -> tuple[Integers, Floats, Floats]:
        """The view whose removal leaves the smallest χ², (S,), with the points (S, 3) and χ² (S,) of the others."""
        view, row = np.nonzero(used)
        others = used[:, row]
        others[view, np.arange(len(view))] = False
        points, chi2, _ = self.fit(item[row], others)
        table = np.full(used.shape, np.inf)
        table[view, row] = chi2
        where = np.zeros(used.shape, dtype=int)
        where[view, row] = np.arange(len(view))
        worst = table.argmin(axis=0)
        columns = np.arange(len(item))
        return worst, points[where[worst, columns]], table[worst, columns]

    def normal_equations(self, points: Floats, item: Integers, used: Bools) -> tuple[Floats, Floats, Floats]:
        """χ² (S,), 1/m² Σ HᵀR⁻¹H (S, 3, 3), and 1/m Σ HᵀR⁻¹(pixel − projection) (S, 3), at `points` (S, 3)."""
        chi2, information, gradient = np.zeros(len(item)), np.zeros((len(item), 3, 3)), np.zeros((len(item), 3))
        for camera, pixels, weight, sees in zip(self.arrays, self.pixels, self.weight, used, strict=True):
            rows = np.flatnonzero(sees)
            views = Views(camera, points[rows])
            in_front = _in_front(views)
            if not in_front.all():
                chi2[rows[~in_front]] += OUT_OF_SIGHT_CHI2
                rows = rows[in_front]
                views = Views(camera, points[rows])
            jacobian, inverse = views.jacobian[0], weight[item[rows]]  # (S', 2, 3) and (S', 2, 2)
            residual = (pixels[item[rows]] - views.pixels[0])[..., None]
            weighted = inverse @ residual
            chi2[rows] += (residual * weighted).sum(axis=(-2, -1))
            information[rows] += jacobian.mT @ (inverse @ jacobian)
            gradient[rows] += (jacobian.mT @ weighted)[..., 0]
        return chi2, information, gradient

    def _start(self, item: Integers, used: Bools) -> Floats:
        """m, where the search begins, (S, 3): the linear solution, or on the first ray if that is behind its camera."""
        first = used.argmax(axis=0)
        reach = np.array([camera.focus_distance_m for camera in self.cameras])[first]
        centre = np.array([camera.position_m for camera in self.cameras]).reshape(-1, 3)[first]
        fallback = centre + reach[:, None] * self.rays[first, item]
        points = self.linear(item, used)
        sound = np.isfinite(points).all(axis=-1)
        points[~sound] = fallback[~sound]
        for camera, sees in zip(self.arrays, used, strict=True):
            sound &= ~sees | _in_front(Views(camera, points))
        return np.where(sound[:, None], points, fallback)


def _in_front(views: Views) -> Bools:
    """Of one camera's points, which may be what it saw, (S,)."""
    depth = views.depth_m[0]
    return np.asarray((depth > NEAREST_M) & (depth < FARTHEST_M))
