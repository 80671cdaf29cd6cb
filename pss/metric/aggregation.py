"""From σ∞ at each point to one number (section 3.3): norms, weights, objects, and the treatment of unobservable points.

Eq. 10 is `Aggregation()`: the mean of 1/σ∞ over all points, where unobservable ones contribute 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.errors import RangeError, ShapeError
from pss.hints import Floats
from pss.inputs import labels, numbers
from pss.metric.evaluation import Evaluation
from pss.processes.process import RandomWalk

__all__ = ["Aggregation", "bounded_by_volume", "cover_all", "environment_size_m", "grown_from_previous"]


Norm = Literal["inverse", "1", "2", "inf"]
Across = Literal["points", "mean", "worst"]


@dataclass(frozen=True, eq=False)
class Aggregation:
    """One number from σ at N points.

    Attributes:
        norm: "inverse", the mean of 1/σ (Eq. 10; higher is better); or of σ itself, lower is better: "1", the mean;
            "2", the root of the mean square; "inf", the largest.
        weights: of the points, 0 or more, (N,); None weights all equally. "inf" ignores points of weight 0.
        objects: label of each point's object, (N,); None treats all points as one object.
        priorities: weight by object label, which multiplies the weights of its points or of its number; 1 if not named.
        across: "points" pools all points; "mean" is the mean of the objects' numbers, whatever their counts of points;
            "worst" is the worst object's number.
        unobservable: "ignore" excludes them from sums over σ, and from the sum of 1/σ, while they still count in its
            denominator, as in Eq. 10; "drop" excludes them from the denominator too; a number or (N,) in metres is
            their σ: the size of the environment, the previous value, or a heuristic bound.

    Raises:
        RangeError: an unknown norm or option, negative weights, or an object in `priorities` that no point belongs to.
        ShapeError: arrays of another length than the points.
    """

    norm: Norm = "inverse"
    weights: ArrayLike | None = None
    objects: Sequence[str] | NDArray[np.str_] | None = None
    priorities: Mapping[str, float] | None = None
    across: Across = "points"
    unobservable: Literal["ignore", "drop"] | float | Floats = "ignore"

    def __post_init__(self) -> None:
        for name, value, allowed in (
            ("norm", self.norm, get_args(Norm)),
            ("across", self.across, get_args(Across)),
        ):
            if value not in allowed:
                raise RangeError(f"{name} = {value!r}; allowed: {', '.join(allowed)}")
        if isinstance(self.unobservable, str) and self.unobservable not in ("ignore", "drop"):
            raise RangeError(f"unobservable = {self.unobservable!r}; allowed: ignore, drop, or metres")
        if not isinstance(self.unobservable, str):
            sigma = numbers(self.unobservable, "unobservable", "ignore, drop, or metres")
            if not (sigma > 0).all():
                raise RangeError(f"unobservable = {self.unobservable!r}; allowed: above 0, in metres")
            object.__setattr__(self, "unobservable", sigma if sigma.ndim else float(sigma))
        if self.weights is not None:
            weights = numbers(self.weights, "weights", "(N,)")
            if not (weights >= 0).all():
                raise RangeError(f"a weight is {weights.min()!r}; allowed: 0 or more")
            object.__setattr__(self, "weights", weights)
        if self.objects is not None:
            object.__setattr__(self, "objects", labels(self.objects, "objects"))
        for label, priority in (self.priorities or {}).items():
            if not 0 <= priority < np.inf:
                raise RangeError(f"priority of {label!r} = {priority!r}; allowed: 0 or more, finite")
            if self.objects is None or label not in set(self.objects):
                raise RangeError(f"priorities name {label!r}; allowed: the labels in objects")

    @property
    def higher_is_better(self) -> bool:
        """Whether higher numbers are better."""
        return self.norm == "inverse"

    def of_objects(self, sigma_m: ArrayLike) -> dict[str, float]:
        """Number of each object on its own, from σ in metres (N,), nan where unobservable; priorities are ignored."""
        sigma, weights, names = self._checked(sigma_m)
        own = {label: names == label for label in dict.fromkeys(names.tolist())}
        return {label: self._number(sigma[mask], weights[mask]) for label, mask in own.items()}

    def __call__(self, sigma_m: ArrayLike) -> float:
        """The number, in 1/m for "inverse", else in m, from σ in metres (N,), nan where unobservable.

        Raises:
            RangeError: σ not above 0, or no object with a priority above 0.
            ShapeError: arrays of another length than the points.
        """
        sigma, weights, names = self._checked(sigma_m)
        priorities = self.priorities or {}
        if self.across == "points":
            return self._number(sigma, weights * np.array([priorities.get(label, 1.0) for label in names]))
        own = self.of_objects(sigma)
        counted = {label: number for label, number in own.items() if priorities.get(label, 1.0) > 0}
        if not counted:
            raise RangeError("all objects have priority 0; allowed: one above")
        if self.across == "worst":
            return min(counted.values()) if self.higher_is_better else max(counted.values())
        shares = np.array([priorities.get(label, 1.0) for label in counted])
        return float(shares @ np.array(list(counted.values())) / shares.sum())

    def _checked(self, sigma_m: ArrayLike) -> tuple[Floats, Floats, NDArray[np.str_]]:
        sigma = numbers(sigma_m, "sigma_m", "(N,)")
        if sigma.ndim != 1 or len(sigma) == 0:
            raise ShapeError(f"sigma_m has shape {sigma.shape}; allowed: (N,) with at least one point")
        if (sigma <= 0).any():
            raise RangeError(f"sigma_m holds {sigma[sigma <= 0][0]!r}; allowed: above 0, or nan where unobservable")
        weights = np.ones(len(sigma)) if self.weights is None else numbers(self.weights, "weights", "(N,)")
        names = np.full(len(sigma), "") if self.objects is None else labels(self.objects, "objects")
        for name, value in (("weights", weights), ("objects", names)):
            if value.shape != sigma.shape:
                raise ShapeError(f"{name} has shape {value.shape}; allowed: {sigma.shape}, that of the points")
        if not isinstance(self.unobservable, str):
            if np.ndim(self.unobservable) and np.shape(self.unobservable) != sigma.shape:
                raise ShapeError(f"unobservable has shape {np.shape(self.unobservable)}; allowed: {sigma.shape}")
            sigma = np.where(np.isnan(sigma), self.unobservable, sigma)
        return sigma, weights, names

    def _number(self, sigma: Floats, weights: Floats) -> float:
        known = np.isfinite(sigma) & (weights > 0)
        if self.norm == "inverse":
            total = weights[known].sum() if self.unobservable == "drop" else weights.sum()
            return float((weights[known] / sigma[known]).sum() / total) if total > 0 else 0.0
        if not known.any():
            return float("inf")
        sigma, weights = sigma[known], weights[known]
        if self.norm == "inf":
            return float(sigma.max())
        power = int(self.norm)
        return float((weights @ sigma**power / weights.sum()) ** (1 / power))


def environment_size_m(lowest_m: ArrayLike, highest_m: ArrayLike) -> float:
    """Metres, the diagonal of the box between two corners (3,): the paper's bound at unobservable points (section 3.3).

    Raises:
        RangeError: a corner is not below the other.
    """
    sides = _sides(lowest_m, highest_m)
    return float(np.linalg.norm(sides))


def grown_from_previous(previous_sigma_m: ArrayLike, process: RandomWalk, frames: int) -> Floats:
    """Metres, (N,): σ of points resolved to `previous_sigma_m` (N,) that were unobservable for `frames` frames since.

    A random walk adds its step's variance in each frame; nan stays nan.

    Raises:
        RangeError: `frames` is negative.
    """
    if frames < 0:
        raise RangeError(f"frames = {frames!r}; allowed: 0 or more")
    return np.asarray(np.sqrt(numbers(previous_sigma_m, "previous_sigma_m", "(N,)") ** 2 + frames * process.Q[0, 0]))


def bounded_by_volume(evaluation: Evaluation, lowest_m: ArrayLike, highest_m: ArrayLike) -> Floats:
    """Metres, (N,): σ∞ of observable points; elsewhere √λmax of the information plus that of lying in a box.

    A uniform distribution in a box of sides s has a variance of s²/12 along each. The information of a single camera
    adds to it, so that a point seen once is bounded by the box along the ray only.

    Args:
        evaluation: of N points.
        lowest_m, highest_m: m, corners of the box, (3,) for all points or (N, 3).

    Raises:
        RangeError: a corner is not below the other.
        ShapeError: corners of another shape.
    """
    sides = np.broadcast_to(_sides(lowest_m, highest_m), (len(evaluation.sigma_m), 3))
    known = evaluation.information[:, :3, :3] + (12 / sides**2)[:, :, None] * np.eye(3)
    bound = 1 / np.sqrt(np.linalg.eigvalsh(known)[:, 0])
    return np.asarray(np.where(evaluation.observable, evaluation.sigma_m, bound))


def cover_all(sigma_m: ArrayLike, objects: ArrayLike, share: float = 1.0) -> float:
    """A score that ranks by coverage first, then by mean inverse σ; no unit. Higher is better.

    An object is covered if at least `share` of its points are observable. The integer part is the number of covered
    objects; the fraction grows with the worst object's mean of 1/σ (m⁻¹, Eq. 10). Between configurations that cover
    equally many objects the more precise one wins, and no gain in precision outweighs the loss of an object.

    Args:
        sigma_m: m, (N,), nan where unobservable.
        objects: label of each point's object, (N,).
        share: share of an object's points that must be observable, above 0, at most 1.

    Raises:
        RangeError: a share out of range.
    """
    if not 0 < share <= 1:
        raise RangeError(f"share = {share!r}; allowed: above 0, at most 1")
    sigma, names = numbers(sigma_m, "sigma_m", "(N,)"), labels(objects, "objects")
    own = Aggregation(objects=names, across="mean").of_objects(sigma)
    covered = sum(float(np.isfinite(sigma[names == label]).mean()) >= share for label in own)
    worst = min(own.values())
    return covered + worst / (1.0 + worst)


def _sides(lowest_m: ArrayLike, highest_m: ArrayLike) -> Floats:
    high, low = numbers(highest_m, "highest_m", "(3,) or (N, 3)"), numbers(lowest_m, "lowest_m", "(3,) or (N, 3)")
    try:
        sides = high - low
    except ValueError as error:
        raise ShapeError(f"a box's corners: {error}; allowed: (3,) or (N, 3)") from None
    if sides.shape[-1:] != (3,):
        raise ShapeError(f"a box's corners differ by shape {sides.shape}; allowed: (3,) or (N, 3)")
    if not (sides > 0).all():
        raise RangeError(f"a box has a side of {sides.min()!r} m; allowed: above 0")
    return np.asarray(sides)
