"""Problems of a scene or sweep file, collected so that all of them are reported at once."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from pss.errors import PSSError

__all__ = ["Location", "Problems", "SceneError", "allowed_in", "dotted", "nearest"]

Location = tuple[str | int, ...]
"""Keys and list indices from the top of a document, such as ("cameras", 1, "zoom")."""

# A longer value would hide the rest of the message.
LONGEST_VALUE = 70
# More lines than can be read; a file of half a megabyte can have a hundred thousand mistakes.
MOST_PROBLEMS = 200

ABSENT = object()


class SceneError(PSSError, ValueError):
    """A scene or sweep file with problems; `problems` has one line for each."""

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems: list[str] = [_printable(problem) for problem in problems]
        super().__init__(self.problems)

    def __str__(self) -> str:
        return "\n".join(self.problems)


class Problems:
    """Collects the problems of one document, each as a line with file, dotted key, value and what is allowed."""

    def __init__(self, file: Path | str, document: dict[str, Any]) -> None:
        self.file = str(file)
        self.document = document
        self.overridden: set[Location] = set()
        self.lines: list[str] = []
        self.warnings: list[str] = []
        self._suggested: set[Location] = set()

    def given(self, location: Location) -> bool:
        """Whether the document has a value at `location`."""
        return _value_at(self.document, location) is not ABSENT

    def add(self, location: Location, allowed: str, *, value: object = ABSENT) -> None:
        """Report the value at `location` (or `value`, a part of it); a nonexistent key is reported as missing."""
        if len(self.lines) > MOST_PROBLEMS:
            return
        if value is ABSENT:
            value = _value_at(self.document, location)
        key = dotted(location, self.document)
        if value is not ABSENT:
            mark = " (override)" if location in self.overridden else ""
            self.report(f"{key} = {shown(value)}{mark}; allowed: {allowed}")
        elif location not in self._suggested:
            self.report(f"{key} is missing; allowed: {allowed}")

    def unknown_key(self, location: Location, allowed: Sequence[str]) -> None:
        """Report an unknown key, with the nearest known one."""
        if len(self.lines) > MOST_PROBLEMS:
            return
        # A misspelt key is one mistake, although the correct key is then missing too: one line for both.
        hint, guess = nearest(str(location[-1]), allowed)
        if guess:
            self._suggested.add((*location[:-1], guess))
        value = _value_at(self.document, location)
        assignment = "" if value is ABSENT else f" = {shown(value)}"
        self.report(f"{dotted(location, self.document)}{assignment}; unknown key{hint}; allowed: {', '.join(allowed)}")

    def removed_key(self, location: Location, reason: str) -> None:
        """Report a key of earlier versions."""
        value = shown(_value_at(self.document, location))
        self.report(f"{dotted(location, self.document)} = {value}; the key was removed: {reason}; delete it")

    def report(self, text: str) -> None:
        """Add a line about the file, once; of very many lines, only the first."""
        line = f"{self.file}: {text}"
        if len(self.lines) == MOST_PROBLEMS:
            line = f"{self.file}: there are more problems; these are the first {MOST_PROBLEMS}"
        if len(self.lines) <= MOST_PROBLEMS and line not in self.lines:
            self.lines.append(line)

    def warn(self, location: Location, text: str) -> None:
        """Add a warning about a value that is accepted but may not have the intended effect."""
        entry = f"{dotted(location, self.document)} = {shown(_value_at(self.document, location))}"
        line = _printable(f"{self.file}: warning: {entry}; {text}")
        if line not in self.warnings and len(self.warnings) < MOST_PROBLEMS:
            self.warnings.append(line)

    def raise_if_any(self) -> None:
        """Raise all problems as one `SceneError`."""
        if self.lines:
            raise SceneError(self.lines)


def nearest(name: str, known: Iterable[str]) -> tuple[str, str]:
    """The text `, did you mean "…"?` and the known name nearest to `name`; both empty if none is near."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return (f', did you mean "{close[0]}"?', close[0]) if close else ("", "")


def allowed_in(error: Exception) -> str:
    """What is allowed, from the message of a `pss.RangeError` ("name = value; allowed: …")."""
    return str(error).rpartition("allowed: ")[2]


def shown(value: object) -> str:
    """A value as in the file, shortened."""
    text = _as_toml(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"


def _as_toml(value: object) -> str:
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(_as_toml(item) for item in value)}]"
    if isinstance(value, dict):
        items = (f"{json.dumps(str(key), ensure_ascii=False)}: {_as_toml(item)}" for key, item in value.items())
        return f"{{{', '.join(items)}}}"
    return json.dumps(value, default=str, ensure_ascii=False)


def dotted(location: Location, document: object) -> str:
    """The dotted key of `location`: items of a list by their name, or by their number from #1 without one."""
    parts, here = [], document
    for step in location:
        part = item_label(here, step) if isinstance(step, int) else step
        parts.append(part if len(part) <= LONGEST_VALUE else part[: LONGEST_VALUE - 1] + "…")
        here = _value_at(here, (step,))
    return ".".join(parts)


def item_label(items: object, index: int) -> str:
    """Label of the item at `index` of a list: its name if it is unique, else "#1", "#2", …"""
    names = [item.get("name") if isinstance(item, dict) else None for item in items] if isinstance(items, list) else []
    name = names[index] if index < len(names) else None
    return name if isinstance(name, str) and names.count(name) == 1 else f"#{index + 1}"


def _printable(text: str) -> str:
    """`text` in one line, with escapes for characters that would break it or control the terminal."""
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in text)


def _value_at(document: object, location: Location) -> object:
    for step in location:
        try:
            document = document[step]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            return ABSENT
    return document
