"""Ctrl-C that is not lost: compiled code that calls back into Python may swallow the KeyboardInterrupt of a signal."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

__all__ = ["interrupts_held", "raise_if_interrupted", "remember_interrupts"]

_interrupted = False


def remember_interrupts() -> None:
    """From now on, an interrupt is raised at once as ever, and remembered for `raise_if_interrupted`."""
    signal.signal(signal.SIGINT, _interrupt)


def raise_if_interrupted() -> None:
    """Raise an interrupt that arrived meanwhile and was not handled."""
    if _interrupted:
        raise KeyboardInterrupt


@contextlib.contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back until the block ends, where the system can (a signal mask, which new processes inherit).

    A mask holds for one thread. If the process has others, one of them receives the signal, and Python would run the
    handler in the main thread all the same: so the handler only takes note, too.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    arrived = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal arrived
        arrived = True

    # Handlers belong to the main thread.
    handler = signal.signal(signal.SIGINT, note) if threading.current_thread() is threading.main_thread() else None
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
            if arrived:
                signal.raise_signal(signal.SIGINT)


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _interrupted
    _interrupted = True
    raise KeyboardInterrupt
