"""Rivals that rotate an occluder about each point: a vertical half-space that hides the cameras behind it.

The occluder's border passes through the point. It faces the azimuth ω, and the cameras less than 90° of azimuth from ω
remain visible. As ω rotates, the set of remaining cameras changes only at their azimuths ± 90°, so that 2C sectors
describe it completely. A camera straight above or below has no azimuth and is never hidden.
"""

from __future__ import annotations

import numpy as np

from pss.hints import Bools, Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric
from pss.rivals.angles import triangulable
from pss.rivals.shared import camera_six, directions, largest_sigma_m, view_pairs

__all__ = ["BOUND_M", "OCCLUSION_METRICS", "dynamic_occlusion_deg", "occluded_error_m", "sectors"]


# m, the error of an unmeasured point: about the diagonal of a room of 6 m by 6 m by 3 m.
BOUND_M = 10.0
# Horizontal component of a unit vector up to which it counts as vertical.
VERTICAL = 1e-9


def sectors(evaluation: Evaluation) -> tuple[Floats, Bools]:
    """Sectors of the occluder's azimuth: their widths in rad, (S, N), and the cameras that see the point, (S, C, N)."""
    C, N = evaluation.visible.shape
    if C == 0:
        return np.full((1, N), 2 * np.pi), np.zeros((1, 0, N), dtype=np.bool_)
    x, y = np.moveaxis(directions(evaluation)[..., :2], -1, 0)
    azimuth = np.arctan2(y, x)
    edges = np.sort(np.mod(np.concatenate([azimuth + np.pi / 2, azimuth - np.pi / 2]), 2 * np.pi), axis=0)
    widths = np.diff(edges, axis=0, append=edges[:1] + 2 * np.pi)
    middle = (edges + widths / 2)[:, None]
    in_front = x * np.cos(middle) + y * np.sin(middle) > 0
    return widths, evaluation.visible & (in_front | (np.hypot(x, y) < VERTICAL))


def dynamic_occlusion_deg(evaluation: Evaluation) -> Floats:
    """Degrees of the occluder's azimuth without a remaining pair of cameras 40° to 140° apart, (N,), 0 to 360.

    Less is better. After Rahimian and Kearney 2017.
    """
    pairs = view_pairs(evaluation)
    usable = triangulable(pairs)
    widths, left = sectors(evaluation)
    lost = np.zeros(usable.shape[1])
    for width, cameras in zip(widths, left, strict=True):
        lost += np.where((usable & cameras[pairs.first] & cameras[pairs.second]).any(axis=0), 0.0, width)
    return np.degrees(lost)


def occluded_error_m(evaluation: Evaluation) -> Floats:
    """Metres, mean over the occluder's azimuth of √λmax(C) of the remaining cameras, at most `BOUND_M`, (N,).

    Less is better. After Chen and Davis 2000 and 2008. According to the abstract: expected error over occluders in all
    directions. That the error is √λmax(C), the occluder a half-space, all azimuths equally likely, and the error with
    fewer than two cameras `BOUND_M`, is our reading.
    """
    widths, left = sectors(evaluation)
    six = np.einsum("scn,cen->esn", left.astype(float), camera_six(evaluation))
    error = np.minimum(largest_sigma_m(six.reshape(6, -1)).reshape(widths.shape), BOUND_M)
    return np.asarray((widths * error).sum(axis=0) / (2 * np.pi))


OCCLUSION_METRICS: tuple[Metric, ...] = (
    Metric.over_points(
        "dynamic-occlusion", dynamic_occlusion_deg, False, "after Rahimian and Kearney 2017", "read", "count 360°"
    ),
    Metric.over_points(
        "occlusion-robustness",
        occluded_error_m,
        False,
        "after Chen and Davis 2000, 2008",
        "after",
        f"count {BOUND_M:g} m",
    ),
)
