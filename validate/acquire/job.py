"""The jobs of a worker process: solve a scene state's light, or render and measure a view. One job at a time.

A worker keeps the scene state that it was sent last, and Mitsuba's scene of it. What it makes goes into the store; back
goes only what the tables need and the store does not hold.
"""

from __future__ import annotations

import pickle
import threading
import time
from dataclasses import dataclass
from functools import cache

import cv2

from pss import ImageSensor, PTZCamera
from render import backend
from render.certificate import Certificate
from render.keys import state_key
from render.lens.sampling import Sampling
from render.renderer import Renderer, ViewRequest
from render.store.folder import Store, StoreError
from render.store.light import baked
from render.store.remote import open_store
from render.store.views import DamagedViewError, certificate_of, save_view
from render.world.state import SceneState
from validate.acquire.request import Acquisition, LightError, error_line
from validate.markers.view_measurement import load_measurement, measure

__all__ = ["Job", "Made", "Measuring", "Place", "cores_here", "work"]

# The resource by which a Dask worker reports how many cores are its own (`dask worker --resources cores=4`).
CORES = "cores"


@dataclass(frozen=True)
class Place:
    """What is the same for all jobs of a run.

    Attributes:
        store: a folder's absolute path, or an address.
        variant: of Mitsuba.
        renderer: the identity that the run's views name (`Backend.identity`).
        cores: for each worker; None: those that the worker reports.
    """

    store: str
    variant: str
    renderer: str
    cores: int | None


@dataclass(frozen=True)
class Measuring:
    """One measuring of a view by a detector; `file` is the name that the run gives its result."""

    seed: int
    trials: int
    detector: str
    file: str


@dataclass(frozen=True)
class Job:
    """A view to be rendered and measured or, without a camera, the light of a scene state to be solved.

    `state` and `view` are hashes: the state itself is sent beside, to a worker that does not have it.
    """

    place: Place
    state: str
    view: str = ""
    camera: PTZCamera | None = None
    sensor: ImageSensor | None = None
    sampling: Sampling | None = None
    measurings: tuple[Measuring, ...] = ()


@dataclass(frozen=True)
class Made:
    """What came of a job.

    Attributes:
        failed: why nothing did; "" where all went well.
        certificate: of the view.
        render_s: s; None where the view was in the store.
        measured_s: s, of each measuring; None where it was in the store.
        light_s: s; None where the light was in the store, or not needed.
        lacks_state: the worker has to be sent the scene state.
    """

    failed: str = ""
    certificate: Certificate | None = None
    render_s: float | None = None
    measured_s: tuple[float | None, ...] = ()
    light_s: float | None = None
    lacks_state: bool = False


class _Kept:
    """What this process keeps from one job to the next."""

    # Dr.Jit locks up if two threads render at once, which a Dask worker with several threads would do.
    one_at_a_time = threading.Lock()
    state: tuple[str, SceneState] | None = None
    renderer: tuple[str, Renderer] | None = None
    cores = 0


def work(job: bytes, state: bytes | None) -> Made:
    """Do a pickled `Job`; `state` is its pickled scene state, or None if this worker was sent it before.

    Raises:
        StoreError: the store cannot be written, or the disk is full.
    """
    with _Kept.one_at_a_time:
        try:
            return _work(pickle.loads(job), state)
        except DamagedViewError as error:
            return Made(failed=error_line(error))
        except StoreError:
            raise
        except Exception as error:  # one failing view must not end the run
            return Made(failed=error_line(error))


def cores_here() -> int:
    """The cores of this Dask worker: its resource `cores`, or else all that its process may use."""
    from dask.system import CPU_COUNT
    from distributed import get_worker

    return max(1, int(get_worker().state.total_resources.get(CORES, CPU_COUNT)))


def _work(job: Job, pickled: bytes | None) -> Made:
    if pickled is not None:
        _Kept.state, _Kept.renderer = (job.state, pickle.loads(pickled)), None
    if _Kept.state is None or _Kept.state[0] != job.state:
        return Made(lacks_state=True)
    state, store, chosen = _Kept.state[1], open_store(job.place.store), _prepared(job.place)
    if state_key(state) != job.state:
        raise RuntimeError(f"this worker's project names the scene state {state_key(state)}, the run's {job.state}")
    if job.camera is None:
        solved: list[float] = []
        baked(state, store, chosen, lambda key, took_s: solved.append(took_s))
        return Made(light_s=solved[0] if solved else None)
    if job.sensor is None or job.sampling is None:
        raise ValueError(f"view {job.view} has no sensor or no sampling; allowed: both")
    request = ViewRequest(state, job.camera, job.sensor, job.sampling, chosen.identity)
    if request.key != job.view:
        raise RuntimeError(f"this worker's project or renderer names the view {request.key}, the run's {job.view}")
    return _view(request, job.measurings, store, chosen)


def _view(request: ViewRequest, measurings: tuple[Measuring, ...], store: Store, chosen: backend.Backend) -> Made:
    certificate, render_s = certificate_of(store, request), None
    if certificate is None:
        certificate, render_s = _render(request, store, chosen)
    try:
        measured_s = _measured(request, measurings, store)
    except DamagedViewError:
        # An image that its sum called whole, and whose bytes are not: rendered again, once.
        certificate, render_s = _render(request, store, chosen)
        measured_s = _measured(request, measurings, store)
    return Made("", certificate, render_s, measured_s)


def _render(request: ViewRequest, store: Store, chosen: backend.Backend) -> tuple[Certificate, float]:
    begin, key = time.perf_counter(), state_key(request.state)
    if _Kept.renderer is None or _Kept.renderer[0] != key:
        _Kept.renderer = None  # so that two scenes are never in memory at once
        try:
            meshes = baked(request.state, store, chosen)
        except StoreError:
            raise
        except Exception as error:
            raise LightError(f"the scene's light cannot be solved: {error_line(error)}") from error
        _Kept.renderer = key, Renderer(request.state, meshes, chosen)
    after_light = time.perf_counter()
    view = _Kept.renderer[1].render(request)
    save_view(store, view, request, time.perf_counter() - after_light)
    return view.certificate, time.perf_counter() - begin


def _measured(request: ViewRequest, measurings: tuple[Measuring, ...], store: Store) -> tuple[float | None, ...]:
    """Measure a stored view in each way that is not stored yet; the seconds of those that were made now."""
    made: list[float | None] = []
    for measuring in measurings:
        task = Acquisition(request, measuring.seed, measuring.trials, measuring.detector).task(store)
        if task.path.name != measuring.file:
            raise RuntimeError(f"this worker's project measures {task.path.name}, the run's {measuring.file}")
        if store.fetch(task.path) and load_measurement(task) is not None:
            made.append(None)
            continue
        begin = time.perf_counter()
        store.push(measure(task))
        made.append(time.perf_counter() - begin)
    return tuple(made)


def _prepared(place: Place) -> backend.Backend:
    chosen = _chosen(place.variant)
    if chosen.identity != place.renderer:
        raise RuntimeError(f"this worker renders with {chosen.identity}, the run with {place.renderer}")
    cores = cores_here() if place.cores is None else place.cores
    if cores != _Kept.cores:
        backend.set_threads(chosen, cores)
        # Captures are small: OpenCV's threads would only get in the way of other workers.
        cv2.setNumThreads(1)
        _Kept.cores = cores
    return chosen


@cache
def _chosen(variant: str) -> backend.Backend:
    return backend.choose(variant)
