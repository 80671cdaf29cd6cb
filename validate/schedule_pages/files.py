"""Write a schedule's report: from the run itself, or again from its tables, the store and cameras steered again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import scenes
from pss import Evaluation
from pss.json_text import as_json
from pss.noise import Calibration
from render import backend
from render.light import lit_scene
from render.store.folder import Store, StoreError, write_text
from render.store.light import baked
from render.store.remote import open_store
from scenes.steps.schedule_file import load_schedule
from validate.acquire.acquire import Acquisition
from validate.markers.view_measurement import ViewMeasurement
from validate.pages.gltf import write_models
from validate.pages.images import pictures_of
from validate.pages.named import Given
from validate.pages.stored import REPORT, stored_measurements
from validate.runs.run_file import listed, needed, option
from validate.schedule.design import Design, design_of
from validate.schedule.held import held_contenders, predicted_at
from validate.schedule.own_strategy import own_strategy
from validate.schedule.results import ScheduleResult
from validate.schedule.runs import limit_name, steered_runs
from validate.schedule.stage import BOTH, stage_of
from validate.schedule_pages.page import html_of_schedule, schedule_section
from validate.schedule_pages.steps import Different, different, steps_of_design
from validate.schedule_pages.tables import ScheduleTable, read_schedule

__all__ = ["ScheduleForReport", "of_schedule", "remade_schedule", "write_schedule_report"]

# Of all pictures of the page, as text in it: plotly and the numbers take the rest of 15 MB.
BUDGET_BYTES = 4_800_000
# px; two views lie beside each other on the page.
WIDEST_PX = 480


@dataclass(frozen=True, eq=False)
class ScheduleForReport:
    """A schedule with what the tables do not have.

    Attributes:
        predictions: of each different step, the metric by noise model, at the markers of both avatars.
        measured: the detections of every view.
    """

    design: Design
    found: Different
    predictions: tuple[Mapping[str, Evaluation], ...]
    measured: Mapping[Acquisition, ViewMeasurement]
    renderer: str


def of_schedule(
    result: ScheduleResult, measured: Mapping[Acquisition, ViewMeasurement], renderer: str
) -> ScheduleForReport:
    """The parts of a run; `result` is of both avatars."""
    design = result.held.design
    found = different(design)
    predictions = tuple(result.held.steps[run][step].assessments[BOTH].predicted for run, step in found.places)
    return ScheduleForReport(design, found, predictions, measured, renderer)


def write_schedule_report(folder: Path, table: ScheduleTable, made: ScheduleForReport, store: Store) -> Path:
    """Write `report.html` and `scene.glb` into a schedule's folder; the report's path.

    Raises:
        StoreError: the tables are of other runs, or the folder cannot be written.
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    design, found = made.design, made.found
    runs = tuple((run.strategy, limit_name(run.zoom_limit)) for run in design.runs)
    if table.runs != runs or len(table.y_m) != len(design.scenes):
        raise StoreError(f"{folder}/configurations.csv has other runs than the schedule; run the schedule again")
    steps = steps_of_design(design, found.places, made.predictions, made.measured)
    section = schedule_section(table, found, design.schedule.spec.title, design.stage.names, steps)
    every = {sight.view_key for step in steps for sight in step.sights}
    pictures = pictures_of(steps, section.crops, store, BUDGET_BYTES, WIDEST_PX)
    about = {
        "schedule": table.every.name,
        "scene": design.stage.scene.path.name,
        "different views": str(len(every)),
        "trials of each view": str(design.schedule.spec.trials),
        "seed": str(design.schedule.spec.seed),
        "renderer": made.renderer,
    }
    path = folder / REPORT
    write_text(path, html_of_schedule(section, table, pictures, about))
    write_models(folder, [section])
    return path


def remade_schedule(folder: Path, recorded: Mapping[str, Any], given: Given, strategy: Sequence[str] = ()) -> Path:
    """The report of a finished schedule, made again: cameras are steered and PSS is predicted anew.

    Args:
        recorded: the folder's run.json.
        given, strategy: what the command line names of the run's files: what run.json names may come from elsewhere.

    Raises:
        StoreError: other strategies than the run's, its files have changed since, or the store lacks what it used.
    """
    options = recorded["options"]
    used = tuple(listed(folder, options, "strategy"))
    if tuple(strategy) != used:
        given_options = " ".join(f"--strategy {each}" for each in used) or "no --strategy"
        raise StoreError(f"{folder} was made with {given_options}; allowed: the same again, as such files are run")
    overrides = listed(folder, options, "overrides")
    store = open_store(given.store_of(folder, needed(folder, options, "store")))
    schedule = given.file_of(folder, "schedule", needed(folder, options, "schedule"))
    file = load_schedule(schedule, overrides, allow_outside=given.allow_outside)
    scene_path = given.scene_of(folder, option(folder, options, "scene"))
    if scene_path is None:
        given.check_scene_of(folder, file.path, scene_path := file.scene_path)
    stage = stage_of(file, scenes.load(scene_path, overrides, allow_outside=given.allow_outside))
    if as_json(file.resolved()) != recorded["schedule"] or as_json(stage.scene.resolved()) != recorded["scene"]:
        raise StoreError(
            f"{file.path} or {scene_path} has changed since the run in {folder}; allowed: the files that it was made "
            "of, or a new run"
        )
    own = dict(own_strategy(each) for each in strategy)
    chosen = backend.choose(option(folder, options, "variant"))
    design = design_of(file, stage, steered_runs(file, stage, own), chosen.identity).without(
        recorded.get("failed") or {}
    )
    found = different(design)
    calibration = Calibration.from_file(folder / "calibrated.toml")
    measured = stored_measurements(design.given_options, store)
    predictions = _predictions(design, found, calibration, store, chosen)
    return write_schedule_report(
        folder, read_schedule(folder), ScheduleForReport(design, found, predictions, measured, chosen.identity), store
    )


def _predictions(
    design: Design, found: Different, calibration: Calibration, store: Store, chosen: backend.Backend
) -> tuple[Mapping[str, Evaluation], ...]:
    """Those of each different step, at the markers of both avatars."""
    markers, predictions = design.stage.groups[BOTH], []
    for step, scene in enumerate(design.scenes):
        cameras = [design.runs[run].steered.cameras[step] for run, at in found.places if at == step]
        look = lit_scene.appearance(scene.state, baked(scene.state, store, chosen))
        contenders = held_contenders(scene, calibration)
        of_models = {c.name: predicted_at(scene, cameras, c, look, markers) for c in contenders}
        predictions += _by_step(of_models, len(cameras))
    return tuple(predictions)


def _by_step(of_models: Mapping[str, Sequence[Evaluation]], count: int) -> list[dict[str, Evaluation]]:
    return [{name: evaluations[number] for name, evaluations in of_models.items()} for number in range(count)]
