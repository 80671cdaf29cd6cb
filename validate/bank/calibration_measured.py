"""Measured errors of configurations whose cameras are wrong: triangulated anew, or carried through to first order.

Each detection's residual and what its camera's error adds to it give the error of a point by G = (ΣHᵀWH)⁻¹HᵀW about
the truth. So many frozen draws cost little more than one. It is the same estimator but for terms of second order, about
the error over the distance: the study triangulates a part of the configurations in full, at every size, and reports the
ratio.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss.cameras.views import Views
from pss.hints import Floats
from pss.riccati.covariances import largest_standard_deviation, root_trace
from validate.bank.calibration_predicted import inverse_where_known, second_moments
from validate.bank.measured import BankData, measure_all
from validate.stats.measured_errors import measured_inverse_sigma

__all__ = ["MeasuredMoments", "carried_through", "triangulated"]


@dataclass(frozen=True, eq=False)
class MeasuredMoments:
    """Of K configurations and N points.

    Attributes:
        second_m2: m², E[eeᵀ] about the truth, (K, N, 3, 3); nan where never triangulated.
        detections: trials that the point was triangulated in, (K, N).
        trials: of all.
    """

    second_m2: Floats
    detections: NDArray[np.int64]
    trials: int

    @classmethod
    def together(cls, draws: Sequence[MeasuredMoments]) -> MeasuredMoments:
        """All trials of several draws, which detected the same, as one record."""
        second = np.mean([draw.second_m2 for draw in draws], axis=0)
        return cls(second, len(draws) * draws[0].detections, len(draws) * draws[0].trials)

    @property
    def inverse_sigma(self) -> Floats:
        """1/m, terms of the measured PSS, (K, N)."""
        sigma = largest_standard_deviation(self.second_m2)
        return measured_inverse_sigma(sigma, self.detections / self.trials, self.detections)

    @property
    def rms_m(self) -> Floats:
        """m, √tr, (K, N)."""
        return root_trace(self.second_m2)

    @property
    def pooled_rms_m(self) -> Floats:
        """m, root mean square over the detected points, (K,)."""
        return np.sqrt(np.nanmean(self.rms_m**2, axis=1))

    @property
    def median_rms_m(self) -> Floats:
        """m, median over all points, with ∞ for those never triangulated, (K,)."""
        return np.median(np.nan_to_num(self.rms_m, nan=np.inf), axis=1)


def triangulated(data: BankData, configurations: NDArray[np.int64], processes: int | None = None) -> MeasuredMoments:
    """By maximum likelihood."""
    found = [of_one.errors for of_one in measure_all(data, configurations.tolist(), processes=processes)]
    return MeasuredMoments(
        np.array([errors.second_moment_m2 for errors in found]),
        np.array([errors.detections for errors in found]),
        found[0].trials,
    )


def carried_through(
    data: BankData, shifts_px: Sequence[Floats], configurations: NDArray[np.int64]
) -> list[MeasuredMoments]:
    """To first order, with the covariances and detections of `data`, for each of `shifts_px`.

    Args:
        shifts_px: what wrong cameras take off the detections, (V, T, N, 2) or (V, 1, N, 2) each.
    """
    detected, weight = data.weights
    jacobian = Views(list(data.cameras), data.points_m).jacobian[:, None]  # (V, 1, N, 2, 3)
    jacobian = np.where(detected[..., None, None], jacobian, 0.0)
    weighted = jacobian.mT @ weight  # HᵀW, (V, T, N, 3, 2)
    information = weighted @ jacobian
    own = weighted @ np.nan_to_num(data.residuals())[..., None]
    moved = np.array([(own - weighted @ shift[..., None])[..., 0] for shift in shifts_px])  # (D, V, T, N, 3)
    trials, points = detected.shape[1:]
    second = np.empty((len(shifts_px), len(configurations), points, 3, 3))
    detections = np.empty((len(configurations), points), dtype=np.int64)
    for row, views in enumerate(configurations):
        enough = detected[views].sum(axis=0) >= 2
        covariance = inverse_where_known(information[views].sum(axis=0), enough)
        errors = (covariance @ moved[:, views].sum(axis=1)[..., None])[..., 0]
        second[:, row] = second_moments(errors)
        detections[row] = np.isfinite(covariance[..., 0, 0]).sum(axis=0)
    return [MeasuredMoments(moments, detections, trials) for moments in second]
