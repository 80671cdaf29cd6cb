"""`run_sweep.py pixel-noise`: measure what the pixel noise table needs, and write its files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from validate.runs.program import program_name

__all__ = ["main", "run"]


def run(
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("results/pixel-noise"),
    store: Annotated[str, tyro.conf.arg(metavar="DIR")] = "results/store",
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0,
    trials: Annotated[int | None, tyro.conf.arg(metavar="N")] = None,
    quick: bool = False,
) -> int:
    """Measure bias and σ of a marker's centre against blur, size, incidence and signal; see docs/pixel-noise.md.

    Args:
        out: folder for the results.
        store: folder of measurements, shared by all runs, or an address (docs/store.md).
        seed: of poses, combinations and noise.
        trials: noisy captures of each render (default: 20; with --quick 6).
        quick: few levels and poses, to see that all works.
    """
    import sys

    from pss import RangeError
    from validate.commands.pixel_noise_run import make
    from validate.runs.console import Console
    from validate.runs.folder_lock import alone_in
    from validate.runs.outputs import check_folders

    if trials is not None and trials < 2:
        raise RangeError(f"--trials {trials}; allowed: 2 or more (a spread needs two)")
    if seed < 0:
        raise RangeError(f"--seed {seed}; allowed: 0 or more")
    check_folders(out, store)
    wide = None if sys.stdout.isatty() else 140
    with alone_in(out):
        make(out, store, seed, trials, quick, Console(width=wide), Console(stderr=True))
    return 0


def main(arguments: list[str]) -> int:
    """Parse the subcommand's own arguments and run it."""
    return tyro.cli(run, prog=f"{program_name()} pixel-noise", args=arguments)
