"""Design of the pixel noise table: one factor at a time about a centre point, and random combinations of all."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from pss import ImageSensor
from render.lens.sampling import Sampling
from render.random_streams import random_stream
from render.renderer import ViewRequest
from validate.pixel_noise.laboratory import Factors, Setup, draw_poses

__all__ = ["COMBINATIONS", "SERIES", "Plan", "Series", "Shot", "make_plan"]


CENTRE = Factors()
# Sampling noise (σ) of the noisiest edge pixels over the sensor's; over all of them it is a third of that.
SAMPLING = Sampling(noise_ratio=0.4)
COMBINATIONS = "combinations"
POSES, QUICK_POSES = 8, 2
RANDOM, QUICK_RANDOM = 140, 10
TRIALS, QUICK_TRIALS = 20, 6
QUICK_LEVELS = slice(2, 7, 4)
# Bounds of the random combinations; a marker whose blur comes near its module is not found at all.
MODULE_PX, INCIDENCE_DEG, WHITE_E, LARGEST_CC_PX, LARGEST_CC_MODULES = (3.5, 25.0), 75.0, (60.0, 8000.0), 12.0, 0.4


@dataclass(frozen=True)
class Series:
    """One factor in steps, the others as in the centre point, except those of `base`.

    Attributes:
        factor: the attribute of `Factors` that varies.
        rendered_e: electrons of white for which its views are rendered, once for all levels; 0: each for its own.
    """

    name: str
    factor: str
    values: tuple[float, ...]
    base: Factors = CENTRE
    rendered_e: float = 0.0

    @property
    def levels(self) -> tuple[Factors, ...]:
        """The factors of each step."""
        return tuple(dataclasses.replace(self.base, **{self.factor: value}) for value in self.values)


SERIES = (
    Series("module", "module_px", (3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 13.0, 18.0, 25.0)),
    Series("cc-10px", "cc_px", (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)),
    Series("cc-25px", "cc_px", (0.0, 1.0, 2.0, 3.0, 4.5, 6.0, 8.0, 10.0, 12.0), Factors(module_px=25.0)),
    Series("incidence", "incidence_deg", (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 75.0)),
    # The signal with the least noise beside its light needs the most samples: its views serve all others.
    Series("white", "white_e", (60.0, 120.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0), rendered_e=8000.0),
)


@dataclass(frozen=True)
class Shot:
    """One setup to be measured, and the series (or `COMBINATIONS`) that contains it."""

    series: str
    setup: Setup
    rendered_e: float

    @property
    def exposed(self) -> ImageSensor:
        """The sensor for which the view is rendered."""
        return self.setup.exposed_for(self.rendered_e)

    def request(self, renderer: str) -> ViewRequest:
        """The view that is to be rendered."""
        return ViewRequest(self.setup.state, self.setup.camera, self.exposed, SAMPLING, renderer)


@dataclass(frozen=True)
class Plan:
    """All shots, and the noisy captures of each."""

    shots: tuple[Shot, ...]
    trials: int


def make_plan(seed: int, trials: int | None = None, quick: bool = False) -> Plan:
    """The shots of the table. The levels of all series share their poses, so that what a pose adds cancels in trends.

    Args:
        trials: of each shot; None: as many as the table has.
        quick: two levels a series and few poses, to see that all works.
    """
    poses = draw_poses(QUICK_POSES if quick else POSES, random_stream(seed, "pixel-noise", "poses"))
    shots = []
    for series in SERIES:
        levels = series.levels[QUICK_LEVELS] if quick else series.levels
        for factors in levels:
            shots += [Shot(series.name, Setup(factors, pose), series.rendered_e or factors.white_e) for pose in poses]
    rng = random_stream(seed, "pixel-noise", "combinations")
    combinations = draw_factors(QUICK_RANDOM if quick else RANDOM, rng)
    for factors, pose in zip(combinations, draw_poses(len(combinations), rng), strict=True):
        shots.append(Shot(COMBINATIONS, Setup(factors, pose), factors.white_e))
    return Plan(tuple(shots), trials or (QUICK_TRIALS if quick else TRIALS))


def draw_factors(count: int, rng: np.random.Generator) -> list[Factors]:
    """A Latin hypercube: even in log module, log white, incidence, and the blur over its bound."""
    found = []
    for module, cc, incidence, white in qmc.LatinHypercube(4, rng=rng).random(count):
        module_px = _between(*MODULE_PX, module)
        cc_px = cc * min(LARGEST_CC_PX, LARGEST_CC_MODULES * module_px)
        found.append(Factors(module_px, float(cc_px), float(INCIDENCE_DEG * incidence), _between(*WHITE_E, white)))
    return found


def _between(low: float, high: float, share: float) -> float:
    return float(low * (high / low) ** share)
