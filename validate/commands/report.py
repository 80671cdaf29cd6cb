"""`run_sweep.py report`: make the report of a finished run again, from its tables and the store."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import scenes
from pss import Evaluation
from pss.json_text import as_json
from render import backend
from render.code_digest import code_of
from render.keys import state_key
from render.lens.sampling import Sampling
from render.light import lit_scene
from render.store.folder import Store, StoreError, write_text
from render.store.light import baked
from render.store.remote import open_store
from scenes import load_sweep
from validate.acquire.acquire import Acquisition
from validate.acquire.auto_exposure import with_exposures
from validate.commands.subcommands import Report
from validate.markers.view_measurement import ViewMeasurement
from validate.pages.data import read_sweeps
from validate.pages.gltf import write_models
from validate.pages.images import pictures_of
from validate.pages.named import Given
from validate.pages.section import Section, html_of, section_of
from validate.pages.steps import steps_of_plan
from validate.pages.stored import REPORT, stored_measurements
from validate.plots.sweep import EXCLUDED
from validate.prediction.predict import predict
from validate.runs.folder_lock import alone_in
from validate.runs.input_files import load_measurement_of
from validate.runs.program import program_name
from validate.runs.run_file import listed, needed, option, read_run
from validate.sweeps.sweep import Plan, SweepResult, plan

__all__ = ["REPORT", "SweepForReport", "execute", "of_results", "remade", "source_of_report", "write_report"]


NOTHING_GIVEN = Given()


@dataclass(frozen=True, eq=False)
class SweepForReport:
    """A sweep with what the tables do not have: predictions by step and noise model, and detections by view."""

    plan: Plan
    labels: tuple[str, ...]
    predictions: tuple[Mapping[str, Evaluation], ...]
    measured: Mapping[Acquisition, ViewMeasurement]


def of_results(results: Sequence[SweepResult], measured: Mapping[Acquisition, ViewMeasurement]) -> list[SweepForReport]:
    """Those sweeps of a run that have a configuration to show."""
    return [
        SweepForReport(
            result.plan,
            tuple(configuration.label for configuration in result.configurations),
            tuple(assessment.predicted for assessment in result.assessments),
            measured,
        )
        for result in results
        if result.assessments
    ]


def write_report(folder: Path, sweeps: Sequence[SweepForReport], store: Store) -> Path:
    """Write `report.html` and the scene as glTF into a run's folder, from its tables; the report's path.

    Raises:
        StoreError: a table is missing or is of other sweeps, or the folder cannot be written.
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    tables = {table.name: table for table in read_sweeps(folder)}
    sections: list[Section] = []
    for sweep in sweeps:
        name = sweep.plan.sweep.name
        if name not in tables or tables[name].labels != sweep.labels:
            raise StoreError(f"{folder}/configurations.csv has other steps than the sweep {name}; run the sweep again")
        steps = steps_of_plan(sweep.plan, sweep.labels, sweep.predictions, sweep.measured)
        sections.append(section_of(tables[name], sweep.plan.sweep.title, steps))
    every_step = [step for section in sections for step in section.steps]
    pictures = pictures_of(every_step, [crop for section in sections for crop in section.crops], store)
    path = folder / REPORT
    write_text(path, html_of(sections, pictures, _about(sweeps)))
    write_models(folder, sections)
    return path


def _about(sweeps: Sequence[SweepForReport]) -> dict[str, str]:
    first = sweeps[0].plan
    return {
        "sweeps": ", ".join(sweep.plan.sweep.name for sweep in sweeps),
        "scene": first.scene.path.name,
        "trials of each view": str(first.sweep.trials),
        "seed": str(first.sweep.seed),
        "renderer": next((item.request.renderer for views in first.views for item in views), "none"),
    }


def source_of_report(figures_drawn_from: str) -> str:
    """Hash of all that a report shows, beside what a run's figures show: the code that makes it."""
    code = code_of("validate.pages.section", "validate.pages.images", "validate.pages.gltf", excluded=EXCLUDED)
    digest = hashlib.sha256(f"{figures_drawn_from} {code.digest}".encode())
    for path in sorted((Path(__file__).parents[1] / "pages" / "templates").iterdir()):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:24]


