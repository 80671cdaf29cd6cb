"""Acquire views: stored ones are loaded, the others are rendered and measured, each view once.

One process renders (Mitsuba's own threads use all cores); others measure what is rendered meanwhile. Or, as
`Scale` of `validate.acquire.options` is set, worker processes each render and measure one view at a time, on this
machine or on others.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from render import backend
from render.keys import light_key, state_key
from render.light import lit_scene
from render.renderer import Renderer
from render.store.atomic import remove_abandoned
from render.store.folder import Store, StoreError
from render.store.light import baked
from render.store.locks import in_turn
from render.store.views import DamagedViewError, certificate_of, render_seconds_of, save_view
from render.world.state import SceneState
from validate.acquire.options import HERE, Scale
from validate.acquire.queue import WorkerQueue
from validate.acquire.request import Acquired, Acquisition, LightError, by_state, error_line, views_of
from validate.markers.view_measurement import load_measurement, measure
from validate.runs.interruption import raise_if_interrupted
from validate.runs.progress import ViewProgress

__all__ = ["Acquired", "Acquisition", "LightError", "acquire", "views_of", "with_whole_views"]

T = TypeVar("T")

# Rendered views that wait to be measured; more would only fill memory.
MOST_WAITING = 4


def acquire(
    requested: Iterable[Acquisition],
    store: Store,
    chosen: backend.Backend,
    progress_for: Callable[[int], ViewProgress],
    scale: Scale = HERE,
) -> Acquired:
    """Render and measure the requested views, each once, on the workers of `scale`, and load the measurements.

    A view that fails is in `failed`, and the others go on. Ctrl-C stops between views; what is stored stays and is
    found by the next run.

    Raises:
        StoreError: the disk is full, or something is missing from a store that cannot be written.
        ScaleError: the workers cannot be used, or cannot be reached any more.
    """
    remove_abandoned(store.folder.glob("**/"))
    unique = list(dict.fromkeys(requested))
    acquired = Acquired()
    todo = [item for item in unique if not (_certified(item, store, acquired) and _loaded(item, store, acquired))]
    if todo and not store.writable:
        raise StoreError(
            f"{store.folder} cannot be written, and {len(todo)} of {len(unique)} views are missing from it or not "
            "measured; allowed is a folder that you may write to, or one that has them all"
        )
    with progress_for(len(todo)) as progress:
        progress.found(item.request for item in acquired.measured)
        if todo and scale == HERE:
            _make(todo, store, chosen, progress, acquired)
        elif todo:
            # Imported late: Dask comes with an extra, and takes a second.
            from validate.acquire.run_jobs import make_on_workers

            make_on_workers(todo, store, chosen, progress, acquired, scale)
    for item in todo:
        if item.request.key not in acquired.failed and not _loaded(item, store, acquired):
            _failed(item, "its measurement is missing from the store", progress, acquired)
    # In the order of the requests, whatever was stored before.
    acquired.measured = {item: acquired.measured[item] for item in unique if item in acquired.measured}
    _find_appearances(unique, store, chosen, progress, acquired)
    return acquired


def with_whole_views(
    use: Callable[[], T],
    requested: Sequence[Acquisition],
    store: Store,
    chosen: backend.Backend,
    progress_for: Callable[[int], ViewProgress],
    scale: Scale = HERE,
) -> T:
    """What `use` gives, which reads views of the store; one that it finds damaged is rendered again before another try.

    Raises:
        DamagedViewError: views are damaged as fast as they are made.
    """
    for _ in requested:
        try:
            return use()
        except DamagedViewError:
            acquire(requested, store, chosen, progress_for, scale)
    return use()


def _certified(item: Acquisition, store: Store, acquired: Acquired) -> bool:
    """Whether the view's image is stored and its checksum matches."""
    key = item.request.key
    if key not in acquired.certificates:
        certificate = certificate_of(store, item.request)
        if certificate is None:
            return False
        acquired.certificates[key] = certificate
        if (seconds := render_seconds_of(store, item.request)) is not None:
            acquired.stored_seconds[key] = seconds
    return True


def _loaded(item: Acquisition, store: Store, acquired: Acquired) -> bool:
    """Whether the view's measurement is stored and whole; then it is loaded."""
    task = item.task(store)
    if store.fetch(task.path) and (measurement := load_measurement(task)) is not None:
        acquired.measured[item] = measurement
        return True
    return False


