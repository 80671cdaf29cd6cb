"""Intervals of statistics over configurations that share cameras, views and points: a jackknife crossed over them.

Each camera, view and point is left out once, with all configurations that have it; nothing is drawn, so that there is
no number of resamples on which an interval depends. The variance of a statistic is the sum of

* what the views explain, or the cameras with their views where that is more. A configuration of c of G cameras is left
  out with each of its cameras, so that its own chance is counted c(G − 1)/(G − c) times by the cameras, and c times by
  the views; a jackknife over groups of configurations measures it, and it is counted once;
* what the points explain.

The deviation is that of a t variable: with G − 1 degrees of freedom where the cameras explain more than their views
(Satterthwaite 1946 for the sum). Correlations are taken on Fisher's scale, positive means on the logarithm's, shares on
the logit's. Sources: Efron and Stein 1981; Owen 2007 (crossed factors); Wager, Hastie and Efron 2014 (the correction).

What an interval is for: the value that the statistic has on average over rooms of the same design, as many cameras,
views, points and trials, drawn anew. `tests/validate/stats/test_coverage.py` gives its coverage in made-up rooms.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.special
import scipy.stats
from numpy.typing import ArrayLike, NDArray

from pss.errors import RangeError, ShapeError
from pss.hints import Floats

__all__ = ["LEVEL", "Judged", "Resamples", "Scale", "deviations", "mean_over_draws", "with_interval"]

Scale = Literal["plain", "correlation", "positive", "share"]

LEVEL = 0.95
# Number of groups of configurations that are left out together, to estimate the variance due to configurations.
GROUPS = 50
# Closer to the end of its range than this a statistic has no scale of its own left.
AT_THE_END = 1e-12


@dataclass(frozen=True, eq=False)
class Resamples:
    """Weights with one unit left out, in the order cameras, views, groups of configurations, points.

    Attributes:
        views: of the configurations, (B, K), 0 or 1.
        points: (B, N), 0 or 1.
        cameras_of_configuration: c.
        units: how many rows are cameras (0: none, or every configuration has them all), views, groups and points.
    """

    views: Floats
    points: Floats
    cameras_of_configuration: int
    units: tuple[int, int, int, int]

    @classmethod
    def of_configurations(cls, views: ArrayLike, points: int, cameras: Sequence[str] | None = None) -> Resamples:
        """Resamples for configurations of views, and so many points.

        Args:
            views: (K, c), of each configuration the views it is made of, whole numbers of 0 and above.
            points: N.
            cameras: the camera of each view, (V,), whose views share what is peculiar to it; None: a view shares
                nothing with another.

        Raises:
            ShapeError: views that are not (K, c).
            RangeError: views that are no indices.
        """
        chosen = np.asarray(views)
        if chosen.ndim != 2 or not len(chosen):
            raise ShapeError(f"views {chosen.shape}; allowed: (K, c), with at least one configuration")
        if not np.issubdtype(chosen.dtype, np.integer) or chosen.min() < 0:
            raise RangeError(f"views of type {chosen.dtype}; allowed: whole numbers of 0 and above")
        count, size = chosen.shape
        without = []
        if cameras is not None:
            _, camera = np.unique(np.asarray(cameras), return_inverse=True)
            without.append(_without(camera[chosen]))
        without.append(_without(chosen))
        groups = min(GROUPS, count)
        # Neighbours in a sorted list of configurations share views; a stride puts them into different groups.
        without.append(_without((np.arange(count) % groups)[:, None]))
        if cameras is None:
            without.insert(0, np.empty((0, count)))
        elif not (without[0].sum(axis=1) > 0).all():  # a camera of all configurations is part of the design
            without[0] = np.empty((0, count))
        rows = sum(len(part) for part in without)
        return cls(
            np.concatenate([*without, np.ones((points, count))]),
            np.concatenate([np.ones((rows, points)), 1 - np.eye(points)]),
            size,
            (len(without[0]), len(without[1]), groups, points),
        )

    def of(self, values: Floats) -> Floats:
        """A metric or measure on each resample, (B, K): a mean over points (K, N), or a number as it is (K,).

        One infinite term of a point with weight makes a mean infinite.
        """
        if values.ndim == 1:
            return np.broadcast_to(values, (len(self.points), len(values)))
        # Only rows without a point differ: the others are the plain mean.
        rows, points = len(self.points) - self.units[3], self.units[3]
        infinite = np.isinf(values)
        finite = np.where(infinite, 0.0, values)
        total, unbounded = finite.sum(axis=1), np.where(infinite, values, 0.0)
        left = (total - finite.T) / max(points - 1, 1)
        mean = np.concatenate([np.broadcast_to(total / points, (rows, len(values))), left])
        if infinite.any():
            signs = np.sign(unbounded)
            of_all = signs.sum(axis=1)
            sign = np.concatenate([np.broadcast_to(of_all, (rows, len(values))), of_all - signs.T])
            mean = np.where(sign != 0, np.copysign(np.inf, sign), mean)
        return mean

    def judged(self, estimate: float, samples: Floats, bound: float = np.inf, scale: Scale | None = None) -> Judged:
        """A statistic, and itself on each of these resamples (B,).

        Args:
            bound: no statistic exceeds ± `bound`.
            scale: on which its deviations are taken; None: "correlation" with a bound of 1, else "plain".
        """
        return Judged(estimate, samples, self, bound, scale or ("correlation" if bound == 1 else "plain"))

    def parts(self, samples: Floats) -> tuple[Floats, ...]:
        """Of samples (B, …), those of cameras, views, groups and points."""
        return tuple(np.split(samples, np.cumsum(self.units)[:-1]))

    def variance(self, samples: Floats) -> tuple[float, float]:
        """Variance of a statistic from its samples (B,), and the degrees of freedom it is known with."""
        cameras, views, groups, points = (_jackknife(part) for part in self.parts(samples))
        of_views, excess = self.shares(cameras, views, groups)
        total = excess + of_views + points
        # Where the cameras explain more than their views, what their views explain is part of it.
        known = (excess + of_views) ** 2 / max(self.units[0] - 1, 1) if excess > 0 else of_views**2 / self._free(1)
        known += points**2 / self._free(3)
        return total, total**2 / known if known > 0 else np.inf

    def shares(self, cameras: float, views: float, groups: float) -> tuple[float, float]:
        """Of jackknife variances: what the views explain, with the configurations' own chance once, and the excess.

        The excess is what the cameras explain beyond their views, 0 or more.
        """
        size, count = self.cameras_of_configuration, self.units[0]
        of_views = max(views - (size - 1) * groups, groups)
        if not count:
            return of_views, 0.0
        of_cameras = cameras - ((count - 1) * size / (count - size) - 1) * groups
        return of_views, max(of_cameras - of_views, 0.0)

    def _free(self, part: int) -> int:
        return max(self.units[part] - 1, 1)


def _without(members: NDArray[np.int64]) -> Floats:
    """Rows of 0 for the configurations (K, c) that have a member, else 1, for each member: (members, K)."""
    names, index = np.unique(members, return_inverse=True)
    left = np.ones((len(names), len(members)))
    left[index.reshape(members.shape), np.arange(len(members))[:, None]] = 0.0
    return left


def _jackknife(samples: Floats) -> float:
    """Variance by the samples with one of n units left out; those of unknown value are taken to be as the others."""
    known = samples[np.isfinite(samples)]
    return float((len(samples) - 1) * known.var()) if len(known) > 1 else 0.0


@dataclass(frozen=True, eq=False)
class Judged:
    """A statistic, itself with each unit left out (B,), and its 95 % interval; no statistic exceeds ± `bound`.

    Of a mean over independent draws of something else (`mean_over_draws`), `of_draws` are its values in each.
    """

    estimate: float
    samples: Floats
    resamples: Resamples
    bound: float = np.inf
    scale: Scale = "plain"
    of_draws: tuple[float, ...] = ()

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval, which holds the estimate; nan where the statistic is not defined."""
        return self.ends()

    @cached_property
    def _known(self) -> bool:
        return bool(np.isfinite(self.estimate)) and bool(np.isfinite(self.samples).mean() > 0.5)

    def ends(self, level: float = LEVEL) -> tuple[float, float]:
        """Ends of the interval of some other level."""
        if not 0 < level < 1:
            raise RangeError(f"level = {level!r}; allowed: between 0 and 1")
        if not self._known:
            return float("nan"), float("nan")
        variance, free = self.resamples.variance(self.samples)
        if len(self.of_draws) > 1:
            drawn = float(np.var(self.of_draws, ddof=1)) / len(self.of_draws)
            both = variance + drawn
            if both > 0:
                free = both**2 / (variance**2 / free + drawn**2 / (len(self.of_draws) - 1))
            variance = both
        half = scipy.stats.t.isf((1 - level) / 2, free) * np.sqrt(variance)
        low, high = (float(np.clip(end, -self.bound, self.bound)) for end in _about(self.estimate, half, self.scale))
        return low, high

    def minus(self, other: Judged) -> Judged:
        """The difference, on the same resamples."""
        return self.resamples.judged(
            self.estimate - other.estimate, self.samples - other.samples, self.bound + other.bound, "plain"
        )


