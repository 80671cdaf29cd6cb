"""The rows of a run's CSV files as arrays, a table for each sweep: all numbers of a report but the poses and pixels."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pss.hints import CsvRow, Floats
from render.store.folder import StoreError
from validate.pages.columns import Columns, check_counts, is_number, whole_number
from validate.prediction.contenders import shown_model
from validate.prediction.own_metrics import OWN_COLUMN
from validate.runs.csv_file import all_of, number_in
from validate.runs.saved import SavedRun
from validate.stats.optimum import FLAT, NO_OPTIMUM, optimum

__all__ = ["KINDS", "MM", "Curve", "Kind", "SweepTable", "needed_tables", "read_sweeps", "sweep_tables", "table_of"]


NEEDED = ("configurations", "points", "correlation", "claims", "detection", "views")
DETECTION = ("visible_detected", "visible_missed", "hidden_detected", "hidden_missed")
# Of those missed, the ones that light explains.
TOO_DARK = "visible_missed_too_dark"
# Runs of before had none.
OPTIONAL = ("optima", "measurement")
NEEDED_COLUMNS = tuple(f"budget_{name}" for name in ("visibility", "noise_model", "detector", "geometry"))
# Columns that hold a number or nothing, by table; those of configurations and points are found by what they hold.
NUMBERS = {
    "correlation": "spearman spearman_ci_low spearman_ci_high kendall pearson_log regret oracle_regret".split(),  # noqa: SIM905
    "claims": ["value", "ci_low", "ci_high"],
    "agreement": "n spearman spearman_ci_low spearman_ci_high median_abs_log_ratio median_log_ratio".split(),  # noqa: SIM905
    "strategies": "value ci_low ci_high rank rank_ci_low rank_ci_high".split(),  # noqa: SIM905
    "ranking": ["spearman", "spearman_ci_low", "spearman_ci_high", "chosen_is_best_share", "regret"],
    "runs": ["swaps", "lost_tracks", "aim_error_rms_m"],
}
MM = 1000.0


@dataclass(frozen=True)
class Kind:
    """Columns of what is set beside each other: one frame triangulated, or the filter."""

    name: str
    words: str
    metric: str
    measure: str
    pss: str
    measured_pss: str
    sigma: str
    measured_sigma: str
    symbol: str


KINDS = (
    Kind(
        "single",
        "single frame",
        "pss-single-frame",
        "measured_pss_single_frame",
        "pss_single_frame",
        "measured_pss_single_frame",
        "single_frame_sigma_m",
        "measured_sigma_m",
        "√λmax of C",
    ),
    Kind(
        "filter",
        "filter",
        "pss",
        "measured_pss_filter",
        "pss",
        "measured_pss_filter",
        "sigma_inf_m",
        "measured_filter_sigma_m",
        "σ∞",
    ),
)


@dataclass(frozen=True, eq=False)
class Curve:
    """PSS over a sweep's S steps, in 1/m; the ends of the 95 % interval are nan where it has none.

    Attributes:
        flat: whether no step is better than another by more than chance (`validate.sweeps.optima`).
    """

    values: Floats
    low: Floats
    high: Floats
    flat: bool = False

    @property
    def best(self) -> int | None:
        """The step of the highest; None of a flat curve, and where no step resolves a point."""
        return None if self.flat else optimum(self.values)

    @property
    def without_best(self) -> str:
        """The word for a curve that has no best step."""
        return NO_OPTIMUM if optimum(self.values) is None else FLAT


@dataclass(frozen=True, eq=False)
class SweepTable:
    """One sweep's rows.

    Attributes:
        labels, values: of the S steps, as the tables have them.
        models: names of the noise models.
        steps: by noise model and column, (S,).
        points: by noise model and column, (S, N).
        point_ids, objects: of the N points, in the tables' order.
        correlation, claims, optima, measurement: the sweep's rows; older runs have none of the last two.
        detection: markers over views: `visible_detected`, `visible_missed`, `hidden_detected`, `hidden_missed`.
    """

    name: str
    parameter: str
    labels: tuple[str, ...]
    values: tuple[str, ...]
    camera_names: tuple[tuple[str, ...], ...]
    models: tuple[str, ...]
    steps: dict[str, dict[str, Floats]]
    points: dict[str, dict[str, Floats]]
    point_ids: tuple[int, ...]
    objects: tuple[str, ...]
    correlation: tuple[CsvRow, ...]
    claims: tuple[CsvRow, ...]
    optima: tuple[CsvRow, ...]
    measurement: tuple[CsvRow, ...]
    detection: dict[str, int]

    @property
    def numeric(self) -> bool:
        """Whether the steps lie along a number."""
        return all(is_number(value) for value in self.values)

    @property
    def leading_model(self) -> str:
        """The noise model that the report begins with, as figures show it."""
        return shown_model(self.models)

    def predicted_pss(self, model: str, kind: Kind) -> Curve:
        """1/m, predicted by a noise model."""
        values = self.steps[model][kind.pss]
        unknown = np.full_like(values, np.nan)
        return Curve(values, unknown, unknown, self._flat(model, kind))

    def measured_pss(self, kind: Kind) -> Curve:
        """1/m, measured; the single-frame kind has an interval, and the filter's in runs that leave it."""
        columns = self.steps[self.models[0]]
        values = columns[kind.measured_pss]
        name = "measured_pss" if kind.name == "single" else kind.measured_pss
        unknown = np.full_like(values, np.nan)
        low, high = (columns.get(f"{name}_ci_{end}", unknown) for end in ("low", "high"))
        return Curve(values, low, high, self._flat("", kind))

    def _flat(self, model: str, kind: Kind) -> bool:
        return any(row["flat"] == "yes" for row in all_of(self.optima, noise_model=model, kind=kind.words))

    def finding(self, kind: Kind, model: str = "") -> str:
        """Where a noise model's PSS, or ("") the measured one, is highest, in words; "" where the run has none."""
        return next((row["finding"] for row in all_of(self.optima, noise_model=model, kind=kind.words)), "")

    def own_metrics(self, model: str) -> dict[str, Floats]:
        """The user's own metrics by name, (S,)."""
        columns = self.steps[model].items()
        return {key.removeprefix(OWN_COLUMN): values for key, values in columns if key.startswith(OWN_COLUMN)}

    def predicted_mm(self, model: str, kind: Kind) -> Floats:
        """Millimetres, predicted σ of each point at each step, (S, N); nan where it is not observable."""
        return self.points[model][kind.sigma] * MM

    def measured_mm(self, kind: Kind) -> Floats:
        """Millimetres, measured σ of each point at each step, (S, N); nan where it was never triangulated."""
        return self.points[self.models[0]][kind.measured_sigma] * MM

    def nees_share(self, model: str | None) -> Floats:
        """NEES/3, (S, N): 1 where the covariance is right. Of a noise model, or (None) of what detections claim."""
        if model is None:
            return self.points[self.models[0]]["nees_detections"] / 3
        return self.points[model]["nees"] / 3

    def at(self, steps: Sequence[int]) -> SweepTable:
        """The table of some of the steps, in their order."""
        chosen = list(steps)
        return replace(
            self,
            labels=tuple(self.labels[n] for n in chosen),
            values=tuple(self.values[n] for n in chosen),
            camera_names=tuple(self.camera_names[n] for n in chosen),
            steps={model: {key: v[chosen] for key, v in columns.items()} for model, columns in self.steps.items()},
            points={model: {key: v[chosen] for key, v in columns.items()} for model, columns in self.points.items()},
        )

    def correlation_of(self, model: str, kind: Kind) -> CsvRow | None:
        """The row of a noise model's PSS with the measured PSS of the same kind, over the steps."""
        found = all_of(
            self.correlation, metric=kind.metric, noise_model=model, level="configuration", measure=kind.measure
        )
        return found[0] if found else None


