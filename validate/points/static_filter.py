"""A linearised simulation of the Kalman filter, driven by rendered residuals, to compare with P⁻ of Eq. 4 and P⁺.

No moving point is rendered. The truth follows the process model in the simulation, from where the points were rendered;
a frame's measurement is the projection plus the residual of a trial, drawn from those the detector made there. The
filter weighs each detection by its own covariance, as triangulation does. The scene is linearised at the rendered
points, so that the error obeys, exactly,

    e⁺ = (I − P⁺Λ) e⁻ + P⁺ y,     e⁻ ← A e⁺ − w,  w ~ N(0, Q),     Λ = Σ HᵀR⁻¹H,  y = Σ HᵀR⁻¹ (pixel − projection)

with sums over the views that detected the point in that trial. So it tests what the residuals do in a filter (their
covariance, frozen bias and misses), not what motion, blur and linearisation do. `validate.points.filter_moments` solves
for its second moments in place of the simulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.cameras.camera import PTZCamera, as_points
from pss.errors import RangeError, ShapeError
from pss.hints import Bools, Floats
from pss.processes.process import ProcessModel
from pss.riccati.solve import posterior_covariance, steady_state_covariance_from_information
from validate.points.triangulate import detection_weights

__all__ = ["Tracked", "embedded", "mean_over", "track", "track_static", "trial_terms"]


# Frames before the average begins, in time constants of the slowest point: e^-10 of the start is left by then.
SETTLING_TIME_CONSTANTS = 10
# Frames that are averaged, likewise: about as many independent draws a run.
AVERAGED_TIME_CONSTANTS = 10
# A filter slower than this (tiny process noise, or one point seen by two nearly parallel rays) is not waited for. It
# starts at P∞ already: what it has no time to gather in full is the frozen bias.
LONGEST_TIME_CONSTANT_FRAMES = 30.0
# A fast filter has settled after one frame, and every further frame is a fresh draw that the average can use.
FEWEST_SETTLING_FRAMES, FEWEST_AVERAGED_FRAMES = 10, 20


@dataclass(frozen=True, eq=False)
class Tracked:
    """Measured errors of the filter at N points; nan where a point was never triangulated.

    Attributes:
        prior_moment_m2: m², (N, 3, 3), second moment E[eeᵀ] of the a-priori (predicted) position.
        posterior_moment_m2: m², (N, 3, 3), of the a-posteriori (updated) position.
        prior_errors_m, posterior_errors_m: m, (runs, N, 3), the errors themselves in the last frame of each run.
        steps: frames run, those of settling included.
    """

    prior_moment_m2: Floats
    posterior_moment_m2: Floats
    prior_errors_m: Floats
    posterior_errors_m: Floats
    steps: int


def track_static(
    cameras: Sequence[PTZCamera],
    points_m: ArrayLike,
    pixels: ArrayLike,
    covariance: ArrayLike,
    usable: ArrayLike,
    process: ProcessModel,
    rng: np.random.Generator,
    runs: int = 32,
) -> Tracked:
    """Run `runs` independent filters for every point and average their squared errors in the steady state.

    The residuals carry the frozen bias of the detector along: it is the same in every trial of a view, does not average
    out in time, and belongs to the error that a user of the filter would have. So the moments are about zero, not
    about the mean, and exceed P∞ and P⁺∞ by the square of the bias that the filter settles at.

    Args:
        cameras: the C views.
        points_m: m, the truth, (N, 3), where the scene was rendered and is linearised.
        pixels: px, (C, T, N, 2), nan where a marker was not detected, or its detection was thrown out as a blunder
            (`Triangulated.used`).
        covariance: px², (C, T, N, 2, 2), of each detection, from its own image.
        usable: (T, N), the trials that may be drawn: those in which the point was triangulated.
        process: A and Q; the first three states are the position.
        runs: filters a point.

    Raises:
        ShapeError, RangeError: the arrays do not fit each other, or `runs` < 1.
    """
    points = as_points(points_m)
    detected, weight = detection_weights(cameras, pixels, covariance)
    drawable = np.asarray(usable, dtype=bool)
    if drawable.shape != detected.shape[1:] or points.shape != (detected.shape[2], 3):
        raise ShapeError(
            f"points_m {points.shape} and usable {drawable.shape}; allowed beside pixels {np.shape(pixels)} are "
            f"{(detected.shape[2], 3)} and {detected.shape[1:]}"
        )
    if runs < 1:
        raise RangeError(f"runs = {runs}; allowed: at least 1")
    pixels = np.asarray(pixels, dtype=float)
    information, pull = (terms.sum(axis=0) for terms in trial_terms(cameras, points, pixels, detected, weight))
    return track(information, pull, drawable, process, rng, runs)


def track(
    information: Floats,
    pull: Floats,
    drawable: Bools,
    process: ProcessModel,
    rng: np.random.Generator,
    runs: int,
    time_constants: tuple[float, float] = (SETTLING_TIME_CONSTANTS, AVERAGED_TIME_CONSTANTS),
) -> Tracked:
    """`track_static` from the trials' Λ (T, N, 3, 3) and y (T, N, 3), summed over the views that detected the point.

    `time_constants` of the slowest point pass before the average begins, and in it.
    """
    points = drawable.shape[1]
    moments, last = np.full((2, points, 3, 3), np.nan), np.full((2, runs, points, 3), np.nan)
    item, start = _start(information, drawable, process)
    if not item.size:
        return Tracked(*moments, *last, steps=0)
    mean_information = embedded(mean_over(information, drawable)[item], process.states)
    slowest = _time_constant_frames(process.A, start, mean_information)
    settling = max(FEWEST_SETTLING_FRAMES, math.ceil(time_constants[0] * slowest))
    averaged = max(FEWEST_AVERAGED_FRAMES, math.ceil(time_constants[1] * slowest))
    draws = _Draws(information[:, item], pull[:, item], drawable[:, item], rng)
    moments[:, item], last[:, :, item] = _run(process, start, draws, rng, runs, settling, averaged)
    return Tracked(*moments, *last, steps=settling + averaged)


def trial_terms(
    cameras: Sequence[PTZCamera], points: Floats, pixels: Floats, detected: Bools, weight: Floats
) -> tuple[Floats, Floats]:
    """1/m² HᵀR⁻¹H (C, T, N, 3, 3) and 1/m HᵀR⁻¹ × residual (C, T, N, 3) of each view; zero where it did not detect.

    Their sums over views are Λ and y of any configuration of these views.

    Args:
        cameras: C of them.
        points: m, (N, 3).
        pixels: px, (C, T, N, 2).
        detected, weight: (C, T, N) and (C, T, N, 2, 2), from `detection_weights`.
    """
    information, pull = np.zeros((*detected.shape, 3, 3)), np.zeros((*detected.shape, 3))
    for of_view, pulled, camera, measured, seen, inverse in zip(
        information, pull, cameras, pixels, detected, weight, strict=True
    ):
        ever = np.flatnonzero(seen.any(axis=0))  # the others may lie in the plane of the lens, where no pixel exists
        projected, jacobian = camera.project(points[ever])[0], camera.jacobian(points[ever])
        residual = np.where(seen[:, ever, None], measured[:, ever] - projected, 0.0)
        weighted = jacobian.mT @ inverse[:, ever]  # HᵀR⁻¹, (T, N', 3, 2)
        of_view[:, ever] = weighted @ jacobian
        pulled[:, ever] = (weighted @ residual[..., None])[..., 0]
    return information, pull


def mean_over(information: Floats, drawable: Bools) -> Floats:
    """1/m², the mean Λ over the trials that may be drawn, (N, 3, 3); zero where there is none."""
    total = (information * drawable[..., None, None]).sum(axis=0)
    return np.asarray(total / np.maximum(drawable.sum(axis=0), 1)[:, None, None])


def embedded(information: Floats, states: int) -> Floats:
    """Λ in the position block of a state's information, (N, n, n)."""
    embedded = np.zeros((len(information), states, states))
    embedded[:, :3, :3] = information
    return embedded


