"""Measured errors of points in bins of the predicted ones: whether predictions are right at every size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pss.hints import Floats, Row
from validate.bank.leaderboard import CountVerdict
from validate.stats.consistency import FEWEST_TRIALS, root_trace_of

__all__ = ["BINS", "binned", "size_rows"]


# Bins of as many cells each; fewer where not each would have `FEWEST_CELLS`.
BINS, FEWEST_CELLS = 10, 20


def size_rows(verdict: CountVerdict, names: Sequence[str]) -> list[Row]:
    """Rows of size.csv: for each contender in `names` bins of √tr C of a point in a configuration, from the smallest.

    Measured is the RMS over the trials of such a cell, where there are enough of them.
    """
    enough = np.array([found.errors.detections for found in verdict.measured]) >= FEWEST_TRIALS
    measured = np.where(enough, np.array([found.errors.rms_m for found in verdict.measured]), np.nan)
    rows: list[Row] = []
    for name in names:
        predicted = root_trace_of(np.array([found[name].covariance_m2 for found in verdict.predicted]))
        common: Row = {"cameras": verdict.cameras, "noise_model": name}
        rows += [common | row for row in binned(predicted.ravel(), measured.ravel())]
    return rows


def binned(predicted: Floats, measured: Floats, bins: int = BINS) -> list[Row]:
    """Bins of the predicted errors with as many cells each: medians of both, and the quartiles of the measured.

    Args:
        predicted, measured: m, (cells,); cells in which one is not finite are left out.
    """
    known = np.isfinite(predicted) & np.isfinite(measured)
    if not known.any():
        return []
    order = np.argsort(predicted[known], kind="stable")
    x, y = predicted[known][order], measured[known][order]
    rows: list[Row] = []
    for number, cells in enumerate(np.array_split(np.arange(len(x)), max(1, min(bins, len(x) // FEWEST_CELLS)))):
        low, middle, high = np.quantile(y[cells], [0.25, 0.5, 0.75])
        rows.append(
            {
                "bin": number + 1,
                "n": len(cells),
                "predicted_low_m": float(x[cells[0]]),
                "predicted_high_m": float(x[cells[-1]]),
                "predicted_rms_m": float(np.median(x[cells])),
                "measured_rms_m": float(middle),
                "measured_q25_m": float(low),
                "measured_q75_m": float(high),
            }
        )
    return rows
