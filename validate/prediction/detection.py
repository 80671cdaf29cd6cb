"""Fit the probability of detection (`pss.visibility.detection`) to who was found on training views.

Only targets count that are in view as a whole with nothing before them: the rest is geometry and needs no fit. The
trials of one render share nearly all that decides (of the pairs of view and marker in training, one in twenty is found
in some trials and missed in others), so that a render counts as one trial that was found with the share of its trials.
Coefficients have the largest likelihood; those of the parts are not negative. Their quality is
estimated by cross-validation over the training cameras. The result is evaluated on other views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from pss import ImageSensor, RangeError
from pss.cameras.views import Views
from pss.hints import Floats
from pss.surrogates import Shape
from pss.visibility.detection import DETECTION_PARTS, detection_features
from pss.visibility.points import visible_in
from pss.visibility.targets import TARGET_VISIBILITY

__all__ = ["DetectionTrials", "FittedDetection", "detection_trials", "fit_detection", "log_loss"]


# Share that is missed however good the view is: more than this is no lapse of a usable detector.
LARGEST_LAPSE = 0.05
# Penalty on the squares of the coefficients in units of their parts' spread: it only bounds them where found and missed
# markers do not overlap at all.
PENALTY = 0.01
# A probability is kept off 0 and 1 by this in a logarithm.
SMALLEST = 1e-6


@dataclass(frozen=True, eq=False)
class DetectionTrials:
    """M pairs of view and whole marker.

    Attributes:
        parts: as `pss.visibility.detection.detection_features` gives them, (4, M).
        rate: share of the trials in which the marker was found, (M,).
        weight: renders of the view, (M,).
        camera: name of the view's camera, (M,).
    """

    parts: Floats
    rate: Floats
    weight: Floats
    camera: NDArray[np.str_]

    def __getitem__(self, chosen: NDArray[np.bool_]) -> DetectionTrials:
        return DetectionTrials(self.parts[:, chosen], self.rate[chosen], self.weight[chosen], self.camera[chosen])

    @classmethod
    def together(cls, several: Sequence[DetectionTrials]) -> DetectionTrials:
        """Those of several sets of views."""
        return cls(
            np.concatenate([each.parts for each in several], axis=1),
            np.concatenate([each.rate for each in several]),
            np.concatenate([each.weight for each in several]),
            np.concatenate([each.camera for each in several]),
        )


@dataclass(frozen=True)
class FittedDetection:
    """Coefficients as `pss.DetectionModel` has them, and the fit's cross-validation over the training cameras.

    Attributes:
        held_back_log_loss, held_back_brier: of each camera's markers by a fit without that camera.
        constant_log_loss: the same of the mean share in place of a fit.
    """

    coefficients: dict[str, float]
    pairs: int
    held_back_log_loss: float
    held_back_brier: float
    constant_log_loss: float

    @property
    def provenance(self) -> dict[str, int | float]:
        """The record of the fit in a calibration's file."""
        return {
            "detection_pairs": self.pairs,
            "detection_log_loss_held_back": self.held_back_log_loss,
            "detection_brier_held_back": self.held_back_brier,
            "detection_log_loss_of_a_constant": self.constant_log_loss,
        }


def detection_trials(
    views: Views, occluders: tuple[Shape, ...], rate: Floats, renders: int, sensor: ImageSensor
) -> DetectionTrials:
    """The whole markers in training views, of which each was found in the share `rate` (V, N) of the trials."""
    whole = visible_in(views, occluders, TARGET_VISIBILITY)
    names = np.array([camera.name for camera in views.cameras])
    return DetectionTrials(
        detection_features(views, sensor)[:, whole],
        rate[whole],
        np.full(int(whole.sum()), float(renders)),
        names[np.nonzero(whole)[0]],
    )


def fit_detection(trials: DetectionTrials) -> FittedDetection:
    """The coefficients of the largest likelihood, and how well they do for cameras that they were not fitted to.

    Raises:
        RangeError: there is no whole marker.
    """
    if not len(trials.rate):
        raise RangeError("no view has a whole marker in it; allowed: at least one to fit probabilities of detection to")
    held_back, mean = np.zeros(len(trials.rate)), np.zeros(len(trials.rate))
    for name in np.unique(trials.camera):
        out = trials.camera == name
        rest = trials if out.all() else trials[~out]
        held_back[out] = _probability(_largest_likelihood(rest), trials.parts[:, out])
        mean[out] = np.average(rest.rate, weights=rest.weight)
    constant, *slopes, lapse = _largest_likelihood(trials).tolist()
    return FittedDetection(
        {"constant": constant, **dict(zip(DETECTION_PARTS, slopes, strict=True)), "lapse": lapse},
        len(trials.rate),
        log_loss(held_back, trials.rate, trials.weight),
        float(np.average((held_back - trials.rate) ** 2, weights=trials.weight)),
        log_loss(mean, trials.rate, trials.weight),
    )


def log_loss(probability: Floats, rate: Floats, weight: Floats | None = None) -> float:
    """Mean of −(r ln p + (1 − r) ln(1 − p)) over M pairs, (M,) each."""
    p = np.clip(probability, SMALLEST, 1 - SMALLEST)
    return float(-np.average(rate * np.log(p) + (1 - rate) * np.log1p(-p), weights=weight))


def _probability(theta: Floats, parts: Floats) -> Floats:
    return np.asarray((1 - theta[-1]) * expit(theta[0] + theta[1:-1] @ parts))


def _largest_likelihood(trials: DetectionTrials) -> Floats:
    """Constant, coefficients of the parts, lapse."""
    spread = np.maximum(trials.parts.std(axis=1), SMALLEST)
    scaled = np.vstack([np.ones(len(trials.rate)), trials.parts / spread[:, None]])
    rate, weight = trials.rate, trials.weight

    def loss(theta: Floats) -> tuple[float, Floats]:
        ramp, lapse = expit(theta[:-1] @ scaled), theta[-1]
        p = np.clip((1 - lapse) * ramp, SMALLEST**2, 1 - SMALLEST**2)
        value = -(weight * (rate * np.log(p) + (1 - rate) * np.log1p(-p))).sum()
        pull = weight * (rate / p - (1 - rate) / (1 - p))
        slope = np.append(scaled @ (pull * (1 - lapse) * ramp * (1 - ramp)), -(pull * ramp).sum())
        value += PENALTY * (theta[:-1] ** 2).sum() / 2
        return float(value), np.append(PENALTY * theta[:-1], 0.0) - slope

    first = np.array([2.0, *np.full(len(DETECTION_PARTS), 0.5), LARGEST_LAPSE / 10])
    bounds = [(None, None), *[(0, None)] * len(DETECTION_PARTS), (0, LARGEST_LAPSE)]
    theta = minimize(loss, first, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 1000}).x
    return np.concatenate([theta[:1], theta[1:-1] / spread, theta[-1:]])