def _start(information: Floats, drawable: Bools, process: ProcessModel) -> tuple[NDArray[np.int64], Floats]:
    """The points that can be tracked, (V,), and P∞ of their mean information, (V, n, n)."""
    item = np.flatnonzero(drawable.any(axis=0))
    mean_information = embedded(mean_over(information, drawable)[item], process.states)
    start = steady_state_covariance_from_information(process.A, process.Q, mean_information, unsolvable="nan")
    solved = np.isfinite(start).all(axis=(-2, -1))
    return item[solved], start[solved]


def _time_constant_frames(A: Floats, prior: Floats, information: Floats) -> float:
    """Frames in which the slowest filter's error falls to 1/e, up to `LONGEST_TIME_CONSTANT_FRAMES`."""
    closed_loop = A @ (np.eye(len(A)) - posterior_covariance(prior, information) @ information)
    modulus = float(np.abs(np.linalg.eigvals(closed_loop)).max())
    if modulus >= math.exp(-1 / LONGEST_TIME_CONSTANT_FRAMES):
        return LONGEST_TIME_CONSTANT_FRAMES
    return -1 / math.log(modulus) if modulus > 0 else 0.0


class _Draws:
    """Draws of a trial's (Λ, y), uniform among those of each point that may be drawn."""

    def __init__(self, information: Floats, pull: Floats, drawable: Bools, rng: np.random.Generator) -> None:
        self.information, self.pull, self.rng = information, pull, rng
        self.count = drawable.sum(axis=0)
        self.order = np.argsort(~drawable, axis=0, kind="stable")  # (T, V): a point's drawable trials come first

    def __call__(self, runs: int) -> tuple[Floats, Floats]:
        """1/m² Λ (runs, V, 3, 3) and 1/m y (runs, V, 3)."""
        point = np.arange(len(self.count))
        trial = self.order[self.rng.integers(self.count, size=(runs, len(point))), point]
        return self.information[trial, point], self.pull[trial, point]


