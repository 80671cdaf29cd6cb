"""Checksums beside files: `<name>.sum` has a line for every content that was written under the name.

A line is a JSON object (size, SHA-256, time of change, and the writer's facts about the content) with its own checksum.
SHA-256 because processors have instructions for it: a view of 10 MB takes 12 ms, an eighth of BLAKE2b's time.

**The sum is written before the file.** If it were written after it, there would be a moment with a file without a sum,
or with that of another process which wrote the same name: two renders of one view need not be equal to the last bit.
Lines are only ever appended, so that each of two such writers finds its own, whichever file comes last. A file is valid
if any line matches it. A file without sums is therefore not an unfinished one but one of an older version; see
`render.store.folder`.

**A file's facts are stored in its sum** (a view's certificate), so that a large image need not be opened or hashed for
three numbers: the line is trusted by its own checksum if size and time of change are those of the file. The time is
compared for equality only, so that clocks do not matter; if it differs (a copy, a backup), the file is hashed. Pixels
and arrays are never trusted because of a time: they are hashed before each use.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pss import RangeError
from pss.files import open_plain
from pss.json_text import json_text
from render.store.atomic import flush

__all__ = ["SUFFIX", "FileSum", "add_sum", "read_sums", "sum_of", "sum_path"]

SUFFIX = ".sum"
# Hexadecimal digits of a line's own checksum: one accidental match in 2⁶⁴.
LINE_DIGITS = 16
# Types of the facts that this project's code reads; a line with others is invalid.
FACTS = {
    "version": str,
    "seconds": (int, float),
    "pixels": int,
    "trials": int,
    "renderer": str,
    "certificate": dict,
    "adopted": bool,
}


@dataclass(frozen=True)
class FileSum:
    """A file's content: its size, its SHA-256 (hexadecimal), and the writer's facts about it.

    `changed_ns` is the file system's time of change in ns when the content was written or last hashed.
    """

    size_bytes: int
    sha256: str
    changed_ns: int
    facts: dict[str, Any] = field(default_factory=dict)

    def to_line(self) -> str:
        """One line of text, which `from_line` reads."""
        content = json_text(
            {"bytes": self.size_bytes, "sha256": self.sha256, "changed_ns": self.changed_ns, "facts": self.facts}
        )
        return f"{content} {_line_checksum(content)}"

    @classmethod
    def from_line(cls, line: str) -> FileSum | None:
        """A line read back; None if it is invalid."""
        content, _, checksum = line.rpartition(" ")
        if checksum != _line_checksum(content):
            return None
        return cls._from_json(content)

    @classmethod
    def _from_json(cls, content: str) -> FileSum | None:
        """None if it is not the output of `to_line` although its checksum matches: other keys or types of values."""
        try:
            data = json.loads(content)
            found = cls(data["bytes"], data["sha256"], data["changed_ns"], data["facts"])
        except (ValueError, KeyError, TypeError, RecursionError):
            return None
        whole = all(type(value) is int for value in (found.size_bytes, found.changed_ns))
        if not whole or not isinstance(found.sha256, str) or not isinstance(found.facts, dict):
            return None
        fits = all(isinstance(found.facts[name], FACTS[name]) for name in FACTS.keys() & found.facts.keys())
        return found if fits else None

    def same_content(self, other: FileSum) -> bool:
        """Whether both have the same bytes."""
        return (self.size_bytes, self.sha256) == (other.size_bytes, other.sha256)


def sum_path(path: Path) -> Path:
    """Path of a file's sums."""
    return path.with_name(path.name + SUFFIX)


def sum_of(path: Path, facts: dict[str, Any] | None = None) -> FileSum:
    """Hash a file's current content."""
    with open_plain(path) as file:
        # The status of the open file, in case the name was replaced.
        status = os.fstat(file.fileno())
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return FileSum(status.st_size, digest, status.st_mtime_ns, facts or {})


def read_sums(path: Path) -> list[FileSum] | None:
    """The valid lines of a file's sums, oldest first; None without sums, [] without valid lines."""
    try:
        with open_plain(sum_path(path)) as file:
            text = file.read().decode("utf-8", errors="replace")
    except FileNotFoundError:
        return None
    except (IsADirectoryError, RangeError):  # no plain file
        return []
    return [found for line in text.splitlines() if (found := FileSum.from_line(line)) is not None]


def add_sum(path: Path, added: FileSum) -> None:
    """Append a line to the sums of `path` and flush it; other processes may do the same concurrently."""
    target = sum_path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle = os.open(target, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        # One call appends the whole line. After a line truncated by a full disk, it begins on a new one.
        size = os.fstat(handle).st_size
        cut = size > 0 and _last_byte(target) != b"\n"
        line = ("\n" if cut else "") + added.to_line() + "\n"
        data = line.encode()
        while data:  # a disk that is nearly full writes a part, and refuses the rest
            data = data[os.write(handle, data) :]
        os.fsync(handle)
    finally:
        os.close(handle)
    flush(target.parent)


def _last_byte(path: Path) -> bytes:
    with open_plain(path) as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1)


def _line_checksum(content: str) -> str:
    return hashlib.sha256(content.encode("utf-8", errors="replace")).hexdigest()[:LINE_DIGITS]
