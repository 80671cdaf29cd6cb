"""The correlation gate on a bank that is rendered for real: sixteen views, more than two hundred configurations.

It must hold on the prediction, and must fall when the prediction is wrong.
"""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console

from pss import noise_model
from render import backend
from validate.acquire import acquire
from validate.bank.gate_bank import draw_configurations, gate_bank, measured_points, predicted_points
from validate.gate import Claim, format_claims, judge
from validate.progress import ViewProgress
from validate.store import Store

pytestmark = pytest.mark.render

CAMERAS = 4
CONFIGURATIONS = 250
# The lower end of the 95 % interval of Spearman's ρ within four cameras has to reach this.
BOUND = 0.55
MODEL = "corrected"


@pytest.fixture(scope="module")
def bank_and_measurements(tmp_path_factory):
    chosen = backend.choose()
    bank = gate_bank(chosen.identity)
    store = Store(tmp_path_factory.mktemp("gate"))
    acquired = acquire(bank.views, store, chosen, lambda total: ViewProgress(total, Console(stderr=True)))
    assert not acquired.failed
    configurations = draw_configurations(bank.camera_names, CAMERAS, CONFIGURATIONS, np.random.default_rng(1))
    return bank, configurations, measured_points(bank, configurations, acquired)


def _judge(predicted, bank_and_measurements, label) -> Claim:
    _, configurations, measured = bank_and_measurements
    (claim,) = judge(
        predicted, measured, configurations, np.random.default_rng(2), bound=BOUND, cameras=CAMERAS, label=label
    )
    print(format_claims([claim]))
    return claim


def _model(bank):
    return noise_model(MODEL, ccd_noise=bank.scene.sensor.ccd_noise)


def test_bank_is_large_enough(bank_and_measurements):
    """Sixteen views give at least two hundred configurations of one camera count, most of which measure something."""
    bank, configurations, measured = bank_and_measurements
    assert len(bank.views) == 16
    assert len(configurations) >= 200
    assert (measured.sum(axis=1) > 0).mean() > 0.9


def test_prediction_ranks_configurations_as_the_measurement_does(bank_and_measurements):
    """THE GATE: within four cameras, predicted and measured PSS agree in rank, the whole interval above the bound."""
    bank, configurations, _ = bank_and_measurements
    claim = _judge(predicted_points(bank, configurations, _model(bank)), bank_and_measurements, "predicted PSS")
    assert claim.holds, format_claims([claim])


def test_gate_fails_on_shuffled_predictions(bank_and_measurements):
    """Predictions of other configurations do not pass."""
    bank, configurations, _ = bank_and_measurements
    predicted = predicted_points(bank, configurations, _model(bank))
    shuffled = predicted[np.random.default_rng(3).permutation(len(predicted))]
    assert not _judge(shuffled, bank_and_measurements, "shuffled PSS").holds


def test_gate_fails_when_the_prediction_ignores_focus(bank_and_measurements):
    """A metric that does not know where the cameras are focused does not pass."""
    bank, configurations, _ = bank_and_measurements
    blind = predicted_points(bank, configurations, _model(bank).without("defocus"))
    assert not _judge(blind, bank_and_measurements, "PSS without focus").holds