def _run(
    process: ProcessModel,
    start: Floats,
    draws: _Draws,
    rng: np.random.Generator,
    runs: int,
    settling: int,
    averaged: int,
) -> tuple[Floats, Floats]:
    """m², second moments before and after the update, averaged over runs and the last frames, (2, V, 3, 3).

    Beside them m, the errors in the last frame, (2, runs, V, 3).
    """
    A, Q, states = process.A, process.Q, process.states
    step_root, shape = _root(Q), (runs, len(start), states)
    prior = np.broadcast_to(start, (runs, *start.shape))
    error = (_root(start) @ rng.standard_normal(shape)[..., None])[..., 0]
    moments, last = np.zeros((2, len(start), 3, 3)), np.zeros((2, runs, len(start), 3))
    for frame in range(settling + averaged):
        information, pull = draws(runs)
        position = prior[..., :3, :3]
        # P⁺ = (P⁻⁻¹ + Λ)⁻¹ = P⁻ − P⁻ G P⁻ with G = (Λ⁻¹ + P⁻)⁻¹ in the position block: 3 × 3 for any number of states.
        gain = np.linalg.solve(np.eye(3) + information @ position, information)
        posterior = prior - prior[..., :3] @ (gain @ prior[..., :3, :])
        surprise = pull[..., None] - information @ error[..., :3, None]
        updated = error + (posterior[..., :3] @ surprise)[..., 0]  # e⁺ = (I − P⁺Λ) e⁻ + P⁺ y
        last[0], last[1] = error[..., :3], updated[..., :3]
        if frame >= settling:
            for moment, e in zip(moments, (error, updated), strict=True):
                moment += np.einsum("rvi,rvj->vij", e[..., :3], e[..., :3])
        error = updated @ A.T - rng.standard_normal(shape) @ step_root.T  # e⁻ ← A e⁺ − w
        prior = A @ posterior @ A.T + Q
        prior = (prior + prior.mT) / 2  # rounding must not gather over the frames
    return moments / (runs * averaged), last


def _root(covariance: Floats) -> Floats:
    """A matrix S with S Sᵀ = `covariance` (..., n, n), which may be singular; units don't matter (unit diagonal)."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    deviations = np.sqrt(np.where(variances > 0, variances, 1.0))
    eigenvalues, axes = np.linalg.eigh(covariance / (deviations[..., :, None] * deviations[..., None, :]))
    return np.asarray(deviations[..., :, None] * axes * np.sqrt(np.maximum(eigenvalues, 0.0))[..., None, :])
