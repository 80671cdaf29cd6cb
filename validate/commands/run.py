"""One run of the command: from the files it is given to the folder it leaves."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pss import RangeError
from render import backend
from render.lens.sampling import Sampling
from render.store.folder import Store, StoreError
from render.store.remote import open_store
from scenes import Scene, SweepFile, known_sweeps
from validate.acquire.acquire import Acquired, Acquisition
from validate.acquire.auto_exposure import with_exposures
from validate.acquire.forecast import announce, exposures_assumed
from validate.acquire.messages import RunMessages
from validate.acquire.options import HERE, Scale
from validate.acquire.source import ViewSource, end_run, warn_of_quality
from validate.commands.report import REPORT, of_results, source_of_report, write_report
from validate.plots import sweep as figures
from validate.prediction.own_metrics import failures_of
from validate.runs.exit_codes import EXIT_DONE
from validate.runs.file_names import check_default_folder, check_names, sweep_name
from validate.runs.input_files import load_measurement_of, load_sweeps
from validate.runs.outputs import check_folders, linked_views
from validate.runs.progress import clock
from validate.runs.run_file import as_options, read_run, write_run
from validate.runs.versions import versions
from validate.stats.measured_errors import FEWEST_TRIALS
from validate.sweeps import claims, correlation, optima, rows, scale_of_r, single_step, slopes, summary
from validate.sweeps.step_names import names_in_steps
from validate.sweeps.sweep import Plan, SweepResult, assess_sweep, plan

__all__ = ["Options", "execute"]


@dataclass(frozen=True)
class Options:
    """What the command line says; see `run_sweep.run_sweep`."""

    sweeps: tuple[str, ...]
    scene: Path | None = None
    out: Path | None = None
    store: str = "results/store"
    trials: int | None = None
    seed: int | None = None
    set: tuple[str, ...] = ()
    variant: str | None = None
    dry_run: bool = False
    allow_outside: bool = False
    quiet: bool = False
    scale: Scale = HERE
    report: bool = True
    cameras: tuple[str, ...] | None = None
    """Of `scene`, which is measured as it is, without sweeps: those that take part, all if there are none."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the sweeps, or of the scene that is measured."""
        if self.cameras is None:
            return tuple(map(sweep_name, self.sweeps))
        return (sweep_name(str(self.scene)),)

    @property
    def folder(self) -> Path:
        """Where the results go."""
        if self.cameras is not None:
            return self.out or Path("results") / "measure" / self.names[0]
        return self.out or Path("results") / "-".join(self.names)

    @property
    def overrides(self) -> tuple[str, ...]:
        """All that is to be changed in the files."""
        given = {"trials": self.trials, "seed": self.seed}
        return (*self.set, *(f"sweep.{key}={value}" for key, value in given.items() if value is not None))


def execute(options: Options, messages: RunMessages) -> int:
    """Run, print the tables, and return the exit code.

    Raises:
        PSSError: the user's mistake; nothing was rendered yet.
    """
    begin = time.perf_counter()
    _check(options)
    chosen = backend.choose(options.variant)
    loaded = _loaded(options)
    messages.console.print(str(chosen), markup=False)
    source = ViewSource(open_store(options.store), options.store, chosen, messages, options.scale)
    store = source.store
    if not options.dry_run:
        command = "sweeps" if options.cameras is None else "measure"
        messages.start(options.folder, command, sweeps=options.names, store=options.store)
    of_files = dict.fromkeys(warning for _, scene in loaded for warning in scene.warnings)
    for warning in of_files:
        messages.warn(warning)
    if options.dry_run:
        exposed = exposures_assumed(loaded, source)
    else:
        exposed = with_exposures(
            loaded,
            store,
            lambda line: messages.console.print(line, markup=False, soft_wrap=True),
            messages.note,
            chosen,
            messages.light_solved,
        )
    plans = [
        plan(sweep, scene, chosen.identity, Sampling(noise_ratio=sweep.render_noise_ratio)) for sweep, scene in exposed
    ]
    wanted = [item for each in plans for views in each.views for item in views]
    of_steps = dict.fromkeys(
        warning for each in plans for step in each.configurations for warning in step.scene.warnings
    )
    for warning in of_steps:
        if warning not in of_files:
            messages.warn(warning)
    if options.dry_run:
        counts = [f"{each.sweep.name}: {len(each.configurations)} configurations" for each in plans]
        announce(counts, wanted, source, options.folder)
        return EXIT_DONE

    acquired = source.acquire(wanted)
    after_views = time.perf_counter()
    results = [assess_sweep(each, acquired) for each in plans]
    after_assessment = time.perf_counter()
    _write(options.folder, results, wanted, acquired, store)
    after_tables = time.perf_counter()
    drawn_from, last = figures.source_of(options.folder, results), _of_last_run(options.folder)
    if drawn_from != last.get("figures_drawn_from") or not figures.all_drawn(options.folder, results):
        source.with_whole_views(lambda: figures.draw_all(options.folder, results, store), wanted)
    after_figures = time.perf_counter()
    reported_from = source_of_report(drawn_from) if options.report else last.get("report_made_from")
    made = last.get("report_made_from") == reported_from and (options.folder / REPORT).exists()
    if options.report and not made and any(result.assessments for result in results):
        source.with_whole_views(
            lambda: write_report(options.folder, of_results(results, acquired.measured), store), wanted
        )
    seconds = {
        "views": after_views - begin,
        "assessment": after_assessment - after_views,
        "tables": after_tables - after_assessment,
        "figures": after_figures - after_tables,
        "report": time.perf_counter() - after_figures,
        "total": time.perf_counter() - begin,
    }
    _write_run(options, plans, chosen, acquired, seconds, drawn_from, reported_from)
    scores = [each for result in results for of_model in result.own_scores.values() for each in of_model]
    for line in failures_of(scores):
        messages.warn(line)
    summary.show(results, acquired, messages.console)
    names = names_in_steps(plans)
    warn_of_quality(wanted, acquired, messages, names)
    messages.failed(acquired.failed, names)
    for each in results:
        for label, cause in each.skipped:
            messages.left_out(f"{each.plan.sweep.name} {label}: left out, a view failed ({cause})")
    counts_now = f"{acquired.rendered} rendered, {len(acquired.measured_items)} measured now"
    return end_run(
        f"{len({i.request.key for i in wanted})} views ({counts_now}) in {clock(seconds['total'])}; "
        f"results in {options.folder}",
        acquired,
        messages,
    )


