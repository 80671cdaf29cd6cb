"""`run_sweep.py compare`: the tables of two or more runs side by side, with differences and intervals."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from pss.hints import Row
from render.store.folder import StoreError
from validate.commands.subcommands import Compare
from validate.comparison.cells import cells
from validate.comparison.matching import QUANTITIES, Quantity, matched
from validate.comparison.sides import Side, settings_rows, sides_of
from validate.runs.console import Console
from validate.runs.folder_lock import alone_in
from validate.runs.table_text import table_text

__all__ = ["compared", "execute"]


# Wide enough that no interval is broken.
COLUMNS_FOR_KEYS, COLUMNS_A_RUN = 60, 60
# Comparisons that are shown whole; of others, what has no interval is left to --rows.
OF_STEPS = ("measured", "predicted")
ALLOWED = "; allowed: runs with the same sweeps and values, or cameras"
TITLE = "What differs in the runs' settings"
# Settings that differ beyond this number are counted by the table they are in, where it has several.
MOST_SETTINGS, SEVERAL = 12, 3
# Other keys that all rows of a printed table share are redundant.
ALWAYS_SHOWN = ("value", "noise_model")


def execute(options: Compare) -> int:
    """Print the comparison, and write its page; the exit code."""
    rows, table, out = options.rows, options.table, options.out
    if out is not None and out.suffix != ".html":
        raise StoreError(f"{out} is no page; allowed: a file that ends in .html")
    sides = sides_of(options.runs)
    if table is not None:
        print(table_text([*compared(sides, rows or "measured")], table), end="")
        if out is not None and options.report:
            _page(sides, out)
        return 0
    # In a file or a pipe the tables keep their columns.
    console = Console(width=None if os.isatty(1) else COLUMNS_FOR_KEYS + COLUMNS_A_RUN * len(sides))
    shown = [rows] if rows else ["settings", "measured", "correlation", "leaderboard", "agreement"]
    if not rows and len({side.folder.resolve() for side in sides}) == 1:  # one run, which measured one thing
        shown = ["predicted", *shown[2:]]
    if "settings" in shown:
        _show_settings(sides, console, short=rows is None)
    if rows in QUANTITIES:
        compared(sides, rows)  # raises where nothing is alike
    for name in shown:
        for quantity in QUANTITIES.get(name, ()):
            _show(sides, name, quantity, console, short=rows is None)
    if rows is None and not any(matched(sides, quantity) for name in OF_STEPS for quantity in QUANTITIES[name]):
        console.print(nothing_alike(sides, "measured"), markup=False, highlight=False, soft_wrap=True)
    if options.report and (out is not None or rows is None):
        console.print(str(_page(sides, out)), markup=False, highlight=False, soft_wrap=True)
    return 0


def _page(sides: Sequence[Side], out: Path | None) -> Path:
    """The page, written; what draws it takes longer to import than a table to print."""
    from validate.comparison.page import PAGE, write_page

    path = out or PAGE
    with alone_in(path.parent):
        return write_page(path, sides)


def compared(sides: Sequence[Side], name: str) -> list[Row]:
    """The rows of one comparison: "settings", or a name in `QUANTITIES`; those of all its quantities have one head.

    Raises:
        StoreError: a side has no such table, or no row has its like in all others.
    """
    if name == "settings":
        return settings_rows(sides)
    found = [row for quantity in QUANTITIES[name] for row in matched(sides, quantity)]
    if not found:
        raise StoreError(nothing_alike(sides, name))
    head = dict.fromkeys(key for row in found for key in row)
    return [{key: row.get(key) for key in head} for row in found]


def nothing_alike(sides: Sequence[Side], name: str) -> str:
    """One line on a comparison whose rows have no like: what each side has, and what is allowed."""
    table = QUANTITIES[name][0].table
    rows = {side.label: side.table(table) for side in sides}
    missing = [label for label, own in rows.items() if own is None]
    empty = [label for label, own in rows.items() if own is not None and not own]
    line = f"{name}: no row of {table}.csv is alike in {', '.join(rows)}"
    if missing or empty:
        return (
            f"{line}: {' and '.join(missing or empty)} has {'no such table' if missing else 'an empty one'}" + ALLOWED
        )
    sweeps = [dict.fromkeys(row.get("sweep", "") for row in own or []) for own in rows.values()]
    if set.intersection(*(set(each) for each in sweeps)):
        return f"{line}: their steps differ" + ALLOWED
    have = "; ".join(f"{label} has {', '.join(own)}" for label, own in zip(rows, sweeps, strict=True))
    return f"{line}: they share no sweep ({have}){ALLOWED}, or sweeps of other names chosen by RUN@sweep=NAME"


def _show_settings(sides: Sequence[Side], console: Console, short: bool) -> None:
    for side in sides:
        if side.settings() is None:
            console.print(f"{side.folder} has no run.json: its settings are not known", markup=False, highlight=False)
    rows = settings_rows([side for side in sides if side.settings() is not None])
    if not rows:
        console.print("no setting differs", highlight=False)
        return
    counted = summarised(rows) if short else rows
    table = Table(title=f"{TITLE}: {len(rows)} keys" if len(rows) > MOST_SETTINGS else TITLE)
    for name in rows[0]:
        table.add_column(name, overflow="fold")
    for row in counted:
        table.add_row(*(str(value) for value in row.values()))
    console.print(table)
    if len(counted) < len(rows):
        console.print("all of them: --rows settings", highlight=False)


def summarised(rows: Sequence[Row]) -> list[Row]:
    """Rows of settings; beyond `MOST_SETTINGS` one stands for all keys of a table, such as those of scene.cameras."""
    if len(rows) <= MOST_SETTINGS:
        return list(rows)
    tables: dict[str, list[Row]] = {}
    for row in rows:
        tables.setdefault(".".join(str(row["key"]).split(".")[:2]), []).append(row)
    found: list[Row] = []
    for name, own in tables.items():
        first = own[0] | {"key": f"{name}: {len(own)} keys, such as {str(own[0]['key']).removeprefix(f'{name}.')}"}
        found += [first] if len(own) > SEVERAL else own
    return found


def _show(sides: Sequence[Side], name: str, quantity: Quantity, console: Console, short: bool) -> None:
    rows = matched(sides, quantity)
    if short and quantity.only:
        chosen = {column for side in sides for column in side.chosen}
        only = {key: allowed for key, allowed in quantity.only.items() if key not in chosen}
        rows = [row for row in rows if all(row.get(key, allowed[0]) in allowed for key, allowed in only.items())]
    labels = [side.label for side in sides]
    if not rows or (short and not quantity.low and name not in OF_STEPS):
        return
    first = rows[0]
    keys = list(first)[: list(first).index("quantity")]
    keys = [key for key in keys if key in ALWAYS_SHOWN or len({row[key] for row in rows}) > 1]
    unit = {"_m": " (m)", "ss": "", "er": ""}.get(quantity.value[-2:], "")
    table = Table(title=f"{quantity.value}{unit}" + (", with 95 % intervals" if quantity.low else ""))
    for key in keys:
        table.add_column(key)
    what = "ratio" if quantity.as_ratio else "difference"
    sign = "÷" if quantity.as_ratio else "−"
    for number, label in enumerate(labels):
        table.add_column(label, justify="right")
        if number:
            table.add_column(f"{label} {sign} {labels[0]}", justify="right")
    previous = None
    for row in rows:
        if previous is not None and row.get("sweep") != previous:
            table.add_section()
        previous = row.get("sweep")
        table.add_row(*(str(row[key]) for key in keys), *cells(row, labels, what))
    console.print(table)
