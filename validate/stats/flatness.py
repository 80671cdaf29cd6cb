"""Whether PSS over the steps of a sweep differs by more than chance, corrected for choosing its highest and lowest.

The highest and the lowest of equal steps differ by chance alone, and the more so the more steps there are. Two
questions:

**For these markers**, is any step better than another? If none is, the errors of a trial might as well have come from
any step: which step each belongs to is drawn anew, trial by trial, and the range of measured PSS over the steps is
compared with the ranges that this makes (`exchanged_ranges`). That is exact: 95 % of the sweeps whose steps have
errors alike are called flat, whatever the errors' distribution, and whatever the points of a trial have in common.

**With other markers of this kind**, would it be so again? That needs resamples of points, too (`least_difference`).
Trials alone show the variance Vt + Vtp, points alone Vp + Vtp, and both at once Vt + Vp + 3 Vtp, since a product of two
weights varies three times as much as either. So twice the sum of the first two less the third is Vt + Vp + Vtp (Owen &
Eckles 2012 state the bias of product weights). Dirichlet's weights have (n − 1)/(n + 1) of the variance that n trials
or points have: corrected as well. Of made-up flat sweeps 94 to 99 % stay below it, 87 to 94 % where all points of a
trial err together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pss.hints import Floats
from pss.riccati.covariances import largest_standard_deviation
from validate.stats.intervals import LEVEL
from validate.stats.measured_errors import MeasuredErrors, measured_inverse_sigma

__all__ = ["EXCHANGES", "exchanged_ranges", "is_flat", "least_difference", "spread_of_points"]


# A p-value of 0.05 needs 19 or more; with 199 it is known to 0.015.
EXCHANGES = 199


def is_flat(values: Floats, ranges: Floats) -> bool:
    """Whether the range of (S,) values is one of those that chance makes in 95 % of flat sweeps."""
    as_large = int((ranges >= np.ptp(values)).sum())
    return (1 + as_large) / (1 + len(ranges)) > 1 - LEVEL


def exchanged_ranges(errors: Sequence[MeasuredErrors], rng: np.random.Generator, exchanges: int = EXCHANGES) -> Floats:
    """1/m, highest less lowest measured PSS over the steps, with the steps exchanged within each trial.

    Args:
        errors: one for each of S steps, all of T trials and N points.
    """
    errors_m = np.array([each.errors_m for each in errors])
    detected = ~np.isnan(errors_m[..., 0])
    known = np.where(detected[..., None], errors_m, 0.0)
    i, j = np.triu_indices(3)
    # Of each step and trial: detections and products of each point.
    terms = np.concatenate([detected[..., None], known[..., i] * known[..., j]], axis=-1)
    steps, trials, _, _ = terms.shape
    found = np.empty(exchanges)
    for number in range(exchanges):
        order = rng.permuted(np.tile(np.arange(steps), (trials, 1)), axis=1)
        sums = terms[order, np.arange(trials)[:, None]].sum(axis=0)
        found[number] = np.ptp(_pss(sums, trials))
    return found


def _pss(sums: Floats, trials: int) -> Floats:
    """1/m, (S,), measured PSS from each point's detections and summed products, (S, N, 7)."""
    counts = sums[..., 0]
    moments = np.empty((*counts.shape, 3, 3))
    i, j = np.triu_indices(3)
    with np.errstate(invalid="ignore"):  # a point that was never found: nan, which counts zero
        moments[..., i, j] = moments[..., j, i] = sums[..., 1:] / counts[..., None]
    terms = measured_inverse_sigma(largest_standard_deviation(moments), counts / trials, counts)
    return np.asarray(terms.mean(axis=-1))


def least_difference(
    values: Floats, of_trials: Floats, of_points: Floats, of_both: Floats, trials: int, points: int
) -> float:
    """The difference between two of S steps that chance reaches in 5 % of flat sweeps, in the values' unit.

    Args:
        values: (S,), what was found.
        of_trials, of_points, of_both: (B, S), with the trials, the points, or both resampled; rows with shared weights.
        trials, points: how many there are, T and N.

    Returns:
        nan where there are no resamples, or fewer than two trials or points.
    """
    if min(trials, points) < 2:
        return float("nan")
    by_trials, by_points, by_both = (_range(values, samples) ** 2 for samples in (of_trials, of_points, of_both))
    trials_factor, points_factor = (trials + 1) / (trials - 1), (points + 1) / (points - 1)
    by_trials, by_points = by_trials * trials_factor, by_points * points_factor
    squared = 2 * (by_trials + by_points) - by_both * np.sqrt(trials_factor * points_factor)
    # By chance the sum may fall below what either source makes by itself.
    return float(np.sqrt(max(squared, by_trials, by_points)))


def spread_of_points(values: Floats, of_points: Floats, points: int) -> float:
    """`least_difference` of values whose only chance is in which points there are, such as those of a long record."""
    return float("nan") if points < 2 else _range(values, of_points) * float(np.sqrt((points + 1) / (points - 1)))


def _range(values: Floats, samples: Floats) -> float:
    """The range over the steps that 95 % of the resampled deviations stay below."""
    return float(np.quantile(np.ptp(samples - values, axis=1), LEVEL))