def read_sweeps(folder: Path) -> list[SweepTable]:
    """The sweeps of a finished run, from the CSV files in its folder, in the order of the tables.

    Raises:
        StoreError: a table is missing, or holds no row of a configuration.
    """
    optional = (name for name in OPTIONAL if os.path.lexists(folder / f"{name}.csv"))
    return sweep_tables(needed_tables(folder, (*NEEDED, *optional)), folder)


def sweep_tables(tables: Mapping[str, Sequence[CsvRow]], folder: Path) -> list[SweepTable]:
    """The sweeps of a run, in the order of its tables.

    Args:
        tables: rows as written, by table.
        folder: of the run, for messages.

    Raises:
        StoreError: there is no row of a configuration.
    """
    names = dict.fromkeys(row["sweep"] for row in tables["configurations"])
    if not names:
        raise StoreError(f"{folder}/configurations.csv has no row; allowed is a run with a configuration that was seen")
    return [table_of(name, {table: _of_sweep(rows, name) for table, rows in tables.items()}) for name in names]


def needed_tables(folder: Path, names: Sequence[str]) -> dict[str, Sequence[CsvRow]]:
    """The CSV files of a run's folder, by name.

    Raises:
        StoreError: one of those named is missing, or one of their columns, or is no table of text and numbers; the line
            names the file, and the line in it.
    """
    missing = [f"{name}.csv" for name in names if not os.path.lexists(folder / f"{name}.csv")]
    if missing:
        raise StoreError(f"{folder} has no {', '.join(missing)}; allowed is a folder that a run has left")
    run = SavedRun(folder)
    tables = {name: run.written(name) for name in names}
    for name in NUMBERS.keys() & tables.keys():
        for row in tables[name]:
            for column in row.keys() & set(NUMBERS[name]):
                number_in(row, column)
    head = next(iter(tables["configurations"]), {})
    lacking = [name for name in NEEDED_COLUMNS if head and name not in head]
    if lacking:
        raise StoreError(
            f"{folder}/configurations.csv is of an older version, without {', '.join(lacking)}; run it again"
        )
    return tables


