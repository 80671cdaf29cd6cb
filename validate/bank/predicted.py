"""The metric and its rivals for every configuration of a bank, under every contender."""

from __future__ import annotations

import dataclasses
import math
import os
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from pss import METRICS, Appearance, Evaluation, PTZCamera, evaluate_many
from pss.cameras.views import Views
from pss.hints import Bools, Floats
from pss.noise.covariance import PixelCovariance
from pss.processes.process import ProcessModel
from pss.surrogates import Shape
from pss.visibility.points import VisibilityTest, visible_in
from validate.bank.processes import workers_context
from validate.prediction.contenders import Contender

__all__ = ["GivenCovariance", "GivenVisibility", "Predicted", "PredictionTask", "predict_all"]


# Configurations evaluated in one call: views that they share are looked at once.
TOGETHER = 50
# Metrics that every prediction has the terms of.
ALWAYS = ("pss", "pss-single-frame")


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
class GivenVisibility:
    """A visibility test that is a table, (V, N), one row a setting: no line of sight is looked for twice."""

    cameras: tuple[PTZCamera, ...]
    visible: Bools
    name: str = "given"

    @classmethod
    def of(cls, views: Views, occluders: Sequence[Shape], tests: Sequence[VisibilityTest]) -> GivenVisibility:
        """What passes `tests`."""
        return cls(views.cameras, visible_in(views, occluders, tests))

    def passed(self, views: Views, candidates: Bools, occluder: Sequence[Shape]) -> Bools:
        """The table's rows of the cameras."""
        return np.asarray(candidates & self.visible[[self.cameras.index(camera) for camera in views.cameras]])


@dataclass(frozen=True, eq=False)
class PredictionTask:
    """What all configurations share: V settings, N points, and the contenders.

    Attributes:
        needs: by contender, the metrics that are requested under it.
    """

    cameras: tuple[PTZCamera, ...]
    points_m: Floats
    normals: Floats
    occluders: tuple[Shape, ...]
    appearance: Appearance | None
    process: ProcessModel
    contenders: tuple[Contender, ...]
    needs: Mapping[str, tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Predicted:
    """One configuration under one contender; points that are not observable have nan.

    Attributes:
        scores: metrics by name, of those that are no mean over the points.
        terms: of those that are, what each point adds, (N,).
        sigma_m: m, σ∞, (N,).
        covariance_m2: m², C of one frame, (N, 3, 3); with a probability of detection, E[C | found].
        information: 1/m², of one frame that finds the point, (N, 3, 3), likewise; the filter's at any process noise.
        found: probability of that, (N,): 1 where the point is observable, else 0, without one.
        visible: (c, N).
    """

    scores: Mapping[str, float]
    terms: Mapping[str, Floats]
    sigma_m: Floats
    covariance_m2: Floats
    information: Floats
    found: Floats
    visible: Bools


def predict_all(
    task: PredictionTask, configurations: Sequence[Sequence[int]], processes: int | None = None
) -> list[dict[str, Predicted]]:
    """By configuration and contender; the result does not depend on `processes`."""
    task = _with_tables(task)
    jobs = [tuple(int(view) for view in chosen) for chosen in configurations]
    workers = min(processes or os.cpu_count() or 1, math.ceil(len(jobs) / TOGETHER))
    parts = [jobs[start : start + TOGETHER] for start in range(0, len(jobs), TOGETHER)]
    if workers <= 1:
        return [found for part in parts for found in _predict(task, part)]
    with ProcessPoolExecutor(workers, workers_context(), _begin, (task,)) as pool:
        return [found for part in pool.map(_in_worker, parts) for found in part]


def _with_tables(task: PredictionTask) -> PredictionTask:
    """The same task with the visibility of each set of tests computed once."""
    views = Views(list(task.cameras), task.points_m, task.normals, task.appearance)
    known: dict[tuple[VisibilityTest, ...], GivenVisibility] = {}
    contenders = []
    for contender in task.contenders:
        if contender.visibility not in known:
            known[contender.visibility] = GivenVisibility.of(views, task.occluders, contender.visibility)
        contenders.append(dataclasses.replace(contender, visibility=(known[contender.visibility],)))
    return dataclasses.replace(task, contenders=tuple(contenders))


_task: PredictionTask | None = None


def _begin(task: PredictionTask) -> None:
    global _task
    _task = task


def _in_worker(jobs: list[tuple[int, ...]]) -> list[dict[str, Predicted]]:
    assert _task is not None
    return _predict(_task, jobs)


def _predict(task: PredictionTask, jobs: Sequence[tuple[int, ...]]) -> list[dict[str, Predicted]]:
    found: list[dict[str, Predicted]] = [{} for _ in jobs]
    for contender in task.contenders:
        evaluations = evaluate_many(
            [[task.cameras[view] for view in views] for views in jobs],
            task.points_m,
            task.normals,
            noise=contender.noise,
            process=task.process,
            occluder=task.occluders,
            appearance=task.appearance,
            visibility=contender.visibility,
            detection=contender.detection,
        )
        for of_all, evaluation in zip(found, evaluations, strict=True):
            of_all[contender.name] = _predicted(task, contender.name, evaluation)
    return found


def _predicted(task: PredictionTask, name: str, evaluation: Evaluation) -> Predicted:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a rival that is not defined for a configuration returns nan
        metrics = [METRICS[metric] for metric in dict.fromkeys((*ALWAYS, *task.needs[name]))]
        terms = {m.name: np.asarray(m.terms(evaluation), dtype=float) for m in metrics if m.terms is not None}
        scores = {m.name: float(m.score(evaluation)) for m in metrics if m.terms is None}
    return Predicted(
        scores,
        terms,
        evaluation.sigma_m,
        evaluation.single_frame_covariance,
        evaluation.information[:, :3, :3],
        evaluation.found,
        evaluation.visible,
    )
