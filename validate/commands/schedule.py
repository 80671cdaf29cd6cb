"""`run_sweep.py schedule`: strategies steer cameras at two people who pass each other; predicted and measured."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

import scenes
from pss.hints import Row
from pss.noise import Calibration
from render.store.folder import atomic_path, write_text
from scenes.steps.schedule_file import load_schedule
from validate.acquire.acquire import Acquired
from validate.acquire.forecast import announce
from validate.acquire.messages import RunMessages
from validate.acquire.source import ViewSource, end_run, open_source, warn_of_quality
from validate.acquire.view_names import view_names
from validate.commands.subcommands import Schedule
from validate.prediction.contenders import judged
from validate.runs.console import Console
from validate.runs.exit_codes import EXIT_DONE
from validate.runs.outputs import check_folders, linked_views
from validate.runs.progress import clock
from validate.runs.run_file import as_options, write_run
from validate.runs.tables import as_written, write_csv
from validate.runs.versions import versions
from validate.schedule.agreement import ALL_RUNS
from validate.schedule.design import Design
from validate.schedule.held import FULL_MODEL, Held, held_contenders
from validate.schedule.own_cameras import own_cameras
from validate.schedule.own_strategy import own_strategy
from validate.schedule.results import ScheduleResult, result_of
from validate.schedule.runs import Run, strategies_of
from validate.schedule.stage import BOTH, stage_of
from validate.schedule.tables import tables_of
from validate.schedule_pages.files import of_schedule, write_schedule_report
from validate.schedule_pages.tables import schedule_table
from validate.tracked_walk.files import write_real_walk
from validate.tracked_walk.frames import track_real_walk
from validate.tracked_walk.path import assessed, planned
from validate.tracked_walk.requested_views import RequestedViews

__all__ = ["execute"]


def execute(options: Schedule) -> int:
    """Steer, render and measure, save and print the results; the exit code."""
    shared, trials, seed = options.run, options.trials, options.seed
    shared.scale.check()
    overrides = list(shared.set)
    overrides += [f"sweep.trials={trials}"] if trials is not None else []
    overrides += [f"sweep.seed={seed}"] if seed is not None else []
    file = load_schedule(options.schedule, overrides, allow_outside=shared.allow_outside)
    folder = options.out or Path("results") / file.name
    check_folders(folder, shared.store)
    own = dict(own_strategy(each) for each in options.strategy)
    strategies_of(file, own)  # raises what is wrong with them
    stage = stage_of(file, scenes.load(options.scene or file.scene_path, overrides, allow_outside=shared.allow_outside))
    with RunMessages(shared.quiet) as messages:
        source = open_source(shared.store, shared.variant, messages, shared.scale)
        requested = planned(file, stage, own, source, real_walk=options.real_walk)
        if not shared.dry_run:
            messages.start(folder, "schedule", schedule=options.schedule, store=shared.store)
        for warning in stage.scene.warnings:
            messages.warn(warning)
        if not shared.dry_run:
            of_run = {"schedule": options.schedule, "scene": options.scene, "store": shared.store}
            of_run |= {"overrides": overrides, "strategy": options.strategy, "variant": shared.variant}
            of_run |= {"allow_outside": shared.allow_outside, "report": options.report}
            return _judge(requested, folder, source, of_run)
        counts = [f"{file.name}: {len(requested.design.runs)} runs of {len(requested.design.scenes)} steps"]
        if requested.real is not None:
            counts.append(f"the real walk: {len(requested.real.scenes)} frames")
        announce(counts, requested.views, source, folder)
        return EXIT_DONE


def _judge(
    requested: RequestedViews,
    folder: Path,
    source: ViewSource,
    options: Mapping[str, object],
) -> int:
    """Get the views, predict and measure, and leave tables, figures, report and film; the exit code."""
    begin = time.perf_counter()
    store, messages = source.store, source.messages
    acquired = source.acquire(requested.views)
    names = view_names(requested.views)
    messages.failed(acquired.failed, names)
    whole = requested.without(acquired.failed, messages)
    after_views = time.perf_counter()
    tables: dict[str, list[Row]] = {}
    predicted_with: dict[str, object] = {}
    reported = 0.0
    if whole is not None:
        calibration, held = assessed(whole, acquired)
        contenders = held_contenders(whole.design.stage.scene, calibration)
        predicted_with = {**judged(contenders)}
        write_text(folder / "calibrated.toml", calibration.to_toml())
        tables, both = _write_tables(whole, held, acquired, calibration, folder)
        linked_views(folder, [i.request.key for i in requested.views if i.request.key not in acquired.failed], store)
        after_tables = time.perf_counter()
        if options["report"]:
            made = of_schedule(both, acquired.measured, source.renderer)
            table = schedule_table({name: as_written(rows) for name, rows in tables.items()}, folder)
            source.with_whole_views(lambda: write_schedule_report(folder, table, made, store), requested.views)
        reported = time.perf_counter() - after_tables
        if whole.real is not None:
            tracked = track_real_walk(whole.real, acquired, calibration)
            schedule_spec = whole.design.schedule.spec
            assumed_density = schedule_spec.process.acceleration_density_m2_s3
            source.with_whole_views(
                lambda: write_real_walk(folder, tracked, store, schedule_spec.seed, assumed_density), requested.views
            )
        _show(tables, messages.console)
    seconds = {"views": after_views - begin, "report": reported, "total": time.perf_counter() - begin}
    _write_run(folder, options, requested.design, source.renderer, acquired, sorted(tables), seconds, predicted_with)
    warn_of_quality(requested.views, acquired, messages, names)
    return end_run(
        f"{len({item.request.key for item in requested.views})} views ({acquired.rendered} rendered, "
        f"{len(acquired.measured_items)} measured now) in {clock(seconds['total'])}, "
        f"{clock(seconds['total'] - seconds['views'])} after the views; results in {folder}",
        acquired,
        messages,
    )


def _write_tables(
    whole: RequestedViews, held: Held, acquired: Acquired, calibration: Calibration, folder: Path
) -> tuple[dict[str, list[Row]], ScheduleResult]:
    """Tables and figure of the held steps; the tables, and the result of both avatars."""
    design = whole.design
    results = [result_of(held, avatar) for avatar in design.stage.groups]
    both = results[-1]
    first = _run_of(design.runs, "follow")
    aside = None if first is None else own_cameras(held, first, acquired, calibration, both)
    tables = tables_of(results, whole.views, acquired, aside)
    for name, rows in tables.items():
        write_csv(folder / f"{name}.csv", rows)
    _draw(folder, both)
    return tables, both


def _run_of(runs: Sequence[Run], strategy: str) -> int | None:
    """The run of a strategy without a zoom limit."""
    found = [number for number, each in enumerate(runs) if each.strategy == strategy and each.zoom_limit is None]
    return found[0] if found else None


def _draw(folder: Path, result: ScheduleResult) -> None:
    # Imported late: slow, and a dry run draws nothing.
    from validate.plots.drawing import plt
    from validate.plots.glyphs import settle_words
    from validate.plots.schedule import schedule_figure

    figure = schedule_figure(result)
    settle_words(figure)
    with atomic_path(folder / "figures" / f"{result.held.design.schedule.name}.png") as temporary:
        figure.savefig(temporary, dpi=130, format="png")
    plt.close(figure)


def _write_run(
    folder: Path,
    options: Mapping[str, object],
    design: Design,
    renderer: str,
    acquired: Acquired,
    tables: list[str],
    seconds: dict[str, float],
    predicted_with: dict[str, object],
) -> None:
    content: dict[str, Any] = {
        "options": as_options(options),
        "schedule": design.schedule.resolved(),
        "scene": design.stage.scene.resolved(),
        "predicted_with": predicted_with,
        "walk": asdict(design.stage.walk),
        "renderer": renderer,
        "versions": versions(),
        **acquired.counts,
        "tables": tables,
        "seconds": seconds,
    }
    write_run(folder, content)


def _show(tables: dict[str, list[Row]], console: Console) -> None:
    """Print the verdict."""
    table = Table(title="Predicted against measured PSS over the steps, both avatars, no zoom limit")
    for name in ("strategy", "kind", "noise model", "Spearman ρ [95 %]", "median |log ratio|"):
        table.add_column(name)
    for row in tables["agreement"]:
        if row["avatar"] == BOTH and row["strategy"] == ALL_RUNS and row["zoom_limit"] == "none":
            rho = f"{row['spearman']:.2f} [{row['spearman_ci_low']:.2f}, {row['spearman_ci_high']:.2f}]"
            ratio = f"{row['median_abs_log_ratio']:.2f}"
            table.add_row(str(row["strategy"]), str(row["kind"]), str(row["noise_model"]), rho, ratio)
    console.print(table)
    table = Table(title="The paper's claims")
    for name in ("claim", "side", "kind", "holds", "statistic", "where"):
        table.add_column(name)
    for row in tables["claims"]:
        if row["noise_model"] in ("", "corrected", FULL_MODEL):
            side = str(row["side"]) if not row["noise_model"] else f"{row['side']}, {row['noise_model']}"
            figure = f"{row['value']:.3g} [{row['ci_low']:.3g}, {row['ci_high']:.3g}]"
            table.add_row(str(row["claim"]), side, str(row["kind"]), str(row["holds"]), figure, str(row["where"]))
    console.print(table)