def _of_sweep(rows: Sequence[CsvRow], name: str) -> list[CsvRow]:
    return [row for row in rows if row.get("sweep") == name]


def table_of(name: str, tables: Mapping[str, Sequence[CsvRow]]) -> SweepTable:
    """A sweep's table from its own rows: of configurations, points, correlation, claims and detection."""
    rows = tables["configurations"]
    models = tuple(dict.fromkeys(row["noise_model"] for row in rows))
    first = all_of(rows, noise_model=models[0])
    points = {model: all_of(tables["points"], noise_model=model) for model in models}
    count = len(points[models[0]]) // len(first)
    check_counts(name, {model: len(all_of(rows, noise_model=model)) for model in models}, "configurations", len(first))
    check_counts(name, {model: len(points[model]) for model in models}, "points", len(first) * count)
    if not count or not tables["detection"]:
        raise StoreError(
            f"{name}: no row in {'detection' if count else 'points'}.csv; allowed: tables as a run left them"
        )
    of_first_step = points[models[0]][:count]
    return SweepTable(
        name=name,
        parameter=first[0]["parameter"],
        labels=tuple(row["configuration"] for row in first),
        values=tuple(row["value"] for row in first),
        camera_names=tuple(tuple(row["camera_names"].split()) for row in first),
        models=models,
        steps={model: Columns(all_of(rows, noise_model=model), (len(first),)) for model in models},
        points={model: Columns(points[model], (len(first), count)) for model in models},
        point_ids=tuple(whole_number(row, "point") for row in of_first_step),
        objects=tuple(row["object"] for row in of_first_step),
        correlation=tuple(tables["correlation"]),
        claims=tuple(tables["claims"]),
        optima=tuple(tables.get("optima", ())),
        measurement=tuple(tables.get("measurement", ())),
        detection={
            key: whole_number(tables["detection"][0], key)
            for key in (*DETECTION, TOO_DARK)
            if key != TOO_DARK or key in tables["detection"][0]  # runs of older versions lack it
        },
    )
