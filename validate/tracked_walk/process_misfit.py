"""How far the true motion of markers is from the process model that a filter assumes.

The limbs of a walking body swing and its trunk hardly does; one density of white acceleration is assumed for all.
The density that matches each marker's own motion shows for which of them that model is too narrow or too wide.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from pss import ConstantVelocity, ShapeError
from pss.cameras.camera import as_points
from pss.hints import Floats, Row
from validate.tracked_walk.consistency import group_masks

__all__ = ["misfit_rows", "motion_misfit"]


# White acceleration of density q, integrated twice over two frames with the weights of a triangle, gives the second
# difference of three positions the variance q ∫ w(t)² dt = 2/3 q Δt³ along each axis.
TRIANGLE_SQUARED = 2 / 3
FRAMES_OF_A_DIFFERENCE = 3


def motion_misfit(truth_m: ArrayLike, process: ConstantVelocity) -> Floats:
    """m²/s³, the acceleration density that matches each marker's true motion, (N,).

    A position that is predicted from the true two before it, at constant velocity, is off by the second difference
    x(k+1) − 2 x(k) + x(k−1). This is the density at which the model gives these errors the mean square, over frames and
    axes, that they have. Above `process.acceleration_density_m2_s3` the filter trusts its predictions too much, below
    it too little. Steady turns and swings are no white noise: their errors come in runs, and a filter with this density
    is right on average over the walk, not in each phase of a stride.

    Args:
        truth_m: m, the true places in K frames, (K, N, 3).
        process: the filter's model; its time step is that of the frames.

    Raises:
        ShapeError: not (K, N, 3) with three frames or more.
    """
    return np.asarray((_prediction_errors(truth_m) ** 2).mean(axis=(0, 2)) / _variance_per_density(process))


def misfit_rows(truth_m: ArrayLike, process: ConstantVelocity, groups: Mapping[str, ArrayLike]) -> list[Row]:
    """`motion_misfit` of each group of markers, given as masks (N,) by name; nan for an empty one.

    Returns:
        Rows with `group`, `markers`, `assumed_density_m2_s3`, `density_m2_s3` (of all the group's errors together),
        `largest_density_m2_s3` (of a marker), `density_over_assumed` (1 where the model fits),
        `prediction_rms_m` (√ of the mean square length of the errors) and `largest_sigmas` (the largest error
        along an axis in the model's own standard deviations).

    Raises:
        ShapeError: as `motion_misfit`; a mask that does not fit.
    """
    errors, assumed = _prediction_errors(truth_m), process.acceleration_density_m2_s3
    densities, rows = motion_misfit(truth_m, process), []
    for name, mask in group_masks(groups, len(densities)).items():
        own, some = errors[:, mask], bool(mask.any())
        density = float(densities[mask].mean()) if some else float("nan")
        rows.append(
            {
                "group": name,
                "markers": int(mask.sum()),
                "assumed_density_m2_s3": assumed,
                "density_m2_s3": density,
                "largest_density_m2_s3": float(densities[mask].max()) if some else float("nan"),
                "density_over_assumed": density / assumed,
                "prediction_rms_m": float(np.sqrt((own**2).sum(axis=-1).mean())) if some else float("nan"),
                "largest_sigmas": float(np.abs(own).max() / np.sqrt(assumed * _variance_per_density(process)))
                if some
                else float("nan"),
            }
        )
    return rows


def _variance_per_density(process: ConstantVelocity) -> float:
    """s³, variance of a second difference along an axis for a density of 1 m²/s³."""
    return TRIANGLE_SQUARED * process.time_step_s**3


def _prediction_errors(truth_m: ArrayLike) -> Floats:
    """m, second differences of the places (K, N, 3), (K − 2, N, 3)."""
    truth = as_points(truth_m, "truth_m")
    if truth.ndim != 3 or len(truth) < FRAMES_OF_A_DIFFERENCE:
        raise ShapeError(f"truth_m has shape {truth.shape}; allowed is (K, N, 3) with at least 3 frames")
    return np.diff(truth, n=2, axis=0)
