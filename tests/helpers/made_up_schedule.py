"""A schedule without renderer, detector and steering: cameras look where they are told, pixels are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import scenes
from pss.cameras.motors import PTZLimits, follow
from pss.noise import Calibration
from render.store.folder import Store
from render.store.views import save_view
from scenes.steps.schedule_file import load_schedule
from tests.helpers.drawn_pixels import acquired_of, levels_at
from tests.helpers.made_up_run import CERTIFICATE, made_up_view
from validate.runs.tables import write_csv
from validate.schedule.design import design_of
from validate.schedule.held import assess_held
from validate.schedule.results import result_of
from validate.schedule.runs import Run
from validate.schedule.stage import BOTH, stage_of
from validate.schedule.steering import Steered
from validate.schedule.tables import tables_of
from validate.schedule_pages.files import of_schedule, write_schedule_report
from validate.schedule_pages.tables import read_schedule

__all__ = ["STEPS", "made_up_schedule"]

STEPS = 3
ASSIGNMENTS = {
    "follow": [("H1", "H1", "H2", "H2")] * STEPS,
    "swap-to-closer": [("H1", "H1", "H2", "H2")] * 2 + [("H2", "H2", "H1", "H1")],
}
# Small views, of the same field of view as the scene's.
SMALL = ["sensor.resolution_px=[320, 240]", "sensor.pixel_pitch_um=18.6"]
FEW = [f"sweep.walk.steps={STEPS}", 'sweep.strategies=["follow", "swap-to-closer"]', "sweep.trials=12"]
FEW += ['sweep.zoom_limits=["none", 8.0]', "sweep.walk.reach_m=2.0"]


def made_up_schedule(folder: Path, overrides: Sequence[str] = ()) -> SimpleNamespace:
    """Leave tables, stored views and the report of a schedule in `folder`/run; two strategies, three steps.

    Args:
        overrides: of the scene.

    Its zoom limit binds nowhere: runs with it see what those without it see.
    """
    schedule = load_schedule("hallway", FEW)
    stage = stage_of(schedule, scenes.load(schedule.scene_path, [*SMALL, *overrides]))
    runs = [Run(name, limit, _steered(stage, name)) for name in ASSIGNMENTS for limit in schedule.zoom_limits]
    design = design_of(schedule, stage, runs, "made up")
    acquired = acquired_of([(scene, views[k]) for views in design.views for k, scene in enumerate(design.scenes)])
    store, out = Store(folder / "store"), folder / "run"
    for item in acquired.measured:
        acquired.certificates[item.request.key] = CERTIFICATE
        save_view(store, made_up_view(item), item.request)
    calibration = Calibration("calibrated", {"brightness-contrast": 1.0}, {})
    held = assess_held(design, acquired, calibration, levels_at(stage))
    # One avatar beside both, since tables have rows of each.
    results = [result_of(held, avatar) for avatar in (stage.names[0], BOTH)]
    both = results[-1]
    for name, rows in tables_of(results, (), acquired, None).items():
        write_csv(out / f"{name}.csv", rows)
    made = of_schedule(both, acquired.measured, "made up")
    write_schedule_report(out, read_schedule(out), made, store)
    return SimpleNamespace(out=out, store=store, design=design, both=both, made=made)


def _steered(stage, strategy) -> Steered:
    """Cameras that look at their avatars exactly."""
    places = stage.walk.positions_m
    cameras = tuple(
        tuple(
            follow(camera, places[name][step], 0.95, PTZLimits(zoom_range=(1, 8)))
            for camera, name in zip(stage.scene.cameras, ASSIGNMENTS[strategy][step], strict=True)
        )
        for step in range(STEPS)
    )
    truth = np.array([places[name] for name in stage.names]).swapaxes(0, 1)
    return Steered(
        times_s=stage.walk.times_s,
        predicted_m=truth,
        covariance_m2=np.zeros((STEPS, 2, 3, 3)),
        lost=np.zeros((STEPS, 2), dtype=bool),
        cameras=cameras,
        assignments=tuple(ASSIGNMENTS[strategy]),
        losses=dict.fromkeys(stage.names, 0),
        swaps=0,
    )
