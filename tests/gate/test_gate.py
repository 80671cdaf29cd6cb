"""The correlation gate on a bank that is rendered for real: sixteen views, 250 configurations of three and of four.

Nothing of it was fitted: the prediction is the physical model, so that all configurations are held out. It must hold on
that prediction, and must fall when the prediction or the measurement is wrong.
"""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console

from pss import noise_model
from render import backend
from render.keys import state_key
from render.store.folder import Store
from tests.gate.claims import BOUND, CONFIGURATIONS, COUNTS, LEAST_RHO, LEVEL, TURN_DEG, TURNED_VIEW
from tests.gate.gate import Claim, format_claims, judge, turn_shows
from tests.gate.gate_bank import gate_bank, measured_points, predicted_points, turned_view
from validate.acquire.acquire import acquire
from validate.bank.design import draw_configurations
from validate.runs.progress import ViewProgress

pytestmark = pytest.mark.render


class Gate:
    """The bank, its measurements, and the claims that are judged on them."""

    def __init__(self, folder) -> None:
        chosen = backend.choose()
        self.bank = gate_bank(chosen.identity)
        self.turned = turned_view(self.bank, TURNED_VIEW, TURN_DEG)
        views = (*self.bank.views, self.turned)
        self.acquired = acquire(views, Store(folder), chosen, lambda total: ViewProgress(total, Console(stderr=True)))
        assert not self.acquired.failed
        names = self.bank.camera_names
        self.configurations = [
            chosen
            for count in COUNTS
            for chosen in draw_configurations(names, count, CONFIGURATIONS, np.random.default_rng(count)).tolist()
        ]
        self.measured = measured_points(self.bank, self.configurations, self.acquired)

    def predicted(self, model="physical", **how) -> np.ndarray:
        scene = self.bank.scene
        if isinstance(model, str):
            model = noise_model(model, sensor=scene.sensor, ccd_noise=scene.sensor.ccd_noise)
        appearance = self.acquired.appearances[state_key(scene.state)]
        return predicted_points(self.bank, self.configurations, model, appearance, **how)

    def judged(self, predicted, label) -> list[Claim]:
        claims = judge(
            predicted,
            self.measured,
            self.configurations,
            bound=BOUND,
            least=LEAST_RHO,
            camera_names=self.bank.camera_names,
            label=label,
            level=LEVEL,
        )
        print(format_claims(claims))
        return claims

    def residuals(self, pixels) -> np.ndarray:
        """px, detections less projections by the camera as the measuring side knows it."""
        camera = self.bank.views[TURNED_VIEW].request.camera
        return pixels - camera.project(self.bank.scene.state.points_m)[0]

    def shift(self) -> np.ndarray:
        """px, what the turn does to each projection."""
        cameras = (self.turned.request.camera, self.bank.views[TURNED_VIEW].request.camera)
        after, before = (camera.project(self.bank.scene.state.points_m)[0] for camera in cameras)
        return after - before

    def turn(self, pixels) -> Claim:
        claim = turn_shows(self.residuals(pixels), self.shift(), np.random.default_rng(3), LEVEL)
        print(format_claims([claim]))
        return claim


@pytest.fixture(scope="module")
def gate(tmp_path_factory):
    return Gate(tmp_path_factory.mktemp("gate"))


def test_bank_is_large_enough(gate):
    """Sixteen views give at least two hundred configurations of each count, most of which measure something."""
    assert len(gate.bank.views) == 16
    assert len(gate.configurations) == len(COUNTS) * CONFIGURATIONS
    assert (gate.measured.sum(axis=1) > 0).mean() > 0.9


def test_prediction_ranks_configurations_as_the_measurement_does(gate):
    """THE GATE: within three and within four cameras, predicted and measured PSS agree in rank."""
    claims = gate.judged(gate.predicted(), "predicted PSS")
    assert all(claim.holds for claim in claims), format_claims(claims)


def test_a_turn_that_nobody_told_of_shows_in_full(gate):
    """THE GATE: what the detector says comes from the image. A camera turned by 0.02° moves every detection by it."""
    claim = gate.turn(gate.acquired.measured[gate.turned].pixels)
    assert claim.holds, format_claims([claim])


def test_gate_fails_on_detections_that_are_made_of_the_truth(gate):
    """Projections of the true points plus noise of the predicted size: no turn shows in them."""
    camera = gate.bank.views[TURNED_VIEW].request.camera
    found = gate.acquired.measured[gate.turned]
    noise = np.sqrt(np.nanmedian(found.covariance[..., 0, 0])) * np.random.default_rng(4).standard_normal(
        found.pixels.shape
    )
    leaked = np.where(found.detected[..., None], camera.project(gate.bank.scene.state.points_m)[0] + noise, np.nan)
    assert not gate.turn(leaked).holds


def test_gate_fails_on_shuffled_predictions(gate):
    """Predictions of other configurations do not pass."""
    predicted = gate.predicted()
    rng = np.random.default_rng(3)
    shuffled = np.concatenate([rng.permutation(part) for part in np.split(predicted, len(COUNTS))])
    assert not any(claim.holds for claim in gate.judged(shuffled, "shuffled PSS"))


def test_gate_fails_when_the_prediction_ignores_focus(gate):
    """A metric that does not know where the cameras are focused does not pass."""
    model = noise_model("corrected", ccd_noise=gate.bank.scene.sensor.ccd_noise).without("defocus")
    assert not any(claim.holds for claim in gate.judged(gate.predicted(model), "PSS without focus"))


def test_gate_fails_when_the_prediction_ignores_occlusion(gate):
    """A metric that sees through the screen and the ball does not pass."""
    assert not any(claim.holds for claim in gate.judged(gate.predicted(occluded=False), "PSS without occlusion"))
