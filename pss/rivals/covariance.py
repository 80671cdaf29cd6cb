"""Rivals that are a scalar of a covariance: of C = J⁻¹, of bearings, of equal pixels, and of a filter's update.

Metrics of C and of bearings are strongly correlated where R is the same for all views: expect near ties.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pss.hints import Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric
from pss.noise import IdentityNoise, NoiseModel
from pss.riccati.covariances import from_six, to_six
from pss.rivals.shared import both_conventions, directions, resolvable_six

__all__ = [
    "COVARIANCE_METRICS",
    "PIXEL_VARIANCE_PX2",
    "PRIOR_SIGMA_M",
    "a_optimality_m2",
    "d_optimality",
    "e_optimality_m2",
    "gdop_m",
    "quantisation_volume_m3",
    "worst_diagonal_m2",
]


# px², variance of a uniform error of ±½ px.
PIXEL_VARIANCE_PX2 = 1 / 12
PIXEL_GRID = NoiseModel("pixel grid", (IdentityNoise(PIXEL_VARIANCE_PX2),))
# m, prior σ of a target before any measurement: it is somewhere in the middle of the room.
PRIOR_SIGMA_M = 1.0


def quantisation_volume_m3(evaluation: Evaluation) -> Floats:
    """m³, √det C with R = I/12 px², (N,); ∞ if unobservable. Less is better.

    After Wu, Sharma and Huang 1998: the intersection of the pyramids of ±½ px, which according to the abstract is
    approximated by an ellipsoid. Its volume as √det of the Gaussian with the squares' variance is our reading. The
    volume of the intersection is a multiple of it: 12^1.5 = 41.6 to √2·12^1.5 = 58.8 for two cameras (58.8 if equal and
    at right angles), and larger with more cameras (about 100 for five).
    """
    weight = PIXEL_GRID.of_views(evaluation.views).inverse(evaluation.visible)
    return _root_determinant(evaluation.views.information(weight, evaluation.visible).sum(axis=0))


def _root_determinant(six: Floats) -> Floats:
    fixed, _ = resolvable_six(six)
    found = np.full(six.shape[1], np.inf)
    found[fixed] = np.exp(-np.linalg.slogdet(from_six(six[:, fixed]))[1] / 2)
    return found


def worst_diagonal_m2(evaluation: Evaluation) -> Floats:
    """m², the largest of C_xx, C_yy, C_zz, (N,); ∞ if unobservable. Less is better; the metric is the worst point's.

    After Olague and Mohr 2002. It depends on the directions of the world's axes.
    """
    return _or_infinite(np.diagonal(evaluation.single_frame_covariance, axis1=1, axis2=2).max(axis=1))


def gdop_m(evaluation: Evaluation) -> Floats:
    """m/rad, √tr (HᵀH)⁻¹ with H = (I − uuᵀ)/d, the bearing on the unit sphere, (N,); ∞ if unobservable.

    Less is better. Source: geometric dilution of precision, as used for bearings.
    """
    u = directions(evaluation)
    range_m = evaluation.views.range_m
    weight = np.where(evaluation.visible, 1 / np.where(range_m > 0, range_m, 1.0) ** 2, 0.0)
    information = np.einsum("cn,ij->nij", weight, np.eye(3)) - np.einsum("cn,cni,cnj->nij", weight, u, u)
    fixed, _ = resolvable_six(to_six(information))
    found = np.full(len(information), np.inf)
    found[fixed] = np.sqrt(np.trace(np.linalg.inv(information[fixed]), axis1=1, axis2=2))
    return found


def a_optimality_m2(evaluation: Evaluation) -> Floats:
    """m², tr C, (N,); ∞ if unobservable. Less is better."""
    return _or_infinite(evaluation.single_frame_rms_m**2)


def d_optimality(evaluation: Evaluation) -> Floats:
    """ln det C, of m⁶, (N,); ∞ if unobservable. Less is better."""
    found, fixed = np.full(len(evaluation.observable), np.inf), evaluation.observable
    found[fixed] = -np.linalg.slogdet(evaluation.information[fixed, :3, :3])[1]
    return found


def e_optimality_m2(evaluation: Evaluation) -> Floats:
    """m², λmax(C), (N,); ∞ if unobservable. Less is better."""
    return _or_infinite(evaluation.single_frame_sigma_m**2)


def _or_infinite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, np.inf)


def _t_optimality(evaluation: Evaluation) -> Floats:
    """1/m², tr J, (N,). More is better; an unobservable point counts with the information there is."""
    return np.asarray(np.trace(evaluation.information[:, :3, :3], axis1=1, axis2=2))


def _t_optimality_count_zero(evaluation: Evaluation) -> Floats:
    """1/m, √tr J, (N,); unobservable points count zero. More is better."""
    return np.where(evaluation.observable, np.sqrt(_t_optimality(evaluation)), 0.0)


def _rewards(evaluation: Evaluation, prior_sigma_m: float = PRIOR_SIGMA_M) -> Floats:
    """m², ‖P⁻‖_F − ‖P⁺‖_F of each point, (N,), P⁻ = σ²I the same for all configurations.

    Source: Stone Soup's UncertaintyRewardFunction. There P⁻ is the track's covariance before the choice, so that it
    must not depend on it. With 1 m against millimetres the sum nearly counts visible points: √3 m² for a point that is
    determined, √3 − 1 for one that a single camera sees, 0 for one that no camera sees.
    """
    information = evaluation.information[:, :3, :3] + np.eye(3) / prior_sigma_m**2
    return np.asarray(math.sqrt(3) * prior_sigma_m**2 - np.linalg.norm(np.linalg.inv(information), axis=(1, 2)))


def _steady_state_rewards(evaluation: Evaluation) -> Floats:
    """m², (N,), the same with P⁻ = P∞ and P⁺ of the filter's steady state; unobservable points count zero.

    More is better. P∞ = P⁺ + Q for a random walk, so that the reward is the contribution of Q, whatever the cameras: it
    is hardly a metric.
    """
    before, after = (np.linalg.norm(P[:, :3, :3], axis=(1, 2)) for P in (evaluation.covariance, evaluation.posterior))
    return np.where(evaluation.observable, before - after, 0.0)


def _summed(values: Callable[[Evaluation], Floats]) -> Callable[[Evaluation], Floats]:
    """Terms whose mean over the points is the sum of these values."""

    def terms(evaluation: Evaluation) -> Floats:
        found = values(evaluation)
        return found * len(found)

    return terms


COVARIANCE_METRICS: tuple[Metric, ...] = (
    *both_conventions(
        "quantisation-volume", quantisation_volume_m3, np.cbrt, "after Wu, Sharma and Huang 1998", "after"
    ),
    *both_conventions(
        "worst-diagonal",
        worst_diagonal_m2,
        np.sqrt,
        "after Olague and Mohr 2002",
        "after",
        worst=True,
    ),
    *both_conventions("gdop", gdop_m, lambda gdop: gdop, "geometric dilution of precision, bearings", "read"),
    *both_conventions("a-optimality", a_optimality_m2, np.sqrt, "optimal design, tr C", "read"),
    *both_conventions(
        "d-optimality", d_optimality, lambda value: np.exp(value / 6), "optimal design, ln det C", "read"
    ),
    *both_conventions("e-optimality", e_optimality_m2, np.sqrt, "optimal design, λmax(C)", "read"),
    Metric.over_points(
        "t-optimality", _t_optimality, True, "optimal design, tr J", "read", "count with what is measured"
    ),
    Metric.over_points(
        "t-optimality-count-zero",
        _t_optimality_count_zero,
        True,
        "optimal design, tr J; averaged as in Eq. 10",
        "read",
        "count zero",
    ),
    Metric.over_points(
        "uncertainty-reward",
        _summed(_rewards),
        True,
        "Stone Soup, UncertaintyRewardFunction",
        "read",
        "by the prior",
    ),
    Metric.over_points(
        "uncertainty-reward-steady-state",
        _summed(_steady_state_rewards),
        True,
        "Stone Soup's UncertaintyRewardFunction at P∞",
        "ours",
        "count zero",
    ),
)
