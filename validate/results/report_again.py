"""The report of a finished run, made again from its tables, the files that it was made of, and the store."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import scenes
from pss.json_text import as_json
from render import backend
from render.keys import state_key
from render.light import lit_scene
from render.store.folder import StoreError
from render.store.light import baked
from render.store.remote import open_store
from scenes import load_sweep
from validate.acquire.messages import RunMessages
from validate.acquire.source import ViewSource
from validate.markers.detector_table import DEFAULT_DETECTOR, detector_called
from validate.pages.data import read_sweeps
from validate.pages.named import Given
from validate.pages.stored import stored_measurements
from validate.prediction.predict import predict
from validate.results.report import SweepForReport, write_report
from validate.runs.input_files import load_measurement_of
from validate.runs.program import program_name
from validate.runs.run_file import listed, needed, option
from validate.runs.saved import SavedRun
from validate.schedule_pages.files import remade_schedule
from validate.sweeps.plan_and_assess import planned
from validate.sweeps.sweep import Plan

__all__ = ["remade"]

NOTHING_GIVEN = Given()


def remade(folder: Path, given: Given = NOTHING_GIVEN, strategy: Sequence[str] = ()) -> Path:
    """The report of a finished run, made again.

    The folder may come from elsewhere: files that it names outside itself are neither run nor opened, unless `given`.

    Args:
        folder: of the run.
        given: what the command line names of the run's files.
        strategy: as given to the run.

    Raises:
        StoreError: the folder is not that of a run, it names what is not given, its files have changed since, or the
            store lacks what it used.
    """
    record = _run_of(folder)
    if "schedule" in record:
        return remade_schedule(folder, record, given, strategy)
    options = record["options"]
    address = given.store_of(folder, needed(folder, options, "store"))
    messages = RunMessages(quiet=True)
    source = ViewSource(open_store(address), address, backend.choose(option(folder, options, "variant")), messages)
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
    tables = read_sweeps(folder)
    labels = {table.name: table.labels for table in tables}
    sweeps = []
    detector = option(folder, options, "detector") or DEFAULT_DETECTOR  # a run from before there were others
    detector_called(detector)
    for made in planned(loaded, source, detector=detector):
        sweep, scene = made.sweep, made.scene
        if as_json([sweep.resolved(), scene.resolved()]) != [
            record[kind].get(sweep.name) for kind in ("sweeps", "scenes")
        ]:
            raise StoreError(
                f"{sweep.path} or {scene.path} has changed since the run in {folder}; allowed: the files that it was "
                "made of, or a new run"
            )
        if sweep.name in labels:
            sweeps.append(_from_store(made, labels[sweep.name], source))
    return write_report(folder, tables, sweeps, source.store)


def _run_of(folder: Path) -> dict[str, Any]:
    record = SavedRun(folder).run
    if record:
        of_what = ("schedule", "scene") if "schedule" in record else ("sweeps", "scenes")
        if all(isinstance(record.get(name), dict) for name in ("options", *of_what)):
            return record
    raise StoreError(
        f"{folder} has no run.json of a run of sweeps or of a schedule; allowed: a folder that "
        f"{program_name()} SWEEP… or {program_name()} schedule has left"
    )


def _from_store(made: Plan, labels: tuple[str, ...], source: ViewSource) -> SweepForReport:
    kept = [pair for pair in zip(made.configurations, made.views, strict=True) if pair[0].label in labels]
    measured = stored_measurements((item for _, views in kept for item in views), source.store)
    predictions = []
    appearances: dict[str, Any] = {}
    for configuration, _ in kept:
        state = configuration.scene.state
        key = state_key(state)
        if key not in appearances:
            appearances[key] = lit_scene.appearance(state, baked(state, source.store, source.backend))
        predictions.append(predict(configuration.scene, configuration.cameras, appearances[key]))
    return SweepForReport(made, labels, tuple(predictions), measured)
