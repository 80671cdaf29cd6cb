"""The expected entropy of a filter whose cameras may each miss the target."""

from __future__ import annotations

import itertools

import numpy as np

from pss.hints import Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric
from pss.riccati.covariances import to_six
from pss.rivals.covariance import PRIOR_SIGMA_M
from pss.rivals.shared import camera_six

__all__ = ["DETECTION_PROBABILITY", "ENTROPY_METRICS", "MOST_CAMERAS", "expected_log_determinant"]


# Probability that a camera that sees the point detects it, independently of the others.
DETECTION_PROBABILITY = 0.9
# 2⁸ subsets of cameras are summed.
MOST_CAMERAS = 8
# Bounds the memory: 256 subsets × 6 entries × this many points.
POINTS_AT_ONCE = 4096


def expected_log_determinant(evaluation: Evaluation, probability: float = DETECTION_PROBABILITY) -> Floats:
    """Σ over subsets s of the cameras of w_s·ln det P_s⁺, of m⁶, (N,).

    P_s⁺ = (Π + Σ_{i∈s} HᵀR⁻¹H)⁻¹ and w_s = p^|s|·(1 − p)^(C − |s|); cameras that do not see the point contribute
    nothing, and the weights of their subsets sum to one. The prior's Π is P∞⁻¹ + I/σ² with σ = `PRIOR_SIGMA_M`, without
    P∞⁻¹ where the point is unobservable. Of more than `MOST_CAMERAS` cameras, those with the most information (tr
    HᵀR⁻¹H) are enumerated, and each of the others contributes p·HᵀR⁻¹H with certainty, which is slightly optimistic.
    Other sensors enter through P∞ only.
    """
    prior = np.broadcast_to(np.eye(3) / PRIOR_SIGMA_M**2, (len(evaluation.observable), 3, 3)).copy()
    seen = evaluation.observable
    prior[seen] += np.linalg.inv(evaluation.covariance[seen, :3, :3])
    base, cameras = to_six(prior), camera_six(evaluation)
    if len(cameras) > MOST_CAMERAS:
        order = np.argsort(-(cameras[:, 0] + cameras[:, 3] + cameras[:, 5]), axis=0, kind="stable")
        cameras = np.take_along_axis(cameras, order[:, None], axis=0)
        base = base + probability * cameras[MOST_CAMERAS:].sum(axis=0)
        cameras = cameras[:MOST_CAMERAS]
    subsets = np.array(list(itertools.product((0.0, 1.0), repeat=len(cameras))))
    weights = np.where(subsets > 0, probability, 1 - probability).prod(axis=1)
    found = np.empty(len(seen))
    for start in range(0, len(seen), POINTS_AT_ONCE):
        part = slice(start, start + POINTS_AT_ONCE)
        six = base[:, part] + np.tensordot(subsets, cameras[..., part], axes=1)
        found[part] = -weights @ _log_determinant(six.swapaxes(0, 1))
    return found


def _log_determinant(six: Floats) -> Floats:
    """Of positive definite matrices (6, ...), by the pivots of Gauss's elimination, which are all positive."""
    a, b, c, d, e, f = six
    second = d - b * b / a
    coupling = e - b * c / a
    return np.asarray(np.log(a) + np.log(second) + np.log(f - c * c / a - coupling * coupling / second))


ENTROPY_METRICS: tuple[Metric, ...] = (
    # According to the abstract: expected conditional entropy, over whether an observation is made. That each camera
    # that sees the point makes one with the same probability, and that P∞ is the prior, is our reading.
    Metric.over_points(
        "entropy",
        expected_log_determinant,
        False,
        "after Denzler, Zobel and Niemann 2003",
        "after",
        f"prior of {PRIOR_SIGMA_M:g} m",
    ),
)
