"""What the images say of every configuration of a bank: triangulated once for all metrics and noise models."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera
from pss.process import ProcessModel
from render.view import random_stream
from validate.bank.workers import workers_context
from validate.errors3d import MeasuredErrors
from validate.track import track_static
from validate.triangulate import detection_weights, triangulated_points

__all__ = ["BankData", "ConfigurationErrors", "measure_all", "residual_moments"]

Floats = NDArray[np.float64]
Views = tuple[int, ...]

# Filters a point; the moments of a configuration are averages over 20 frames and more of each.
FILTER_RUNS = 16


@dataclass(frozen=True, eq=False)
class BankData:
    """Detections of a bank: V views, T trials, N points.

    Attributes:
        cameras: V settings.
        points_m: m, the truth, (N, 3).
        pixels: px, (V, T, N, 2); nan where not detected.
        covariance: px², each detection's own, (V, T, N, 2, 2).
        process: of the filter.
        seed: of the filter's draws.
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
        """What each view says in any configuration: which points it detected, and 1/px² R⁻¹ (`detection_weights`)."""
        return detection_weights(self.cameras, self.pixels, self.covariance)

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

    `kept` and `rejected` count detections. Of the filter, where it was run: m², second moments (N, 3, 3), and m, errors
    in the last frame of each run (runs, N, 3), before and after the update.
    """

    errors: MeasuredErrors
    kept: int
    rejected: int
    prior_moment_m2: Floats | None = None
    posterior_moment_m2: Floats | None = None
    prior_errors_m: Floats | None = None
    posterior_errors_m: Floats | None = None


def measure_all(
    data: BankData, configurations: Sequence[Sequence[int]], filtered: bool = False, processes: int | None = None
) -> list[ConfigurationErrors]:
    """Triangulate, and with `filtered` track, every configuration; the result does not depend on `processes`."""
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
    result = ConfigurationErrors(MeasuredErrors(points_m - data.points_m), int(used.sum()), int(rejected.sum()))
    if not filtered:
        return result
    kept = np.where(used[..., None], data.pixels[chosen], np.nan)
    usable = np.isfinite(points_m[..., 0])
    rng = random_stream(data.seed, "+".join(map(str, chosen)), "filter")
    tracked = track_static(
        cameras, data.points_m, kept, data.covariance[chosen], usable, data.process, rng, FILTER_RUNS
    )
    return dataclasses.replace(
        result,
        prior_moment_m2=tracked.prior_moment_m2,
        posterior_moment_m2=tracked.posterior_moment_m2,
        prior_errors_m=tracked.prior_errors_m,
        posterior_errors_m=tracked.posterior_errors_m,
    )


def residual_moments(residuals: Floats) -> Floats:
    """px², second moments (V, N, 2, 2) of residuals (V, T, N, 2); nan with fewer than three."""
    seen = np.isfinite(residuals[..., 0])
    known = np.where(seen[..., None], residuals, 0.0)
    count = seen.sum(axis=1)[..., None, None]
    moment = np.einsum("vtni,vtnj->vnij", known, known) / np.maximum(count, 1)
    return np.where(count >= 3, moment, np.nan)
