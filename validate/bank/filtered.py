"""The filter at many levels of process noise, over the configurations of a bank that were triangulated already.

A linearised simulation driven by rendered residuals (`validate.points.static_filter`): at each level the second moments
are solved for (`validate.points.filter_moments`), and at one of them filters are simulated too, for errors that have a
distribution.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats
from pss.processes.process import ProcessModel
from pss.riccati.covariances import largest_standard_deviation
from render.random_streams import random_stream
from validate.bank.measured import BankData, ConfigurationErrors
from validate.bank.processes import workers_context
from validate.points.filter_moments import steady_moments
from validate.points.static_filter import track
from validate.prediction.process_levels import Level, headline_of
from validate.stats.measured_errors import measured_inverse_sigma

__all__ = ["Filtered", "filter_all"]

Job = tuple[tuple[int, ...], NDArray[np.bool_], NDArray[np.bool_]]

# Simulated filters a point. Each gives one error, of its last frame.
RUNS = 8
# Time constants before that frame: filters start in P∞, and of the frozen bias e^-3 is not gathered yet. Nothing is
# averaged, as the moments are solved for.
TIME_CONSTANTS = (3.0, 0.0)


@dataclass(frozen=True, eq=False)
class Filtered:
    """Errors of the filter over K configurations at N points, for L process models; nan where never triangulated.

    Attributes:
        process: the one that is simulated.
        inverse_sigma: 1/m, (L, K, N), detection rate over the a-priori √λmax: the terms of the measured filter PSS.
        prior_moment_m2, posterior_moment_m2: m², (K, N, 3, 3), at that level.
        prior_errors_m, posterior_errors_m: m, (K, RUNS, N, 3), there.
    """

    process: ProcessModel
    inverse_sigma: Floats
    prior_moment_m2: Floats
    posterior_moment_m2: Floats
    prior_errors_m: Floats
    posterior_errors_m: Floats


def filter_all(
    data: BankData,
    configurations: NDArray[np.int64],
    measured: Sequence[ConfigurationErrors],
    levels: Sequence[Level],
    processes: int | None = None,
) -> Filtered:
    """Every configuration at every level, of the detections that triangulation kept; the same for any `processes`.

    The headline level is simulated too.

    Args:
        configurations: (K, c), views of each.
        measured: of the configurations, from `measure_all`.
        levels: L of them.
    """
    models, simulated = tuple(level.process for level in levels), headline_of(levels)
    jobs: list[Job] = [
        (tuple(views), found.used, found.errors.detected)
        for views, found in zip(configurations.tolist(), measured, strict=True)
    ]
    workers = min(processes or os.cpu_count() or 1, len(jobs))
    if workers <= 1:
        found = [_filter(data, models, simulated, job) for job in jobs]
    else:
        with ProcessPoolExecutor(workers, workers_context(), _begin, (data, models, simulated)) as pool:
            found = list(pool.map(_in_worker, jobs, chunksize=max(1, len(jobs) // (8 * workers))))
    sigma, *rest = (np.array(values) for values in zip(*found, strict=True))
    rate = np.array([f.errors.detection_rate for f in measured])
    inverse = measured_inverse_sigma(sigma.swapaxes(0, 1), np.broadcast_to(rate, sigma.swapaxes(0, 1).shape))
    return Filtered(models[simulated], inverse, *rest)


_shared: tuple[BankData, tuple[ProcessModel, ...], int] | None = None


def _begin(data: BankData, levels: tuple[ProcessModel, ...], simulated: int) -> None:
    global _shared
    _shared = data, levels, simulated


def _in_worker(job: Job) -> tuple[Floats, ...]:
    assert _shared is not None
    return _filter(*_shared, job)


def _filter(data: BankData, levels: Sequence[ProcessModel], simulated: int, job: Job) -> tuple[Floats, ...]:
    """m, a-priori √λmax (L, N); then moments (N, 3, 3) and errors (RUNS, N, 3) at the level that is simulated."""
    views, used, usable = job
    information, pull = data.summed_terms(views, used)
    moments = [steady_moments(information, pull, usable, process) for process in levels]
    rng = random_stream(data.seed, "+".join(map(str, views)), "filter")
    tracked = track(information, pull, usable, levels[simulated], rng, RUNS, TIME_CONSTANTS)
    sigma = np.array([largest_standard_deviation(prior) for prior, _ in moments])
    return sigma, *moments[simulated], tracked.prior_errors_m, tracked.posterior_errors_m
