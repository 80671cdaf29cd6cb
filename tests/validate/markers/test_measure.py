"""The workers that measure: what Ctrl-C and a stop do to them."""

from __future__ import annotations

import os
import signal
import time

import pytest

from render.store.folder import atomic_path
from validate.acquire.pool import WorkerPool


def _write_slowly(path):
    with atomic_path(path) as temporary:
        temporary.write_text("half")
        time.sleep(60)


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no signal masks here")
def test_an_interrupt_does_not_cut_a_worker_that_is_starting():
    """Ctrl-C reaches the whole group, also a worker whose interpreter has not yet read a line of ours."""
    pool = WorkerPool(1)
    future = pool.submit(os.getpid)
    (worker,) = pool._processes
    os.kill(worker, signal.SIGINT)
    assert future.result(60) == worker
    pool.shutdown()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, set())


def test_a_stopped_worker_leaves_no_half_written_file(tmp_path):
    """The pool stops a worker that is writing, and the folder is as before."""
    pool = WorkerPool(1)
    pool.submit(_write_slowly, tmp_path / "view.exr")
    deadline = time.monotonic() + 60
    while not list(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert list(tmp_path.iterdir())
    pool.stop()
    assert not list(tmp_path.iterdir())
