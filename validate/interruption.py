"""Ctrl-C that is not lost: compiled code that calls back into Python may swallow the KeyboardInterrupt of a signal."""

from __future__ import annotations

import signal
from types import FrameType

__all__ = ["raise_if_interrupted", "remember_interrupts"]

_interrupted = False


def remember_interrupts() -> None:
    """From now on, an interrupt is raised at once as ever, and remembered for `raise_if_interrupted`."""
    signal.signal(signal.SIGINT, _interrupt)


def raise_if_interrupted() -> None:
    """Raise the interrupt that came since, if nobody saw it."""
    if _interrupted:
        raise KeyboardInterrupt


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _interrupted
    _interrupted = True
    raise KeyboardInterrupt
