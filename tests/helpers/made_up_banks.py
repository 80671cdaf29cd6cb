"""Banks made up of cameras, views, points and trials that all have chance of their own, and what is judged on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from validate.bank.ceilings import attenuation_ceiling
from validate.stats.consistency import crossed_mean, pooled_spearman
from validate.stats.crossed import Judged, Resamples
from validate.stats.ranking import Ranked, partial
from validate.stats.regret import Choices, Picked, Regrets, numbers_of

SETTINGS, CONFIGURATIONS, POINTS = 10, 200, 30
CAMERAS = tuple(f"{number}" for number in range(7))
# Spread of what a trial's noise does to the logarithm of the measured information, over all trials.
TRIALS = 0.15
SIZE, DRAWS = 10, 60


@dataclass(frozen=True, eq=False)
class Bank:
    """Terms (K, N) of the predicted, the measured and the true 1/σ of each configuration; see `bank`."""

    configurations: np.ndarray
    predicted: np.ndarray
    worse: np.ndarray
    visible: np.ndarray
    measured: np.ndarray
    halves: tuple[np.ndarray, np.ndarray]
    true: np.ndarray
    nees: np.ndarray
    inside: np.ndarray

    @property
    def resamples(self) -> Resamples:
        """Of its cameras, views and points."""
        names = [name for name in CAMERAS for _ in range(SETTINGS)]
        return Resamples.of_configurations(self.configurations, POINTS, names)


def _effects(rng, camera, view, point, cell):
    """(V, N): what is peculiar to a camera, to a view, to a point, and to a view of a point."""
    of_cameras = np.repeat(camera * rng.standard_normal((len(CAMERAS), 1)), SETTINGS, axis=0)
    views = len(of_cameras)
    own = view * rng.standard_normal((views, 1)) + point * rng.standard_normal((1, POINTS))
    return of_cameras + own + cell * rng.standard_normal((views, POINTS))


def bank(rng: np.random.Generator, size: int, cameras: float) -> Bank:
    """A bank of configurations of `size` cameras, with effects of the cameras as strong as the views' times `cameras`.

    1/σ² adds over the views that see a point; the prediction errs by camera, view, point and cell, in what a view is
    worth and in whether it sees the point.
    """
    level = _effects(rng, 0.4 * cameras, 0.5, 0.3, 0.3)
    wrong = _effects(rng, 0.25 * cameras, 0.25, 0.2, 0.25)
    more_wrong = wrong + _effects(rng, 0.3 * cameras, 0.3, 0.2, 0.3)
    side = 0.7 + _effects(rng, 0.6 * cameras, 0.6, 0.3, 0.8)
    seen = side > 0
    expected = side + _effects(rng, 0.1 * cameras, 0.1, 0.1, 0.2) > 0
    order = np.argsort(rng.random((CONFIGURATIONS, len(CAMERAS))), axis=1)[:, :size]
    chosen = order * SETTINGS + rng.integers(SETTINGS, size=order.shape)
    noise = TRIALS * np.sqrt(2) * rng.standard_normal((2, *level.shape))

    def terms(information):
        return np.sqrt(information[chosen].sum(axis=1))

    claimed = np.exp(level) * expected
    both = claimed[chosen] * seen[chosen]
    ratio = np.exp(-(wrong + noise.mean(axis=0)))[chosen]
    weight = both.sum(axis=1)
    with np.errstate(invalid="ignore"):
        nees = (both * ratio).sum(axis=1) / np.where(weight > 0, weight, np.nan)
    inside = np.where(np.isfinite(nees), np.exp(-0.1 * nees), np.nan)
    return Bank(
        chosen,
        terms(claimed),
        terms(np.exp(level + wrong - more_wrong) * expected),
        (expected[chosen].sum(axis=1) >= 2).astype(float),
        terms(np.exp(level + wrong + noise.mean(axis=0)) * seen),
        (terms(np.exp(level + wrong + noise[0]) * seen), terms(np.exp(level + wrong + noise[1]) * seen)),
        terms(np.exp(level + wrong) * seen),
        nees,
        inside,
    )


def judgements(made: Bank, resamples: Resamples) -> dict[str, Judged]:
    """Every kind of figure with an interval that the findings print."""
    names = ("predicted", "worse", "visible", "measured")
    ranked = {name: Ranked.of(getattr(made, name), resamples) for name in names}
    rho, worse = (ranked[name].against(ranked["measured"]) for name in ("predicted", "worse"))
    seen = ranked["visible"].against(ranked["measured"])
    halves = [Ranked.of(half, resamples) for half in made.halves]
    choices = {SIZE: Choices.of(resamples, SIZE, DRAWS)}
    costs = Regrets.of_values(made.halves, choices)
    regret, _ = costs.of(Picked.by(numbers_of(made.worse, resamples), choices), SIZE)
    oracle, _ = costs.oracle(SIZE)
    with np.errstate(divide="ignore"):
        sigma, rms = (np.where(terms > 0, 1 / terms, np.nan) for terms in (made.predicted, made.measured))
    return {
        "rho": rho,
        "rho of a worse model": worse,
        "partial rho": partial(rho, ranked["predicted"].against(ranked["visible"]), seen),
        "difference of rho": rho.minus(worse),
        "NEES": crossed_mean(made.nees, resamples),
        "coverage": crossed_mean(made.inside, resamples, "share"),
        "rho of points": pooled_spearman(sigma, rms, resamples),
        "regret": regret,
        "regret of the oracle": oracle,
        "regret over the oracle's": regret.minus(oracle),
        "ceiling": attenuation_ceiling(halves[0].against(halves[1])),
    }
