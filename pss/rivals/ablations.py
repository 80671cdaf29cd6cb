"""PSS without some of its parts: R = I, a single quality factor, or the filter's error after its update.

PSS without the process model is "pss-single-frame", which the table has already. For Q → ∞ the a-posteriori P⁺ tends
to C, and the a-priori P∞ to Q + C.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from pss.hints import Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric
from pss.noise import (
    BrightnessContrast,
    Defocus,
    DistanceIncidence,
    IdentityNoise,
    NoiseFactor,
    NoiseModel,
    Resolution,
    Weighted,
)
from pss.processes.steady_state import solve
from pss.riccati.covariances import from_six, to_six
from pss.rivals.covariance import PIXEL_VARIANCE_PX2

__all__ = ["ABLATIONS", "evaluation_with", "own_factor"]

F = TypeVar("F", bound=NoiseFactor)

# Without it R would be zero in the plane of focus, and at grazing incidence with Eq. 11 as printed.
PIXEL = IdentityNoise(PIXEL_VARIANCE_PX2, "pixel")


def evaluation_with(evaluation: Evaluation, noise: NoiseModel) -> Evaluation:
    """The same cameras, points and visibility with another model of R; other sensors keep their covariance."""
    task = dataclasses.replace(evaluation.task, noise=noise)
    if not evaluation.cameras:
        return dataclasses.replace(evaluation, task=task)
    six = noise.information(evaluation.views, evaluation.visible).sum(axis=0)
    if task.sensors:
        six += to_six(evaluation.information[:, :3, :3] - evaluation.camera_information.sum(axis=0))
    information = evaluation.information.copy()
    information[:, :3, :3] = from_six(six)
    state_information = information if information.shape[-1] > 3 else None
    observable, sigma, frame_sigma = (array[0] for array in solve(task.processes, six[None], state_information))
    return dataclasses.replace(
        evaluation,
        task=task,
        observable=observable,
        information=information,
        sigma_m=sigma,
        single_frame_sigma_m=frame_sigma,
    )


def own_factor(evaluation: Evaluation, default: F) -> F:
    """The factor of the default's type in the evaluation's noise model, for its constants; or the default."""
    for factor in evaluation.task.noise.factors:
        unweighted = factor.factor if isinstance(factor, Weighted) else factor
        if isinstance(unweighted, type(default)):
            return unweighted
    return default


def _identity(evaluation: Evaluation) -> tuple[NoiseFactor, ...]:
    return (IdentityNoise(),)


def _distance(evaluation: Evaluation) -> tuple[NoiseFactor, ...]:
    own = own_factor(evaluation, DistanceIncidence())
    return (dataclasses.replace(own, distance=True, incidence=False),)


def _incidence_as_printed(evaluation: Evaluation) -> tuple[NoiseFactor, ...]:
    own = own_factor(evaluation, DistanceIncidence())
    return (dataclasses.replace(own, distance=False, incidence=True, corrected=False), PIXEL)


def _incidence_corrected(evaluation: Evaluation) -> tuple[NoiseFactor, ...]:
    own = own_factor(evaluation, DistanceIncidence())
    return (dataclasses.replace(own, distance=False, incidence=True, corrected=True),)


def _resolution(evaluation: Evaluation) -> tuple[NoiseFactor, ...]:
    return (own_factor(evaluation, Resolution()),)


def _defocus(evaluation: Evaluation) -> tuple[NoiseFactor, ...]:
    return (own_factor(evaluation, Defocus()), PIXEL)


def _brightness_contrast(evaluation: Evaluation) -> tuple[NoiseFactor, ...]:
    return (own_factor(evaluation, BrightnessContrast()),) if evaluation.task.appearance is not None else ()


def _ablation(name: str, factors: Callable[[Evaluation], tuple[NoiseFactor, ...]], reference: str) -> Metric:
    """Eq. 10, 1/m, with R the sum of these factors; 0 if there are none. More is better."""

    def terms(evaluation: Evaluation) -> Floats:
        chosen = factors(evaluation)
        if not chosen:
            return np.zeros(len(evaluation.observable))
        return evaluation_with(evaluation, NoiseModel(name, chosen)).inverse_sigma

    return Metric.over_points(name, terms, True, reference, "ours", "count zero")


def _posterior(evaluation: Evaluation) -> Floats:
    """1/m, (N,), terms of Eq. 10 with P⁺ for P∞. More is better."""
    return np.nan_to_num(1 / evaluation.posterior_sigma_m)


ABLATIONS: tuple[Metric, ...] = (
    _ablation("pss-identity-noise", _identity, "Eq. 10 with R = I px²"),
    _ablation("pss-distance-alone", _distance, "Eq. 10 with R = D² of Eq. 11"),
    _ablation("pss-incidence-printed-alone", _incidence_as_printed, "Eq. 10 with R = cos α of Eq. 11 + 1/12 px²"),
    _ablation("pss-incidence-corrected-alone", _incidence_corrected, "Eq. 10 with R = 1/cos α"),
    _ablation("pss-resolution-alone", _resolution, "Eq. 10 with R of Eqs. 12 and 13"),
    _ablation("pss-defocus-alone", _defocus, "Eq. 10 with R of Eq. 15 + 1/12 px²"),
    _ablation(
        "pss-brightness-contrast-alone",
        _brightness_contrast,
        "Eq. 10 with R of brightness and contrast; 0 without an appearance",
    ),
    Metric.over_points(
        "pss-posterior", _posterior, True, "Eq. 10 with the a-posteriori P⁺ for P∞", "ours", "count zero"
    ),
)