def mean_over_draws(judged: Sequence[Judged]) -> Judged:
    """The mean of a statistic over independent draws of what its resamples know nothing of; the chance of both."""
    known = [one for one in judged if np.isfinite(one.estimate)] or list(judged)[:1]
    estimates = tuple(one.estimate for one in known)
    samples = np.mean([one.samples for one in known], axis=0)
    first = known[0]
    return Judged(float(np.mean(estimates)), samples, first.resamples, first.bound, first.scale, estimates)


def deviations(judged: Sequence[Judged], rng: np.random.Generator, draws: int) -> Floats:
    """Draws of what chance does to statistics that share their resamples, (draws, S).

    Each camera, view and point has a random number of its own, by which its part of the jackknife is taken; those of
    the cameras are of a t variable with as many degrees of freedom as the cameras have.
    """
    resamples = judged[0].resamples
    samples = np.array([one.samples for one in judged]).T
    total = np.zeros((draws, len(judged)))
    cameras, views, groups, points = resamples.parts(np.where(np.isfinite(samples), samples, np.nan))
    variances = np.array([[_jackknife(part[:, s]) for part in (cameras, views, groups)] for s in range(len(judged))])
    shares = [resamples.shares(*of_one) for of_one in variances]
    of_views = np.array([share[0] for share in shares])
    excess = np.array([share[1] for share in shares])
    free = max(len(cameras) - 1, 1)
    stretched = np.sqrt(free / rng.chisquare(free, size=(draws, 1)))
    for part, requested, stretch in (
        (cameras, excess, stretched),
        (views, of_views, np.where(excess > of_views, stretched, 1.0)),
        (points, np.array([_jackknife(points[:, s]) for s in range(len(judged))]), 1.0),
    ):
        if len(part) < 2:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # no sample known: no part in it
            centred = np.nan_to_num(part - np.nanmean(part, axis=0))
        length = np.sqrt((centred**2).sum(axis=0))
        scaled = centred * np.where(length > 0, np.sqrt(requested) / np.where(length > 0, length, 1.0), 0.0)
        total += stretch * (rng.standard_normal((draws, len(part))) @ scaled)
    return total


def _about(estimate: float, half: float, scale: Scale) -> tuple[float, float]:
    """The estimate ± a half length, which is carried over to the scale and back."""
    if scale == "correlation" and abs(estimate) < 1 - AT_THE_END:
        middle, reach = np.arctanh(estimate), half / (1 - estimate**2)
        return float(np.tanh(middle - reach)), float(np.tanh(middle + reach))
    if scale == "positive" and estimate > 0:
        return float(estimate * np.exp(-half / estimate)), float(estimate * np.exp(half / estimate))
    if scale == "share" and AT_THE_END < estimate < 1 - AT_THE_END:
        middle, reach = scipy.special.logit(estimate), half / (estimate * (1 - estimate))
        return float(scipy.special.expit(middle - reach)), float(scipy.special.expit(middle + reach))
    return estimate - half, estimate + half


def with_interval(name: str, judged: Judged) -> dict[str, object]:
    """Columns of a statistic: its name, and the ends of its interval."""
    low, high = judged.interval
    return {name: judged.estimate, f"{name}_ci_low": low, f"{name}_ci_high": high}
