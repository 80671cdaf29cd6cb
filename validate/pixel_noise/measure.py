"""Render each setup once, take noisy captures of it, and find the marker in each; what is stored is not done again.

One process renders (Mitsuba's own threads use all cores); others measure what is rendered meanwhile.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from pss.hints import Floats
from render import backend
from render.code_digest import Code, code_of
from render.keys import content_of, view_code
from render.random_streams import random_stream
from render.renderer import Renderer
from render.sensor import FixedPattern, capture, expected_electrons, fixed_pattern
from render.store.arrays import Arrays, check_arrays
from render.store.folder import Store
from validate.acquire.queue import WorkerQueue
from validate.markers.detector import Targets
from validate.markers.view_measurement import EXCLUDED as MEASURE_EXCLUDED
from validate.markers.view_measurement import measure_capture
from validate.pixel_noise.design import Plan, Shot
from validate.pixel_noise.laboratory import DICTIONARY, Setup
from validate.runs.progress import ViewProgress

__all__ = ["EXCLUDED", "Measured", "measure_all", "pixel_noise_code"]


# Rendered views that wait to be measured; more would only fill memory.
MOST_WAITING = 8
EXCLUDED = MEASURE_EXCLUDED | {
    "validate.pixel_noise.design": "chooses what is measured, which the names of views hold",
    "validate.runs.progress": "counts for people",
    "validate.acquire.queue": "has calls made in other processes",
}
"""Modules that the code of these measurements does not count, with the reason."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What was found in the captures of one shot.

    Attributes:
        residuals_px: px, (T, 2), found minus true centre; nan where the marker was not found or not localised.
        claimed_px2: px², (T, 2, 2), the covariance that each detection states for itself; nan likewise.
        physical_px2: px², (2, 2), the prediction of the `physical` noise model.
        bound_px2: px², (2, 2), the Cramér–Rao bound.
        unexpected_ids: detections of other markers, over all captures.
        render_noise_ratio: sampling noise over sensor noise (RMS over edge pixels) at the exposure of the render.
    """

    shot: Shot
    residuals_px: Floats
    claimed_px2: Floats
    physical_px2: Floats
    bound_px2: Floats
    unexpected_ids: int
    render_noise_ratio: float


@dataclass(frozen=True)
class Task:
    """What a worker needs besides the image; it gets no truth."""

    sensor: ImageSensor
    marker_id: int
    seed: int
    key: str
    trials: int


def find_centres(task: Task, electrons: NDArray[np.float32], pattern: FixedPattern) -> Arrays:
    """Centres and covariances found in captures of mean photoelectrons (height, width)."""
    name = f"pixel noise {task.sensor.exposure_ms!r}"
    targets, trials = Targets(DICTIONARY, (task.marker_id,)), []
    for trial in range(task.trials):
        numbers = capture(electrons, task.sensor, random_stream(task.seed, content_of(task.key), name, trial), pattern)
        trials.append(measure_capture(numbers, targets, task.sensor))
    pixels, covariances, unexpected_ids = zip(*trials, strict=True)
    return {
        "pixels": np.array(pixels)[:, 0],
        "covariance": np.array(covariances)[:, 0],
        "strangers": np.array(sum(unexpected_ids)),
    }


def find_and_bound(task: Task, electrons: NDArray[np.float32], pattern: FixedPattern, setup: Setup) -> Arrays:
    """Detections in the captures, with the setup's predictions."""
    return find_centres(task, electrons, pattern) | {"bound": setup.bound_px2()}


def measure_all(
    plan: Plan, store: Store, chosen: backend.Backend, seed: int, progress_for: Callable[[int], ViewProgress]
) -> list[Measured]:
    """Measure every shot of a plan, in its order. Ctrl-C stops it; what is stored is found by the next run."""
    keys = [shot.request(chosen.identity).key for shot in plan.shots]
    paths = [_path(store, key, shot, seed, plan.trials) for key, shot in zip(keys, plan.shots, strict=True)]

    # The centre point belongs to several series.
    def load(path: Path) -> Arrays | None:
        return store.load(path, lambda arrays: _check(arrays, plan.trials))

    loaded = {path: load(path) for path in dict.fromkeys(paths)}
    missing = {path: number for number, path in enumerate(paths) if loaded[path] is None}
    with progress_for(len(missing)) as progress:
        if missing:
            _make(plan, store, chosen, seed, keys, missing, progress)
    loaded |= {path: load(path) for path in missing}
    return [_measured(shot, loaded[path]) for shot, path in zip(plan.shots, paths, strict=True)]


