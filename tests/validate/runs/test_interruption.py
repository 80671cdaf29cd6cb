"""Ctrl-C is held back while a worker starts, whichever thread receives it."""

import os
import signal
import threading
import time

import pytest

from validate.runs.interruption import interrupts_held

pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no signal masks here")

# s, for a thread to receive a signal, and for the main thread to run Python's handler of it.
LONG_ENOUGH_S = 0.2


@pytest.fixture(autouse=True)
def pythons_handler():
    """Python's own handler, also where the tests were started with Ctrl-C ignored, as a shell's background jobs are."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("with_another_thread", [False, True])
def test_an_interrupt_arrives_after_the_block(with_another_thread):
    """Another thread, which masks nothing, receives the signal; Python would interrupt the main thread for it."""
    done = threading.Event()
    if with_another_thread:
        threading.Thread(target=done.wait, args=(10,), daemon=True).start()
    steps = []

    def interrupted_block() -> None:
        with interrupts_held():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(LONG_ENOUGH_S)
            steps.append("the whole block")

    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted_block()
        assert steps == ["the whole block"]
    finally:
        done.set()


def test_the_handler_is_the_former_one_afterwards():
    before = signal.getsignal(signal.SIGINT)
    with interrupts_held():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before
