"""Worker processes of Dask, each with one job at a time: started here, or those of a running scheduler.

Dask carries jobs and results, starts local processes, and starts them again when they die. Which worker does what, and
how often a job is tried, is decided in `validate.acquire.run_jobs`: a job is sent to one worker by name. (Dask's own
count of failures, `allowed-failures`, is also raised for jobs that merely waited at the worker that died.)
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import pickle
import queue
import signal
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from typing import Any

import dask
from dask.system import CPU_COUNT
from distributed import CancelledError, Client, Future, KilledWorker, LocalCluster, Nanny, Worker, WorkerPlugin

from pss import PSSError
from validate.acquire.call import call
from validate.acquire.job import Job, Made
from validate.acquire.options import Scale
from validate.acquire.pool import end_worker
from validate.runs.interruption import interrupts_held, raise_if_interrupted

__all__ = ["ScaleError", "WorkerGoneError", "Workers", "workers_of"]

# s, for a scheduler to answer at all.
SECONDS_TO_ANSWER = 10.0
# s, between two looks at which workers are there: what a death costs before its job is done elsewhere.
POLL_SECONDS = 1.0
# s, for a finished job's few hundred bytes to come, before its worker counts as gone.
SECONDS_FOR_RESULT = 30.0
# s, for local processes to end after a request to stop, before they are killed.
SECONDS_TO_STOP = 3.0
# s, without any local process: they die as fast as they are started.
MOST_SECONDS_ALONE = 60.0

_log = logging.getLogger(__name__)


class ScaleError(PSSError, RuntimeError):
    """Workers cannot be used, or cannot be reached any more; what is stored stays."""


class WorkerGoneError(PSSError, RuntimeError):
    """A worker died, or cannot be reached any more, before its job was done."""


class Workers:
    """Workers that can be given jobs.

    Attributes:
        client: Dask's.
        cores: for each worker; None: those that the worker reports.
        local: whether the processes are this program's own.
    """

    def __init__(self, client: Client, cores: int | None, local: bool, name: str) -> None:
        self.client, self.cores, self.local, self._name = client, cores, local, name
        self._finished: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._under_way: dict[str, tuple[Future, str, Job]] = {}
        self._live: set[str] = set()
        self._last_poll = self._seen = time.monotonic()
        self._reported = False
        self._run = uuid.uuid4().hex[:8]
        self._number = 0

    def live(self) -> set[str]:
        """Addresses of the workers that are there, as of the last second.

        Raises:
            ScaleError: the scheduler does not answer, or no local process stays alive.
        """
        now = time.monotonic()
        if not self._live or now - self._last_poll > POLL_SECONDS:
            try:
                self._live = set(self.client.nthreads())
            except (OSError, TimeoutError, RuntimeError) as error:
                raise ScaleError(f"{self._name} does not answer any more; what is made so far is stored") from error
            self._last_poll = time.monotonic()
        if self._live:
            self._seen, self._reported = now, False
        elif self.local and now - self._seen > MOST_SECONDS_ALONE:
            raise ScaleError(f"no worker process has stayed alive for {MOST_SECONDS_ALONE:g} s")
        elif not self.local and not self._reported and now - self._seen > SECONDS_TO_ANSWER:
            self._reported = True
            _log.warning("%s has no worker; waiting for one", self._name)
        return self._live

    def wait_for_one(self) -> None:
        """Wait until there is a worker: a queue of a cluster may take its time."""
        while not self.live():
            raise_if_interrupted()
            time.sleep(POLL_SECONDS)

    def busy(self) -> set[str]:
        """Addresses of the workers that have a job."""
        return {address for _, address, _ in self._under_way.values()}

    def start(self, address: str, job: Job, state: bytes | None) -> None:
        """Give a worker a job, and its pickled scene state if it does not have it."""
        self._number += 1
        # A key of its own for each try: on a scheduler that others use too, equal keys would be one task.
        key = f"{'view' if job.camera else 'light'}-{self._run}-{self._number}"
        future = self.client.submit(
            call, pickle.dumps(job), state, key=key, workers=[address], allow_other_workers=False, pure=False
        )
        self._under_way[key] = future, address, job
        future.add_done_callback(lambda ended: self._finished.put(str(ended.key)))

    def finished(self, timeout_s: float) -> Iterator[tuple[str, Job, Made | BaseException]]:
        """Jobs that have come to an end, with their workers; waits up to `timeout_s` for the first.

        A job whose worker died has ended with a `WorkerGoneError`.
        """
        wait_s: float | None = timeout_s
        while True:
            try:
                key = self._finished.get(timeout=wait_s) if wait_s else self._finished.get_nowait()
            except queue.Empty:
                break
            wait_s = None
            if key in self._under_way:
                future, address, job = self._under_way.pop(key)
                yield address, job, self._result_of(future, address)
        live = self.live()
        for key, (future, address, job) in list(self._under_way.items()):
            if address not in live and not future.done():
                del self._under_way[key]
                future.cancel()
                yield address, job, WorkerGoneError(address)

    def cancel(self) -> None:
        """Take back all jobs; one that a worker has begun cannot be stopped from here."""
        self.client.cancel([future for future, _, _ in self._under_way.values()], force=True)
        self._under_way.clear()

    def _result_of(self, future: Future, address: str) -> Made | BaseException:
        if future.status in ("cancelled", "lost"):
            return WorkerGoneError(address)
        try:
            result: Made = future.result(timeout=SECONDS_FOR_RESULT)
            return result
        except (TimeoutError, CancelledError, KilledWorker):
            return WorkerGoneError(address)
        except Exception as error:
            return error


class _EndCleanly(WorkerPlugin):
    """A local worker that is stopped leaves no half-written file; Ctrl-C is the parent's business alone."""

    def setup(self, worker: Worker) -> None:
        """Called in the main thread of the worker's process."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, end_worker)


@contextmanager
def workers_of(scale: Scale) -> Iterator[Workers]:
    """The workers that `scale` names, as long as the context lasts; local processes end with it.

    Raises:
        ScaleError: no scheduler at the address, or local processes that do not start.
    """
    with warnings.catch_warnings():
        # A scene of meshes is large, and goes to each worker once; differences between versions are checked in
        # `validate.acquire.checks`, and reported in one line.
        warnings.filterwarnings("ignore", module="distributed")
        with _silent(), _here(scale.workers) if scale.workers else _at(str(scale.cluster)) as workers:
            yield workers


@contextmanager
def _silent() -> Iterator[None]:
    """Silence Dask's own messages: errors are reported here, in one line."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client", "distributed.scheduler")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


