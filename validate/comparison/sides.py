"""The tables of runs, as sides of a comparison: a folder and a selection of its rows."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pss.hints import CsvRow
from pss.json_text import json_text
from render.store.folder import StoreError
from scenes.errors import nearest
from validate.runs.csv_file import read_csv, read_head
from validate.runs.run_file import read_run

__all__ = ["Side", "settings_rows", "sides_of"]


# What may differ between two runs of the same thing, or is redundant.
NOT_SETTINGS = (
    "options",
    "seconds",
    "rendered",
    "measured",
    "failed",
    "figures_drawn_from",
    "report_made_from",
    "seeds",
)
# Tables of a run of several sweeps, each under the sweep's name.
BY_SWEEP = {"scenes": "scene", "sweeps": "sweep"}


@dataclass(frozen=True)
class Side:
    """One side of a comparison.

    Attributes:
        label: its name in the tables.
        folder: of a run.
        chosen: the value that a column must have, by column: rows are matched by the other columns.
    """

    label: str
    folder: Path
    chosen: Mapping[str, str]

    def table(self, name: str) -> list[CsvRow] | None:
        """The rows of `name`.csv that are meant; None if the run left no such table, or one without a chosen column."""
        path = self.folder / f"{name}.csv"
        if not os.path.lexists(path):
            return None
        rows = read_csv(path)
        if rows and not set(self.chosen) <= set(rows[0]):
            return None
        return [row for row in rows if all(row[column] == value for column, value in self.chosen.items())]

    def settings(self) -> dict[str, str] | None:
        """The values of the run's `run.json`, by dotted key; None without one."""
        run = read_run(self.folder)
        if run is None:
            return None
        return _flat({key: value for key, value in run.items() if key not in NOT_SETTINGS})


def sides_of(arguments: Sequence[str]) -> list[Side]:
    """The sides that the command line names, such as "results/a" or "results/a@noise_model=physical".

    Raises:
        StoreError: fewer than two, one twice, a folder that is none, a selection that is not COLUMN=VALUE, or one of a
            column or value that no table of the run has.
    """
    if len(arguments) < 2:
        raise StoreError(f"{len(arguments)} given to compare; allowed: two folders of results or more")
    parsed = [_parsed(each) for each in arguments]
    if len({(folder.resolve(), tuple(sorted(chosen.items()))) for folder, chosen in parsed}) < len(parsed):
        raise StoreError(f"{', '.join(arguments)}: one is given twice; allowed: each once")
    return [Side(label, *each) for label, each in zip(_labels(parsed), parsed, strict=True)]


def _parsed(argument: str) -> tuple[Path, dict[str, str]]:
    folder, at, selection = (argument, "", "") if Path(argument).is_dir() else argument.partition("@")
    if not Path(folder).is_dir():
        raise StoreError(f"{folder} is no folder; allowed is one that a run left, such as results/zoom")
    if not list(Path(folder).glob("*.csv")):
        raise StoreError(f"{folder} has no tables; allowed is a folder that a run left, such as results/zoom")
    chosen = {}
    for part in selection.split(",") if at else ():
        column, equals, value = part.partition("=")
        if not (column and equals and value):
            raise StoreError(f"{argument}: {part!r}; allowed after @: COLUMN=VALUE, such as noise_model=physical")
        known = sorted({name for path in Path(folder).glob("*.csv") for name in read_head(path)})
        if column not in known:
            hint, _ = nearest(column, known)
            raise StoreError(f"{argument}: no table has a column {column!r}{hint}; allowed: {', '.join(known)}")
        values = sorted({row for path in Path(folder).glob("*.csv") for row in _values(path, column)})
        if value not in values:
            hint, _ = nearest(value, values)
            raise StoreError(f"{argument}: no table has {column} = {value}{hint}; allowed: {', '.join(values)}")
        chosen[column] = value
    return Path(folder), chosen


def _values(path: Path, column: str) -> set[str]:
    """The values of one column; none where there is no such column."""
    return {row[column] for row in read_csv(path) if row.get(column)}


def _labels(parsed: Sequence[tuple[Path, dict[str, str]]]) -> list[str]:
    """The shortest distinct labels: what was chosen, the folder's name, both, or the whole path."""
    makers = [
        lambda folder, chosen: " ".join(chosen.values()),
        lambda folder, chosen: folder.resolve().name,
        lambda folder, chosen: " ".join((folder.resolve().name, *chosen.values())),
    ]
    for make in makers:
        labels = [make(folder, chosen) for folder, chosen in parsed]
        if all(labels) and len(set(labels)) == len(labels):
            return labels
    return [" ".join((folder.as_posix(), *chosen.values())) for folder, chosen in parsed]


def settings_rows(sides: Sequence[Side]) -> list[dict[str, object]]:
    """A row for each key of the runs' files that is not the same in all, a column for each side; "" where it lacks.

    What the scenes or sweeps of a run have in common counts once. Sweeps that not all runs had are named, and their own
    keys are not compared; where the runs have no sweep in common, their scenes are compared all the same.
    """
    settings = [side.settings() for side in sides]
    known = [each if each is not None else {} for each in settings]
    sweeps = [dict.fromkeys(key.split(".")[1] for key in each if key.startswith("sweeps.")) for each in known]
    common = set.intersection(*(set(each) for each in sweeps)) if sweeps else set()
    if common:
        known = [
            {"sweeps": ", ".join(own)}
            | {k: value for k, value in each.items() if k.split(".")[0] not in BY_SWEEP or k.split(".")[1] in common}
            for each, own in zip(known, sweeps, strict=True)
        ]
    elif any(sweeps):
        known = [_by_scene(each, own) for each, own in zip(known, sweeps, strict=True)]
    rows: dict[tuple[str, ...], None] = {}
    for key in dict.fromkeys(key for each in known for key in each):
        values = tuple(each.get(key, "") for each in known)
        if len(set(values)) > 1:
            first, _, rest = key.partition(".")
            name = f"{BY_SWEEP[first]}.{rest.partition('.')[2]}" if first in BY_SWEEP and rest else key
            rows[name, *values] = None
    return [{"key": name, **dict(zip((s.label for s in sides), values, strict=True))} for name, *values in rows]


def _by_scene(settings: Mapping[str, str], sweeps: Iterable[str]) -> dict[str, str]:
    """A run's settings without its sweeps' own, the keys of its scenes without the sweeps' names.

    Where its sweeps' scenes differ in a key, all their values stand together.
    """
    found = {"sweeps": ", ".join(sweeps)}
    of_scene: dict[str, dict[str, None]] = {}
    for key, value in settings.items():
        first, _, rest = key.partition(".")
        if first not in BY_SWEEP:
            found[key] = value
        elif BY_SWEEP[first] == "scene":
            of_scene.setdefault(f"scene.{rest.partition('.')[2]}", {})[value] = None
    return found | {key: " or ".join(values) for key, values in of_scene.items()}


def _flat(value: Any, prefix: str = "") -> dict[str, str]:
    """Leaves by dotted key; a list's tables go by their names, a list of anything else is a leaf."""
    if isinstance(value, dict):
        items = [(str(key), item) for key, item in value.items()]
    elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        items = [(str(item.get("name", f"#{number}")), item) for number, item in enumerate(value, start=1)]
    else:
        return {prefix.removesuffix("."): value if isinstance(value, str) else json_text(value)}
    return {key: leaf for name, item in items for key, leaf in _flat(item, f"{prefix}{name}.").items()}
