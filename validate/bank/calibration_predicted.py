"""The covariance of a triangulated point under an R, without errors of calibration and with them, in closed form.

Both ways of counting the errors in take points one by one, as PSS does, with J Σ Jᵀ of each view independent of the
others'; which of them is like which measurement depends on the weights that triangulation uses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pss import NoiseModel
from pss.cameras.views import Views
from pss.hints import Bools, Floats
from pss.noise import PixelCovariance
from pss.processes.steady_state import SMALLEST_INFORMATION_RATIO
from pss.riccati.covariances import largest_standard_deviation, root_trace
from validate.bank.calibration_errors import CalibrationNoise, CalibrationSizes

__all__ = ["PredictedErrors", "Predictions", "inverse_sigma", "second_moments"]


@dataclass(frozen=True, eq=False)
class PredictedErrors:
    """Of K configurations: 1/m, terms of the single-frame PSS (K, N), 0 where not observable; m, √tr (K, N), or nan."""

    inverse_sigma: Floats
    rms_m: Floats

    @classmethod
    def of(cls, covariance_m2: Floats) -> PredictedErrors:
        """From (K, N, 3, 3), nan where not observable."""
        return cls(inverse_sigma(covariance_m2), root_trace(covariance_m2))


@dataclass(frozen=True, eq=False)
class Predictions:
    """A noise model in V views of N points, and K configurations of c views.

    Attributes:
        visible: what counts as visible, (V, N).
        configurations: indices of views, (K, c).
    """

    views: Views
    visible: Bools
    model: NoiseModel
    configurations: NDArray[np.int64]

    def plain(self) -> PredictedErrors:
        """C = (Σ HᵀR⁻¹H)⁻¹: of a calibration without errors."""
        return PredictedErrors.of(self._inverse(self._own_px2))

    def term_in_r(self, sizes: CalibrationSizes) -> PredictedErrors:
        """(Σ Hᵀ(R + JΣJᵀ)⁻¹H)⁻¹: of triangulation that has the term in its weights."""
        return PredictedErrors.of(self._inverse(self._own_px2 + self._added_px2(sizes)))

    def propagated(self, sizes: CalibrationSizes) -> PredictedErrors:
        """C + GΣGᵀ with G = C Σ HᵀR⁻¹J: of triangulation that ignores the errors and weights by R alone."""
        weighted = self._jacobian.mT @ np.linalg.inv(self._own_px2)  # HᵀR⁻¹, (V, N, 3, 2)
        middle = self._sum(weighted @ self._added_px2(sizes) @ weighted.mT)
        plain = self._inverse(self._own_px2)
        return PredictedErrors.of(plain + plain @ middle @ plain)

    @cached_property
    def _jacobian(self) -> Floats:
        """px/m, (V, N, 2, 3), 0 where not visible."""
        return np.where(self.visible[..., None, None], self.views.jacobian, 0.0)

    @cached_property
    def _own_px2(self) -> Floats:
        """R of the model, (V, N, 2, 2), I where not visible."""
        own: PixelCovariance = self.model.of_views(self.views)
        return np.where(self.visible[..., None, None], own.matrix(*self.visible.shape), np.eye(2))

    def _added_px2(self, sizes: CalibrationSizes) -> Floats:
        with np.errstate(all="ignore"):  # of points that are not seen
            added = CalibrationNoise(sizes).covariance(self.views).matrix(*self.visible.shape)
        return np.where(self.visible[..., None, None], added, 0.0)

    def _inverse(self, px2: Floats) -> Floats:
        """(Σ HᵀR⁻¹H)⁻¹ with R = `px2`, (K, N, 3, 3), nan where not observable."""
        information = self._sum(self._jacobian.mT @ np.linalg.inv(px2) @ self._jacobian)
        enough = self.visible[self.configurations].sum(axis=1) >= 2
        return inverse_where_known(information, enough)

    def _sum(self, of_views: Floats) -> Floats:
        """Sums over the views of each configuration, (K, N, ...), of (V, N, ...)."""
        total = np.zeros((len(self.configurations), *of_views.shape[1:]))
        for column in self.configurations.T:
            total += of_views[column]
        return total


def inverse_where_known(information: Floats, enough: Bools) -> Floats:
    """Inverses of (..., 3, 3); nan where not `enough` (...) or where two rays are parallel to double precision."""
    smallest = np.linalg.eigvalsh(information)[..., 0]
    known = enough & (smallest > SMALLEST_INFORMATION_RATIO * np.trace(information, axis1=-2, axis2=-1))
    inverse = np.linalg.inv(np.where(known[..., None, None], information, np.eye(3)))
    return np.where(known[..., None, None], inverse, np.nan)


def inverse_sigma(covariance_m2: Floats) -> Floats:
    """1/√λmax of (..., 3, 3), 1/m; 0 where it is nan."""
    return np.nan_to_num(1 / largest_standard_deviation(covariance_m2))


def second_moments(errors: Floats) -> Floats:
    """E[eeᵀ] (..., N, 3, 3) of errors (..., T, N, 3), over the trials that have one; nan without any."""
    known = np.isfinite(errors[..., :1])
    values = np.where(known, errors, 0.0)
    count = known.sum(axis=-3)[..., None]
    of_points = np.swapaxes(values, -3, -2)  # (..., N, T, 3)
    moment = of_points.mT @ of_points
    return np.where(count > 0, moment / np.maximum(count, 1), np.nan)
