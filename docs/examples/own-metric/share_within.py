"""Metrics of one's own: the share of points that a network resolves to a tolerance."""

import numpy as np

from pss import Evaluation, Metric

# What a gripper allows, in m.
TOLERANCE_M = 0.005


def within_tolerance(evaluation: Evaluation) -> float:
    """Share of the points whose σ∞ is at most the tolerance, 0 to 1; what is not observable (nan) is not within."""
    return float(np.mean(evaluation.sigma_m <= TOLERANCE_M))


def median_sigma_m(evaluation: Evaluation) -> float:
    """m, median σ∞ of all points, the unobservable ones counted as infinitely bad."""
    return float(np.median(np.where(evaluation.observable, evaluation.sigma_m, np.inf)))


METRICS = (
    Metric("share-within-5-mm", within_tolerance, higher_is_better=True, reference="own", unobservable="count zero"),
    Metric("median-sigma", median_sigma_m, higher_is_better=False, reference="own", unobservable="count as infinite"),
)
