"""Events of a run, for programs: `events.jsonl` in its folder, a JSON object a line, added as it happens.

A run must not fail because an event cannot be written: it is skipped, and one line reports that. Events
have numbers, so that a reader finds what is missing. A line that a power cut or a full disk tore stays as it is, and
the next one begins behind it on a line of its own.

`docs/runs.md` lists the events.
"""

from __future__ import annotations

import datetime
import errno
import os
import time
import uuid
from collections.abc import Callable
from pathlib import Path

from pss.json_text import json_text

__all__ = ["EVENTS", "EventFile"]

EVENTS = "events.jsonl"
# Raised when the meaning of a key changes.
FORMAT = 1
# Digits of a run's name: runs of one folder are few.
RUN_DIGITS = 12


class EventFile:
    """The events of one run; runs before it in the same folder stay in the file.

    Args:
        folder: of the run's results; made if it is not there.
        warn: hears once that the file cannot be written.
        begin: s, `time.monotonic()` when the run began.
    """

    def __init__(self, folder: Path, warn: Callable[[str], None], begin: float | None = None) -> None:
        self.path, self.run = folder / EVENTS, uuid.uuid4().hex[:RUN_DIGITS]
        self._warn, self._warned = warn, False
        self._begin = time.monotonic() if begin is None else begin
        self._number = 0

    def write(self, event: str, **fields: object) -> None:
        """Add an event; its fields must be representable in JSON."""
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        content = {
            "time": now,
            "since_start_s": round(time.monotonic() - self._begin, 3),
            "run": self.run,
            "number": self._number,
            "event": event,
            **({"format": FORMAT} if self._number == 0 else {}),
            **fields,
        }
        self._number += 1
        try:
            self._add(json_text(content, ensure_ascii=False))
        except OSError as error:
            if not self._warned:
                self._warned = True
                self._warn(f"{self.path}: {error.strerror}; the run goes on, and events are left out")

    def _add(self, line: str) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # Opened for each line: folders are moved and disks come back while a run goes on.
        if self.path.exists() and not self.path.is_file():
            raise OSError(errno.EINVAL, "it is no plain file")
        handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            size = os.fstat(handle).st_size
            if size:
                os.lseek(handle, size - 1, os.SEEK_SET)
                line = line if os.read(handle, 1) == b"\n" else "\n" + line
            data = (line + "\n").encode("utf-8", errors="replace")
            while data:  # a disk that is nearly full takes a part, and refuses the rest
                data = data[os.write(handle, data) :]
        finally:
            os.close(handle)
