"""What the metric says of every configuration of a bank, under every noise model, and what its rivals say."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from pss import METRICS, Appearance, NoiseModel, PTZCamera, evaluate
from pss.noise.covariance import PixelCovariance
from pss.process import ProcessModel
from pss.surrogates import Shape
from pss.views import Views

__all__ = ["GivenCovariance", "Predicted", "PredictionTask", "predict_all"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GivenCovariance:
    """A noise factor that is a table: px², (V, N, 2, 2), one row a setting; what was never measured is not seen."""

    cameras: tuple[PTZCamera, ...]
    covariance_px2: Floats
    name: str = "given"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², the table's rows of the cameras."""
        rows = [self.cameras.index(camera) for camera in views.cameras]
        table = self.covariance_px2[rows]
        known = np.isfinite(table).all(axis=(-2, -1))
        uu, vv, uv = (np.where(known, table[..., i, j], np.inf if i == j else 0.0) for i, j in ((0, 0), (1, 1), (0, 1)))
        return PixelCovariance(uu, vv, uv)


@dataclass(frozen=True, eq=False)
class PredictionTask:
    """What all configurations share: V settings, N points, and the models.

    Attributes:
        needs: by noise model, the metrics that are asked under it.
    """

    cameras: tuple[PTZCamera, ...]
    points_m: Floats
    normals: Floats
    occluders: tuple[Shape, ...]
    appearance: Appearance | None
    process: ProcessModel
    models: tuple[NoiseModel, ...]
    needs: Mapping[str, tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Predicted:
    """One configuration under one noise model; points that are not observable have nan.

    Attributes:
        scores: metrics by name.
        sigma_m: m, σ∞, (N,).
        covariance_m2: m², C of one frame, (N, 3, 3).
        prior_m2, posterior_m2: m², position blocks of P⁻ and P⁺, (N, 3, 3).
        visible: (c, N).
    """

    scores: Mapping[str, float]
    sigma_m: Floats
    covariance_m2: Floats
    prior_m2: Floats
    posterior_m2: Floats
    visible: NDArray[np.bool_]


def predict_all(
    task: PredictionTask, configurations: Sequence[Sequence[int]], processes: int | None = None
) -> list[dict[str, Predicted]]:
    """By configuration and noise model; the result does not depend on `processes`."""
    jobs = [tuple(int(view) for view in chosen) for chosen in configurations]
    workers = min(processes or os.cpu_count() or 1, len(jobs))
    if workers <= 1:
        return [_predict(task, job) for job in jobs]
    with ProcessPoolExecutor(workers, get_context("spawn"), _begin, (task,)) as pool:
        return list(pool.map(_in_worker, jobs, chunksize=max(1, len(jobs) // (8 * workers))))


_task: PredictionTask | None = None


def _begin(task: PredictionTask) -> None:
    global _task
    _task = task


def _in_worker(job: tuple[int, ...]) -> dict[str, Predicted]:
    assert _task is not None
    return _predict(_task, job)


def _predict(task: PredictionTask, views: tuple[int, ...]) -> dict[str, Predicted]:
    cameras = [task.cameras[view] for view in views]
    found = {}
    for model in task.models:
        evaluation = evaluate(
            cameras,
            task.points_m,
            task.normals,
            noise=model,
            process=task.process,
            occluder=task.occluders,
            appearance=task.appearance,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a rival that is not defined for a configuration says so with its number
            scores = {name: float(METRICS[name].score(evaluation)) for name in task.needs[model.name]}
        found[model.name] = Predicted(
            scores,
            evaluation.sigma_m,
            evaluation.single_frame_covariance,
            evaluation.covariance[:, :3, :3],
            evaluation.posterior[:, :3, :3],
            evaluation.visible,
        )
    return found
