"""Covariances of pixels, 2 × 2, as three arrays: contributions of factors, their sums, and weights of cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import RangeError, ShapeError
from pss.hints import Bools, Floats

__all__ = ["PixelCovariance"]


@dataclass(frozen=True, eq=False)
class PixelCovariance:
    """px², the entries of covariances of image coordinates (u right, v down), arrays that broadcast to (C, N).

    An infinite uu and vv means that a view has no information on a point.
    """

    uu: Floats
    vv: Floats
    uv: Floats

    @classmethod
    def isotropic(cls, variance_px2: ArrayLike) -> PixelCovariance:
        """The same variance, px², in every direction."""
        variance = np.asarray(variance_px2, dtype=float)
        return cls(variance, variance, np.zeros(()))

    @classmethod
    def diagonal(cls, uu_px2: ArrayLike, vv_px2: ArrayLike) -> PixelCovariance:
        """Separate variances, px², across and down."""
        return cls(np.asarray(uu_px2, dtype=float), np.asarray(vv_px2, dtype=float), np.zeros(()))

    @classmethod
    def from_matrix(cls, covariance_px2: ArrayLike) -> PixelCovariance:
        """From px² matrices (..., 2, 2), symmetric."""
        matrix = np.asarray(covariance_px2, dtype=float)
        if matrix.shape[-2:] != (2, 2):
            raise ShapeError(f"covariance_px2 has shape {matrix.shape}; allowed: (..., 2, 2)")
        return cls(matrix[..., 0, 0], matrix[..., 1, 1], (matrix[..., 0, 1] + matrix[..., 1, 0]) / 2)

    def matrix(self, *shape: int) -> Floats:
        """px², (..., 2, 2); with `shape` given, broadcast to it."""
        uu, vv, uv = np.broadcast_arrays(self.uu, self.vv, self.uv)
        matrix = np.stack([np.stack([uu, uv], axis=-1), np.stack([uv, vv], axis=-1)], axis=-2)
        return np.broadcast_to(matrix, (*shape, 2, 2)).copy() if shape else matrix

    def __add__(self, other: PixelCovariance) -> PixelCovariance:
        return PixelCovariance(self.uu + other.uu, self.vv + other.vv, self.uv + other.uv)

    def __mul__(self, weight: float) -> PixelCovariance:
        return PixelCovariance(self.uu * weight, self.vv * weight, self.uv * weight)

    def inverse(self, where: Bools) -> tuple[Floats, Floats, Floats]:
        """1/px², entries uu, uv, vv of R⁻¹; undefined outside `where` (C, N).

        Raises:
            RangeError: a covariance in `where` is not positive definite.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            determinant = self.uu * self.vv - self.uv * self.uv
            nothing = np.isposinf(self.uu) & np.isposinf(self.vv)
            bad = where & ~((self.uu > 0) & (determinant > 0)) & ~nothing
            if bad.any():
                self._refuse(bad)
            uu, uv, vv = self.vv / determinant, -self.uv / determinant, self.uu / determinant
        if nothing.any():
            uu, uv, vv = (np.where(nothing, 0.0, entry) for entry in (uu, uv, vv))
        return uu, uv, vv

    def _refuse(self, bad: Bools) -> None:
        camera, point = np.argwhere(bad)[0]
        matrix = self.matrix(*bad.shape)[camera, point]
        what = f"the eigenvalue {np.linalg.eigvalsh(matrix)[0]:.3g}" if np.isfinite(matrix).all() else "nan"
        raise RangeError(f"R has {what}; allowed: positive definite matrices (camera {camera}, point {point})")
