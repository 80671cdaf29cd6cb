"""The local steady state of a schedule: at each step the people are held as they are, predicted and measured.

Runs whose cameras stand alike at a step are one configuration there: it is rendered, predicted and measured once.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss import Appearance, Evaluation, PTZCamera, evaluate_many
from pss.hints import Bools
from pss.noise import Calibration
from render.keys import state_key
from render.random_streams import random_stream
from scenes import Scene
from validate.acquire.acquire import Acquired
from validate.points.configuration import Measured, measure_configuration
from validate.points.static_filter import Tracked
from validate.points.triangulate import Triangulated
from validate.prediction.contenders import (
    CALIBRATED_LIMITS,
    FULL_MODEL,
    PHYSICAL_WHOLE,
    SCALED,
    Contender,
    own_models,
    scene_contenders,
)
from validate.prediction.process_levels import Level
from validate.schedule.design import Design
from validate.schedule.process_noise import RULED_BY, FilterLevels, levels_of_walk, measured_inverse, predicted_inverse
from validate.schedule.stage import BOTH, Stage
from validate.schedule.surrogate_predictions import SurrogatePrediction, predicted_at_surrogates
from validate.schedule.training import Training
from validate.stats.measured_errors import MeasuredErrors
from validate.sweeps.assessment import Assessment

__all__ = ["MODELS", "Held", "HeldStep", "assess_held", "held_contenders", "predicted_at", "training_levels"]


# What is judged: the paper's two readings as they are and scaled, what needs no fit, and what was calibrated on other
# views. Of these, the scaled ones are there if the calibration has their scales.
MODELS = (
    "as-printed",
    "corrected",
    "identity",
    *SCALED.values(),
    "physical",
    PHYSICAL_WHOLE,
    CALIBRATED_LIMITS,
    FULL_MODEL,
)


def held_contenders(scene: Scene, calibration: Calibration) -> list[Contender]:
    """What is judged in a scene: those of `MODELS`, then the models of the scene's own file."""
    names = (*MODELS, *(model.name for model in own_models(scene)))
    of_scene = {each.name: each for each in scene_contenders(scene, calibration)}
    return [of_scene[name] for name in names if name in of_scene]


@dataclass(frozen=True, eq=False)
class HeldStep:
    """One configuration at a step, predicted and measured.

    Attributes:
        assessments: of the markers of each avatar, and of both, by `Stage.groups`.
        surrogate: by the same groups and by noise model, the prediction at the surrogates' points.
        filters: by the same groups, the filter at the levels of process noise of `Held.levels`.
    """

    assessments: Mapping[str, Assessment]
    surrogate: Mapping[str, Mapping[str, SurrogatePrediction]]
    filters: Mapping[str, FilterLevels]


@dataclass(frozen=True, eq=False)
class Held:
    """All runs and steps, `steps[r][k]`, of a design, and the levels of process noise that they were judged at."""

    design: Design
    steps: tuple[tuple[HeldStep, ...], ...]
    levels: tuple[Level, ...]


def training_levels(stage: Stage, training: Sequence[Training], acquired: Acquired) -> list[Level]:
    """The levels of process noise of a schedule, by what is predicted for its training views.

    Of `acquired` it takes how the markers look in the solved light, and no measurement.

    Raises:
        RangeError: no marker is observable in any of them.
    """
    contender = Contender(RULED_BY, stage.scene.noise_model(RULED_BY))
    predicted = []
    for place in training:
        marker_appearance, every = acquired.appearances[state_key(place.scene.state)], stage.groups[BOTH]
        predicted += predicted_at(place.scene, [place.cameras], contender, marker_appearance, every)
    return levels_of_walk(predicted, stage.scene.process)


def assess_held(design: Design, acquired: Acquired, calibration: Calibration, levels: Sequence[Level]) -> Held:
    """Predict and measure every run at every step, the filter at the scene's process and at `levels`."""
    columns = [_assess_step(design, step, acquired, calibration, levels) for step in range(len(design.scenes))]
    return Held(design, tuple(zip(*columns, strict=True)), tuple(levels))


