"""Measure one view: many noisy captures of one render, the markers found and localised in each.

Runs in worker processes, which load neither Mitsuba nor the scene's geometry: a worker gets the image and the list of
the markers' numbers, and nothing of where they are.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context, resource_tracker
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from render.sensor import capture, fixed_pattern
from render.view import random_stream
from validate.detect import SEARCHES, Search, find_markers
from validate.interruption import interrupts_held
from validate.localise import localise
from validate.store import Store, discard_unfinished
from validate.stored_views import stored_view

__all__ = [
    "DETECTOR",
    "MeasureTask",
    "ViewMeasurement",
    "WorkerPool",
    "end_worker",
    "load_measurement",
    "measure",
    "measure_capture",
]

Floats = NDArray[np.float64]
T = TypeVar("T")

# s, for a worker to end after it was told to; what it holds up is only the prompt.
SECONDS_TO_STOP = 5.0
# Named in the store's hash: raised whenever detection or localisation change.
DETECTOR = "registration-6"


@dataclass(frozen=True, eq=False)
class ViewMeasurement:
    """Detections of one view over T trials and the scene's N markers.

    Attributes:
        pixels: px, OpenCV's, (T, N, 2); nan where a marker was not found or not localised.
        covariance: px², each detection's own, (T, N, 2, 2); nan likewise.
        strangers: detections of markers that the scene does not have.
        seconds: s, spent on captures, search and localisation.
    """

    pixels: Floats
    covariance: Floats
    strangers: int
    seconds: float

    @property
    def detected(self) -> NDArray[np.bool_]:
        """(T, N), found and localised."""
        return np.isfinite(self.pixels[..., 0])


@dataclass(frozen=True)
class MeasureTask:
    """What a worker needs to measure a view."""

    store: Path
    view_key: str
    dictionary: str
    marker_ids: tuple[int, ...]
    seed: int
    trials: int
    search: str = "plain"

    @property
    def path(self) -> Path:
        """Where the measurement is stored."""
        detector = f"{DETECTOR}/{self.dictionary}/{','.join(map(str, self.marker_ids))}"
        if self.search != "plain":
            detector += f"/{SEARCHES[self.search]}"
        return Store(self.store).measurement(self.view_key, detector, self.seed, self.trials)


def measure_capture(
    capture_dn: NDArray[np.uint16],
    dictionary: str,
    marker_ids: tuple[int, ...],
    sensor: ImageSensor,
    search: Search = SEARCHES["plain"],
) -> tuple[Floats, Floats, int]:
    """Find and localise markers in one capture: pixels (N, 2), covariance (N, 2, 2), and the number of strangers."""
    pixels = np.full((len(marker_ids), 2), np.nan)
    covariance = np.full((len(marker_ids), 2, 2), np.nan)
    index = {marker: number for number, marker in enumerate(marker_ids)}
    found = find_markers(capture_dn, dictionary, search)
    strangers = 0
    for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
        if marker not in index:
            strangers += 1
            continue
        localised = localise(capture_dn, corners, marker, dictionary, sensor)
        if localised is not None:
            pixels[index[marker]], covariance[index[marker]] = localised.centre_px, localised.covariance_px2
    return pixels, covariance, strangers


def measure(task: MeasureTask) -> Path:
    """Measure a stored view over its trials and store the result.

    Raises:
        DamagedViewError: the view is not there, or was found damaged and set aside.
        StoreError: the store cannot be written, or the disk is full.
    """
    begin = time.perf_counter()
    store = Store(task.store)
    view = stored_view(store, task.view_key)
    electrons = view.expected_electrons()
    pattern = fixed_pattern(view.camera, view.sensor)
    trials = []
    for trial in range(task.trials):
        rng = random_stream(task.seed, task.view_key, "capture", trial)
        numbers = capture(electrons, view.sensor, rng, pattern)
        trials.append(measure_capture(numbers, task.dictionary, task.marker_ids, view.sensor, SEARCHES[task.search]))
    pixels, covariances, strangers = zip(*trials, strict=True)
    seconds = time.perf_counter() - begin
    store.save(
        task.path,
        {
            "pixels": np.array(pixels),
            "covariance": np.array(covariances),
            "strangers": np.array(sum(strangers)),
            "seconds": np.array(seconds),
        },
        DETECTOR,
        {"seconds": seconds, "trials": task.trials, "pixels": int(electrons.size)},
    )
    return task.path


def load_measurement(task: MeasureTask) -> ViewMeasurement | None:
    """The stored measurement of a view, or None."""
    arrays = Store(task.store).load(task.path)
    if arrays is None:
        return None
    return ViewMeasurement(
        arrays["pixels"].astype(float),
        arrays["covariance"].astype(float),
        int(arrays["strangers"]),
        float(arrays["seconds"]),
    )


class WorkerPool(ProcessPoolExecutor):
    """Processes that measure. Ctrl-C, which reaches the whole group, is the parent's business alone."""

    def __init__(self, workers: int) -> None:
        # One view a core: libraries that start threads of their own only get in each other's way.
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        # "spawn", because a fork of a process with Dr.Jit's threads hangs.
        super().__init__(workers, mp_context=get_context("spawn"), initializer=_start_worker)
        # Started while Ctrl-C is held back, it would let it through again, to the worker that it is started for.
        resource_tracker.ensure_running()

    def submit(self, function: Callable[..., T], /, *args: object, **kwargs: object) -> Future[T]:
        """Submit a call. A worker started for it inherits the blocked interrupt, so that not even its start is cut."""
        with interrupts_held():
            return super().submit(function, *args, **kwargs)

    def stop(self) -> None:
        """Stop at once, busy workers too; no half-written file stays."""
        # No public way to reach the workers before Python 3.14.
        workers = list((self._processes or {}).values())
        self.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()
        for worker in workers:
            worker.join(SECONDS_TO_STOP)


def _start_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where no mask was inherited
    signal.signal(signal.SIGTERM, end_worker)
    cv2.setNumThreads(1)


def end_worker(_signal: int, _frame: object) -> None:
    """End this process at once, without a half-written file: what a worker does if it is told to stop."""
    # Not by an exception: the pool would catch it as the task's and go on with the next.
    discard_unfinished()
    os._exit(128 + signal.SIGTERM)
