"""The program's name, the versions of its libraries, and its exit when the output pipe is closed."""

from __future__ import annotations

import importlib.metadata
import os
import select
import sys
from collections.abc import Callable
from pathlib import Path

from validate.runs.exit_codes import EXIT_CLOSED_PIPE

__all__ = ["named_as_called", "output_is_closed", "program_name", "version_line", "with_quiet_end"]

SCRIPT = "run_sweep.py"
"""Its name from a clone, which texts have (`named_as_called`)."""
INSTALLED = "pss-testbed"
# Distributions by the names that users know.
MADE_OF = {INSTALLED: "pss-testbed", "Mitsuba": "mitsuba", "OpenCV": "opencv-contrib-python-headless"}


def program_name() -> str:
    """The name by which the program was called: "run_sweep.py", or "pss-testbed" where it is installed."""
    called = Path(sys.argv[0]).name.removesuffix(".exe")
    return INSTALLED if called == INSTALLED else SCRIPT


def named_as_called(text: str) -> str:
    """A text for users that names the program "run_sweep.py", with the name by which it was called."""
    return text.replace(SCRIPT, program_name())


def version_line() -> str:
    """The versions of the program, and of what renders and detects, in one line."""
    own, *others = (f"{name} {_version(distribution)}" for name, distribution in MADE_OF.items())
    return f"{own} ({', '.join(others)})"


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def with_quiet_end(run: Callable[[], int]) -> int:
    """The exit code of `run`; `EXIT_CLOSED_PIPE`, without a word, where the reader of the output has ended before.

    So it is in `run_sweep.py --help | head -1`. What `run` raises goes on, also `SystemExit`.
    """
    try:
        try:
            return run()
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
    except BrokenPipeError:
        if not output_is_closed():
            raise
        # What is buffered still: Python would write it when it ends, and complain.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            if _is_closed(stream.fileno()):
                os.dup2(nowhere, stream.fileno())
        return EXIT_CLOSED_PIPE


def output_is_closed() -> bool:
    """Whether standard output or error is a closed pipe; a broken pipe may also be one to a worker."""
    return any(_is_closed(stream.fileno()) for stream in (sys.stdout, sys.stderr))


def _is_closed(descriptor: int) -> bool:
    if not hasattr(select, "poll"):  # Windows
        return True
    poll = select.poll()
    poll.register(descriptor, 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))
