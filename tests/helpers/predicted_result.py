"""A sweep's result for tests of figures: what is predicted is the real one, what is measured is made up."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

import scenes
from render.light.estimated_light import estimated_appearance
from scenes import load_sweep
from validate.prediction.contenders import shown_model
from validate.prediction.predict import predict

__all__ = ["predicted_result"]

TRIALS = 20


def predicted_result(name: str, measured: Sequence[float] | None = None, every: int = 4) -> Any:
    """The result of a sweep of the project with every so many of its markers.

    Args:
        measured: PSS of its first steps, which are then all; by default of all of its steps, rising from 1 to 2.
    """
    sweep = load_sweep(name)
    scene = scenes.load(sweep.scene_path)
    scene = scene.replace(state=dataclasses.replace(scene.state, markers=scene.state.markers[::every]))
    steps = tuple(dataclasses.replace(step, scene=scene) for step in sweep.configurations(scene))
    pss = np.linspace(1.0, 2.0, len(steps)) if measured is None else np.array(measured)
    steps = steps[: len(pss)]
    appearance = estimated_appearance(scene.state)
    predicted = [predict(scene, step.cameras, appearance) for step in steps]
    draws = np.array([0.9, 1.0, 1.1])[:, None] * pss
    points = len(scene.state.markers)
    models = tuple(model.name for model in scene.noise_models)
    return SimpleNamespace(
        plan=SimpleNamespace(sweep=sweep, scene=scene),
        configurations=steps,
        assessments=[
            SimpleNamespace(
                predicted=each,
                measured=SimpleNamespace(
                    errors=SimpleNamespace(detected=np.ones((TRIALS, points), dtype=bool)),
                    inverse_filter_sigma=np.full(points, 3 * value),
                ),
            )
            for each, value in zip(predicted, pss, strict=True)
        ],
        noise_models=models,
        shown_model=shown_model(models),
        replicates={
            model: SimpleNamespace(
                measured_pss=draws,
                measured_pss_of_trials=draws,
                measured_pss_of_points=draws,
                point_weights=np.full((len(draws), points), 1 / points),
            )
            for model in models
        },
        # Steps that are exchanged make no difference: what differs is no chance.
        exchanged_ranges=np.zeros(100),
        measured_pss=lambda single_frame=True: pss * (1 if single_frame else 3),
        predicted_pss=lambda model, single_frame=True: np.array(
            [each[model].pss_single_frame if single_frame else each[model].pss for each in predicted]
        ),
    )
