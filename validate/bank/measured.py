"""Measurements of every configuration of a bank from its images: triangulated once for all metrics and noise models.

The filter's errors are those of a linearised simulation driven by rendered residuals (`validate.points.static_filter`),
of which the second moments are solved for (`validate.points.filter_moments`).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera
from pss.hints import Floats
from pss.processes.process import ProcessModel
from validate.bank.processes import workers_context
from validate.points.filter_moments import steady_moments
from validate.points.static_filter import trial_terms
from validate.points.triangulate import detection_weights, triangulated_points
from validate.stats.measured_errors import MeasuredErrors

__all__ = ["BankData", "ConfigurationErrors", "measure_all", "residual_moments"]

Views = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class BankData:
    """Detections of a bank: V views, T trials, N points.

    Attributes:
        cameras: V settings.
        points_m: m, the truth, (N, 3).
        pixels: px, (V, T, N, 2); nan where not detected.
        covariance: px², each detection's own, (V, T, N, 2, 2).
        process: the scene's own, of the filter.
        seed: of all draws.
    """

    cameras: tuple[PTZCamera, ...]
    points_m: Floats
    pixels: Floats
    covariance: Floats
    process: ProcessModel
    seed: int

    @property
    def detected(self) -> NDArray[np.bool_]:
        """(V, T, N)."""
        return np.isfinite(self.pixels[..., 0])

    @cached_property
    def weights(self) -> tuple[NDArray[np.bool_], Floats]:
        """Each view's part in any configuration: which points it detected, and 1/px² R⁻¹ (`detection_weights`)."""
        return detection_weights(self.cameras, self.pixels, self.covariance)

    @cached_property
    def trial_terms(self) -> tuple[Floats, Floats]:
        """1/m² (V, T, N, 3, 3) and 1/m (V, T, N, 3): what each view adds to Λ and y of the filter."""
        return trial_terms(self.cameras, self.points_m, self.pixels, *self.weights)

    def summed_terms(self, views: Sequence[int], used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Λ (T, N, 3, 3) and y (T, N, 3) of the configuration of `views`, of the detections `used` (c, T, N)."""
        information, pull = (terms[list(views)] for terms in self.trial_terms)
        return np.einsum("ctn,ctnij->tnij", used, information), np.einsum("ctn,ctni->tni", used, pull)

    def residuals(self) -> Floats:
        """px, detection less projection, (V, T, N, 2); nan where not detected."""
        projected = []
        for camera, seen in zip(self.cameras, self.detected, strict=True):
            pixels = np.full((len(self.points_m), 2), np.nan)
            ever = seen.any(axis=0)
            pixels[ever] = camera.project(self.points_m[ever])[0]
            projected.append(pixels)
        return self.pixels - np.array(projected)[:, None]


@dataclass(frozen=True, eq=False)
class ConfigurationErrors:
    """Measured errors of one configuration.

    Attributes:
        errors: of triangulation.
        used: (c, T, N), detections that triangulation kept.
        rejected: how many it threw out.
        prior_moment_m2: m², (N, 3, 3), second moment of the filter's a-priori error; None where it was not requested.
    """

    errors: MeasuredErrors
    used: NDArray[np.bool_]
    rejected: int
    prior_moment_m2: Floats | None = None

    @property
    def kept(self) -> int:
        """How many detections triangulation kept."""
        return int(self.used.sum())


def measure_all(
    data: BankData, configurations: Sequence[Sequence[int]], filtered: bool = False, processes: int | None = None
) -> list[ConfigurationErrors]:
    """Triangulate, and with `filtered` filter, every configuration; the result does not depend on `processes`."""
    jobs = [tuple(int(view) for view in chosen) for chosen in configurations]
    workers = min(processes or os.cpu_count() or 1, len(jobs))
    if workers <= 1:
        return [_measure(data, job, filtered) for job in jobs]
    with ProcessPoolExecutor(workers, workers_context(), _begin, (data, filtered)) as pool:
        return list(pool.map(_in_worker, jobs, chunksize=max(1, len(jobs) // (8 * workers))))


_data: tuple[BankData, bool] | None = None


def _begin(data: BankData, filtered: bool) -> None:
    global _data
    _data = data, filtered


def _in_worker(job: Views) -> ConfigurationErrors:
    assert _data is not None
    data, filtered = _data
    return _measure(data, job, filtered)


def _measure(data: BankData, views: Views, filtered: bool) -> ConfigurationErrors:
    chosen = list(views)
    cameras = [data.cameras[view] for view in chosen]
    detected, weight = data.weights
    points_m, used, rejected = triangulated_points(cameras, data.pixels[chosen], detected[chosen], weight[chosen])
    errors = MeasuredErrors(points_m - data.points_m)
    moment = None
    if filtered:
        moment, _ = steady_moments(*data.summed_terms(chosen, used), errors.detected, data.process)
    return ConfigurationErrors(errors, used, int(rejected.sum()), moment)


def residual_moments(residuals: Floats) -> Floats:
    """px², second moments (V, N, 2, 2) of residuals (V, T, N, 2); nan with fewer than three."""
    seen = np.isfinite(residuals[..., 0])
    known = np.where(seen[..., None], residuals, 0.0)
    count = seen.sum(axis=1)[..., None, None]
    moment = np.einsum("vtni,vtnj->vnij", known, known) / np.maximum(count, 1)
    return np.where(count >= 3, moment, np.nan)
