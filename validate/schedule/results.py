"""Results of a schedule's runs in the form of sweeps: for each avatar, and for both, all runs at all steps in one row.

Item r · K + k of a result is run r at step k. Resamples of trials and markers are shared by all, so that differences
between strategies keep their pairing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pss.hints import Floats
from render.random_streams import random_stream
from scenes import Configuration
from validate.prediction.contenders import FULL_MODEL
from validate.schedule.held import Held
from validate.schedule.process_noise import headline_of_walk, inverse_sigma
from validate.stats.flatness import EXCHANGES
from validate.sweeps.assessment import Assessment
from validate.sweeps.replicates import SweepReplicates, sweep_replicates
from validate.sweeps.sweep import REPLICATES, Plan, SweepResult

__all__ = ["HEADLINE_KIND", "KINDS", "Curves", "ScheduleResult", "result_of"]


HEADLINE_KIND = "filter, q ≈ c"
KINDS = ("filter", HEADLINE_KIND, "single frame")
"""PSS made of σ∞ beside the filter over the held views, at the schedule's process and at the level of process noise
where σ∞ is neither all process nor all measurement (`validate.schedule.process_noise`); PSS made of C beside frames."""


@dataclass(frozen=True, eq=False)
class Curves:
    """PSS of R runs at K steps: 1/m, (R, K), and B resamples of it, (B, R, K).

    Attributes:
        side: "predicted" or "measured".
        noise_model: "" for what is measured.
        kind: one of `KINDS`.

    The same for shares of the markers, without a unit, where `ScheduleResult.counts` has them.
    """

    side: str
    noise_model: str
    kind: str
    values: Floats
    samples: Floats


@dataclass(frozen=True, eq=False)
class ScheduleResult(SweepResult):
    """A sweep's result of the markers of one avatar, or of both: `avatar`."""

    avatar: str
    held: Held

    @property
    def noise_models(self) -> tuple[str, ...]:
        """What was judged."""
        return tuple(self.assessments[0].predicted)

    @property
    def shown_model(self) -> str:
        """The noise model that figures show: the one with all that was calibrated."""
        return FULL_MODEL

    @property
    def shape(self) -> tuple[int, int]:
        """R runs and K steps."""
        return len(self.held.steps), len(self.held.steps[0])

    @cached_property
    def exchanged_ranges(self) -> Floats:
        """1/m; of a walk's instants the order is no question, and the ranks are judged as they are: never flat."""
        return np.zeros(EXCHANGES)

    @cached_property
    def curves(self) -> dict[tuple[str, str], Curves]:
        """By noise model ("" for what is measured) and kind."""
        found = {}
        for kind in KINDS:
            for model in self.noise_models:
                found[model, kind] = self.terms_of("predicted", model, kind, self._predicted_terms(model, kind))
            if kind == "single frame":
                samples = self._resampled.measured_pss
                found["", kind] = self._curves("measured", "", kind, self.measured_pss(True), samples)
            else:
                found["", kind] = self.terms_of("measured", "", kind, self._measured_terms(kind))
        return found

    @property
    def _resampled(self) -> SweepReplicates:
        """Weights of trials and markers, and what is measured under them: the same for all models."""
        return self.replicates[self.noise_models[0]]

    @property
    def headline(self) -> int:
        """Which of the held levels of process noise is the headline."""
        return headline_of_walk(self.held.levels)

    def level_terms(self, model: str, level: int) -> Floats:
        """1/m, (R·K, N), what each marker adds to PSS of the filter at a level; "" for what is measured."""
        filters = [step.filters[self.avatar] for of_run in self.held.steps for step in of_run]
        return np.array([(each.predicted[model] if model else each.measured)[level] for each in filters])

    def _predicted_terms(self, model: str, kind: str) -> Floats:
        if kind == HEADLINE_KIND:
            return self.level_terms(model, self.headline)
        return np.array([inverse_sigma(a.predicted[model], kind == "single frame") for a in self.assessments])

    def _measured_terms(self, kind: str) -> Floats:
        """Of the filter."""
        if kind == HEADLINE_KIND:
            return self.level_terms("", self.headline)
        return np.array([a.measured.inverse_filter_sigma for a in self.assessments])

    def terms_of(self, side: str, model: str, kind: str, terms: Floats) -> Curves:
        """Means of what markers add, (R·K, N), with the markers resampled."""
        return self._curves(side, model, kind, terms.mean(axis=1), self._resampled.point_weights @ terms.T)

    @cached_property
    def counts(self) -> dict[tuple[str, str], Curves]:
        """What PSS would be if all markers that count had σ = 1, by the keys of `curves`.

        Predicted, the share of markers that are expected to be found; measured, the share that is triangulated, in the
        mean over the trials. Resampled as the curves beside them, so that a ratio of the two is PSS of the markers that
        count.
        """
        replicates, found = self._resampled, {}
        weights = replicates.point_weights
        detected = np.array([a.measured.errors.detected for a in self.assessments], dtype=float)
        rates = np.array([a.measured.errors.detection_rate for a in self.assessments])
        by_trials = np.einsum("bt,stn,bn->bs", replicates.trial_weights, detected, weights, optimize=True)
        for kind in KINDS:
            for model in self.noise_models:
                share = np.array([a.predicted[model].found for a in self.assessments])
                found[model, kind] = self.terms_of("predicted", model, kind, share)
            samples = by_trials if kind == "single frame" else weights @ rates.T
            found["", kind] = self._curves("measured", "", kind, rates.mean(axis=1), samples)
        return found

    def _curves(self, side: str, model: str, kind: str, values: Floats, samples: Floats) -> Curves:
        return Curves(side, model, kind, values.reshape(self.shape), samples.reshape(-1, *self.shape))


