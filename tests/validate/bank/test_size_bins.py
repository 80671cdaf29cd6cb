"""Bins of predicted error beside the measured ones: by hand, and on errors drawn from a known covariance."""

from __future__ import annotations

import numpy as np
import pytest

from validate.bank.size_bins import BINS, FEWEST_CELLS, binned

NAN = float("nan")
# Of the median of 2,000 draws' own quantile: four standard errors of a uniform order statistic.
SAMPLING = 4 * 0.5 / np.sqrt(2000)


def test_bins_by_hand():
    """Two bins of 20: medians and quartiles are those of their own cells; what is not known is left out."""
    predicted = np.r_[np.arange(1.0, 41.0), NAN, 7.0]
    measured = np.r_[np.arange(101.0, 141.0), 5.0, NAN]
    shuffled = np.random.default_rng(0).permutation(42)
    first, second = binned(predicted[shuffled], measured[shuffled])
    assert (first["n"], second["n"]) == (FEWEST_CELLS, 20)
    assert (first["predicted_low_m"], first["predicted_high_m"], first["predicted_rms_m"]) == (1.0, 20.0, 10.5)
    assert (second["measured_q25_m"], second["measured_rms_m"], second["measured_q75_m"]) == (125.75, 130.5, 135.25)


def test_few_cells_are_one_bin_and_none_are_none():
    assert [row["n"] for row in binned(np.ones(5), np.ones(5))] == [5]
    assert binned(np.full(4, NAN), np.ones(4)) == []


def test_right_predictions_lie_on_the_diagonal_in_every_bin():
    """Errors drawn with the predicted σ: medians agree; with predictions half as large they are twice the predicted."""
    rng = np.random.default_rng(3)
    sigma = np.exp(rng.normal(size=2000 * BINS))
    factor = np.exp(rng.normal(scale=0.2, size=sigma.shape))
    for times in (1.0, 0.5):
        rows = binned(times * sigma, sigma * factor)
        assert [row["n"] for row in rows] == [2000] * BINS
        # Inside, where a bin is narrow; the first and the last reach far out.
        for row in rows[1:-1]:
            assert float(row["measured_rms_m"]) * times / float(row["predicted_rms_m"]) == pytest.approx(
                1, abs=SAMPLING
            )
