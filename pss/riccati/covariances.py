"""Scalars of covariances: √λmax (Eq. 9) and √tr; and symmetric 3 × 3 matrices as six arrays."""

from __future__ import annotations

import numpy as np

from pss.hints import Floats
from pss.riccati.small_matrices import AT

__all__ = ["from_six", "largest_standard_deviation", "mean_inverse_sigma", "root_trace", "to_six"]


# Positions of the entries xx, xy, xz, yy, yz, zz in the full matrix; `AT[3]` is the inverse.
ROWS, COLUMNS = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)


def largest_standard_deviation(covariance: Floats) -> Floats:
    """√λmax of (..., n, n) covariances (Eq. 9), nan for those with nan; shape (...)."""
    known = np.asarray(np.isfinite(covariance).all(axis=(-2, -1)))
    eigenvalues = np.linalg.eigvalsh(np.where(known[..., None, None], covariance, 0.0))[..., -1]
    return np.where(known, np.sqrt(np.maximum(eigenvalues, 0.0)), np.nan)


def root_trace(covariance: Floats) -> Floats:
    """√tr of (..., n, n) covariances, nan for those with nan; shape (...)."""
    return np.asarray(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1)))


def mean_inverse_sigma(sigma_m: Floats) -> float:
    """1/m, Eq. 10: Σ 1/σ over the observable points, divided by the number of all points, (N,); nan counts as zero."""
    return float(np.nansum(1 / sigma_m) / len(sigma_m))


def from_six(six: Floats) -> Floats:
    """Full matrices (N, 3, 3) of the entries xx, xy, xz, yy, yz, zz, (6, N)."""
    return np.ascontiguousarray(np.moveaxis(six[np.array(AT[3])], -1, 0))


def to_six(matrices: Floats) -> Floats:
    """The entries xx, xy, xz, yy, yz, zz, (6, N), of symmetric matrices (N, 3, 3)."""
    return np.ascontiguousarray(matrices[:, ROWS, COLUMNS].T)
