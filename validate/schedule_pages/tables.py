"""The rows of a schedule's CSV files as arrays: all numbers of its report but the poses and pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pss.hints import CsvRow, Floats
from render.store.folder import StoreError
from validate.pages.data import Kind, SweepTable, needed_tables, table_of
from validate.runs.csv_file import all_of, number_in
from validate.schedule.stage import BOTH

__all__ = ["KIND_NAMES", "ScheduleTable", "read_schedule", "schedule_table"]


NEEDED = (
    "configurations points correlation claims detection agreement strategies ranking runs".split()  # noqa: SIM905
)
KIND_NAMES = {"single": "single frame", "filter": "filter"}
"""A schedule's tables' names of the kinds of PSS, by the reports'."""


@dataclass(frozen=True, eq=False)
class ScheduleTable:
    """A schedule's rows of both avatars: R runs at K steps.

    Attributes:
        every: item r · K + k is run r at step k.
        runs: strategy and zoom limit of each run, as the tables have them.
        y_m, time_s: of the steps, (K,): where the first avatar is, and when.
        agreement, strategies, ranking: the rows of both avatars.
        claims, steering: all rows of claims.csv and runs.csv.
    """

    every: SweepTable
    runs: tuple[tuple[str, str], ...]
    y_m: Floats
    time_s: Floats
    assigned: tuple[str, ...]
    agreement: tuple[CsvRow, ...]
    strategies: tuple[CsvRow, ...]
    ranking: tuple[CsvRow, ...]
    claims: tuple[CsvRow, ...]
    steering: tuple[CsvRow, ...]

    @property
    def strategy_names(self) -> tuple[str, ...]:
        """In the tables' order."""
        return tuple(dict.fromkeys(strategy for strategy, _ in self.runs))

    @property
    def limits(self) -> tuple[str, ...]:
        """Zoom limits in the tables' order, "none" among them."""
        return tuple(dict.fromkeys(limit for _, limit in self.runs))

    @property
    def first_limit(self) -> str:
        """That the verdict is on: no zoom limit, if there was such a run."""
        return "none" if "none" in self.limits else self.limits[0]

    def by_run(self, values: Floats) -> Floats:
        """(R·K,) as (R, K)."""
        return values.reshape(len(self.runs), len(self.y_m))

    def measured(self, kind: Kind) -> tuple[Floats, Floats, Floats]:
        """Measured PSS in 1/m and the ends of its interval (nan: none), (R, K) each."""
        curve = self.every.measured_pss(kind)
        return self.by_run(curve.values), self.by_run(curve.low), self.by_run(curve.high)

    def predicted(self, model: str, kind: Kind) -> Floats:
        """Predicted PSS in 1/m, (R, K)."""
        return self.by_run(self.every.predicted_pss(model, kind).values)


def read_schedule(folder: Path) -> ScheduleTable:
    """The tables of a finished schedule's folder.

    Raises:
        StoreError: a table is missing, or holds no row of both avatars.
    """
    return schedule_table(needed_tables(folder, NEEDED), folder)


def schedule_table(tables: Mapping[str, Sequence[CsvRow]], folder: Path) -> ScheduleTable:
    """The rows of both avatars.

    Args:
        tables: rows as written, by table.
        folder: of the run, for messages.

    Raises:
        StoreError: there is no row of both avatars.
    """
    of_both = {name: all_of(tables[name], avatar=BOTH) for name in ("configurations", "correlation")}
    rows = of_both["configurations"]
    if not rows:
        raise StoreError(f"{folder}/configurations.csv has no row of both avatars; allowed is a run that has steps")
    every = table_of(rows[0]["sweep"], {**tables, **of_both})
    first = all_of(rows, noise_model=every.models[0])
    runs = tuple(dict.fromkeys((row["strategy"], row["zoom_limit"]) for row in first))
    steps = first[: len(first) // len(runs)]
    return ScheduleTable(
        every,
        runs,
        np.array([number_in(row, "value") for row in steps]),
        np.array([number_in(row, "time_s") for row in steps]),
        tuple(row["assigned"] for row in first),
        *(tuple(all_of(tables[name], avatar=BOTH)) for name in ("agreement", "strategies", "ranking")),
        tuple(tables["claims"]),
        tuple(tables["runs"]),
    )