@contextmanager
def _here(number: int) -> Iterator[Workers]:
    nanny: dict[str, Any] = {
        # Each process has its share of the cores, and what it frees it may keep: it will need it for the next view.
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
        "distributed.worker.multiprocessing-method": "spawn",  # a fork of a process with Dr.Jit's threads hangs
    }
    with dask.config.set(nanny):
        # Started by another thread, it would leave that thread open to signals again.
        resource_tracker.ensure_running()
        others = set(multiprocessing.active_children())
        # Threads and processes that are started now never see Ctrl-C, not even while they start.
        with interrupts_held():
            try:
                cluster = LocalCluster(
                    n_workers=number,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                    memory_limit=0,  # a share of the memory for each would refuse views that one process makes
                    silence_logs=logging.CRITICAL,
                    plugins=[_EndCleanly()],
                )
            except (OSError, RuntimeError, TimeoutError) as error:
                raise ScaleError(f"--workers {number}: the processes do not start: {error}") from error
            client = Client(cluster, set_as_default=False)
        workers = Workers(client, max(1, CPU_COUNT // number), True, f"--workers {number}")
        try:
            yield workers
        finally:
            with interrupts_held():
                _stop(cluster)
                _quietly(client.close)
                _quietly(lambda: cluster.close(SECONDS_TO_STOP))
                _end_late_ones(others)


def _end_late_ones(others: set[BaseProcess]) -> None:
    """End processes that nannies were starting, in place of dead ones, while all were ended."""
    end = time.monotonic() + SECONDS_TO_STOP
    while (late := set(multiprocessing.active_children()) - others) and time.monotonic() < end:
        for process in late:
            process.kill()
            process.join(0.1)


def _stop(cluster: LocalCluster) -> None:
    """End the local processes, busy ones too; no half-written file stays."""
    processes = []
    for nanny in cluster.workers.values():
        if isinstance(nanny, Nanny):
            nanny.close_gracefully()  # so that it does not start another
            if nanny.pid:
                processes.append(nanny.pid)
    for signal_number in (signal.SIGTERM, signal.SIGKILL):
        for process in processes:
            _quietly(lambda process=process, number=signal_number: os.kill(process, number))
        end = time.monotonic() + SECONDS_TO_STOP
        while processes and time.monotonic() < end:
            processes = [process for process in processes if _runs(process)]
            time.sleep(0.02)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except OSError:
        return False
    return True


@contextmanager
def _at(address: str) -> Iterator[Workers]:
    with interrupts_held():
        try:
            client = Client(address, timeout=SECONDS_TO_ANSWER, set_as_default=False)
        except (OSError, TimeoutError, ValueError, RuntimeError) as error:
            raise ScaleError(f"--cluster {address}: no Dask scheduler answers there") from error
    workers = Workers(client, None, False, f"--cluster {address}")
    try:
        yield workers
    finally:
        with interrupts_held():
            _quietly(workers.cancel)
            _quietly(lambda: client.close(SECONDS_TO_STOP))


def _quietly(end: Callable[[], object]) -> None:
    """What is done on the way out must not hide why."""
    try:
        end()
    except Exception as error:
        _log.debug("while ending: %s", error)