def _find_appearances(
    unique: Sequence[Acquisition],
    store: Store,
    chosen: backend.Backend,
    progress: ViewProgress,
    acquired: Acquired,
) -> None:
    """How the markers of each scene state look; where the light cannot be solved, the state's views have failed."""
    for key, state in {state_key(item.request.state): item.request.state for item in unique}.items():
        members = [item for item in unique if state_key(item.request.state) == key]
        if all(item.request.key in acquired.failed for item in members):
            continue  # so that light that cannot be solved is not tried once more
        try:
            acquired.appearances[key] = lit_scene.appearance(state, baked(state, store, chosen, progress.light_solved))
        except StoreError:
            raise
        except Exception as error:
            for item in members:
                if item.request.key not in acquired.failed:
                    _failed(item, error_line(error), progress, acquired)
                acquired.measured.pop(item, None)


def _make(
    todo: list[Acquisition], store: Store, chosen: backend.Backend, progress: ViewProgress, acquired: Acquired
) -> None:
    damaged: list[Acquisition] = []

    def done(item: Acquisition, path: Path | None, error: BaseException | None) -> None:
        if path is not None:
            store.push(path)
            acquired.measured_items.add(item)
            progress.measured(item.request, (store.facts(path) or {}).get("seconds"))
        elif isinstance(error, DamagedViewError) and item not in damaged:
            damaged.append(item)
            return
        elif isinstance(error, StoreError) and not isinstance(error, DamagedViewError):
            raise error
        else:
            _failed(item, error_line(error), progress, acquired)

    with WorkerQueue(max(1, os.cpu_count() or 1), MOST_WAITING, done) as queue:
        _render_all(todo, store, chosen, queue, progress, acquired)
        if damaged:
            # Images that their sums called whole, and whose bytes are not: rendered again, once.
            for item in damaged:
                acquired.certificates.pop(item.request.key, None)
            _render_all(list(damaged), store, chosen, queue, progress, acquired)


def _render_all(
    todo: list[Acquisition],
    store: Store,
    chosen: backend.Backend,
    queue: WorkerQueue[Acquisition, Path],
    progress: ViewProgress,
    acquired: Acquired,
) -> None:
    """Render what has no certificate, and have all of it measured."""
    renderers: dict[str, Renderer] = {}
    unlit: dict[str, str] = {}
    for item in in_turn(by_state(todo), lambda item: item.request.key, store.folder):
        raise_if_interrupted()
        request = item.request
        state = state_key(request.state)
        if state not in renderers:
            # The last state's scene and its instants of motion are not needed any more.
            renderers.clear()
        if not _certified(item, store, acquired):
            progress.note(
                f"rendering camera {request.camera.name}"
                if state in renderers or store.has(store.light(light_key(request.state)))
                else "solving the scene's light"
            )
            begin = time.perf_counter()
            try:
                if state in unlit:
                    raise LightError(unlit[state])
                renderer = _renderer(request.state, store, chosen, renderers, progress)
                after_light = time.perf_counter()
                view = renderer.render(request)
                save_view(store, view, request, time.perf_counter() - after_light)
            except StoreError:
                raise
            except Exception as error:  # one failing view must not end the sweep
                if isinstance(error, LightError):
                    unlit[state] = str(error)
                _failed(item, error_line(error), progress, acquired)
                continue
            acquired.render_seconds[request.key] = time.perf_counter() - begin
            acquired.certificates[request.key] = view.certificate
            acquired.rendered += 1
            progress.rendered(request, acquired.render_seconds[request.key])
        elif _loaded(item, store, acquired):  # another run made it meanwhile
            progress.measured(request, None)
            continue
        queue.submit(item, measure, item.task(store))
    queue.drain(raise_if_interrupted)
    raise_if_interrupted()


def _failed(item: Acquisition, cause: str, progress: ViewProgress, acquired: Acquired) -> None:
    acquired.failed[item.request.key] = cause
    progress.failed(item.request, cause)


def _renderer(
    state: SceneState, store: Store, chosen: backend.Backend, renderers: dict[str, Renderer], progress: ViewProgress
) -> Renderer:
    key = state_key(state)
    if key not in renderers:
        try:
            meshes = baked(state, store, chosen, progress.light_solved)
        except StoreError:
            raise
        except Exception as error:
            raise LightError(f"the scene's light cannot be solved: {error_line(error)}") from error
        renderers[key] = Renderer(state, meshes, chosen)
    return renderers[key]
