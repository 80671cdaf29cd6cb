"""Progress in views with the time left, from the first second on: a bar for people, plain lines without a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from types import TracebackType

from rich.progress import BarColumn, Progress, TextColumn

from render.renderer import ViewRequest
from validate.runs.console import Console
from validate.runs.events import EventFile

__all__ = ["ViewProgress", "clock"]

# Expected seconds of a view until this run has measured its own: those on two cores (benchmarks/README.md).
EXPECTED_SECONDS = 4.5
# What solving the light of a scene state, and measuring one capture, takes there.
EXPECTED_LIGHT_SECONDS, EXPECTED_MEASURE_SECONDS = 13.0, 0.6
# The expectation counts as this many views already seen.
EXPECTED_WEIGHT = 3.0
SECONDS_BETWEEN_LINES = 10.0


def clock(seconds: float) -> str:
    """Minutes and seconds, such as "3:07"."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


class ViewProgress:
    """Counts the views of a run: `with ViewProgress(total) as progress: … progress.measured(request, 2.1)`.

    Args:
        total: views that are still to be made.
        console: where the bar goes; quiet for none.
        events: where programs hear of each view; None for nowhere.
    """

    def __init__(self, total: int, console: Console, events: EventFile | None = None) -> None:
        self.total, self.done = total, 0
        self._found = 0
        self._events = events
        self._quiet = console.quiet
        self._begin = self._last_line = time.monotonic()
        self._bar: Progress | None = None
        self._task = None
        if console.is_terminal and not console.quiet:
            self._bar = Progress(
                TextColumn("views", markup=False),
                BarColumn(),
                TextColumn("{task.completed:.0f}/{task.total:.0f}", markup=False),
                TextColumn("{task.fields[left]}", markup=False),
                TextColumn("{task.description}", markup=False),
                console=console,
                transient=True,
            )
            self._task = self._bar.add_task("starting", total=max(total, 1), left=self.left())

    def __enter__(self) -> ViewProgress:
        if self._bar:
            self._bar.start()
        elif self.total and not self._quiet:
            print(f"views 0/{self.total}, {self.left()}", file=sys.stderr, flush=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if self._bar:
            self._bar.stop()

    def left(self) -> str:
        """Time left, from the views so far and, at first, from what a view is expected to take."""
        elapsed = time.monotonic() - self._begin
        rate = (EXPECTED_WEIGHT * EXPECTED_SECONDS + elapsed) / (EXPECTED_WEIGHT + self.done)
        return f"about {clock(rate * (self.total - self.done))} left"

    def note(self, what: str) -> None:
        """Print what is being done."""
        if self._bar and self._task is not None:
            self._bar.update(self._task, description=what, left=self.left())

    def advance(self, what: str) -> None:
        """One more view is done."""
        self.done += 1
        if self._bar and self._task is not None:
            self._bar.update(self._task, completed=self.done, description=what, left=self.left())
        elif self._quiet:
            return
        elif time.monotonic() - self._last_line > SECONDS_BETWEEN_LINES or self.done == self.total:
            self._last_line = time.monotonic()
            print(f"views {self.done}/{self.total}, {self.left()}", file=sys.stderr, flush=True)

    def found(self, requests: Iterable[ViewRequest]) -> None:
        """These are in the store, image and measurement."""
        known = list(requests)
        for request in known:
            self._found += 1
            self._event("view-found", request, total=len(known) + self.total)

    def light_solved(self, state: str, took_s: float) -> None:
        """The light of a scene state is solved; `state` is its hash."""
        if self._events is not None:
            self._events.write("light-solved", state=state, took_s=round(took_s, 3))

    def rendered(self, request: ViewRequest, took_s: float) -> None:
        """A view is rendered and stored."""
        self._event("view-rendered", request, took_s=round(took_s, 3))

    def measured(self, request: ViewRequest, took_s: float | None) -> None:
        """A view is measured, and so done; None where its time is unknown."""
        self.advance(f"measured camera {request.camera.name}")
        self._event("view-measured", request, took_s=None if took_s is None else round(took_s, 3))

    def failed(self, request: ViewRequest, cause: str) -> None:
        """A view has failed, and will not be tried again in this run."""
        if self.done < self.total:  # one that fails after it was measured is counted
            self.advance("failed")
        self._event("view-failed", request, cause=cause)

    def _event(self, event: str, request: ViewRequest, total: int | None = None, **fields: object) -> None:
        if self._events is not None:
            self._events.write(
                event,
                view=request.key,
                camera=request.camera.name,
                done=self._found + self.done,
                total=self._found + self.total if total is None else total,
                **fields,
            )
