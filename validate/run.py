"""One run of the command: from the files it is given to the folder it leaves."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from pss import RangeError
from render import backend
from render.sampling import Sampling
from scenes import Scene, SceneError, SweepFile, known_sweeps, load_scene, load_sweep
from validate import claims, compare, figures, slopes, summary, tables
from validate.acquire import Acquired, Acquisition, acquire, with_whole_views
from validate.expose import with_exposures
from validate.progress import EXPECTED_SECONDS, ViewProgress, clock
from validate.remote_store import is_address, open_store
from validate.scale.options import HERE, Scale
from validate.store import Store, StoreError, write_text
from validate.sweep import Plan, SweepResult, assess_sweep, plan
from validate.versions import versions
from validate.warnings_of_views import warn_of_render_noise, warn_of_saturation

__all__ = ["MEGABYTES_A_VIEW", "Options", "check_folders", "execute", "linked_views", "versions"]

MEGABYTES_A_VIEW = 10


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
    scale: Scale = HERE

    @property
    def folder(self) -> Path:
        """Where the results go."""
        return self.out or Path("results") / "-".join(Path(name).stem for name in self.sweeps)


def execute(options: Options, console: Console, errors: Console) -> int:
    """Run, print the tables, and return the exit code.

    Raises:
        PSSError: the user's mistake; nothing was rendered yet.
    """
    begin = time.perf_counter()
    _check(options)
    chosen = backend.choose(options.variant)
    loaded = _loaded(options)
    console.print(str(chosen), markup=False)
    for warning in dict.fromkeys(warning for _, scene in loaded for warning in scene.warnings):
        errors.print(warning, markup=False, soft_wrap=True)
    store = open_store(options.store)
    exposed = with_exposures(
        loaded,
        store,
        lambda line: console.print(line, markup=False, soft_wrap=True),
        lambda line: errors.print(line, markup=False, soft_wrap=True),
        chosen,
    )
    plans = [
        plan(sweep, scene, chosen.identity, Sampling(noise_ratio=sweep.render_noise_ratio)) for sweep, scene in exposed
    ]
    wanted = [item for each in plans for views in each.views for item in views]
    of_files = {warning for _, scene in loaded for warning in scene.warnings}
    of_steps = (warning for each in plans for step in each.configurations for warning in step.scene.warnings)
    for warning in dict.fromkeys(warning for warning in of_steps if warning not in of_files):
        errors.print(warning, markup=False, soft_wrap=True)
    if options.dry_run:
        _announce(plans, wanted, store, console)
        return 0

    acquired = acquire(wanted, store, chosen, lambda total: ViewProgress(total, errors), options.scale)
    after_views = time.perf_counter()
    results = [assess_sweep(each, acquired) for each in plans]
    after_assessment = time.perf_counter()
    _write(options.folder, results, wanted, acquired, store)
    after_tables = time.perf_counter()
    drawn_from = figures.source_of(options.folder, results)
    if drawn_from != _figures_of_last_run(options.folder) or not figures.all_drawn(options.folder, results):
        with_whole_views(
            lambda: figures.draw_all(options.folder, results, store),
            wanted,
            store,
            chosen,
            lambda total: ViewProgress(total, errors),
            options.scale,
        )
    seconds = {
        "views": after_views - begin,
        "assessment": after_assessment - after_views,
        "tables": after_tables - after_assessment,
        "figures": time.perf_counter() - after_tables,
        "total": time.perf_counter() - begin,
    }
    _write_run(options, plans, chosen, acquired, seconds, drawn_from)
    summary.show(results, acquired, console)
    console.print(
        f"{len({i.request.key for i in wanted})} views ({acquired.rendered} rendered, "
        f"{len(acquired.measured_items)} measured now) in {clock(seconds['total'])}; results in {options.folder}",
        markup=False,
    )
    warn_of_render_noise(wanted, acquired, errors)
    warn_of_saturation(wanted, acquired, errors)
    for key, cause in acquired.failed.items():
        errors.print(f"view {key} failed: {cause}", markup=False, style="red")
    return 1 if acquired.failed else 0


def _check(options: Options) -> None:
    """What the user can get wrong before any file is read."""
    if not options.sweeps:
        raise RangeError(f"no sweep given; allowed: {', '.join(known_sweeps())}, or the paths of .toml files")
    if options.trials is not None and options.trials < 2:
        raise RangeError(f"--trials {options.trials}; allowed: 2 or more (choices are made and scored on two halves)")
    if options.seed is not None and options.seed < 0:
        raise RangeError(f"--seed {options.seed}; allowed: 0 or more")
    names = [Path(name).stem for name in options.sweeps]
    for name in names:
        if names.count(name) > 1:
            raise RangeError(f"sweep {name!r} is given twice; allowed: each once, as it names its rows")
    check_folders(options.folder, options.store)
    options.scale.check()


def check_folders(out: Path, store: str) -> None:
    """Whether a run could leave something there, before it takes its time.

    Raises:
        StoreError: a file is in the way, or the folder of results cannot be written.
    """
    # A store that has all that is wanted need not be writable.
    if not is_address(store) and Path(store).exists() and not Path(store).is_dir():
        raise StoreError(f"--store {store} is a file; allowed is a folder")
    if out.exists() and not out.is_dir():
        raise StoreError(f"--out {out} is a file; allowed is a folder")
    existing = next(parent for parent in [out, *out.resolve().parents] if parent.exists())
    if not os.access(existing, os.W_OK):
        raise StoreError(f"--out {out} cannot be written; allowed is a folder that you may write to")


def _loaded(options: Options) -> list[tuple[SweepFile, Scene]]:
    """Read all files and report all their problems together."""
    loaded, problems = [], []
    overrides = list(options.set)
    if options.trials is not None:
        overrides.append(f"sweep.trials={options.trials}")
    if options.seed is not None:
        overrides.append(f"sweep.seed={options.seed}")
    for name in options.sweeps:
        try:
            sweep = load_sweep(name, overrides, allow_outside=options.allow_outside)
            scene = load_scene(options.scene or sweep.scene_path, overrides, allow_outside=options.allow_outside)
            sweep.configurations(scene)  # raises what is wrong with them
            loaded.append((sweep, scene))
        except SceneError as error:
            problems += [problem for problem in error.problems if problem not in problems]
    if problems:
        raise SceneError(problems)
    return loaded


def _announce(plans: Sequence[Plan], wanted: Sequence[Acquisition], store: Store, console: Console) -> None:
    """Say what a run would do."""
    unique = list(dict.fromkeys(wanted))
    missing = [item for item in unique if not store.has(store.view(item.request.key))]
    unmeasured = [item for item in unique if not store.has(item.task(store).path)]
    for each in plans:
        console.print(f"{each.sweep.name}: {len(each.configurations)} configurations", markup=False)
    console.print(
        f"{len(unique)} views: {len(missing)} to render, {len(unmeasured)} to measure; about "
        f"{clock(EXPECTED_SECONDS * len(unmeasured))} and {MEGABYTES_A_VIEW * len(missing)} MB",
        markup=False,
    )


def _write(
    folder: Path, results: Sequence[SweepResult], wanted: Sequence[Acquisition], acquired: Acquired, store: Store
) -> None:
    """Write the CSV files and point `views/` into the store."""
    whole = [result for result in results if result.assessments]
    tables.write_csv(folder / "configurations.csv", [r for result in whole for r in tables.configuration_rows(result)])
    tables.write_csv(folder / "points.csv", [r for result in whole for r in tables.point_rows(result)])
    tables.write_csv(folder / "views.csv", tables.view_rows(whole, acquired))
    tables.write_csv(folder / "timings.csv", tables.timing_rows(wanted, acquired))
    tables.write_csv(folder / "detection.csv", tables.detection_rows(whole))
    tables.write_csv(folder / "correlation.csv", [r for result in whole for r in compare.correlation_rows(result)])
    tables.write_csv(folder / "claims.csv", [r for result in whole for r in claims.claim_rows(result)])
    tables.write_csv(folder / "slopes.csv", [r for result in whole for r in slopes.slope_rows(result)])
    linked_views(folder, sorted({item.request.key for item in wanted} - set(acquired.failed)), store)


def linked_views(folder: Path, keys: Iterable[str], store: Store) -> None:
    """Point `views/` of a run's folder into the store."""
    views = folder / "views"
    views.mkdir(parents=True, exist_ok=True)
    for key in dict.fromkeys(keys):
        link, target = views / f"{key}.exr", store.view(key)
        if link.is_symlink() or link.exists():
            link.unlink()
        link.symlink_to(os.path.relpath(target, views))


def _write_run(
    options: Options,
    plans: Sequence[Plan],
    chosen: backend.Backend,
    acquired: Acquired,
    seconds: dict[str, float],
    drawn_from: str,
) -> None:
    content = {
        "options": {name: str(value) for name, value in dataclasses.asdict(options).items()},
        "sweeps": {each.sweep.name: each.sweep.resolved() for each in plans},
        "scenes": {each.sweep.name: each.scene.resolved() for each in plans},
        "seeds": {each.sweep.name: each.sweep.seed for each in plans},
        "renderer": chosen.identity,
        "versions": versions(),
        "seconds": seconds,
        "rendered": acquired.rendered,
        "measured": len(acquired.measured_items),
        "failed": acquired.failed,
        "figures_drawn_from": drawn_from,
    }
    write_text(options.folder / "run.json", json.dumps(content, indent=2) + "\n")


def _figures_of_last_run(folder: Path) -> str | None:
    """What the figures that lie in a folder were drawn from; None where that is not known."""
    try:
        said = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        return str(said["figures_drawn_from"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
