"""What several rivals share: directions, pairs of views, inverses, and conventions for unobservable points.

They use cameras only. Other sensors enter where a metric uses J or C of the evaluation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pss.hints import Bools, Floats, Indices
from pss.metric.evaluation import Evaluation
from pss.metric.table import Metric, Status
from pss.processes.steady_state import resolvable
from pss.riccati.covariances import to_six

__all__ = ["Pairs", "both_conventions", "camera_six", "directions", "largest_sigma_m", "resolvable_six", "view_pairs"]


def directions(evaluation: Evaluation) -> Floats:
    """Unit vectors from the points to the cameras, (C, N, 3); zero at a lens centre."""
    away = evaluation.views.arrays.position_m[:, None] - evaluation.points_m
    range_m = evaluation.views.range_m
    return np.asarray(away / np.where(range_m > 0, range_m, 1.0)[..., None])


@dataclass(frozen=True, eq=False)
class Pairs:
    """The P = C(C − 1)/2 pairs of cameras at N points.

    Attributes:
        first, second: their cameras, (P,).
        seen: whether both see the point, (P, N).
        cos, sin: of the angle at the point between them; sin is 0 or more, (P, N).
    """

    first: Indices
    second: Indices
    seen: Bools
    cos: Floats
    sin: Floats


def view_pairs(evaluation: Evaluation) -> Pairs:
    """All pairs of the evaluation's cameras."""
    first, second = np.triu_indices(len(evaluation.cameras), 1)
    towards = directions(evaluation)
    one, other = towards[first], towards[second]
    # The cross product is accurate for nearly parallel rays, where 1 − cos² would cancel.
    sin = np.linalg.norm(np.cross(one, other), axis=-1)
    seen = evaluation.visible[first] & evaluation.visible[second]
    return Pairs(first, second, seen, np.einsum("pni,pni->pn", one, other), np.minimum(sin, 1.0))


def camera_six(evaluation: Evaluation) -> Floats:
    """1/m², HᵀR⁻¹H of each camera, entries xx, xy, xz, yy, yz, zz, (C, 6, N); zero where not visible."""
    C, N = evaluation.visible.shape
    return to_six(evaluation.camera_information.reshape(-1, 3, 3)).reshape(6, C, N).swapaxes(0, 1)


def resolvable_six(six: Floats) -> tuple[Bools, Floats]:
    """Whether measurements determine all three coordinates, by the rule of `pss.evaluate`, and λmin in 1/m².

    Args:
        six: 1/m², entries xx, xy, xz, yy, yz, zz of information matrices, (6, M).

    Returns:
        (M,) both; λmin is 0 where nothing is measured.
    """
    fixed, smallest = resolvable(six[None])
    return fixed[0], smallest[0]


def largest_sigma_m(six: Floats) -> Floats:
    """Metres, √λmax of the inverses of information matrices (6, M) in 1/m²; ∞ where it has no inverse, (M,)."""
    fixed, smallest = resolvable_six(six)
    return np.where(fixed, 1 / np.sqrt(np.where(fixed, smallest, 1.0)), np.inf)


def both_conventions(
    name: str,
    values: Callable[[Evaluation], Floats],
    sigma: Callable[[Floats], Floats],
    reference: str,
    status: Status,
    *,
    worst: bool = False,
) -> tuple[Metric, Metric]:
    """A metric of which less is better, by its own convention and by that of Eq. 10.

    The former is the mean over the points (or the `worst`), ∞ if a single one is unobservable. The latter, named
    "-count-zero", is the mean of 1/σ over all points, in which unobservable ones count zero, so that more is better.

    Args:
        values: from an evaluation to a number for each point, (N,), ∞ where it is unobservable.
        sigma: from these numbers to an equivalent standard deviation; ∞ stays ∞.
    """

    infinite = "infinite if a point is unobservable"
    if worst:
        own = Metric(name, lambda evaluation: float(values(evaluation).max()), False, reference, status, infinite)
    else:
        own = Metric.over_points(name, values, False, reference, status, infinite)
    return own, Metric.over_points(
        f"{name}-count-zero",
        lambda evaluation: np.asarray(1 / sigma(values(evaluation))),
        True,
        f"{reference}; averaged as in Eq. 10",
        status,
        "count zero",
    )
