"""The tables of a comparison's page: settings by group, matched rows in whole, and what was left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from validate.comparison.cells import cells
from validate.comparison.matching import QUANTITIES, matched
from validate.comparison.sides import Side, settings_rows

__all__ = ["Folded", "Setting", "folded_tables", "left_out", "settings_by_group"]

SECTIONS = {"sensor": "Sensor", "scene": "Scene", "sweep": "Sweep", "versions": "Versions", "run": "Run"}
TITLES = {
    "measured": "Measured",
    "predicted": "Predicted",
    "correlation": "Correlation of prediction and measurement",
    "leaderboard": "Leaderboard of the bank",
    "agreement": "Agreement in the hallway",
    "strategies": "Strategies of the hallway",
    "slopes": "Log-log slopes",
}
# Tables that hold steps, which two runs may have different ones of.
STEPS_IN = ("sweep", "value")


@dataclass(frozen=True)
class Setting:
    """A key that is not the same in all runs: `values` in the sides' order, "" where a run has none."""

    key: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class Folded:
    """A table: title, head and cells as text; `keys` columns at the left identify a row."""

    title: str
    keys: int
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def settings_by_group(sides: Sequence[Side]) -> dict[str, list[Setting]]:
    """What differs between the runs, by "Sensor", "Scene", "Sweep", "Versions" and "Run"; those that have any.

    Runs without a run.json are left out: their settings are not known.
    """
    known = [side for side in sides if side.settings() is not None]
    found: dict[str, list[Setting]] = {words: [] for words in SECTIONS.values()}
    for row in settings_rows(known) if len(known) > 1 else []:
        key = str(row["key"])
        section, short = _section(key)
        values = tuple(str(row.get(side.label, "not known")) if side in known else "not known" for side in sides)
        found[SECTIONS[section]].append(Setting(short, values))
    return {words: settings for words, settings in found.items() if settings}


def _section(key: str) -> tuple[str, str]:
    """The group of a key, and the key within it."""
    parts = key.split(".")
    if parts[0] == "scene" and len(parts) > 2 and parts[1] == "sensor":
        return "sensor", ".".join(parts[2:])
    if parts[0] in ("scene", "sweep", "versions") and len(parts) > 1:
        return parts[0], ".".join(parts[1:])
    return ("versions", key) if key == "renderer" else ("sweep", key) if key == "sweeps" else ("run", key)


def folded_tables(sides: Sequence[Side], names: Sequence[str]) -> list[Folded]:
    """Every quantity that all sides have, with all its rows, as `compare --rows` has them."""
    labels = [side.label for side in sides]
    found = []
    for comparison, quantities in QUANTITIES.items():
        for quantity in quantities:
            rows = matched(sides, quantity)
            if not rows:
                continue
            keys = list(rows[0])[: list(rows[0]).index("quantity")]
            keys = [key for key in keys if len({row[key] for row in rows}) > 1 or key in ("value", "sweep")]
            what, sign = ("ratio", "÷") if quantity.as_ratio else ("difference", "−")
            head = [*keys, names[0]]
            for name in names[1:]:
                head += [name, f"{name} {sign} {names[0]}"]
            lines = tuple((*(str(row[key]) for key in keys), *cells(row, labels, what)) for row in rows)
            unit = " in m" if quantity.value.endswith("_m") else ""
            title = f"{TITLES[comparison]}: {quantity.value}{unit}" + (" [95 %]" if quantity.low else "")
            found.append(Folded(title, len(keys), tuple(head), lines))
    return found


def left_out(sides: Sequence[Side], names: Sequence[str]) -> list[str]:
    """Sentences on what one side has and another lacks, so that it is not shown."""
    found = []
    tables = dict.fromkeys([quantity.table for each in QUANTITIES.values() for quantity in each] + ["points"])
    for table in tables:
        rows = [side.table(table) for side in sides]
        have = [name for name, own in zip(names, rows, strict=True) if own is not None]
        if not have or len(have) == len(sides):
            continue
        lack = [name for name, own in zip(names, rows, strict=True) if own is None]
        exists = all((side.folder / f"{table}.csv").is_file() for side in sides)
        if exists:
            columns = ", ".join(sorted({column for side in sides for column in side.chosen}))
            found.append(f"{table}.csv has no column {columns} to choose by for {_listed(lack)}.")
        else:
            found.append(f"{table}.csv: {_listed(have)} left one, {_listed(lack)} did not.")
    for table in tables:
        of_sides = [side.table(table) for side in sides]
        empty = [name for name, own in zip(names, of_sides, strict=True) if own is not None and not own]
        if empty and all(own is not None for own in of_sides):
            found.append(f"{table}.csv has no rows for {_listed(empty)}.")
    found += [
        f"{table}.csv: no row of {names[0]} has its like in all others."
        for table in dict.fromkeys(quantity.table for each in QUANTITIES.values() for quantity in each)
        if all(side.table(table) for side in sides)
        and not any(matched(sides, q) for each in QUANTITIES.values() for q in each if q.table == table)
    ]
    return found + _steps_left_out([side.table("configurations") or [] for side in sides], names)


def _steps_left_out(tables: Sequence[Sequence[Mapping[str, str]]], names: Sequence[str]) -> list[str]:
    if not all(tables):
        return []
    steps = [dict.fromkeys(tuple(row.get(key, "") for key in STEPS_IN) for row in rows) for rows in tables]
    common = set.intersection(*(set(each) for each in steps))
    found = []
    for own, name in zip(steps, names, strict=True):
        for sweep in dict.fromkeys(sweep for sweep, _ in own):
            alone = [value for step, value in own if step == sweep and (step, value) not in common]
            whole = not any(step == sweep for step, _ in common)
            if alone:
                shown = ", ".join(alone[:6]) + ("…" if len(alone) > 6 else "")
                words = "all its steps" if whole else f"{len(alone)} of its steps ({shown})"
                found.append(f"Sweep {sweep} of {name}: {words}, which not all others have.")
    return found


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
