"""PSS of each avatar from its own cameras alone: the difference to all cameras is what the others add."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pss.hints import Floats
from pss.noise import Calibration
from render.keys import state_key
from render.random_streams import random_stream
from validate.acquire.acquire import Acquired
from validate.points.configuration import measure_configuration
from validate.schedule.held import Held, held_contenders, predicted_at
from validate.schedule.process_noise import inverse_sigma, measured_inverse, predicted_inverse
from validate.schedule.results import HEADLINE_KIND, KINDS, Curves, ScheduleResult
from validate.stats.measured_errors import MeasuredErrors
from validate.sweeps.replicates import sweep_replicates

__all__ = ["OwnCameras", "own_cameras"]


@dataclass(frozen=True, eq=False)
class OwnCameras:
    """PSS of each avatar from its own cameras, by noise model ("" for the measured one) and kind.

    Attributes:
        inverse_sigma: 1/m, 1/σ of every marker from the cameras that are assigned to its avatar, (K, N).
        samples: 1/m, PSS, the mean of the same, resampled, (B, K).
        found: share of frames in which those cameras find the marker, (K, N); predicted 0 or 1, or a probability.
        point_weights: of the resamples, (B, N).
    """

    inverse_sigma: dict[tuple[str, str], Floats]
    samples: dict[tuple[str, str], Floats]
    found: dict[tuple[str, str], Floats]
    point_weights: Floats

    def counts(self, key: tuple[str, str]) -> Curves:
        """The share of markers in PSS, (1, K)."""
        model, kind = key
        values, samples = self.found[key].mean(axis=1), self.point_weights @ self.found[key].T
        return Curves("predicted" if model else "measured", model, kind, values[None], samples[:, None])

    def curves(self, key: tuple[str, str]) -> Curves:
        """PSS of the one run, (1, K)."""
        model, kind = key
        values, samples = self.inverse_sigma[key].mean(axis=1), self.samples[key]
        return Curves("predicted" if model else "measured", model, kind, values[None], samples[:, None])


def own_cameras(
    held: Held, run: int, acquired: Acquired, calibration: Calibration, result: ScheduleResult
) -> OwnCameras:
    """Predict and measure a run with each avatar's own cameras alone.

    Args:
        result: of both avatars, whose resamples of markers and trials are taken.
    """
    design = held.design
    groups = {name: design.stage.groups[name] for name in design.stage.names}
    both = np.any(list(groups.values()), axis=0)
    steps = len(design.scenes)
    headline = [held.levels[result.headline]]
    keys = [(model, kind) for model in ("", *result.noise_models) for kind in KINDS]
    inverse = {key: np.zeros((steps, len(both))) for key in keys}
    rates = {key: np.zeros((steps, len(both))) for key in keys}
    errors = []
    for step, scene in enumerate(design.scenes):
        state, steered = scene.state, design.runs[run].steered
        appearance = acquired.appearances[state_key(state)]
        contenders = held_contenders(scene, calibration)
        together = np.full((design.schedule.spec.trials, len(both), 3), np.nan)
        for name, markers in groups.items():
            mine = [c for c, assigned in enumerate(steered.assignments[step]) if assigned == name]
            if not mine:
                continue
            cameras = [steered.cameras[step][c] for c in mine]
            for contender in contenders:
                (prediction,) = predicted_at(scene, [tuple(cameras)], contender, appearance, markers)
                name_of = contender.name
                inverse[name_of, "filter"][step, markers] = inverse_sigma(prediction, single_frame=False)
                inverse[name_of, HEADLINE_KIND][step, markers] = predicted_inverse(prediction, headline)[0]
                inverse[name_of, "single frame"][step, markers] = inverse_sigma(prediction, single_frame=True)
                for kind in KINDS:
                    rates[name_of, kind][step, markers] = prediction.found
            requested = [design.views[run][step][c] for c in mine]
            rng = random_stream(
                design.schedule.spec.seed, "+".join(item.request.content for item in requested), "filter of own cameras"
            )
            views = [acquired.measured[item] for item in requested]
            found = measure_configuration(scene, cameras, views, rng)
            together[:, markers] = found.errors.errors_m[:, markers]
            rate = found.errors.detection_rate
            inverse["", "filter"][step, markers] = found.inverse_filter_sigma[markers]
            (at_headline,) = measured_inverse(cameras, state.points_m, views, found, headline)
            inverse["", HEADLINE_KIND][step, markers] = at_headline[markers]
            for kind in KINDS:
                rates["", kind][step, markers] = rate[markers]
        errors.append(MeasuredErrors(together[:, both]))
    inverse = {key: values[:, both] for key, values in inverse.items()}
    inverse["", "single frame"] = np.array([e.inverse_sigma for e in errors])
    weights = result.replicates[result.noise_models[0]].point_weights
    samples = {key: weights @ values.T for key, values in inverse.items()}
    # The stream of the result's own resamples, so that a ratio of the two keeps its pairing.
    rng = random_stream(design.schedule.spec.seed, result.avatar, "schedule intervals")
    replicates = sweep_replicates(errors, inverse[result.noise_models[0], "single frame"], rng, len(weights))
    samples["", "single frame"] = replicates.measured_pss
    return OwnCameras(inverse, samples, {key: values[:, both] for key, values in rates.items()}, weights)
