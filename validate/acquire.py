"""Get views rendered and measured: what the store has is taken, the rest is made, each view once.

One process renders (Mitsuba's own threads use all cores); others measure what is rendered meanwhile.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pss import Appearance, PTZCamera
from render import backend, glow
from render.exr import ImageFileError, read_certificate, write_view
from render.light import solve_light
from render.sampling import Sampling
from render.state import SceneState
from render.view import Certificate, Renderer, ViewRequest, state_key
from scenes import Scene
from validate.interruption import raise_if_interrupted
from validate.measure import MeasureTask, ViewMeasurement, WorkerPool, load_measurement, measure
from validate.progress import ViewProgress
from validate.store import Store, StoreError, atomic_path

__all__ = ["Acquired", "Acquisition", "acquire", "views_of"]

# Rendered views that wait to be measured; more would only fill memory.
MOST_WAITING = 4


@dataclass(frozen=True)
class Acquisition:
    """A view that is wanted, with the trials to be measured on it and how markers are searched in them."""

    request: ViewRequest
    seed: int
    trials: int
    search: str = "plain"

    def task(self, store: Store) -> MeasureTask:
        """The measuring task of this view."""
        state = self.request.state
        ids = tuple(marker.id for marker in state.markers)
        return MeasureTask(
            store.folder, self.request.key, state.print.dictionary, ids, self.seed, self.trials, self.search
        )


def views_of(
    scene: Scene,
    cameras: Iterable[PTZCamera],
    sampling: Sampling,
    renderer: str,
    seed: int,
    trials: int,
    search: str = "plain",
) -> tuple[Acquisition, ...]:
    """A view of a scene for each of `cameras`, as `Acquisition` has them."""
    return tuple(
        Acquisition(ViewRequest(scene.state, camera, scene.sensor, sampling, renderer), seed, trials, search)
        for camera in cameras
    )


@dataclass
class Acquired:
    """What came of the wanted views; keys are the views' hashes (`measured`: with seed and trials).

    `appearances` says how the markers of each scene state look, by the state's hash, from its solved light;
    `failed` says why a view is missing; `rendered` and `measured_items` are what this run made itself.
    """

    measured: dict[Acquisition, ViewMeasurement] = field(default_factory=dict)
    certificates: dict[str, Certificate] = field(default_factory=dict)
    appearances: dict[str, Appearance] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    render_seconds: dict[str, float] = field(default_factory=dict)
    rendered: int = 0
    measured_items: set[Acquisition] = field(default_factory=set)


def acquire(
    wanted: Iterable[Acquisition],
    store: Store,
    chosen: backend.Backend,
    progress_for: Callable[[int], ViewProgress],
) -> Acquired:
    """Render and measure the wanted views, each once, and load the measurements.

    Ctrl-C stops between views; what is stored stays and is found by the next run.
    """
    unique = list(dict.fromkeys(wanted))
    acquired = Acquired()
    todo = [item for item in unique if not item.task(store).path.exists() or not _certified(item, store, acquired)]
    with progress_for(len(todo)) as progress:
        if todo:
            pool = WorkerPool(max(1, os.cpu_count() or 1))
            try:
                _make(todo, store, chosen, pool, progress, acquired)
            except BaseException:
                pool.stop()
                raise
            pool.shutdown()
    for state in {state_key(item.request.state): item.request.state for item in unique}.items():
        acquired.appearances[state[0]] = glow.appearance(state[1], baked(state[1], store, chosen))
    for item in unique:
        if item.request.key in acquired.failed:
            continue
        measurement = load_measurement(item.task(store))
        if measurement is None:
            acquired.failed[item.request.key] = "its measurement is missing from the store"
        else:
            acquired.measured[item] = measurement
    return acquired


def _certified(item: Acquisition, store: Store, acquired: Acquired) -> bool:
    """Whether the view's image is stored and readable."""
    key = item.request.key
    if key in acquired.certificates:
        return True
    path = store.view(key)
    if not path.exists():
        return False
    try:
        acquired.certificates[key] = read_certificate(path)
    except ImageFileError:
        path.unlink(missing_ok=True)
        return False
    return True


def _make(
    todo: list[Acquisition],
    store: Store,
    chosen: backend.Backend,
    pool: WorkerPool,
    progress: ViewProgress,
    acquired: Acquired,
) -> None:
    waiting: dict[Future[Path], Acquisition] = {}
    renderers: dict[str, Renderer] = {}
    for item in _by_state(todo):
        raise_if_interrupted()
        request = item.request
        if state_key(request.state) not in renderers:
            # The last state's scene and its instants of motion are not needed any more.
            renderers.clear()
        if not _certified(item, store, acquired):
            light_is_solved = state_key(request.state) in renderers or store.light(state_key(request.state)).exists()
            progress.note(f"rendering camera {request.camera.name}" if light_is_solved else "solving the scene's light")
            begin = time.perf_counter()
            try:
                view = _renderer(request.state, store, chosen, renderers).render(request)
                with atomic_path(store.view(request.key)) as temporary:
                    write_view(temporary, view, request)
            except StoreError:
                raise
            except Exception as error:  # one failing view must not end the sweep
                acquired.failed[request.key] = f"{type(error).__name__}: {error}"
                progress.advance("failed")
                continue
            acquired.render_seconds[request.key] = time.perf_counter() - begin
            acquired.certificates[request.key] = view.certificate
            acquired.rendered += 1
        waiting[pool.submit(measure, item.task(store))] = item
        while len(waiting) > MOST_WAITING:
            _collect(waiting, progress, acquired)
    while waiting:
        raise_if_interrupted()
        _collect(waiting, progress, acquired)
    raise_if_interrupted()


def _by_state(todo: list[Acquisition]) -> list[Acquisition]:
    """The same, those of one scene state together, in the order in which the states come first."""
    first: dict[str, int] = {}
    for item in todo:
        first.setdefault(state_key(item.request.state), len(first))
    return sorted(todo, key=lambda item: first[state_key(item.request.state)])


def _collect(waiting: dict[Future[Path], Acquisition], progress: ViewProgress, acquired: Acquired) -> None:
    done, _ = wait(waiting, return_when=FIRST_COMPLETED)
    for future in done:
        item = waiting.pop(future)
        error = future.exception()
        if error is None:
            acquired.measured_items.add(item)
        else:
            acquired.failed[item.request.key] = f"{type(error).__name__}: {error}"
        progress.advance(f"measured camera {item.request.camera.name}")


def _renderer(state: SceneState, store: Store, chosen: backend.Backend, renderers: dict[str, Renderer]) -> Renderer:
    key = state_key(state)
    if key not in renderers:
        renderers[key] = Renderer(state, baked(state, store, chosen), chosen)
    return renderers[key]


def baked(state: SceneState, store: Store, chosen: backend.Backend | None = None) -> glow.GlowMeshes:
    """The lit scene of a state, from the store or solved now: by `chosen`'s rays where meshes stand in the way."""
    path = store.light(state_key(state))
    arrays = store.load(path)
    if arrays is None:
        meshes = glow.bake(state, solve_light(state, backend.start(chosen) if chosen else None))
        store.save(path, {name: np.asarray(value) for name, value in vars(meshes).items()})
        return meshes
    return glow.GlowMeshes(**arrays)
