"""`run_sweep.py figures`: the paper's Figures 1 to 4 from our own runs, as PDF and SVG."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

import scenes
from pss import RangeError
from pss.hints import Row
from render import backend
from render.store.folder import Store, StoreError, write_text
from render.store.remote import open_store
from scenes import load_sweep
from scenes.steps.schedule_file import load_schedule
from validate.acquire.acquire import Acquired, Acquisition
from validate.acquire.messages import RunMessages
from validate.acquire.source import ViewSource
from validate.acquire.view_names import view_names
from validate.commands.subcommands import Figures
from validate.runs.folder_lock import alone_in
from validate.runs.outputs import check_folders
from validate.runs.progress import EXPECTED_SECONDS, clock
from validate.runs.table_text import table_text
from validate.sweeps.plan_and_assess import assessed, planned, requested_views

__all__ = ["execute"]


FIGURES = (1, 2, 3, 4)
SCHEDULE = "hallway"


def execute(options: Figures) -> int:
    """Draw the paper's figures from the store, rendering what it lacks; the exit code."""
    out, rendering = options.out, options.rendering
    for number in options.figures:
        if number not in FIGURES:
            raise RangeError(f"figure {number}; allowed: {', '.join(str(each) for each in FIGURES)}")
    check_folders(out, rendering.store)
    with RunMessages() as messages, contextlib.nullcontext() if options.dry_run else alone_in(out):
        source = ViewSource(open_store(rendering.store), rendering.store, backend.choose(rendering.variant), messages)
        _make_all(options.figures, out, options.table, source, options.dry_run)
    return 0


def _make_all(figures: tuple[int, ...], out: Path, table: str | None, source: ViewSource, dry_run: bool) -> None:
    for number in dict.fromkeys(figures):
        make = _walk if number == max(FIGURES) else _static
        paths = make(number, out, table, source, dry_run)
        if paths:
            print(f"Figure {number}: {', '.join(str(path) for path in paths)}")


def _static(number: int, out: Path, table: str | None, source: ViewSource, dry_run: bool) -> list[Path]:
    from validate.plots.paper_sweeps import SWEEPS, static_figure, static_rows

    sweep = load_sweep(SWEEPS[number])
    plans = planned([(sweep, scenes.load(sweep.scene_path))], source, forecast=dry_run)
    requested = requested_views(plans)
    if dry_run:
        _announce(number, requested, source.store)
        return []
    [result] = assessed(plans, _acquired(number, requested, source))
    return _write(number, out, table, lambda: static_figure(number, result), static_rows(number, result))


def _walk(number: int, out: Path, table: str | None, source: ViewSource, dry_run: bool) -> list[Path]:
    # Imported late: slow, and requested for one figure alone.
    from validate.plots.paper_walk import walk_figure, walk_rows
    from validate.schedule.results import result_of
    from validate.schedule.stage import BOTH, stage_of
    from validate.tracked_walk import path

    file = load_schedule(SCHEDULE)
    stage = stage_of(file, scenes.load(file.scene_path))
    planned_walk = path.planned(file, stage, {}, source, real_walk=False)
    if dry_run:
        _announce(number, planned_walk.views, source.store)
        return []
    _, held = path.assessed(planned_walk, _acquired(number, planned_walk.views, source))
    result = result_of(held, BOTH)
    return _write(number, out, table, lambda: walk_figure(result), walk_rows(result))


def _announce(number: int, requested: Sequence[Acquisition], store: Store) -> None:
    unique = list(dict.fromkeys(requested))
    missing = [item for item in unique if not store.has(item.task(store).path)]
    print(
        f"Figure {number}: {len(unique)} views, {len(missing)} to render or measure, "
        f"about {clock(EXPECTED_SECONDS * len(missing))}"
    )


def _acquired(number: int, requested: Sequence[Acquisition], source: ViewSource) -> Acquired:
    acquired = source.acquire(requested)
    if acquired.failed:
        names = view_names(requested)
        causes = "; ".join(f"{names[key]}: {cause}" for key, cause in acquired.failed.items())
        raise StoreError(f"Figure {number} lacks {len(acquired.failed)} views ({causes})")
    return acquired


def _write(number: int, out: Path, table: str | None, draw: Callable[[], Figure], rows: Sequence[Row]) -> list[Path]:
    from validate.plots.print_style import print_style, save

    name = f"figure-{number}"
    with print_style():
        paths = save(draw(), out, name)
    if table is not None:
        paths.append(out / f"{name}.{table}")
        write_text(paths[-1], table_text(rows, table))
    return paths
