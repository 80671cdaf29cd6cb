"""Processes that measure: how they start, and how they are stopped without a half-written file."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import types
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context, resource_tracker
from typing import TypeVar

import cv2

from render.store.atomic import discard_unfinished
from validate.runs.interruption import interrupts_held

__all__ = ["WorkerPool", "end_worker"]

T = TypeVar("T")

# s, for a worker to end after a request to stop; only the prompt waits for it.
SECONDS_TO_STOP = 5.0


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
        with interrupts_held(), _without_main():
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


@contextlib.contextmanager
def _without_main() -> Iterator[None]:
    """Start workers that do not run the user's script again, which needs no `if __name__ == "__main__":` then.

    "spawn" imports the script of the main process in each worker; what these workers call is in modules.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _start_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where no mask was inherited
    signal.signal(signal.SIGTERM, end_worker)
    cv2.setNumThreads(1)


def end_worker(_signal: int, _frame: object) -> None:
    """End this process at once, without a half-written file: a worker does so on a request to stop."""
    # Not by an exception: the pool would catch it as the task's and go on with the next.
    discard_unfinished()
    os._exit(128 + signal.SIGTERM)
