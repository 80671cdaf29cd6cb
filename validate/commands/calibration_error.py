"""`run_sweep.py calibration-error`: the size of calibration errors from which PSS no longer ranks configurations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

import scenes
from pss.cameras.views import Views
from pss.hints import Row
from pss.json_text import json_text
from pss.noise.table import BUILT_IN_MODELS
from pss.visibility.points import visible_in
from render.random_streams import random_stream
from scenes import Scene, SceneError
from scenes.steps.sweep_file import SWEEPS
from validate.acquire.acquire import Acquired
from validate.acquire.messages import RunMessages
from validate.acquire.source import end_run, open_source
from validate.bank.acquire import acquire_banks, calibrate, enough
from validate.bank.calibration_predicted import Predictions
from validate.bank.calibration_study import IN_WEIGHTS, OWN, study
from validate.bank.design import BankDesign, ViewBank, draw_configurations, held_out_views, training_views
from validate.bank.judge import appearance_of, data_of
from validate.commands.subcommands import CalibrationError
from validate.plots.calibration_error import draw
from validate.prediction.contenders import FULL_MODEL, noise_models, own_models, visibilities
from validate.runs.console import Console
from validate.runs.outputs import check_folders
from validate.runs.tables import write_csv

__all__ = ["check_keys", "execute"]

CAMERAS = 4
# Columns of sizes, and what they are multiplied by to be degrees, % and mm.
SCALES = (("pan_tilt_deg", 1), ("focal_share", 100), ("position_m", 1000))
# Columns of the table, on every terminal.
WIDTH = 140


def execute(options: CalibrationError) -> int:
    """Rank the configurations, save and print the table; the exit code."""
    out, rendering = options.out, options.rendering
    options.scale.check()
    check_folders(out, rendering.store)
    design = BankDesign(**vars(options.views))
    loaded = scenes.load(options.scene or SWEEPS.parent / "room.toml", allow_outside=options.allow_outside)
    check_keys(loaded)
    with RunMessages(width=WIDTH) as messages:
        source = open_source(rendering.store, rendering.variant, messages, options.scale)
        messages.start(out, "calibration-error", store=rendering.store)
        requested = training_views(loaded, design, source.renderer), held_out_views(loaded, design, source.renderer)
        acquired, (training, bank) = acquire_banks(requested, source)
        if enough(training, bank, CAMERAS, messages):
            _rank(training, bank, acquired, design, options.configurations, out, messages.console)
        return end_run(f"results in {out}", acquired, messages)


def check_keys(scene: Scene) -> None:
    """Refuse a scene that sets what this command cannot obey: it judges one model, fitted in the run.

    The models that all commands know may be listed: nothing is expected of them here.

    Raises:
        SceneError: with the keys and why.
    """
    resolved = scene.resolved()
    noise, metric = resolved["noise"], resolved["metric"]
    keys = [f"noise.models = {json_text(noise['models'])}"] if own_models(scene) else []
    keys += [f"noise.{key} = {json_text(noise[key])}" for key in ("switched_off", "weights") if noise.get(key)]
    keys += [f"noise.px2_per_m2 = {noise['px2_per_m2']:g}"] if noise["px2_per_m2"] != 1 else []
    keys += [f'metric.visibility = "{metric["visibility"]}"'] if metric["visibility"] != "point" else []
    if keys:
        allowed = f"none of these with calibration-error; allowed: models of {', '.join(BUILT_IN_MODELS)}"
        why = "the model that is judged, and its limits of detection, are fitted in the run"
        raise SceneError([f"{scene.path}: {', '.join(keys)}; {allowed}, as {why}"])


def _rank(
    training: ViewBank,
    bank: ViewBank,
    acquired: Acquired,
    design: BankDesign,
    configurations: int,
    out: Path,
    console: Console,
) -> None:
    """Leave table and figure, and print the table."""
    seed, loaded = design.seed, bank.scene
    calibration = calibrate(training, acquired, design, out)
    data = data_of(bank, acquired, seed)
    rng = random_stream(seed, bank.scene.path.name, "calibration error")
    drawn = draw_configurations([camera.name for camera in bank.cameras], CAMERAS, configurations, rng)
    (model,) = (model for model in noise_models(loaded, calibration) if model.name == FULL_MODEL)
    views = Views(list(bank.cameras), data.points_m, loaded.state.normals, appearance_of(loaded, acquired))
    visible = visible_in(views, loaded.state.occluders, visibilities(loaded, calibration)["fitted limits"])
    rows = study(data, Predictions(views, visible, model, drawn))
    write_csv(out / "calibration_error.csv", rows)
    draw(out / "figures" / "calibration_error.png", rows)
    table = Table(title=f"Ranking {len(drawn)} configurations of {CAMERAS} cameras with errors of calibration")
    for name in ("°, %, mm", "kind", "judged", "RMS in mm", "ρ of PSS", "with a term in R", "… and in the weights"):
        table.add_column(name)
    for row, in_weights in beside(rows):
        sizes = (scale * float(str(row[key])) for key, scale in SCALES)
        table.add_row(
            ", ".join(f"{size:g}" for size in sizes),
            str(row["kind"]),
            str(row["judged"]),
            f"{1000 * float(str(row['median_rms_m'])):.2f}",
            *(_interval(row, name) for name in ("spearman_plain", "spearman_with_term")),
            _interval(in_weights, "spearman_with_term") if in_weights else "",
        )
    console.print(table)


def beside(rows: Sequence[Row]) -> list[tuple[Row, Row | None]]:
    """Each row without the term in the weights, and the one beside it that has it (None without errors)."""
    keys = (*(key for key, _ in SCALES), "kind", "judged")
    others = {tuple(row[key] for key in keys): row for row in rows if row["weights"] == IN_WEIGHTS}
    return [(row, others.get(tuple(row[key] for key in keys))) for row in rows if row["weights"] == OWN]


def _interval(row: Row, name: str) -> str:
    value, low, high = (float(str(row[key])) for key in (name, f"{name}_low", f"{name}_high"))
    return f"{value:.2f} [{low:.2f}, {high:.2f}]"
