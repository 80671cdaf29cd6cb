"""One sweep from acquired views to assessed configurations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pss import RangeError
from pss.hints import Floats
from render.keys import state_key
from render.lens.sampling import Sampling
from render.random_streams import random_stream
from scenes import Configuration, Scene, SweepFile
from validate.acquire.acquire import Acquired, Acquisition, views_of
from validate.markers.detector_table import DEFAULT_DETECTOR
from validate.markers.view_measurement import ViewMeasurement
from validate.prediction.contenders import shown_model
from validate.prediction.own_metrics import OwnScores, own_metrics, own_scores
from validate.stats.flatness import exchanged_ranges
from validate.sweeps.assessment import Assessment, assess
from validate.sweeps.replicates import SweepReplicates, sweep_replicates

__all__ = ["Plan", "SweepResult", "assess_sweep", "plan"]


REPLICATES = 500


@dataclass(frozen=True, eq=False)
class Plan:
    """A sweep with its configurations and the views that they need."""

    sweep: SweepFile
    scene: Scene
    configurations: tuple[Configuration, ...]
    views: tuple[tuple[Acquisition, ...], ...]
    """One for each camera of each configuration."""


@dataclass(frozen=True, eq=False)
class SweepResult:
    """A sweep's assessed configurations.

    Attributes:
        configurations, assessments, views: those whose views all exist, in the sweep's order.
        skipped: label and cause of those with a failed view.
        replicates: by noise model, resamples of trials and points shared by all configurations.
    """

    plan: Plan
    configurations: tuple[Configuration, ...]
    assessments: tuple[Assessment, ...]
    views: tuple[tuple[Acquisition, ...], ...]
    skipped: tuple[tuple[str, str], ...]
    replicates: dict[str, SweepReplicates]

    @cached_property
    def own_scores(self) -> dict[str, tuple[OwnScores, ...]]:
        """By noise model, the metrics of installed entry points at each of the S steps."""
        names = self.noise_models if own_metrics() else ()
        return {model: tuple(own_scores(each.predicted[model]) for each in self.assessments) for model in names}

    @property
    def noise_models(self) -> tuple[str, ...]:
        """Names of the noise models, in the scene's order."""
        return tuple(model.name for model in self.plan.scene.noise_models)

    @property
    def shown_model(self) -> str:
        """The noise model that figures show."""
        return shown_model(self.noise_models)

    @cached_property
    def exchanged_ranges(self) -> Floats:
        """1/m, ranges of measured single-frame PSS over the steps where they are exchanged within each trial."""
        rng = random_stream(self.plan.sweep.seed, self.plan.sweep.name, "flatness")
        return exchanged_ranges([assessment.measured.errors for assessment in self.assessments], rng)

    def predicted_pss(self, model: str, single_frame: bool = True) -> Floats:
        """1/m, (S,), PSS made of C (single frame) or of P∞ (the paper's)."""
        chosen = [assessment.predicted[model] for assessment in self.assessments]
        return np.array([e.pss_single_frame if single_frame else e.pss for e in chosen])

    def measured_pss(self, single_frame: bool = True) -> Floats:
        """1/m, (S,), measured PSS of the single-frame or of the filter kind."""
        chosen = [assessment.measured for assessment in self.assessments]
        return np.array([m.errors.pss() if single_frame else m.pss_filter for m in chosen])

    def measured_halves(self) -> tuple[Floats, Floats]:
        """1/m, (S,) each, measured single-frame PSS of the even and of the odd trials."""
        halves = [assessment.measured.errors.halves() for assessment in self.assessments]
        first, second = zip(*halves, strict=True)
        return np.array([h.pss() for h in first]), np.array([h.pss() for h in second])


def plan(sweep: SweepFile, scene: Scene, renderer: str, sampling: Sampling, detector: str = DEFAULT_DETECTOR) -> Plan:
    """Name the views that a sweep needs, and the detector that measures them.

    Raises:
        RangeError: the scene's exposure is still to be chosen; a view's name contains it.
    """
    if scene.auto_exposure is not None:
        raise RangeError(f'{scene.path}: sensor.exposure_ms = "auto"; allowed: a scene after Scene.with_exposure')
    configurations = tuple(sweep.configurations(scene))
    views = tuple(
        views_of(each.scene, each.cameras, sampling, renderer, sweep.seed, sweep.trials, detector)
        for each in configurations
    )
    return Plan(sweep, scene, configurations, views)


def assess_sweep(plan: Plan, acquired: Acquired) -> SweepResult:
    """Predict and measure every configuration whose views exist."""
    kept, assessments, views, skipped = [], [], [], []
    for configuration, requested in zip(plan.configurations, plan.views, strict=True):
        failed = [acquired.failed[w.request.key] for w in requested if w.request.key in acquired.failed]
        if failed:
            skipped.append((configuration.label, failed[0]))
            continue
        measurements = _measurements(requested, acquired)
        # The filter's random numbers belong to the configuration, whatever sweep or order it is met in.
        keys = "+".join(w.request.content for w in requested)
        rng = random_stream(plan.sweep.seed, keys, "filter")
        appearance = acquired.appearances[state_key(configuration.scene.state)]
        kept.append(configuration)
        views.append(requested)
        assessments.append(assess(configuration.scene, configuration.cameras, measurements, rng, appearance))
    return SweepResult(
        plan,
        tuple(kept),
        tuple(assessments),
        tuple(views),
        tuple(skipped),
        _replicates(plan, assessments) if assessments else {},
    )


def _measurements(requested: Sequence[Acquisition], acquired: Acquired) -> list[ViewMeasurement]:
    return [acquired.measured[item] for item in requested]


def _replicates(plan: Plan, assessments: Sequence[Assessment]) -> dict[str, SweepReplicates]:
    found = {}
    for model in plan.scene.noise_models:
        inverse = [1 / assessment.predicted[model.name].single_frame_sigma_m for assessment in assessments]
        # The same stream for every model: the models are compared on the same resamples.
        rng = random_stream(plan.sweep.seed, plan.sweep.name, "intervals")
        errors = [assessment.measured.errors for assessment in assessments]
        found[model.name] = sweep_replicates(errors, np.nan_to_num(np.array(inverse)), rng, REPLICATES)
    return found
