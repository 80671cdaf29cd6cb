"""Expectations over which cameras find a point, each with its own probability.

Given the views, detections by different cameras are independent: a camera's blur, size, angle and noise are part of its
own probability. A set S of the cameras finds the point with probability Π p Π (1 − p), and an expectation is a sum over
the sets. A set that does not determine the point (fewer than two cameras, or two collinear with it) counts as not
finding it.

Up to `EXACT_CAMERAS` cameras with 0 < p < 1 at a point, all their sets are summed. For more, the sum is over
`DRAWN_SETS` sets drawn with a fixed seed, in antithetic pairs (u and 1 − u): a mean is then accurate to about 1/64 of
the standard deviation over the sets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats
from pss.processes.steady_state import resolvable
from pss.riccati.covariances import from_six

__all__ = ["Expected", "expected", "probability_of_at_least"]


EXACT_CAMERAS = 8
DRAWN_SETS = 4096
DRAWING_SEED = 1
# Sets times points at once.
CASES_AT_ONCE = 65536


@dataclass(frozen=True, eq=False)
class Expected:
    """Expectations at N points.

    Attributes:
        found: probability that the set of cameras that find the point determines it, (N,).
        inverse_sigma: 1/m, E[1/√λmax C_S], with 0 for a set that does not determine it, (N,).
        covariance_m2: m², E[C_S | found], (N, 3, 3); nan where `found` is 0.
        information: 1/m², E[Λ_S | found], entries xx, xy, xz, yy, yz, zz, (6, N); 0 where `found` is 0.
    """

    found: Floats
    inverse_sigma: Floats
    covariance_m2: Floats
    information: Floats


def expected(information: Floats, probability: Floats, always: Floats | None = None) -> Expected:
    """Expectations over the sets of C cameras that find N points.

    Args:
        information: 1/m², HᵀR⁻¹H of each camera if it finds the point, six entries, (C, 6, N).
        probability: probability that a camera finds the point, (C, N).
        always: 1/m², six entries of the information available in any case, (6, N).
    """
    N = probability.shape[1]
    sure = probability >= 1
    base = np.where(sure[:, None], information, 0.0).sum(axis=0) + (0.0 if always is None else always)
    result = Expected(np.zeros(N), np.zeros(N), np.full((N, 3, 3), np.nan), np.zeros((6, N)))
    open_ = (probability > 0) & ~sure
    counts = open_.sum(axis=0)
    for count in np.unique(counts).tolist():
        points = np.flatnonzero(counts == count)
        sets = 2**count if count <= EXACT_CAMERAS else DRAWN_SETS
        at_once = max(1, CASES_AT_ONCE // sets)
        for start in range(0, len(points), at_once):
            part = points[start : start + at_once]
            order = np.argsort(~open_[:, part], axis=0, kind="stable")[:count]
            p = probability[order, part]
            of_cameras = information[order[:, None], np.arange(6)[None, :, None], part]
            member, weight = _sets(p)
            _fill(result, part, base[:, part] + np.einsum("scn,cen->sen", member, of_cameras), weight)
    return result


def _sets(p: Floats) -> tuple[Floats, Floats]:
    """Sets of c cameras with probabilities (c, n): their members, (S, c, n), and the sets' probabilities, (S, n)."""
    count, points = p.shape
    if count <= EXACT_CAMERAS:
        bits = (np.arange(2**count)[:, None] >> np.arange(count)) & 1
        member = np.broadcast_to(bits[:, :, None].astype(float), (2**count, count, points))
        return member, np.where(member > 0, p, 1 - p).prod(axis=1)
    drawn = np.random.default_rng(DRAWING_SEED).uniform(size=(DRAWN_SETS // 2, count, 1))
    member = (np.concatenate([drawn, 1 - drawn]) < p).astype(float)
    return member, np.full((DRAWN_SETS, points), 1 / DRAWN_SETS)


def _fill(result: Expected, part: NDArray[np.intp], information: Floats, weight: Floats) -> None:
    """Add the sums over sets with information (S, 6, n) and probabilities (S, n) to the points `part` of `result`."""
    fixed, smallest = resolvable(information)
    weight = np.where(fixed, weight, 0.0)
    found = weight.sum(axis=0)
    safe = np.where(found > 0, found, 1.0)
    result.found[part] = np.minimum(found, 1.0)
    result.inverse_sigma[part] = (weight * np.sqrt(np.maximum(smallest, 0.0))).sum(axis=0)
    result.information[:, part] = np.einsum("sn,sen->en", weight, information) / safe
    of_set, point = np.nonzero(weight > 0)
    covariance = np.zeros((*weight.shape, 3, 3))
    covariance[of_set, point] = np.linalg.inv(from_six(information[of_set, :, point].T))
    total = np.einsum("sn,snij->nij", weight, covariance)
    result.covariance_m2[part] = np.where((found > 0)[:, None, None], total / safe[:, None, None], np.nan)


def probability_of_at_least(probability: Floats, most: int) -> Floats:
    """Probability that at least 1, 2, …, `most` of C cameras with probabilities (C, N) find a point, (most, N)."""
    exactly = np.zeros((most, probability.shape[1]))
    exactly[0] = 1.0
    for p in probability:
        exactly[1:] = exactly[1:] * (1 - p) + exactly[:-1] * p
        exactly[0] *= 1 - p
    return np.asarray(1 - np.cumsum(exactly, axis=0))