def _check(options: Options) -> None:
    """What the user can get wrong before any file is read."""
    if not options.sweeps and options.cameras is None:
        raise RangeError(f"no sweep given; allowed: {', '.join(known_sweeps())}, or the paths of .toml files")
    if options.trials is not None and options.trials < 2:
        raise RangeError(f"--trials {options.trials}; allowed: {FEWEST_TRIALS} or more (one has no spread)")
    if options.seed is not None and options.seed < 0:
        raise RangeError(f"--seed {options.seed}; allowed: 0 or more")
    check_names(options.names)
    if options.out is None and options.cameras is None:
        check_default_folder(options.names, options.folder)
    check_folders(options.folder, options.store)
    options.scale.check()


def _loaded(options: Options) -> list[tuple[SweepFile, Scene]]:
    """Sweeps with their scenes, or the scene that is measured as it is."""
    if options.cameras is None:
        return load_sweeps(options.sweeps, options.scene, options.overrides, options.allow_outside)
    assert options.scene is not None
    return [load_measurement_of(options.scene, options.cameras, options.overrides, options.allow_outside)]


def _write(
    folder: Path, results: Sequence[SweepResult], wanted: Sequence[Acquisition], acquired: Acquired, store: Store
) -> None:
    """Write the CSV files and point `views/` into the store."""
    whole = [result for result in results if result.assessments]
    rows.write_csv(folder / "configurations.csv", [r for result in whole for r in rows.configuration_rows(result)])
    rows.write_csv(folder / "points.csv", [r for result in whole for r in rows.point_rows(result)])
    rows.write_csv(folder / "views.csv", rows.view_rows(whole, acquired))
    rows.write_csv(folder / "timings.csv", rows.timing_rows(wanted, acquired))
    rows.write_csv(folder / "detection.csv", rows.detection_rows(whole))
    rows.write_csv(folder / "correlation.csv", [r for result in whole for r in correlation.correlation_rows(result)])
    rows.write_csv(folder / "claims.csv", [r for result in whole for r in claims.claim_rows(result)])
    rows.write_csv(folder / "scale.csv", [r for result in whole for r in scale_of_r.scale_rows(result)])
    rows.write_csv(folder / "optima.csv", [r for result in whole for r in optima.optimum_rows(result)])
    rows.write_csv(folder / "measurement.csv", [r for result in whole for r in single_step.measurement_rows(result)])
    rows.write_csv(folder / "slopes.csv", [r for result in whole for r in slopes.slope_rows(result)])
    linked_views(folder, sorted({item.request.key for item in wanted} - set(acquired.failed)), store)


def _write_run(
    options: Options,
    plans: Sequence[Plan],
    chosen: backend.Backend,
    acquired: Acquired,
    seconds: dict[str, float],
    drawn_from: str,
    reported_from: object,
) -> None:
    content = {
        "options": as_options(dataclasses.asdict(options)),
        "sweeps": {each.sweep.name: each.sweep.resolved() for each in plans},
        "scenes": {each.sweep.name: each.scene.resolved() for each in plans},
        "seeds": {each.sweep.name: each.sweep.seed for each in plans},
        "renderer": chosen.identity,
        "versions": versions(),
        "seconds": seconds,
        **acquired.counts,
        "figures_drawn_from": drawn_from,
        "report_made_from": reported_from,
    }
    write_run(options.folder, content)


def _of_last_run(folder: Path) -> dict[str, object]:
    """What the run that left a folder says of itself, such as what its figures were drawn from; empty if unknown."""
    try:
        return read_run(folder) or {}
    except StoreError:
        return {}
