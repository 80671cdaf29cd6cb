"""Shot noise is Poisson's on both sides of the limit below which it is drawn exactly."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from render.sensor import EXACT_BELOW_E, shot_noise

DRAWS = 400_000
# Largest distance of the distribution functions: 0.0009 of the expansion, 0.0026 of 400 000 draws at the 99 % level.
LARGEST_DISTANCE = 0.0035
# Standard errors; 2 statistics × 5 levels, one failure in 1 600 correct runs (the seed is fixed).
LARGEST_Z = 4.0
LEVELS_E = [0.3, 8.0, EXACT_BELOW_E * 0.999, EXACT_BELOW_E, 300.0]


@pytest.mark.parametrize("mean", LEVELS_E)
def test_mean_and_variance_are_the_expected_electrons(mean):
    """The photon transfer law: variance equals mean."""
    drawn = shot_noise(np.full(DRAWS, mean, dtype=np.float32), np.random.default_rng(5)).astype(float)
    assert abs(drawn.mean() - mean) < LARGEST_Z * np.sqrt(mean / DRAWS)
    # Var(s²) of a Poisson variable: (2 λ² + λ)/n.
    assert abs(drawn.var() - mean) < LARGEST_Z * np.sqrt((2 * mean**2 + mean) / DRAWS)


@pytest.mark.parametrize("mean", LEVELS_E)
def test_distribution_is_poisson(mean):
    """Distribution functions agree at every whole number."""
    drawn = shot_noise(np.full(DRAWS, mean, dtype=np.float32), np.random.default_rng(6))
    assert (drawn == np.rint(drawn)).all()
    numbers = np.arange(0, int(mean + 8 * np.sqrt(mean) + 8))
    empirical = np.searchsorted(np.sort(drawn), numbers, side="right") / DRAWS
    assert np.abs(empirical - scipy.stats.poisson.cdf(numbers, mean)).max() < LARGEST_DISTANCE
