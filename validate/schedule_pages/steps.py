"""The different steps of a schedule as a report shows them: runs that set the cameras alike share a step."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss import Evaluation
from validate.acquire.acquire import Acquisition
from validate.markers.view_measurement import ViewMeasurement
from validate.pages.steps import Step, covariances, sight_of
from validate.schedule.design import Design
from validate.schedule.runs import limit_name
from validate.schedule.stage import BOTH

__all__ = ["Different", "different", "label_of", "steps_of_design"]


@dataclass(frozen=True)
class Different:
    """The different pictures of a schedule.

    Attributes:
        places: run and step of each, those of a step together.
        courses: by strategy and zoom limit, which of them each step of the walk is.
    """

    places: tuple[tuple[int, int], ...]
    courses: Mapping[tuple[str, str], tuple[int, ...]]


def different(design: Design) -> Different:
    """Runs that see the same views for the same avatars at a step are one there."""
    found: dict[object, int] = {}
    places: list[tuple[int, int]] = []
    courses: dict[tuple[str, str], list[int]] = {(r.strategy, limit_name(r.zoom_limit)): [] for r in design.runs}
    for step in range(len(design.scenes)):
        for number, run in enumerate(design.runs):
            key = (step, design.views[number][step], run.steered.assignments[step])
            if key not in found:
                found[key] = len(places)
                places.append((number, step))
            courses[run.strategy, limit_name(run.zoom_limit)].append(found[key])
    return Different(tuple(places), {name: tuple(numbers) for name, numbers in courses.items()})


def label_of(y_m: float) -> str:
    """Such as "y = −1.2 m"; a step that is meant to be the middle may come out a rounding beside it."""
    return f"y = {round(y_m, 6) + 0.0:.2g} m".replace("-", "−")


def steps_of_design(
    design: Design,
    places: Sequence[tuple[int, int]],
    predictions: Sequence[Mapping[str, Evaluation]],
    measured: Mapping[Acquisition, ViewMeasurement],
) -> list[Step]:
    """The steps of a schedule at some places, with the markers of both avatars.

    Args:
        predictions: for each place, the metric by noise model, at the markers of both.
        measured: the detections of every view that they need.
    """
    worn, steps = design.stage.groups[BOTH], []
    states = []
    for scene in design.scenes:
        markers = tuple(m for m, kept in zip(scene.state.markers, worn, strict=True) if kept)
        states.append(dataclasses.replace(scene.state, markers=markers))
    y_m = design.stage.walk.positions_m[design.stage.names[0]][:, 1]
    for (number, step), predicted in zip(places, predictions, strict=True):
        run, state = design.runs[number], states[step]
        cameras = run.steered.cameras[step]
        sights = []
        for camera, item in zip(cameras, design.views[number][step], strict=True):
            found = measured[item]
            own = dataclasses.replace(found, pixels=found.pixels[:, worn], covariance=found.covariance[:, worn])
            sights.append(sight_of(camera, state.points_m, item.request.key, own))
        steps.append(
            Step(
                f"{run.strategy}, {label_of(float(y_m[step]))}",
                state,
                tuple(cameras),
                (),
                tuple(run.steered.assignments[step]),
                np.asarray(next(iter(predicted.values())).visible),
                covariances(predicted),
                tuple(sights),
            )
        )
    return steps
