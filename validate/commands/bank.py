"""`run_sweep.py bank`: render and measure a bank of views, calibrate on one part, judge all metrics on the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.table import Table

import scenes
from pss import RangeError
from pss.hints import Row
from pss.noise import Calibration
from render.store.folder import write_text
from scenes import Scene
from scenes.steps.sweep_file import SWEEPS
from validate.acquire.acquire import Acquired
from validate.acquire.forecast import announce
from validate.acquire.messages import RunMessages
from validate.acquire.source import ViewSource, end_run, open_source
from validate.bank.acquire import acquire_banks, calibrate, enough
from validate.bank.ceilings import oracle_rows, parts_rows
from validate.bank.consistency_rows import blunder_row, consistency_rows, pixel_rows
from validate.bank.design import BankDesign, ViewBank, detection_views, held_out_views, training_views
from validate.bank.detected import detection_rows, reliability_rows
from validate.bank.differences import difference_rows
from validate.bank.filtered import filter_all
from validate.bank.judge import data_of, requested_pairs, verdict_of
from validate.bank.leaderboard import leaderboard
from validate.bank.process_noise import process_levels, process_rows
from validate.bank.sensitivity import scale_rows, sensitivity_rows
from validate.bank.size_bins import size_rows
from validate.commands.subcommands import Bank
from validate.findings.bank import bank_findings
from validate.prediction.contenders import (
    BASES,
    detection_model_of,
    judged,
    noise_models,
    own_models,
    scene_contenders,
    visibilities,
)
from validate.prediction.frozen import FrozenCalibration, provenance_of, read_frozen, save_calibration
from validate.prediction.process_levels import Level
from validate.runs.console import Console
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
# The camera count whose configurations are tracked by the filter as well, and the one of the headline.
HEADLINE = 4
# The first banks, on which a calibration is fitted: of training and of detection; then come those that are judged.
FITTED_ON = 2
# Ranks of two are always in one order or the other.
FEWEST_CONFIGURATIONS = 3


def execute(options: Bank) -> int:
    """Judge metrics and noise models on a bank of views, save and print the tables; the exit code."""
    shared, out, configurations = options.run, options.out, options.configurations
    shared.scale.check()
    design = BankDesign(settings=options.settings, trials=options.trials, turns=options.turns, seed=options.seed)
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
        _show(tables, calibration, messages.console, "in the file" if frozen else "on the training views")
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


def judge(
    bank: ViewBank,
    acquired: Acquired,
    calibration: Calibration,
    configurations: int,
    seed: int,
    counts: tuple[int, ...],
    levels: Sequence[Level],
    report: Callable[[str], None] = lambda line: None,
) -> dict[str, list[Row]]:
    """Tables of a held-out bank by name; the filter at `levels` of process noise; `report` is called with progress."""
    data = data_of(bank, acquired, seed)
    models, contenders = noise_models(bank.scene, calibration), scene_contenders(bank.scene, calibration)
    rows: dict[str, list[Row]] = {"leaderboard": [], "ceiling": [], "consistency": [], "detection": [], "parts": []}
    rows |= {"sensitivity": [], "blunders": [], "differences": [], "scale": []}
    rows["consistency"] += pixel_rows(bank, data, acquired, models)
    for count in counts:
        report(f"{bank.scene.path.stem}: evaluating {configurations} configurations of {count} cameras")
        verdict = verdict_of(bank, data, acquired, contenders, count, configurations, seed, filtered=count == HEADLINE)
        rows["leaderboard"] += leaderboard(verdict, requested_pairs(contenders))
        rows["ceiling"] += oracle_rows(bank, data, verdict)
        rows["blunders"].append(blunder_row(verdict))
        filtered = None
        if count == HEADLINE:
            filtered = filter_all(data, verdict.configurations, verdict.measured, levels)
            rows["process"] = process_rows(verdict, [contender.name for contender in contenders], levels, filtered)
        rows["consistency"] += consistency_rows(verdict, bank, data, contenders, acquired, filtered)
        if count == HEADLINE:
            visible = visibilities(bank.scene, calibration)
            used, ramp = np.unique(verdict.configurations), detection_model_of(bank.scene, calibration)
            rows["detection"] += detection_rows(bank, data, used, visible, ramp, acquired)
            if ramp is not None:
                rows["reliability"] = reliability_rows(bank, data, used, ramp, acquired)
            rows["sensitivity"] += sensitivity_rows(bank, data, verdict, visible["points"], acquired)
            names = [contender.name for contender in contenders]
            rows["size"] = size_rows(verdict, names)
            rows["differences"] += difference_rows(verdict, names, [base for base in BASES if base in names])
            of_open_unit = [model for model in models if model.name in calibration.scales] + own_models(bank.scene)
            rows["scale"] += scale_rows(bank, verdict, of_open_unit, calibration.scales, acquired)
            rows["parts"] += parts_rows(bank, data, verdict, models, visible, acquired)
    # The pixel level has fewer columns; every row of a file has all of them.
    columns = list(dict.fromkeys(key for row in rows["consistency"] for key in row))
    rows["consistency"] = [{key: row.get(key, float("nan")) for key in columns} for row in rows["consistency"]]
    return rows


def _show(tables: dict[str, list[Row]], calibration: Calibration, console: Console, where: str) -> None:
    """Print the verdict."""
    weights = ", ".join(f"{name} {weight:.3g}" for name, weight in calibration.weights.items() if weight > 0)
    limits = ", ".join(f"{name} {value:g}" for name, value in calibration.limits.items())
    console.print(f"calibrated {where}: {weights}; {limits}", markup=False)
    board = [
        row
        for row in tables["leaderboard"]
        if row["cameras"] == HEADLINE and row["measure"] == "measured_pss_single_frame"
    ]
    board.sort(key=lambda row: -float(str(row["spearman"])) if row["spearman"] == row["spearman"] else 2)
    table = Table(title=f"Ranking {board[0]['n']} held-out configurations of {HEADLINE} cameras by measured PSS")
    for name in (
        "rank",
        "metric",
        "noise model",
        "Spearman [95 %]",
        "given the visible share",
        "regret of 20 (median)",
    ):
        table.add_column(name)
    for row in board:
        table.add_row(
            f"{row['rank']} [{row['rank_ci_low']}, {row['rank_ci_high']}]",
            str(row["metric"]),
            str(row["noise_model"]),
            _interval(row, "spearman"),
            _interval(row, "partial_given_visible"),
            f"{100 * float(str(row['regret_of_20_median'])):.1f} %",
        )
    console.print(table)
    for name, rows in tables.items():
        if name.endswith("ceiling"):
            for row in rows:
                if row["cameras"] == HEADLINE:
                    console.print(f"{name}: {row['ceiling']}: {_interval(row, 'spearman')}", markup=False)
        if name.endswith("consistency"):
            console.print(_consistency_table(name, rows))


def _consistency_table(name: str, rows: list[Row]) -> Table:
    table = Table(title=name)
    for column in ("level", "cameras", "noise model", "NEES/dof", "50 %", "90 %", "95 %", "|log ratio|", "ρ of points"):
        table.add_column(column)
    for row in rows:
        if row["cameras"] not in (1, HEADLINE):
            continue
        table.add_row(
            *(str(row[key]) for key in ("level", "cameras", "noise_model")),
            _interval(row, "nees_per_dof"),
            *(f"{100 * float(str(row[f'coverage_{level}'])):.1f}" for level in (50, 90, 95)),
            f"{float(str(row['median_abs_log_ratio'])):.3f}",
            _interval(row, "point_spearman"),
        )
    return table


def _interval(row: Row, name: str) -> str:
    value, low, high = (float(str(row.get(key, "nan"))) for key in (name, f"{name}_ci_low", f"{name}_ci_high"))
    return "" if np.isnan(value) else f"{value:.3g} [{low:.3g}, {high:.3g}]"
