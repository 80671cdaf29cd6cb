"""`run_sweep.py pixel-noise`: measure what the pixel noise table needs, and write its files."""

from __future__ import annotations

import importlib.metadata
import math
import sys
import time
from collections.abc import Sequence

from rich.table import Table

from pss import RangeError
from render import backend
from render.store.remote import open_store
from validate.commands.subcommands import PixelNoise
from validate.pixel_noise.design import make_plan
from validate.pixel_noise.exponents import PowerLaw
from validate.pixel_noise.measure import measure_all
from validate.pixel_noise.rows import JOINT, exponent_rows, joint_law, level_rows, render_rows
from validate.plots.pixel_noise import draw
from validate.runs.console import Console
from validate.runs.exit_codes import EXIT_DONE
from validate.runs.folder_lock import alone_in
from validate.runs.outputs import check_folders
from validate.runs.progress import ViewProgress, clock
from validate.runs.run_file import write_run
from validate.runs.tables import write_csv

__all__ = ["execute"]

PACKAGES = ("mitsuba", "drjit", "opencv-contrib-python-headless", "numpy", "scipy")


def execute(options: PixelNoise) -> int:
    """Measure, save and print the table of pixel noise; the exit code.

    Raises:
        PSSError: the user's mistake.
    """
    if options.trials is not None and options.trials < 2:
        raise RangeError(f"--trials {options.trials}; allowed: 2 or more (a spread needs two)")
    if options.seed < 0:
        raise RangeError(f"--seed {options.seed}; allowed: 0 or more")
    check_folders(options.out, options.store)
    wide = None if sys.stdout.isatty() else 140
    with alone_in(options.out):
        _make(options, Console(width=wide), Console(stderr=True))
    return EXIT_DONE


def _make(options: PixelNoise, console: Console, errors: Console) -> None:
    """Measure; write the three tables, `run.json` and the figure; print the exponents."""
    out, seed = options.out, options.seed
    begin = time.perf_counter()
    chosen = backend.choose()
    console.print(str(chosen), markup=False)
    plan = make_plan(seed, options.trials, options.quick)
    measured = measure_all(plan, open_store(options.store), chosen, seed, lambda total: ViewProgress(total, errors))
    law = joint_law(measured, seed=seed)
    levels, exponents = level_rows(measured), exponent_rows(measured, law)
    write_csv(out / "pixel_noise.csv", levels)
    write_csv(out / "renders.csv", render_rows(measured))
    write_csv(out / "exponents.csv", exponents)
    draw(out / "figures" / "pixel-noise.png", levels, exponents)
    seconds = time.perf_counter() - begin
    record = {
        "seed": seed,
        "trials": plan.trials,
        "quick": options.quick,
        "renderer": chosen.identity,
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
        "power_law": _law(law),
        "seconds": seconds,
    }
    write_run(out, record)
    console.print(exponent_table(exponents))
    console.print(_law(law), markup=False, soft_wrap=True)
    console.print(
        f"{len(levels)} levels and {law.renders} combinations, {len(plan.shots)} × {plan.trials} captures, "
        f"in {clock(seconds)}; results in {out}",
        markup=False,
    )


def _law(law: PowerLaw) -> str:
    terms = " · ".join(f"{name}^{e.value:+.2f}" for name, e in zip(JOINT, law.exponents, strict=True))
    return f"combinations: σ ≈ {law.constant_px:.3g} px · {terms}; {law.renders} renders scatter by × {law.scatter:.2f}"


def exponent_table(rows: Sequence[dict[str, object]]) -> Table:
    """The exponents of σ, with what is predicted of them."""
    table = Table(title="σ of a marker's centre ∝ factor to the power of … (95 % interval)")
    for name in ("set", "factor", "range", "renders", "measured", "bound", "physical", "paper's R alone"):
        table.add_column(name, justify="right" if name in ("renders", "measured", "bound", "physical") else "left")
    for row in rows:
        low, high = row["exponent_low"], row["exponent_high"]
        table.add_row(
            str(row["set"]),
            str(row["factor"]),
            f"{row['from']:.3g} … {row['to']:.3g}",
            str(row["renders"]),
            f"{_signed(row['exponent'])}  [{_signed(low)}, {_signed(high)}]",
            _signed(row["bound_exponent"]),
            _signed(row["physical_exponent"]),
            f"{_signed(row['paper_exponent'])} ({row['paper']})" if row["paper"] else "",
        )
    return table


def _signed(value: object) -> str:
    assert isinstance(value, float)
    return "–" if math.isnan(value) else f"{value:+.2f}".replace("-", "−")