def _assess_step(
    design: Design, step: int, acquired: Acquired, calibration: Calibration, levels: Sequence[Level]
) -> list[HeldStep]:
    """All runs at one step."""
    scene, groups = design.scenes[step], design.stage.groups
    marker_appearance = acquired.appearances[state_key(scene.state)]
    requested = [views[step] for views in design.views]
    different = list(dict.fromkeys(requested))
    cameras = [tuple(item.request.camera for item in views) for views in different]
    contenders = held_contenders(scene, calibration)
    predicted = {
        name: {c.name: predicted_at(scene, cameras, c, marker_appearance, markers) for c in contenders}
        for name, markers in groups.items()
    }
    surrogates = predicted_at_surrogates(design, step, cameras, contenders, marker_appearance)
    found = {}
    for number, views in enumerate(different):
        measurements = [acquired.measured[item] for item in views]
        keys = "+".join(item.request.content for item in views)
        rng = random_stream(design.schedule.spec.seed, keys, "filter")
        measured = measure_configuration(scene, cameras[number], measurements, rng)
        rates = np.array([view.detected.mean(axis=0) for view in measurements])
        of_levels = measured_inverse(cameras[number], scene.state.points_m, measurements, measured, levels)
        assessments = {
            name: Assessment(
                cameras[number],
                {model: evaluations[number] for model, evaluations in predicted[name].items()},
                _measured_of(measured, markers),
                rates[:, markers],
            )
            for name, markers in groups.items()
        }
        filters = {
            name: FilterLevels(
                {model: predicted_inverse(of_model, levels) for model, of_model in assessments[name].predicted.items()},
                of_levels[:, markers],
            )
            for name, markers in groups.items()
        }
        found[views] = HeldStep(assessments, surrogates[number], filters)
    return [found[views] for views in requested]


def predicted_at(
    scene: Scene,
    cameras: Sequence[tuple[PTZCamera, ...]],
    contender: Contender,
    marker_appearance: Appearance,
    markers: Bools,
) -> list[Evaluation]:
    """Each configuration at some of the scene's markers, (N,)."""
    state = scene.state
    return list(
        evaluate_many(
            cameras,
            state.points_m[markers],
            state.normals[markers],
            noise=contender.noise,
            process=scene.process,
            occluder=state.occluders,
            appearance=_appearance_of(marker_appearance, markers),
            visibility=contender.visibility,
            detection=contender.detection,
        )
    )


def _appearance_of(marker_appearance: Appearance, markers: Bools) -> Appearance:
    """How some of the markers look, (N,)."""
    values = {field.name: getattr(marker_appearance, field.name) for field in dataclasses.fields(marker_appearance)}
    of_each = {name: value[markers] for name, value in values.items() if np.shape(value)[:1] == markers.shape}
    return dataclasses.replace(marker_appearance, **of_each)


def _measured_of(measured: Measured, markers: Bools) -> Measured:
    """The measurement of some of the markers, (N,)."""
    found, tracked = measured.triangulated, measured.tracked
    return Measured(
        MeasuredErrors(measured.errors.errors_m[:, markers]),
        MeasuredErrors(measured.linear.errors_m[:, markers]),
        Triangulated(
            *(getattr(found, name)[:, markers] for name in ("points_m", "covariance_m2", "linear_m")),
            found.views[:, markers],
            found.rejected[:, markers],
            found.used[:, :, markers],
        ),
        MeasuredErrors(measured.propagated.errors_m[:, markers]),
        Tracked(
            tracked.prior_moment_m2[markers],
            tracked.posterior_moment_m2[markers],
            tracked.prior_errors_m[:, markers],
            tracked.posterior_errors_m[:, markers],
            tracked.steps,
        ),
    )
