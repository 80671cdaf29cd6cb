"""Fit a noise model's weights to what detections did on training views.

Each view and marker that was detected often enough gives a second moment of its pixel residuals over the trials. A
model R = Σ w F with weights w ≥ 0 is fitted by the likelihood of those moments (Wishart). It need not have one minimum
alone: the search is started from several weights, and the best is kept. The result is judged on other views.

A model that is given but for its unit, s R, has one number to fit by the same likelihood (`fit_scale`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from pss import Appearance, ImageSensor, NoiseModel, PTZCamera, RangeError
from pss.cameras.views import Views
from pss.hints import Floats
from pss.noise import CALIBRATION_FACTORS, calibration_factor

__all__ = [
    "Fitted",
    "PixelMoments",
    "factor_covariances",
    "fit",
    "fit_best_form",
    "fit_scale",
    "model_covariance",
    "pixel_moments",
    "scaled",
]


# Trials in which a marker must have been detected for its moment to count.
FEWEST_DETECTIONS = 5
# A moment this many times that of the fit (tr(R⁻¹S)/2) is a blunder of the detector, not its noise: left out and
# counted. For ten trials of Gaussian noise, one in 1e12 is.
BLUNDER_RATIO = 6.0
# A factor that improves the log likelihood by less than this (per moment it is far less than its noise) is left out.
SMALLEST_GAIN = 10.0
STARTS = (1e-3, 1.0)


@dataclass(frozen=True, eq=False)
class PixelMoments:
    """M second moments of pixel residuals: `moment_px2` (M, 2, 2), over `trials` (M,), by `view` and `point` (M,)."""

    moment_px2: Floats
    trials: NDArray[np.int64]
    view: NDArray[np.int64]
    point: NDArray[np.int64]

    def __getitem__(self, chosen: NDArray[np.bool_]) -> PixelMoments:
        return PixelMoments(self.moment_px2[chosen], self.trials[chosen], self.view[chosen], self.point[chosen])


@dataclass(frozen=True, eq=False)
class Fitted:
    """Weights by factor, −2 log likelihood (up to a constant), and what it was fitted to.

    `kept`: (M,), the moments that are no blunders.
    """

    weights: Mapping[str, float]
    deviance: float
    kept: NDArray[np.bool_]

    @property
    def moments(self) -> int:
        """How many it was fitted to."""
        return int(self.kept.sum())

    @property
    def left_out(self) -> int:
        """How many were left out as blunders."""
        return int((~self.kept).sum())


def pixel_moments(residuals: Floats) -> PixelMoments:
    """Second moments about zero of `residuals` (V, T, N, 2) px, nan where not detected."""
    seen = np.isfinite(residuals[..., 0])
    count = seen.sum(axis=1)
    known = np.where(seen[..., None], residuals, 0.0)
    moment = np.einsum("vtni,vtnj->vnij", known, known) / np.maximum(count, 1)[..., None, None]
    view, point = np.nonzero(count >= FEWEST_DETECTIONS)
    return PixelMoments(moment[view, point], count[view, point], view, point)


def factor_covariances(
    cameras: Sequence[PTZCamera],
    points_m: Floats,
    normals: Floats,
    appearance: Appearance,
    sensor: ImageSensor,
    moments: PixelMoments,
    names: Sequence[str] = CALIBRATION_FACTORS,
) -> Floats:
    """px², what each of J factors adds at each of M moments with the weight 1, (J, M, 2, 2)."""
    views = Views(list(cameras), points_m, normals, appearance)
    found = []
    for name in names:
        factor = calibration_factor(name, sensor, sensor.ccd_noise)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            matrix = factor.covariance(views).matrix(len(cameras), len(points_m))
        found.append(matrix[moments.view, moments.point])
    return np.array(found)


def model_covariance(model: NoiseModel, views: Views, moments: PixelMoments) -> Floats:
    """px², the R of a whole model at each of M moments in `views`, (M, 2, 2)."""
    return model.of_views(views).matrix(len(views.cameras), len(views.points_m))[moments.view, moments.point]


def fit_scale(covariance: Floats, moments: PixelMoments) -> float:
    """The s with which s R is likeliest, for R = `covariance` (M, 2, 2) px²: the mean over all trials of tr(R⁻¹S)/2.

    It is where the derivative of Σ n (log det sR + tr((sR)⁻¹S)) is zero. No moment is left out: what a model that is
    wrong in its form cannot explain would be taken for a blunder. `moments` are those that a fit kept (`Fitted.kept`).

    Raises:
        RangeError: there is no moment, or an R that is not positive definite.
    """
    if not len(moments.trials):
        raise RangeError("no moments of pixel errors to fit a scale to; allowed: at least one")
    if not (np.isfinite(covariance).all() and (np.linalg.eigvalsh(covariance) > 0).all()):
        raise RangeError("an R that is not positive definite where a marker was detected; allowed: positive definite")
    ratio = np.trace(np.linalg.solve(covariance, moments.moment_px2), axis1=1, axis2=2) / 2
    return float(np.average(ratio, weights=moments.trials))


def fit(names: Sequence[str], covariances: Floats, moments: PixelMoments) -> Fitted:
    """Weights of the factors `names` with `covariances` (J, M, 2, 2) px²; blunders are left out once and counted."""
    if not len(moments.trials):
        raise RangeError(f"no marker was detected in {FEWEST_DETECTIONS} trials of a view; allowed: at least one")
    weights, deviance = _minimum(covariances, moments)
    model = np.einsum("j,jmab->mab", weights, covariances)
    ratio = np.trace(np.linalg.solve(model, moments.moment_px2), axis1=1, axis2=2) / 2
    kept = ratio < BLUNDER_RATIO
    if not kept.all():
        weights, deviance = _minimum(covariances[:, kept], moments[kept])
    return Fitted(dict(zip(names, weights.tolist(), strict=True)), deviance, kept)


def fit_best_form(names: Sequence[str], covariances: Floats, moments: PixelMoments) -> Fitted:
    """Fit all factors, then leave out one after the other while that costs less than `SMALLEST_GAIN`."""
    chosen = list(range(len(names)))
    best = fit([names[j] for j in chosen], covariances[chosen], moments)
    while len(chosen) > 1:
        trials = []
        for left_out in chosen:
            rest = [j for j in chosen if j != left_out]
            trials.append((fit([names[j] for j in rest], covariances[rest], moments), rest))
        smaller, rest = min(trials, key=lambda trial: trial[0].deviance / trial[0].moments)
        # Compared for the same number of moments: blunders differ a little between forms.
        if smaller.deviance / smaller.moments - best.deviance / best.moments > SMALLEST_GAIN / best.moments:
            break
        best, chosen = smaller, rest
    return best


def _minimum(covariances: Floats, moments: PixelMoments) -> tuple[Floats, float]:
    """The best weights and their deviance, Σ n (log det R + tr(R⁻¹S))."""
    # In units in which every factor has the data's own size.
    size = np.array([np.median(np.trace(f, axis1=1, axis2=2)) for f in covariances]) / 2
    scale = float(np.median(np.trace(moments.moment_px2, axis1=1, axis2=2))) / 2 / np.maximum(size, 1e-300)
    n = moments.trials.astype(float)

    def deviance(w: Floats) -> tuple[float, Floats]:
        model = np.einsum("j,jmab->mab", w * scale, covariances)
        inverse = np.linalg.inv(model)
        spread = inverse @ moments.moment_px2
        value = (n * (np.log(np.linalg.det(model)) + np.trace(spread, axis1=1, axis2=2))).sum()
        # d log det R = tr(R⁻¹F), d tr(R⁻¹S) = −tr(R⁻¹S R⁻¹F)
        slope = np.einsum("m,mab,jmba->j", n, inverse - spread @ inverse, covariances) * scale
        return float(value), slope

    found = []
    for start in STARTS:
        first = np.full(len(covariances), start)
        first[0] = 1.0
        # Never all zero: R must stay positive definite, so that the largest factor keeps a grain.
        result = minimize(
            deviance,
            first,
            jac=True,
            method="L-BFGS-B",
            bounds=[(1e-9, None)] * len(covariances),
            options={"maxiter": 500, "ftol": 1e-12, "gtol": 1e-6},
        )
        found.append((float(result.fun), result.x))
    value, best = min(found, key=lambda pair: pair[0])
    return np.where(best <= 1e-8, 0.0, best) * scale, value


def scaled(model: NoiseModel, times: float, name: str) -> NoiseModel:
    """The model with its whole R multiplied, under another name."""
    return model.weighted({factor.name: times for factor in model.factors}, name)
