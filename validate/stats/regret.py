"""Regret of choosing the best of some configurations by a number, and that of the oracle.

Regret is 1 − measured(chosen)/max measured on one half of the trials, averaged over the halves. The oracle chooses by
the other half's measurement, and is charged on the same terms: even a perfect choice loses something, as the best
measured value is itself picked from noisy ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pss.hints import Floats, Integers
from validate.stats.crossed import Judged, Resamples

__all__ = ["Choices", "Picked", "Regrets", "numbers_of"]


DRAWS = 400


def numbers_of(values: Floats, resamples: Resamples) -> Floats:
    """A metric or measure as it is and on each resample, (1 + B, K)."""
    own = values.mean(axis=1) if values.ndim == 2 else values
    return np.concatenate([own[None], resamples.of(values)])


@dataclass(frozen=True, eq=False)
class Choices:
    """Random choices of `size` configurations of those that are left, the same for all that are judged on them.

    A choice is the first `size` of a random order that are not left out, so that a unit that is left out changes only
    the choices that have it.

    Attributes:
        own: (draws, size), from all configurations.
        left: (rows, draws, size), from those left without a camera, view or group; −1 where too few are left.
    """

    size: int
    resamples: Resamples
    own: Integers
    left: Integers

    @classmethod
    def of(cls, resamples: Resamples, size: int, draws: int = DRAWS) -> Choices:
        """Choices of so many of the resamples' configurations, or of all where there are no more."""
        count = resamples.views.shape[1]
        size = min(size, count)
        rng = np.random.default_rng(size)
        orders = np.array([rng.permutation(count) for _ in range(draws)])
        units = len(resamples.views) - resamples.units[3]
        left = np.full((units, draws, size), -1, dtype=np.int64)
        for unit in range(units):
            there = resamples.views[unit].astype(bool)[orders]
            if there[0].sum() >= size:
                first = there & (np.cumsum(there, axis=1) <= size)
                left[unit] = orders[first].reshape(draws, size)
        return cls(size, resamples, orders[:, :size], left)

    def picked(self, numbers: Floats) -> Integers:
        """The configuration with the highest number of each choice, (1 + B, draws); nan is never chosen, −1 unknown.

        Of several with the same number it is the first of the choice, whose order is random.

        Args:
            numbers: (1 + B, K), of `numbers_of`.
        """
        known = np.where(np.isnan(numbers), -np.inf, numbers)
        found = np.empty((len(known), len(self.own)), dtype=np.int64)
        rows = len(self.left)
        for row, values in enumerate(known):
            chosen = self.left[row - 1] if 1 <= row <= rows else self.own
            best = values[chosen].argmax(axis=1)
            found[row] = np.where(chosen[:, 0] < 0, -1, chosen[np.arange(len(chosen)), best])
        return found


@dataclass(frozen=True, eq=False)
class Picked:
    """What a number picks from each choice of each size."""

    by_size: dict[int, Integers]

    @classmethod
    def by(cls, numbers: Floats, choices: dict[int, Choices]) -> Picked:
        """Of numbers (1 + B, K), higher is better."""
        return cls({size: of_size.picked(numbers) for size, of_size in choices.items()})


@dataclass(frozen=True, eq=False)
class Regrets:
    """What choices cost by one measure.

    Attributes:
        choices: by size.
        halves: the measure from each half of the trials, (1 + B, K) each, higher is better, 0 or more.
    """

    choices: dict[int, Choices]
    halves: tuple[Floats, Floats]

    @classmethod
    def of_values(cls, halves: tuple[Floats, Floats], choices: dict[int, Choices]) -> Regrets:
        """Of a measure from each half: terms of a mean over the points (K, N), or a number (K,)."""
        resamples = next(iter(choices.values())).resamples
        a, b = (numbers_of(half, resamples) for half in halves)
        return cls(choices, (a, b))

    @cached_property
    def _best(self) -> tuple[Picked, Picked]:
        a, b = self.halves
        return Picked.by(a, self.choices), Picked.by(b, self.choices)

    def of(self, picked: Picked, size: int) -> tuple[Judged, float]:
        """Mean regret over the choices, and its median."""
        return self._judged((picked, picked), size)

    def oracle(self, size: int) -> tuple[Judged, float]:
        """That of choosing by the other half of the trials."""
        return self._judged(self._best[::-1], size)

    def _judged(self, picked: tuple[Picked, Picked], size: int) -> tuple[Judged, float]:
        lost = np.mean(
            [
                _lost(chosen.by_size[size], best.by_size[size], half)
                for chosen, best, half in zip(picked, self._best, self.halves, strict=True)
            ],
            axis=0,
        )
        means = lost.mean(axis=1)
        judged = self.choices[size].resamples.judged(float(means[0]), means[1:], 1.0, "share")
        return judged, float(np.median(lost[0]))


def _lost(chosen: Integers, best: Integers, measured: Floats) -> Floats:
    """1 − measured(chosen)/measured(best), (1 + B, draws); 0 where the best is no more than 0, nan where unknown."""
    got, most = (np.take_along_axis(measured, np.maximum(index, 0), axis=1) for index in (chosen, best))
    lost = np.where(most > 0, 1 - got / np.where(most > 0, most, 1.0), 0.0)
    return np.where(chosen < 0, np.nan, lost)
