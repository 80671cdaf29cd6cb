"""Predicted visibility and detection in the views of a bank, against the detector's detections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pss import DetectionModel
from pss.cameras.views import Views
from pss.hints import Floats, Row
from pss.visibility.points import VisibilityTest, visible_in
from pss.visibility.targets import TARGET_VISIBILITY
from validate.acquire.acquire import Acquired
from validate.bank.design import ViewBank
from validate.bank.judge import appearance_of
from validate.bank.measured import BankData
from validate.prediction.detection import log_loss
from validate.stats.consistency import crossed_mean
from validate.stats.ranking import Resamples
from validate.stats.shares import share_interval

__all__ = ["detection_rows", "reliability_rows"]


# Ends of the bins of predicted probability.
BINS = (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
RAMP = "probability of detection"


def detection_rows(
    bank: ViewBank,
    data: BankData,
    used: NDArray[np.int64],
    visibilities: Mapping[str, Sequence[VisibilityTest]],
    ramp: DetectionModel | None,
    acquired: Acquired,
) -> list[Row]:
    """Predicted visible × detected, over the markers in the `used` views, all trials; and scores of whole markers.

    With a probability p "visible" counts p and "hidden" 1 − p. `brier` and `log_loss` are means over the pairs of view
    and whole marker, `expected_found` and `found` sums over them. A step has a finite logarithmic loss only with
    shares that are found on its sides: it gets those of these very markers, which is more than a prediction can have.

    Args:
        ramp: the probability of detection of a whole marker, for a row of its own.
    """
    views, rate, whole = _seen(bank, data, used, acquired)
    occluders = bank.scene.state.occluders
    chances = {name: visible_in(views, occluders, tests).astype(float) for name, tests in visibilities.items()}
    if ramp is not None:
        chances[RAMP] = np.where(whole, ramp.probability(views), 0.0)
    rows: list[Row] = []
    for name, chance in chances.items():
        stated = chance[whole] if name == RAMP else _own_shares(chance[whole] > 0, rate[whole])
        rows.append(
            {
                "visibility": name,
                "visible_detected": float((rate * chance).mean()),
                "visible_missed": float(((1 - rate) * chance).mean()),
                "hidden_detected": float((rate * (1 - chance)).mean()),
                "hidden_missed": float(((1 - rate) * (1 - chance)).mean()),
                "views": len(used),
                "whole_markers": int(whole.sum()),
                "expected_found": float(chance[whole].sum()),
                "found": float(rate[whole].sum()),
                "brier": float(((chance - rate)[whole] ** 2).mean()),
                "log_loss": log_loss(stated, rate[whole]),
            }
        )
    return rows


def _own_shares(inside: NDArray[np.bool_], rate: Floats) -> Floats:
    """The share found on each side of a step, (M,): the best that it can state of these very markers."""
    shares = [float(rate[side].mean()) if side.any() else 0.0 for side in (inside, ~inside)]
    return np.where(inside, *shares)


def reliability_rows(
    bank: ViewBank, data: BankData, used: NDArray[np.int64], ramp: DetectionModel, acquired: Acquired
) -> list[Row]:
    """The share of whole markers found, in bins of predicted probability; intervals over cameras, views and points."""
    views, rate, whole = _seen(bank, data, used, acquired)
    chance = ramp.probability(views)
    names = [camera.name for camera in views.cameras]
    resamples = Resamples.of_configurations(np.arange(len(names))[:, None], rate.shape[1], names)
    rows: list[Row] = []
    for low, high in pairwise(BINS):
        within = whole & (chance >= low) & ((chance < high) | (high == BINS[-1]))
        row: Row = {
            "probability_from": low,
            "probability_to": high,
            "whole_markers": int(within.sum()),
            "views": int(within.any(axis=1).sum()),
            "predicted": float(chance[within].mean()) if within.any() else float("nan"),
        }
        found = crossed_mean(np.where(within, rate, np.nan), resamples)
        ends = share_interval(found.estimate, *found.interval, int(within.any(axis=1).sum()))
        rows.append(row | {"found": found.estimate, "found_ci_low": ends[0], "found_ci_high": ends[1]})
    return rows


def _seen(
    bank: ViewBank, data: BankData, used: NDArray[np.int64], acquired: Acquired
) -> tuple[Views, Floats, NDArray[np.bool_]]:
    """The `used` views, the share of trials that found each marker, and which are in view as a whole, (V, N) both."""
    state = bank.scene.state
    cameras = [bank.cameras[view] for view in used]
    views = Views(cameras, state.points_m, state.normals, appearance_of(bank.scene, acquired))
    return views, data.detected[used].mean(axis=1), visible_in(views, state.occluders, TARGET_VISIBILITY)
