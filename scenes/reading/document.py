"""Reading of TOML files, and command-line overrides, which change a document before it is validated."""

from __future__ import annotations

import copy
import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import pss.files
from pss import RangeError
from scenes.errors import Location, Problems, SceneError, dotted, item_label, nearest, shown
from scenes.reading.spec import Spec, allowed_keys, child_tables, narrowed, validate

__all__ = [
    "SWEEP_PREFIX",
    "apply_overrides",
    "check_once",
    "named_file",
    "read_spec",
    "read_toml",
    "set_value",
]

S = TypeVar("S", bound=Spec)

# Prefix of overrides of the sweep file; all others are for the scene file.
SWEEP_PREFIX = "sweep."


def read_toml(path: Path) -> dict[str, Any]:
    """The document in the file at `path`.

    Raises:
        SceneError: one line; the file is missing, unreadable, too large, too deep (`pss.files.read_toml`), or not valid
            TOML (then with line and column).
    """
    try:
        return pss.files.read_toml(path)
    except RangeError as error:
        raise SceneError([str(error)]) from None


def named_file(path_or_name: str | Path, folder: Path, kind: str) -> Path:
    """The path of a TOML file: the given one, or that of a bare name in `folder`.

    Args:
        kind: kind of the file, for the message.

    Raises:
        SceneError: no file of that name; the message has the nearest name and all others.
    """
    path = Path(path_or_name)
    if path.suffix == ".toml" or len(path.parts) != 1:
        return path
    known = sorted(file.stem for file in folder.glob("*.toml"))
    if path.name not in known:
        hint, _ = nearest(path.name, known)
        raise SceneError(
            [f'there is no {kind} "{path}"{hint}; allowed: {", ".join(known)}, or the path of a .toml file']
        )
    return folder / f"{path.name}.toml"


def read_spec(model: type[S], path: Path, overrides: Iterable[str]) -> tuple[S | None, S, Problems]:
    """The sweep or schedule file at `path`, with the `overrides` for it applied.

    Returns:
        The strict reading (None if there are problems), the draft, and the problems so far.
    """
    problems = Problems(path, read_toml(path))
    stripped = (override.strip() for override in overrides)
    own = [override.removeprefix(SWEEP_PREFIX) for override in stripped if override.startswith(SWEEP_PREFIX)]
    apply_overrides(model, own, problems)
    return *validate(model, problems.document, problems), problems


def check_once(location: Location, items: Iterable[object] | None, problems: Problems) -> None:
    """Report items that are in a list twice."""
    for item, count in Counter(items or ()).items():
        if count > 1:
            problems.add(location, "nothing twice", value=item)


def check_overrides(overrides: Iterable[str]) -> None:
    """Refuse one text in place of a list, whose letters would be overrides.

    Raises:
        SceneError: with the text.
    """
    if isinstance(overrides, str):
        raise SceneError([f'overrides = {shown(overrides)}; allowed: a list of "key=value"'])


def apply_overrides(model: type[Spec], overrides: Iterable[str], problems: Problems) -> None:
    """Set each "key=value" of `overrides` in the document of `problems`, whose schema is `model`.

    An unknown key is a problem; values are checked later, by the validation.
    """
    for override in overrides:
        key, equals, text = (part.strip() for part in override.partition("="))
        if not equals or not key:
            problems.report(f"override {shown(override)}; allowed: key=value, such as cameras.2.zoom=4")
            continue
        value = _parsed(text)
        try:
            pss.files.check_values({key: value})
        except RangeError as error:
            problems.report(f"override {shown(override)}; {error}")
            continue
        set_value(model, key, value, problems)


def set_value(model: type[Spec], key: str, value: object, problems: Problems) -> None:
    """Set the value at the dotted `key` of the document of `problems`, whose schema is `model`."""
    document = copy.deepcopy(problems.document)
    try:
        location = _set(model, document, key.split("."), value)
    except (_NoSuchKey, _RemovedKey) as error:
        problems.report(f"override {key} = {shown(value)}; {error}")
    else:
        problems.document = document
        problems.overridden.add(location)


def _parsed(text: str) -> object:
    """The TOML value of `text`, or else the text itself, so that names need no quotes in a shell."""
    try:
        document = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return document["value"] if set(document) == {"value"} else text


class _RemovedKey(Exception):
    """A key of earlier versions; the text is the reason for its removal."""


class _NoSuchKey(Exception):
    def __init__(self, step: str, place: str, allowed: list[str]) -> None:
        hint, _ = nearest(step, allowed)
        super().__init__(f'{place} has no key "{step}"{hint}; allowed: {", ".join(allowed)}')


def _set(model: type[Spec], document: dict[str, Any], steps: list[str], value: object) -> Location:
    """Set the value at the dotted key `steps` of `document`, and return its location."""
    tables: tuple[type[Spec], ...] = (model,)
    here: Any = document
    location: Location = ()
    for number, step in enumerate(steps, start=1):
        place, last = dotted(location, document) or "the file", number == len(steps)
        if tables and isinstance(here, list) and all(isinstance(item, dict) for item in here):
            labels = [item_label(here, index) for index in range(len(here))]
            if step not in labels:
                raise _NoSuchKey(step, place, labels)
            index = labels.index(step)
            location += (index,)
            if last:
                here[index] = value
            else:
                here = here[index]
        elif tables and isinstance(here, dict):
            table = narrowed(tables, here)[0]
            if step in table.removed:
                raise _RemovedKey(f"the key was removed: {table.removed[step]}")
            if step not in allowed_keys(table):
                raise _NoSuchKey(step, place, allowed_keys(table))
            location += (step,)
            tables = child_tables(table, step)
            if last:
                # The override takes precedence: it also removes alternative keys.
                for rival in table.replaces.get(step, ()):
                    here.pop(rival, None)
                here[step] = value
            else:
                here = here.setdefault(step, {})
        else:
            raise _NoSuchKey(step, place, [f"{place} as a whole"])
    return location
