"""The PSS metric: from cameras and points of interest to σ∞ at each point (section 3.2), then one number (3.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.camera import PTZCamera, as_points
from pss.errors import RangeError, ShapeError
from pss.noise import NoiseModel, noise_model
from pss.process import ProcessModel, RandomWalk
from pss.riccati import measurement_information, posterior_covariance, steady_state_covariance_from_information
from pss.surrogates import Shape
from pss.visibility import visible_points

__all__ = ["METRICS", "Evaluation", "Metric", "evaluate", "mean_inverse_sigma"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# The paper's definition of an observable point: c ≥ 2 cameras see it (section 3.2).
CAMERAS_TO_OBSERVE = 2
# Rays closer to parallel than double precision can tell apart carry no depth: smallest over largest eigenvalue of J.
SMALLEST_INFORMATION_RATIO = 1e-13
# A unit normal read from a file with seven digits is off by less.
NORMAL_LENGTH_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What the metric says of one configuration of C cameras at N points, for a state of n numbers.

    Unobservable points have nan in every array but `visible` and `observable`.

    Attributes:
        visible: (C, N), the camera sees the point.
        observable: (N,), at least two cameras see it, and not along one line as far as double precision can tell.
        covariance: (N, n, n), a-priori P∞, Eq. 4; the position block is in m².
        posterior: (N, n, n), a-posteriori P⁺∞.
        single_frame_covariance: m², (N, 3, 3), C = (Σ HᵀR⁻¹H)⁻¹ of one frame's triangulation.
    """

    visible: Bools
    observable: Bools
    covariance: Floats
    posterior: Floats
    single_frame_covariance: Floats

    @property
    def sigma_m(self) -> Floats:
        """Metres, σ∞ of Eq. 9 of the position block, (N,)."""
        return largest_standard_deviation(self.covariance[:, :3, :3])

    @property
    def rms_m(self) -> Floats:
        """Metres, √tr of the position block of P∞, (N,)."""
        return root_trace(self.covariance[:, :3, :3])

    @property
    def posterior_rms_m(self) -> Floats:
        """Metres, √tr of the position block of P⁺∞, (N,)."""
        return root_trace(self.posterior[:, :3, :3])

    @property
    def single_frame_sigma_m(self) -> Floats:
        """Metres, √λmax of C, (N,)."""
        return largest_standard_deviation(self.single_frame_covariance)

    @property
    def single_frame_rms_m(self) -> Floats:
        """Metres, √tr of C, (N,): what the RMS error of triangulated points is compared with."""
        return root_trace(self.single_frame_covariance)

    @property
    def pss(self) -> float:
        """1/m, Eq. 10."""
        return mean_inverse_sigma(self.sigma_m)

    @property
    def pss_single_frame(self) -> float:
        """1/m, Eq. 10 with √λmax of C in place of σ∞."""
        return mean_inverse_sigma(self.single_frame_sigma_m)


def evaluate(
    cameras: Sequence[PTZCamera],
    points_m: ArrayLike,
    normals: ArrayLike,
    *,
    noise: NoiseModel | str = "as-printed",
    process: ProcessModel | None = None,
    occluder: Sequence[Shape] = (),
) -> Evaluation:
    """Evaluate the PSS metric of one configuration (Eqs. 4–10).

    Args:
        points_m: m, points of interest, (N, 3).
        normals: unit outward normals of the surface at the points, (N, 3).
        noise: model of R_k, or its name.
        process: model of A and Q; a random walk of 1 mm a frame if None.
        occluder: shapes that block lines of sight.

    Raises:
        ShapeError, RangeError: wrong shapes, values or normals; a noise model's R that is not positive definite.
        RiccatiError: the process model has no steady state, however well its position is measured.
    """
    points, unit_normals = as_points(points_m), as_points(normals, "normals")
    if points.ndim != 2 or points.shape != unit_normals.shape:
        raise ShapeError(f"points_m {points.shape} and normals {unit_normals.shape}; allowed are two alike, (N, 3)")
    if len(points) == 0:
        raise ShapeError(f"points_m has shape {points.shape}; allowed is (N, 3) with at least one point")
    lengths = np.linalg.norm(unit_normals, axis=-1)
    if (np.abs(lengths - 1) > NORMAL_LENGTH_TOLERANCE).any():
        worst = float(lengths[np.abs(lengths - 1).argmax()])
        raise RangeError(f"a normal has length {worst:.6g}; allowed is 1 ± {NORMAL_LENGTH_TOLERANCE:g}")
    model = noise_model(noise) if isinstance(noise, str) else noise
    process = RandomWalk() if process is None else process

    visible = visible_points(cameras, points, unit_normals, occluder)
    information = np.zeros((len(points), 3, 3))
    for camera, seen in zip(cameras, visible, strict=True):
        information[seen] += _information(camera, points[seen], unit_normals[seen], model)
    observable = (visible.sum(axis=0) >= CAMERAS_TO_OBSERVE) & _well_conditioned(information)
    prior = _steady_state(process, information[observable])
    # A point too close to unobservable for Eq. 4 in double precision counts as what it is close to.
    solved = np.isfinite(prior).all(axis=(-2, -1))
    observable[observable] = solved
    prior = prior[solved]
    posterior = posterior_covariance(prior, _of_state(process, information[observable]))
    single_frame = _fill(observable, np.linalg.inv(information[observable]))
    return Evaluation(visible, observable, _fill(observable, prior), _fill(observable, posterior), single_frame)