def _check(arrays: Arrays, trials: int) -> None:
    """That a stored measurement has what `find_and_bound` gives.

    Raises:
        ValueError: other keys, shapes or kinds of numbers.
    """
    shapes: dict[str, tuple[int | None, ...]] = {
        "pixels": (trials, 2),
        "covariance": (trials, 2, 2),
        "strangers": (),
        "bound": (2, 2),
        "render_noise_ratio": (),
    }
    check_arrays(arrays, shapes)
    if arrays["strangers"].dtype.kind not in "iu":
        raise ValueError("its number of unexpected ids is none")


def pixel_noise_code() -> Code:
    """The code that finds markers in the captures of the laboratory, and bounds how well that can be done."""
    return code_of("validate.pixel_noise.measure", excluded=tuple(EXCLUDED))


def _path(store: Store, key: str, shot: Shot, seed: int, trials: int) -> Path:
    detector = f"pixel-noise/{pixel_noise_code().digest}/{shot.setup.sensor.exposure_ms!r}"
    return store.measurement(key, detector, seed, trials)


def _measured(shot: Shot, arrays: Arrays | None) -> Measured:
    assert arrays is not None
    return Measured(
        shot,
        arrays["pixels"].astype(float) - shot.setup.truth_px,
        arrays["covariance"].astype(float),
        shot.setup.physical_px2(),
        arrays["bound"].astype(float),
        int(arrays["strangers"]),
        float(arrays["render_noise_ratio"]),
    )


def _make(
    plan: Plan,
    store: Store,
    chosen: backend.Backend,
    seed: int,
    keys: Sequence[str],
    missing: dict[Path, int],
    progress: ViewProgress,
) -> None:
    by_view: dict[str, list[tuple[Path, int]]] = {}
    for path, number in missing.items():
        by_view.setdefault(keys[number], []).append((path, number))

    def done(item: tuple[Path, float], found: Arrays | None, error: BaseException | None) -> None:
        path, noise = item
        if found is None:
            assert error is not None
            raise error
        store.save(path, found | {"render_noise_ratio": np.array(noise)}, pixel_noise_code().digest)
        progress.advance("measured")

    workers = max(1, os.cpu_count() or 1)
    with WorkerQueue[tuple[Path, float], Arrays](workers, MOST_WAITING, done) as queue:
        for key, group in by_view.items():
            view = _view(plan.shots[group[0][1]], key, store, chosen)
            for path, number in group:
                setup = plan.shots[number].setup
                electrons = np.asarray(
                    expected_electrons(view["radiance"], setup.camera, setup.sensor), dtype=np.float32
                )
                pattern = fixed_pattern(setup.camera, setup.sensor)
                task = Task(setup.sensor, setup.pose.marker_id, seed, key, plan.trials)
                item = path, float(view["render_noise_ratio"])
                queue.submit(item, find_and_bound, task, electrons, pattern, setup)
        queue.drain()


def _view(shot: Shot, key: str, store: Store, chosen: backend.Backend) -> Arrays:
    """Radiance of a view and its sampling noise over the sensor's, from the store or rendered now."""
    path = store.folder / "pixel-noise" / key[:2] / f"{key}.npz"
    width, height = shot.setup.camera.resolution
    shapes: dict[str, tuple[int | None, ...]] = {"radiance": (height, width), "render_noise_ratio": ()}
    arrays = store.load(path, lambda arrays: check_arrays(arrays, shapes))
    if arrays is None:
        view = Renderer(shot.setup.state, shot.setup.baked(), chosen).render(shot.request(chosen.identity))
        arrays = {"radiance": view.radiance, "render_noise_ratio": np.array(view.certificate.edge_rms)}
        store.save(path, arrays, view_code().digest)
    return arrays
