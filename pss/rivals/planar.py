"""The planar best linear estimator: cameras as bearings in the horizontal plane of the point."""

from __future__ import annotations

import numpy as np

from pss.hints import Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric
from pss.processes.steady_state import SMALLEST_INFORMATION_RATIO
from pss.rivals.occlusion import VERTICAL
from pss.rivals.shared import both_conventions, directions, view_pairs

__all__ = ["PLANAR_METRICS", "planar_variance_m2", "planar_weights"]


def planar_weights(evaluation: Evaluation) -> tuple[Floats, Floats]:
    """Weight of each camera's measurement across its line of sight in the horizontal plane.

    Returns:
        w = nᵀHᵀR⁻¹Hn = 1/σ² in 1/m², (C, N), where σ² is R propagated to the point's distance, with the point's height
        and its position along the ray given; and n, the horizontal unit vector across the line of sight, (C, N, 2). A
        camera straight above or below has weight zero.
    """
    x, y = np.moveaxis(directions(evaluation)[..., :2], -1, 0)
    length = np.hypot(x, y)
    level = length > VERTICAL
    across = np.stack([-y, x], axis=-1) * np.where(level, 1 / np.where(level, length, 1.0), 0.0)[..., None]
    return np.einsum("cni,cnij,cnj->cn", across, evaluation.camera_information[..., :2, :2], across), across


def planar_variance_m2(evaluation: Evaluation) -> Floats:
    """m², tr J⁻¹ in the plane, (N,); ∞ where the rays are parallel or fewer than two.

    4W/(W² − (Σ w cos 2θ)² − (Σ w sin 2θ)²) with W = Σ w and the azimuth θ of a camera. The denominator is computed as
    4 Σ_{i<j} w_i w_j sin²(θ_i − θ_j), which is accurate for nearly parallel rays too.
    Source: Ercan, Yang, El Gamal and Guibas.
    """
    weight, across = planar_weights(evaluation)
    pairs = view_pairs(evaluation)
    one, other = across[pairs.first], across[pairs.second]
    sin = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    crossed = (weight[pairs.first] * weight[pairs.second] * sin**2).sum(axis=0)
    total = weight.sum(axis=0)
    known = crossed > SMALLEST_INFORMATION_RATIO * total**2
    return np.where(known, total / np.where(known, crossed, 1.0), np.inf)


PLANAR_METRICS: tuple[Metric, ...] = both_conventions(
    "planar-estimator", planar_variance_m2, np.sqrt, "Ercan, Yang, El Gamal and Guibas, planar estimator", "checked"
)