def _information(camera: PTZCamera, points_m: Floats, normals: Floats, model: NoiseModel) -> Floats:
    """1/m², HᵀR⁻¹H of one camera, (N, 3, 3): with the batch of Eq. 5, Ĥᵀ R̂⁻¹ Ĥ is the sum of these."""
    return measurement_information(camera.jacobian(points_m), model.covariance(camera, points_m, normals))


def _well_conditioned(information: Floats) -> Bools:
    eigenvalues = np.linalg.eigvalsh(information)
    return np.asarray(eigenvalues[:, 0] > SMALLEST_INFORMATION_RATIO * eigenvalues[:, -1])


def _steady_state(process: ProcessModel, information: Floats) -> Floats:
    """P∞ (V, n, n) of points with positions' `information` (V, 3, 3); nan where it defeats Eq. 4.

    Raises:
        RiccatiError: the process is at fault: it has no steady state even where all directions are measured alike.
    """
    A, Q = process.A, process.Q
    prior = steady_state_covariance_from_information(A, Q, _of_state(process, information), unsolvable="nan")
    if np.isnan(prior).any():
        alike = np.trace(information, axis1=-2, axis2=-1)[:, None, None] / 3 * np.eye(3)
        steady_state_covariance_from_information(A, Q, _of_state(process, alike))
    return prior


def _of_state(process: ProcessModel, information: Floats) -> Floats:
    """Information on positions, (V, 3, 3), as information on the whole state, (V, n, n)."""
    whole = np.zeros((len(information), process.states, process.states))
    whole[:, :3, :3] = information
    return whole


def _fill(observable: Bools, values: Floats) -> Floats:
    """`values` of the observable points, (V, n, n), among nan for the others, (N, n, n)."""
    filled = np.full((len(observable), *values.shape[1:]), np.nan)
    filled[observable] = values
    return filled


def largest_standard_deviation(covariance: Floats) -> Floats:
    """√λmax of (..., n, n) covariances (Eq. 9), nan where they are; shape (...)."""
    known = np.asarray(np.isfinite(covariance).all(axis=(-2, -1)))
    eigenvalues = np.linalg.eigvalsh(np.where(known[..., None, None], covariance, 0.0))[..., -1]
    return np.where(known, np.sqrt(np.maximum(eigenvalues, 0.0)), np.nan)


def root_trace(covariance: Floats) -> Floats:
    """√tr of (..., n, n) covariances, nan where they are; shape (...)."""
    return np.asarray(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1)))


def mean_inverse_sigma(sigma_m: Floats) -> float:
    """1/m, Eq. 10: Σ 1/σ over the observable points, divided by the number of all points, (N,); nan adds zero."""
    return float(np.nansum(1 / sigma_m) / len(sigma_m))


@dataclass(frozen=True)
class Metric:
    """A number for a configuration.

    Attributes:
        score: from the configuration's evaluation to the number.
        higher_is_better: the direction in which configurations get better.
        reference: where the formula comes from.
    """

    name: str
    score: Callable[[Evaluation], float]
    higher_is_better: bool
    reference: str


def _visible_share(evaluation: Evaluation) -> float:
    return float((evaluation.visible.sum(axis=0) >= CAMERAS_TO_OBSERVE).mean())


def _worst_sigma(evaluation: Evaluation) -> float:
    """m, the ∞-norm of section 3.3 over the observable points; ∞ where none is."""
    sigma = evaluation.sigma_m[evaluation.observable]
    return float(sigma.max()) if len(sigma) else np.inf


METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        Metric("pss", lambda evaluation: evaluation.pss, True, "Eq. 10"),
        Metric("pss-single-frame", lambda evaluation: evaluation.pss_single_frame, True, "Eq. 10 with C for P∞"),
        Metric("worst-sigma", _worst_sigma, False, "Eq. 9, ∞-norm of section 3.3"),
        Metric("visible-share", _visible_share, True, "share of the points that two cameras or more see"),
    )
}
