"""`run_sweep.py bank`: render and measure a bank of views, calibrate on one part, judge all metrics on the other."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import scenes
from pss import RangeError
from pss.hints import Row
from render.store.folder import write_text
from scenes import Scene
from scenes.steps.sweep_file import SWEEPS
from validate.acquire.forecast import announce
from validate.acquire.messages import RunMessages
from validate.acquire.source import ViewSource, end_run, open_source
from validate.bank.acquire import acquire_banks, calibrate, enough
from validate.bank.design import BankDesign, ViewBank, detection_views, held_out_views, training_views
from validate.bank.process_noise import process_levels
from validate.bank.summary import show
from validate.bank.tables import HEADLINE, judge
from validate.commands.subcommands import Bank
from validate.findings.bank import bank_findings
from validate.prediction.contenders import judged, scene_contenders
from validate.prediction.frozen import FrozenCalibration, provenance_of, read_frozen, save_calibration
from validate.runs.csv_file import read_tables
from validate.runs.exit_codes import EXIT_DONE
from validate.runs.outputs import check_folders
from validate.runs.progress import clock
from validate.runs.run_file import write_run
from validate.runs.tables import write_csv

__all__ = ["execute"]


SECOND_SCENE = "atrium.toml"
COUNTS = (2, 3, 4, 6)
# Columns of the tables, on every terminal.
WIDTH = 140
# The first banks, on which a calibration is fitted: of training and of detection; then come those that are judged.
FITTED_ON = 2
# Ranks of two are always in one order or the other.
FEWEST_CONFIGURATIONS = 3


def execute(options: Bank) -> int:
    """Judge metrics and noise models on a bank of views, save and print the tables; the exit code."""
    shared, out, configurations = options.run, options.out, options.configurations
    shared.scale.check()
    design = BankDesign(**vars(options.views))
    if configurations < FEWEST_CONFIGURATIONS:
        raise RangeError(f"--configurations {configurations}; allowed: {FEWEST_CONFIGURATIONS} or more, to be ranked")
    check_folders(out, shared.store)
    with RunMessages(shared.quiet, width=WIDTH) as messages:
        source = open_source(shared.store, shared.variant, messages, shared.scale)
        frozen = None if options.calibration is None else read_frozen(options.calibration)
        # Overrides are of the first scene alone: beside it in another light, the second as it is would say nothing.
        judged_as_usual = frozen is None and not shared.set
        second_scene = options.second_scene
        if judged_as_usual and second_scene is None and (SWEEPS.parent / SECOND_SCENE).exists():
            second_scene = SWEEPS.parent / SECOND_SCENE
        banks = _banks(options.scene, second_scene, shared.set, shared.allow_outside, design, source.renderer)
        if not shared.dry_run:
            return _judge_all(banks, frozen, design, configurations, out, source)
        banks = _rendered(banks, frozen)
        counts = [
            f"{bank.scene.path.stem}, {bank.role}: {len(bank.views)} views in {len(bank.requested)} renders"
            for bank in banks
        ]
        counts.append(f"{configurations} configurations of each of {', '.join(map(str, COUNTS))} cameras")
        requested = [item for bank in banks for item in bank.requested]
        announce(counts, requested, source, out)
        return EXIT_DONE


def _banks(
    scene: Path | None,
    second_scene: Path | None,
    overrides: tuple[str, ...],
    allow_outside: bool,
    design: BankDesign,
    renderer: str,
) -> list[ViewBank]:
    """The training bank, that for detection, the one to be judged and, if there is another room, that of the second."""
    first = scenes.load(scene or SWEEPS.parent / "room.toml", overrides, allow_outside=allow_outside)
    _check_cameras(first)
    training = training_views(first, design, renderer)
    held_out = held_out_views(first, design, renderer)
    banks = [training, detection_views(first, design, renderer), held_out]
    if second_scene is not None:
        other_scene = scenes.load(second_scene, allow_outside=allow_outside)
        _check_cameras(other_scene)
        banks.append(held_out_views(other_scene, design, renderer))
    return banks


def _rendered(banks: list[ViewBank], frozen: FrozenCalibration | None) -> list[ViewBank]:
    """The banks whose views are needed: with a frozen calibration only those that are judged."""
    return banks if frozen is None else banks[FITTED_ON:]


def _check_cameras(scene: Scene) -> None:
    """Refuse, before anything is rendered, a scene of too few cameras for the headline's configurations."""
    if len(scene.cameras) < HEADLINE:
        count = f"{len(scene.cameras)} camera" + "s" * (len(scene.cameras) != 1)
        raise RangeError(f"{scene.path}: {count}; allowed: {HEADLINE} or more, as configurations take {HEADLINE}")


def _judge_all(
    requested: list[ViewBank],
    frozen: FrozenCalibration | None,
    design: BankDesign,
    configurations: int,
    out: Path,
    source: ViewSource,
) -> int:
    """Get the views, judge, and leave the tables; the exit code."""
    begin = time.perf_counter()
    messages = source.messages
    messages.start(out, "bank", store=source.address)
    acquired, banks = acquire_banks(_rendered(requested, frozen), source)
    after_views = time.perf_counter()
    renders, views = (sum(counts) for counts in zip(*((len(b.requested), len(b.views)) for b in banks), strict=True))
    if frozen is not None:
        banks = [*requested[:FITTED_ON], *banks]
    training, held_out, others = banks[0], banks[FITTED_ON], banks[FITTED_ON + 1 :]
    tables: dict[str, list[Row]] = {}
    predicted_with: dict[str, object] = {}
    calibrated_by: Mapping[str, object] = {}
    if enough(training, held_out, HEADLINE, messages):
        if frozen is None:
            calibration = calibrate(training, acquired, design, out, banks[1])
        else:
            calibration = frozen.calibration
            save_calibration(frozen, out)
        calibrated_by = provenance_of(calibration, frozen)
        by_file = {bank.scene.path.name: bank.scene for bank in (held_out, *others)}
        predicted_with = {name: judged(scene_contenders(scene, calibration)) for name, scene in by_file.items()}
        counts = tuple(count for count in COUNTS if count <= len({camera.name for camera in held_out.cameras}))
        levels = process_levels(training, acquired, HEADLINE, design.seed)
        common = (calibration, configurations, design.seed)
        tables = judge(held_out, acquired, *common, counts, levels, messages.note)
        for second in others:
            if enough(training, second, HEADLINE, messages):
                other = judge(second, acquired, *common, (HEADLINE,), levels, messages.note)
                tables |= {f"{second.scene.path.stem}-{name}": rows for name, rows in other.items()}
        for name, rows in tables.items():
            write_csv(out / f"{name}.csv", rows)
        # Tables of an earlier run that lie there are not of this one.
        written = {name: rows for name, rows in read_tables(out).items() if name in tables}
        write_text(out / "findings.md", bank_findings(written))
        show(tables, calibration, messages.console, "in the file" if frozen else "on the training views")
    seconds = {"views": after_views - begin, "total": time.perf_counter() - begin}
    content = {
        "design": asdict(design),
        "configurations": configurations,
        "scenes": {bank.scene.path.name: bank.scene.resolved() for bank in banks},
        "calibration": calibrated_by,
        "predicted_with": predicted_with,
        "renderer": source.renderer,
        **acquired.counts,
        "tables": sorted(tables),
        "seconds": seconds,
    }
    write_run(out, content)
    return end_run(
        f"{renders} renders ({acquired.rendered} now) of {views} views in {clock(seconds['total'])}, "
        f"{clock(seconds['total'] - seconds['views'])} after the views; results in {out}",
        acquired,
        messages,
    )
