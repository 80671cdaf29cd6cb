"""Messages of a run: to people on the screen, to programs in `events.jsonl`."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from pss import PSSError
from validate.acquire.acquire import Acquired
from validate.runs.console import Console
from validate.runs.events import EventFile
from validate.runs.exit_codes import EXIT_BROKEN, EXIT_CLOSED_PIPE, EXIT_INTERRUPTED, EXIT_MISTAKE
from validate.runs.folder_lock import alone_in
from validate.runs.program import output_is_closed
from validate.runs.progress import ViewProgress

__all__ = ["PLAIN_WIDTH", "RunMessages"]

# Columns in a file or a pipe, where tables keep their columns; 80 would break every line.
PLAIN_WIDTH = 140


class RunMessages:
    """A context around a run; `messages(total)` counts the views of one pass, as `acquire` requests it.

    Nothing is written before `start`, so that a mistake found until then creates no folder. If the context ends
    with an exception, the last event names it, and the exception propagates.

    Args:
        quiet: whether only errors and the last line are printed. Warnings are among the events all the same.
        width: columns of the tables (default: those of the terminal, or `PLAIN_WIDTH` without one).

    Attributes:
        console: tables and lines on standard output; silent if quiet.
        notes: what is being done, on standard error; silent if quiet.
        errors: what went wrong, on standard error.
    """

    def __init__(self, quiet: bool = False, width: int | None = None) -> None:
        if width is None and not sys.stdout.isatty():
            width = PLAIN_WIDTH
        self._begin = time.monotonic()
        self._last = Console(width=width)
        self.console = Console(width=width, quiet=quiet)
        self.notes = Console(stderr=True, quiet=quiet)
        self.errors = Console(stderr=True)
        self._events: EventFile | None = None
        self._folder = contextlib.ExitStack()

    def __enter__(self) -> RunMessages:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if isinstance(error, KeyboardInterrupt):
            self._event("interrupted", exit_code=EXIT_INTERRUPTED)
        elif isinstance(error, BrokenPipeError) and output_is_closed():
            self._event("finished", exit_code=EXIT_CLOSED_PIPE, cause="nobody reads the output any more")
        elif isinstance(error, PSSError):
            self._event("finished", exit_code=EXIT_MISTAKE, cause=str(error))
        elif isinstance(error, Exception):
            self._event("finished", exit_code=EXIT_BROKEN, cause=f"{type(error).__name__}: {error}")
        self._folder.close()

    def __call__(self, total: int) -> ViewProgress:
        """Progress of one pass over the views of which `total` are still to be made."""
        return ViewProgress(total, self.notes, self._events)

    def start(self, folder: Path, command: str, **fields: object) -> None:
        """From now on there are events, in the run's folder, and no other run may use it until the context ends.

        Args:
            fields: goes into the first event.

        Raises:
            StoreError: another run uses the folder; nothing is written there.
        """
        self._folder.enter_context(alone_in(folder))
        self._events = EventFile(
            folder, lambda line: self.errors.print(line, markup=False, soft_wrap=True), self._begin
        )
        self._event("started", command=command, **fields)

    def light_solved(self, state: str, took_s: float) -> None:
        """The light of a scene state was solved before any view was requested."""
        self._event("light-solved", state=state, took_s=round(took_s, 3))

    def note(self, line: str) -> None:
        """Print what is being done."""
        self.notes.print(line, markup=False, soft_wrap=True)

    def warn(self, line: str) -> None:
        """Print a caveat about the results, in one yellow line."""
        self.notes.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)
        self._event("warning", text=line)

    def failed(self, failed: Mapping[str, str], names: Mapping[str, str]) -> None:
        """Name the views that failed, with their causes; the events have them already.

        Args:
            failed: causes by the views' hashes.
            names: what people call these views.
        """
        for key, cause in failed.items():
            self.errors.print(f"{names[key]} failed: {cause}", markup=False, style="red", soft_wrap=True)

    def left_out(self, line: str) -> None:
        """Report, quiet or not, which results are missing because of failed views."""
        self.errors.print(line, markup=False, style="red", soft_wrap=True)
        self._event("left-out", text=line)

    def end(self, exit_code: int, line: str, acquired: Acquired) -> int:
        """Print the last line, which names the results' folder, and return the exit code."""
        self._last.print(line, markup=False, soft_wrap=True)
        self._event(
            "finished",
            exit_code=exit_code,
            rendered=acquired.rendered,
            measured=len(acquired.measured_items),
            failed=len(acquired.failed),
        )
        return exit_code

    def _event(self, event: str, **fields: object) -> None:
        if self._events is not None:
            self._events.write(event, **fields)
