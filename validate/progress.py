"""Progress in views with the time left, from the first second on: a bar for people, plain lines without a terminal."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

__all__ = ["ViewProgress", "clock"]

# Until views of this run say better, a view is expected to take what it took on two cores (benchmarks/README.md).
EXPECTED_SECONDS = 4.5
# The expectation counts as this many views already seen.
EXPECTED_WEIGHT = 3.0
SECONDS_BETWEEN_LINES = 10.0


def clock(seconds: float) -> str:
    """Minutes and seconds, such as "3:07"."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


class ViewProgress:
    """Counts the views of a run: `with ViewProgress(total) as progress: … progress.advance("rendered zoom=2")`."""

    def __init__(self, total: int, console: Console) -> None:
        self.total, self.done = total, 0
        self._console = console
        self._begin = self._last_line = time.monotonic()
        self._bar: Progress | None = None
        self._task = None
        if console.is_terminal:
            self._bar = Progress(
                TextColumn("views"),
                BarColumn(),
                TextColumn("{task.completed:.0f}/{task.total:.0f}"),
                TextColumn("{task.fields[left]}"),
                TextColumn("{task.description}"),
                console=console,
                transient=True,
            )
            self._task = self._bar.add_task("starting", total=max(total, 1), left=self.left())

    def __enter__(self) -> ViewProgress:
        if self._bar:
            self._bar.start()
        elif self.total:
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
        """Say what is going on."""
        if self._bar and self._task is not None:
            self._bar.update(self._task, description=what, left=self.left())

    def advance(self, what: str) -> None:
        """One more view is done."""
        self.done += 1
        if self._bar and self._task is not None:
            self._bar.update(self._task, completed=self.done, description=what, left=self.left())
        elif time.monotonic() - self._last_line > SECONDS_BETWEEN_LINES or self.done == self.total:
            self._last_line = time.monotonic()
            print(f"views {self.done}/{self.total}, {self.left()}", file=sys.stderr, flush=True)
