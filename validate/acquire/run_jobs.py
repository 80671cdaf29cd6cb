"""Views made by workers: jobs are handed out, and results are counted, reported and kept."""

from __future__ import annotations

import pickle
from collections.abc import Sequence

from render.backend import Backend
from render.keys import light_key, state_key
from render.store.folder import Store, StoreError
from validate.acquire.checks import check_workers, store_name
from validate.acquire.dask_workers import WorkerGoneError, Workers, workers_of
from validate.acquire.handout import MOST_DEATHS, Handout
from validate.acquire.job import Job, Made, Measuring, Place
from validate.acquire.options import Scale
from validate.acquire.request import Acquired, Acquisition, by_state, error_line
from validate.runs.interruption import raise_if_interrupted
from validate.runs.progress import ViewProgress

__all__ = ["hand_out", "jobs_of", "make_on_workers"]

# s, of waiting before Ctrl-C is looked for once more.
POLL_SECONDS = 0.5


def make_on_workers(
    todo: Sequence[Acquisition],
    store: Store,
    chosen: Backend,
    progress: ViewProgress,
    acquired: Acquired,
    scale: Scale,
) -> None:
    """Have views rendered and measured by workers; the same views come of any number of them.

    Raises:
        StoreError: the store cannot be written, or the disk is full.
        ScaleError: the workers cannot be used, or cannot be reached any more.
    """
    progress.note("starting workers")
    if scale.workers is not None:
        # No more than can have a view; the fewer there are, the more cores each has.
        scale = Scale(workers=min(scale.workers, len({item.request.key for item in todo})))
    with workers_of(scale) as workers:
        check_workers(workers, store, chosen)
        place = Place(store_name(store), chosen.variant, chosen.identity, workers.cores)
        hand_out(todo, place, workers, store, progress, acquired)
    # In the order in which one process would have made them, whoever was first.
    keys = dict.fromkeys(item.request.key for item in by_state(todo))
    acquired.failed |= {key: acquired.failed.pop(key) for key in keys if key in acquired.failed}


def jobs_of(todo: Sequence[Acquisition], place: Place, store: Store) -> dict[str, tuple[Job, list[Acquisition]]]:
    """A job for each view, by the view's hash, with all its requests; those of one scene state together."""
    requested: dict[str, list[Acquisition]] = {}
    for item in by_state(todo):
        requested.setdefault(item.request.key, []).append(item)
    jobs = {}
    for key, items in requested.items():
        request = items[0].request
        measurings = tuple(
            Measuring(item.seed, item.trials, item.detector, item.task(store).path.name) for item in items
        )
        state = state_key(request.state)
        job = Job(place, state, key, request.camera, request.sensor, request.sampling, measurings)
        jobs[key] = job, items
    return jobs


def hand_out(
    todo: Sequence[Acquisition],
    place: Place,
    workers: Workers,
    store: Store,
    progress: ViewProgress,
    acquired: Acquired,
) -> None:
    """Hand out all jobs, one to each worker at a time, and take in what comes of them."""
    jobs = jobs_of(todo, place, store)
    states = {job.state: items[0].request.state for job, items in jobs.values()}
    handout = Handout((job for job, _ in jobs.values()), lambda state: store.has(store.light(light_key(states[state]))))
    has: dict[str, str] = {}

    def fail(job: Job, cause: str) -> None:
        failed = [job] if job.camera else handout.light_has_failed(job)
        for view in failed:
            why = cause if job.camera else f"the scene's light cannot be solved: {cause}"
            acquired.failed[view.view] = why
            for item in jobs[view.view][1]:
                progress.failed(item.request, why)

    def take_in(job: Job, made: Made) -> None:
        if made.light_s is not None:
            progress.light_solved(job.state, made.light_s)
        if job.camera is None:
            handout.light_is_there(job)
            return
        items = jobs[job.view][1]
        if made.certificate is not None:
            acquired.certificates[job.view] = made.certificate
        if made.render_s is not None:
            acquired.render_seconds[job.view] = made.render_s
            acquired.rendered += 1
            progress.rendered(items[0].request, made.render_s)
        for item, measured_s in zip(items, made.measured_s, strict=True):
            if measured_s is not None:
                acquired.measured_items.add(item)
            progress.measured(item.request, measured_s)

    while handout or workers.busy():
        raise_if_interrupted()
        for address in sorted(workers.live() - workers.busy()):
            job = handout.next_for(has.get(address))
            if job is None:
                break
            progress.note(f"rendering camera {job.camera.name}" if job.camera else "solving the scene's light")
            sent = has.get(address) == job.state
            workers.start(address, job, None if sent else pickle.dumps(states[job.state]))
            has[address] = job.state
        for address, job, made in workers.finished(POLL_SECONDS):
            if isinstance(made, WorkerGoneError):
                has.pop(address, None)
                if not handout.died(job):
                    fail(job, f"{MOST_DEATHS} workers died while they made it")
            elif isinstance(made, StoreError):
                raise made
            elif isinstance(made, BaseException):
                fail(job, error_line(made))
            elif made.lacks_state:
                # Another run uses the same worker, and has sent it another state.
                has.pop(address, None)
                handout.put_back(job)
            elif made.failed:
                fail(job, made.failed)
            else:
                take_in(job, made)
