"""The metrics by name: PSS, the paper's other measures, and the rivals."""

from __future__ import annotations

import numpy as np

from pss.hints import Floats
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric, MetricTable
from pss.rivals import RIVALS
from pss.visibility.expected import probability_of_at_least

__all__ = ["CAMERAS_TO_OBSERVE", "METRICS"]


# The paper's definition of an observable point: c ≥ 2 cameras see it (section 3.2).
CAMERAS_TO_OBSERVE = 2


def _visible_twice(evaluation: Evaluation) -> Floats:
    """Whether at least two cameras see each point, (N,), or the probability that they find it, for `visible-share`."""
    if evaluation.detection is not None:
        return np.asarray(probability_of_at_least(evaluation.detection, CAMERAS_TO_OBSERVE)[-1])
    return np.asarray(evaluation.visible.sum(axis=0) >= CAMERAS_TO_OBSERVE, dtype=float)


def _worst_sigma(evaluation: Evaluation) -> float:
    """m, the ∞-norm of section 3.3 over the observable points; ∞ where none is."""
    sigma = evaluation.sigma_m[evaluation.observable]
    return float(sigma.max()) if len(sigma) else np.inf


ZERO = "count zero"
OF_THE_PAPER = (
    Metric.over_points("pss", lambda e: e.inverse_sigma, True, "Eq. 10", "paper", ZERO),
    Metric.over_points(
        "pss-single-frame", lambda e: e.single_frame_inverse_sigma, True, "Eq. 10 with C for P∞", "ours", ZERO
    ),
    Metric("worst-sigma", _worst_sigma, False, "Eq. 9, ∞-norm of section 3.3", "paper", "left out"),
    Metric.over_points(
        "visible-share", _visible_twice, True, "share of points that two cameras or more see", "ours", ZERO
    ),
)

METRICS = MetricTable((*OF_THE_PAPER, *RIVALS))
