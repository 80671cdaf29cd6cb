"""A run of sweeps as one object: tables, figures, report and console format what it has computed once."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from matplotlib.figure import Figure

from pss.hints import CsvRow, Floats, Row
from render.store.folder import StoreError, write_text
from validate.acquire.request import Acquired, Acquisition
from validate.acquire.source import ViewSource
from validate.pages.data import sweep_tables
from validate.pages.stored import REPORT
from validate.plots import sweep as figures
from validate.points.error_budget import ErrorBudget
from validate.prediction.contenders import judged, listed_contenders
from validate.results.report import of_results, source_of_report, write_report
from validate.results.run_request import RunRequest
from validate.runs.folder_lock import alone_in
from validate.runs.outputs import linked_views
from validate.runs.run_file import as_options, read_run, write_run
from validate.runs.tables import RunTables, as_written, table_file
from validate.runs.versions import versions
from validate.sweeps.claims import claim_rows
from validate.sweeps.departures import error_budgets, nees
from validate.sweeps.slopes import Slopes, slopes_of
from validate.sweeps.sweep import SweepResult
from validate.sweeps.tables import TABLES, tables_of

__all__ = ["RunResult"]


@dataclass(frozen=True, eq=False, repr=False)
class RunResult(RunTables):
    """What a run of sweeps predicted and measured.

    Attributes:
        request: the run's files, overrides and options.
        sweeps: each sweep's plan, configurations, predictions and measurements, in the order of the request.
        requested: the views of all steps.
        acquired: what came of them: measurements, certificates, and the causes of failures.
        source: where the views are from; figures and report read the images there.
        seconds: s, that views and assessment took.
    """

    request: RunRequest
    sweeps: tuple[SweepResult, ...]
    requested: tuple[Acquisition, ...]
    acquired: Acquired
    source: ViewSource
    seconds: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def rows(self) -> dict[str, list[Row]]:
        """The rows of each table, by name, with all digits."""
        return tables_of(self.sweeps, self.requested, self.acquired)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tables, in the order in which they are written."""
        return TABLES

    @cached_property
    def _written(self) -> dict[str, list[dict[str, str]]]:
        return {name: as_written(rows) for name, rows in self.rows.items()}

    def written(self, name: str) -> Sequence[CsvRow]:
        """The rows of a table as its CSV file has them, text by column.

        Raises:
            RangeError: the run has no such table.
        """
        self._check_name(name)
        return self._written[name]

    @property
    def failed(self) -> Mapping[str, str]:
        """The causes of views that could not be rendered or measured, by the views' hashes; none of a whole run."""
        return self.acquired.failed

    @property
    def claims(self) -> dict[str, list[Row]]:
        """By sweep, what the paper's Figures 1 to 3 state of it, predicted and measured; none of other sweeps."""
        return {result.plan.sweep.name: claim_rows(result) for result in self._whole}

    @property
    def slopes(self) -> dict[str, Slopes | None]:
        """By sweep, log-log slopes of RMS over the steps; None unless its values are distinct positive numbers."""
        return {result.plan.sweep.name: slopes_of(result) for result in self._whole}

    @property
    def error_budget(self) -> dict[tuple[str, str], tuple[ErrorBudget, ...]]:
        """By sweep and noise model, the factors from predicted to measured single-frame PSS, of each step."""
        return {(r.plan.sweep.name, model): error_budgets(r, model) for r in self._whole for model in r.noise_models}

    @property
    def nees(self) -> dict[tuple[str, str], Floats]:
        """By sweep and noise model, NEES of each of N points at each of S steps, (S, N): 3 where C is right."""
        return {(r.plan.sweep.name, model): nees(r, model) for r in self._whole for model in r.noise_models}

    @property
    def _whole(self) -> list[SweepResult]:
        return [result for result in self.sweeps if result.assessments]

    def save(self, folder: str | Path | None = None, *, report: bool = True) -> Path:
        """Write tables, figures, report and `run.json`, and links to the views: what the command writes; the folder.

        Figures and report that are there already, and show the same, stay as they are.

        Args:
            folder: of the results (default: that of the request, `results/` and the sweeps' names).
            report: whether to write report.html, and the scene as glTF.

        Raises:
            StoreError: the folder cannot be written, something is in the way, or another process uses it.
        """
        request = replace(self.request, report=report)
        if folder is not None and Path(folder) != request.folder:
            request = replace(request, out=Path(folder))
        request.check_folder()
        with alone_in(request.folder):
            self.write(request)
        return request.folder

    def write(self, request: RunRequest) -> float:
        """Write all files into the folder of `request`, which nobody else uses meanwhile; s, that the run took.

        Raises:
            StoreError: the folder cannot be written.
            DamagedViewError: views are damaged as fast as they are rendered again.
        """
        folder, store, source = request.folder, self.source.store, self.source
        begin = time.perf_counter()
        for name in self.names:
            write_text(folder / f"{name}.csv", table_file(self.written(name)))
        linked_views(folder, sorted({item.request.key for item in self.requested} - set(self.failed)), store)
        after_tables = time.perf_counter()
        drawn_from, last = figures.source_of(folder, self.sweeps), _of_last_run(folder)
        if drawn_from != last.get("figures_drawn_from") or not figures.all_drawn(folder, self.sweeps):
            source.with_whole_views(lambda: figures.draw_all(folder, self.sweeps, store), self.requested)
        after_figures = time.perf_counter()
        reported_from = source_of_report(drawn_from) if request.report else last.get("report_made_from")
        made = last.get("report_made_from") == reported_from and (folder / REPORT).exists()
        whole = of_results(self.sweeps, self.acquired.measured)
        if request.report and not made and whole:
            tables = sweep_tables({name: self.written(name) for name in self.names}, folder)
            source.with_whole_views(lambda: write_report(folder, tables, whole, store), self.requested)
        seconds = {
            **self.seconds,
            "tables": after_tables - begin,
            "figures": after_figures - after_tables,
            "report": time.perf_counter() - after_figures,
        }
        seconds["total"] = sum(seconds.values())
        plans = [each.plan for each in self.sweeps]
        write_run(
            folder,
            {
                "options": as_options(dataclasses.asdict(request)),
                "sweeps": {plan.sweep.name: plan.sweep.resolved() for plan in plans},
                "scenes": {plan.sweep.name: plan.scene.resolved() for plan in plans},
                "predicted_with": {plan.sweep.name: judged(listed_contenders(plan.scene)) for plan in plans},
                "seeds": {plan.sweep.name: plan.sweep.seed for plan in plans},
                "renderer": source.renderer,
                "versions": versions(),
                "seconds": seconds,
                **self.acquired.counts,
                "figures_drawn_from": drawn_from,
                "report_made_from": reported_from,
            },
        )
        return seconds["total"]

    def plot(self) -> dict[str, Figure]:
        """The command's figures, by the names of their files: curves, points and captures of each sweep.

        Raises:
            DamagedViewError: views are damaged as fast as they are rendered again.
        """
        return self.source.with_whole_views(
            lambda: {
                name: each for result in self._whole for name, each in figures.figures_of(result, self.source.store)
            },
            self.requested,
        )

    def __repr__(self) -> str:
        """The sweeps with their numbers of configurations, and what failed."""
        counts = (f"{each.plan.sweep.name}: {len(each.assessments)} configurations" for each in self.sweeps)
        lost = f"; {len(self.failed)} views failed" if self.failed else ""
        return f"RunResult({', '.join(counts)}{lost})"


def _of_last_run(folder: Path) -> dict[str, object]:
    """What the last run of a folder recorded, such as what its figures were drawn from; nothing if unknown."""
    try:
        return read_run(folder) or {}
    except StoreError:
        return {}