def result_of(held: Held, avatar: str) -> ScheduleResult:
    """All runs and steps of `held` at the markers of one avatar, or of both (`stage.BOTH`)."""
    design = held.design
    runs, steps = len(held.steps), len(held.steps[0])
    configurations = tuple(_configuration(held, run, step, avatar) for run in range(runs) for step in range(steps))
    assessments = tuple(held.steps[run][step].assessments[avatar] for run in range(runs) for step in range(steps))
    views = tuple(design.views[run][step] for run in range(runs) for step in range(steps))
    # Writers of tables use only the sweep's name of a plan.
    plan = Plan(design.schedule, design.stage.scene, configurations, views)  # type: ignore[arg-type]
    replicates = _replicates(held, assessments, avatar)
    return ScheduleResult(plan, configurations, assessments, views, (), replicates, avatar, held)


def _configuration(held: Held, run: int, step: int, avatar: str) -> Configuration:
    """As sweeps have it, with the markers of `avatar` alone in its scene; the value is y of the first avatar."""
    design = held.design
    which, stage, scene = design.runs[run], design.stage, design.scenes[step]
    worn = stage.groups[avatar]
    markers = tuple(m for m, kept in zip(scene.state.markers, worn, strict=True) if kept)
    own = scene.replace(state=dataclasses.replace(scene.state, markers=markers))
    y = float(stage.walk.positions_m[stage.names[0]][step, 1])
    return Configuration(f"{which.label} step {step}", "y_m", y, which.steered.cameras[step], own)


def _replicates(held: Held, assessments: tuple[Assessment, ...], avatar: str) -> Mapping[str, SweepReplicates]:
    errors = [a.measured.errors for a in assessments]
    predicted = {
        model: np.array([inverse_sigma(a.predicted[model], single_frame=True) for a in assessments])
        for model in assessments[0].predicted
    }
    rng = random_stream(held.design.schedule.spec.seed, avatar, "schedule intervals")
    first = sweep_replicates(errors, next(iter(predicted.values())), rng, REPLICATES)
    # What is measured is the same for all models, and they are compared on the same resamples.
    return {
        model: dataclasses.replace(first, predicted_pss=first.point_weights @ inverse.T)
        for model, inverse in predicted.items()
    }
