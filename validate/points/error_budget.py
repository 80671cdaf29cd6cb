"""Error budget of measured over predicted PSS: four factors, one for each link from model to point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss import Evaluation, PTZCamera
from pss.cameras.views import Views
from pss.hints import Bools, Floats
from pss.riccati.covariances import from_six, largest_standard_deviation
from validate.points.triangulate import SMALLEST_INFORMATION_RATIO, Triangulated, detection_weights
from validate.stats.measured_errors import FEWEST_TRIALS, MeasuredErrors

__all__ = ["ErrorBudget", "error_budget", "propagated_errors"]


@dataclass(frozen=True)
class ErrorBudget:
    """Factors from predicted to measured single-frame PSS, whose product is the quotient of the two; nan if undefined.

    Attributes:
        visibility: points and views that were predicted to see them, and did not find them in every trial.
        noise_model: the predicted R against the covariance that each detection gets from its own image, both carried to
            the point from the same views by the same linear geometry.
        detector: that covariance against how far the detections really are off, the bias of each view included.
        geometry: what triangulation makes of those detections against what linear geometry does.
    """

    visibility: float
    noise_model: float
    detector: float
    geometry: float


def error_budget(
    predicted: Evaluation, triangulated: Triangulated, propagated: MeasuredErrors, pss: float
) -> ErrorBudget:
    """The budget of one configuration.

    Args:
        triangulated: its points, in T trials.
        propagated: from `propagated_errors`, for the same trials.
        pss: 1/m, measured, single frame.
    """
    rate, counted = propagated.detection_rate, propagated.detections >= FEWEST_TRIALS
    # Each link's mean over all points of rate / σ, from the prediction to the measurement.
    links = np.array(
        [
            np.nan_to_num(1 / predicted.single_frame_sigma_m).mean(),
            _mean_inverse(_of_views_used(predicted, triangulated.used), rate, counted),
            _mean_inverse(triangulated.covariance_m2, rate, counted),
            propagated.pss(),
            pss,
        ]
    )
    usable = links > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        factors = np.where(usable[1:] & usable[:-1], links[1:] / links[:-1], np.nan)
    return ErrorBudget(*(float(factor) for factor in factors))


def _of_views_used(predicted: Evaluation, used: Bools) -> Floats:
    """m², (T, N, 3, 3), C by the predicted R from the views that each trial used, if they were predicted to see."""
    task = predicted.task
    views = Views(predicted.cameras, task.points_m, task.normals, task.appearance)
    of_cameras = task.noise.information(views, predicted.visible & used.any(axis=1))
    six = np.einsum("ctn,csn->stn", used & predicted.visible[:, None], of_cameras)
    information = from_six(six.reshape(6, -1)).reshape(*six.shape[1:], 3, 3)
    covariance = np.full_like(information, np.nan)
    eigenvalues = np.linalg.eigvalsh(information)
    solid = eigenvalues[..., 0] > SMALLEST_INFORMATION_RATIO * eigenvalues[..., -1]
    covariance[solid] = np.linalg.inv(information[solid])
    return covariance


def _mean_inverse(covariance_m2: Floats, rate: Floats, counted: Bools) -> float:
    """1/m, mean over all points of rate / σ; σ² is the largest eigenvalue of the mean over the trials."""
    known = counted & np.isfinite(covariance_m2[..., 0, 0]).any(axis=0)
    terms = np.zeros(len(rate))
    if known.any():
        terms[known] = rate[known] / largest_standard_deviation(np.nanmean(covariance_m2[:, known], axis=0))
    return float(terms.mean())


def propagated_errors(
    cameras: Sequence[PTZCamera], truth_m: Floats, pixels: ArrayLike, covariance: ArrayLike, used: Bools
) -> MeasuredErrors:
    """What linear geometry makes of the pixel errors: (Σ HᵀR⁻¹H)⁻¹ Σ HᵀR⁻¹(pixel − projection), H at the true point.

    Trials are the measured ones, so that their chance is in both alike.

    Args:
        truth_m: m, the points, (N, 3).
        pixels, covariance: px and px², (C, T, N, 2) and (C, T, N, 2, 2), as given to the triangulation.
        used: (C, T, N), the detections it used.
    """
    _, weight = detection_weights(cameras, np.where(used[..., None], pixels, np.nan), covariance)
    views = Views(cameras, truth_m)
    jacobian = views.jacobian[:, None]
    residual = np.where(used[..., None], np.asarray(pixels, dtype=float) - views.pixels[:, None], 0.0)
    weighted = jacobian.mT @ weight
    information = (weighted @ jacobian).sum(axis=0)
    gradient = (weighted @ residual[..., None]).sum(axis=0)
    known = used.any(axis=0)
    errors = np.full(gradient.shape[:-1], np.nan)
    errors[known] = np.linalg.solve(information[known], gradient[known])[..., 0]
    return MeasuredErrors(errors)