def remade(folder: Path, given: Given = NOTHING_GIVEN, strategy: Sequence[str] = ()) -> Path:
    """The report of a finished run, made again.

    The folder may be a stranger's: what it names outside itself is neither run nor opened, unless `given`.

    Args:
        folder: of the run.
        given: what the command line names of the run's files.
        strategy: as given to the run.

    Raises:
        StoreError: the folder is not that of a run, it names what is not given, its files have changed since, or the
            store lacks what it used.
    """
    said = _run_of(folder)
    if "schedule" in said:
        # Imported late: it builds on this package.
        from validate.schedule_pages.files import remade_schedule

        return remade_schedule(folder, said, given, strategy)
    options = said["options"]
    store = open_store(given.store_of(folder, needed(folder, options, "store")))
    chosen = backend.choose(option(folder, options, "variant"))
    overrides = listed(folder, options, "set")
    overrides += [f"sweep.{name}={value}" for name in ("trials", "seed") if (value := option(folder, options, name))]
    loaded = []
    if option(folder, options, "cameras") is not None:
        scene_path = given.scene_of(folder, needed(folder, options, "scene"))
        assert scene_path is not None  # as it is named
        cameras = listed(folder, options, "cameras")
        loaded.append(load_measurement_of(scene_path, cameras, overrides, given.allow_outside))
    for name in listed(folder, options, "sweeps"):
        sweep = load_sweep(given.file_of(folder, "sweep", name), overrides, allow_outside=given.allow_outside)
        scene_path = given.scene_of(folder, option(folder, options, "scene"))
        if scene_path is None:
            given.check_scene_of(folder, sweep.path, scene_path := sweep.scene_path)
        loaded.append((sweep, scenes.load(scene_path, overrides, allow_outside=given.allow_outside)))
    sweeps = []
    tables = {table.name: table for table in read_sweeps(folder)}
    for sweep, scene in with_exposures(loaded, store, lambda line: None, lambda line: None, chosen):
        if as_json([sweep.resolved(), scene.resolved()]) != [
            said[kind].get(sweep.name) for kind in ("sweeps", "scenes")
        ]:
            raise StoreError(
                f"{sweep.path} or {scene.path} has changed since the run in {folder}; allowed: the files that it was "
                "made of, or a new run"
            )
        made = plan(sweep, scene, chosen.identity, Sampling(noise_ratio=sweep.render_noise_ratio))
        if sweep.name in tables:
            sweeps.append(_from_store(made, tables[sweep.name].labels, store, chosen))
    return write_report(folder, sweeps, store)


def _run_of(folder: Path) -> dict[str, Any]:
    said = read_run(folder)
    if said is not None:
        of_what = ("schedule", "scene") if "schedule" in said else ("sweeps", "scenes")
        if all(isinstance(said.get(name), dict) for name in ("options", *of_what)):
            return said
    raise StoreError(
        f"{folder} has no run.json of a run of sweeps or of a schedule; allowed: a folder that "
        f"{program_name()} SWEEP… or {program_name()} schedule has left"
    )


def _from_store(made: Plan, labels: tuple[str, ...], store: Store, chosen: backend.Backend) -> SweepForReport:
    kept = [pair for pair in zip(made.configurations, made.views, strict=True) if pair[0].label in labels]
    measured = stored_measurements((item for _, wanted in kept for item in wanted), store)
    predictions = []
    looks: dict[str, Any] = {}
    for configuration, _ in kept:
        state = configuration.scene.state
        key = state_key(state)
        if key not in looks:
            looks[key] = lit_scene.appearance(state, baked(state, store, chosen))
        predictions.append(predict(configuration.scene, configuration.cameras, looks[key]))
    return SweepForReport(made, labels, tuple(predictions), measured)


def execute(options: Report) -> int:
    """Write the report of a finished run again, and print its path; the exit code."""
    folder, given = options.folder, Given(options.store, options.scene, options.file, options.allow_outside)
    with alone_in(folder) if folder.is_dir() else contextlib.nullcontext():
        print(remade(folder, given, options.strategy))
    return 0
