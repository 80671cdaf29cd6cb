"""`run_sweep.py measure`: predict, render and measure a scene as it is: the error in mm of each marker."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from validate.acquire.options import HERE, Scale
from validate.runs.program import program_name

__all__ = ["main", "run"]

SCENES = Path(__file__).parents[2] / "scenes"


def run(
    scene: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    /,
    cameras: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME…")] = (),
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None,
    store: Annotated[str, tyro.conf.arg(metavar="DIR")] = "results/store",
    trials: Annotated[int | None, tyro.conf.arg(metavar="N")] = None,
    seed: Annotated[int | None, tyro.conf.arg(metavar="N")] = None,
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="KEY=VALUE")] = (),
    variant: Literal["llvm_ad_mono", "cuda_ad_mono", "scalar_rgb"] | None = None,
    dry_run: bool = False,
    allow_outside: bool = False,
    quiet: bool = False,
    report: bool = True,
    scale: Annotated[Scale, tyro.conf.arg(name="")] = HERE,
) -> int:
    """Measure a scene as it is: the error of each marker in mm, beside what each noise model predicts.

    A sweep of one step: views, measurements and tables are those of sweeps, and shared with them.

    Args:
        scene: path of a scene file, or the name of one in scenes/.
        cameras: names of the cameras that take part (default: all of the scene).
        out: folder for the results (default: results/measure/ and the scene's name).
        store: folder of rendered views and measurements, shared by all runs, or an address (docs/store.md).
        trials: noisy captures of each view (default: 20).
        seed: of the run (default: 2011, as the project's sweeps have).
        set: override a key of the scene file; may be repeated.
        variant: Mitsuba's variant (default: LLVM if a libLLVM is found, else scalar).
        dry_run: print what would be done, how long it would take and how much it would fill, and stop.
        allow_outside: let files name others outside their folder (see "Files from others" in docs/scenes.md).
        quiet: print nothing but errors and the last line, which names the folder of the results.
        report: write report.html, which shows the run in a browser, and its scene as glTF.
        scale: where views are made (docs/scale.md).
    """
    from scenes.reading.document import named_file
    from validate.acquire.messages import RunMessages
    from validate.commands.run import Options, execute

    path = named_file(scene, SCENES, "scene")
    options = Options(
        (), path, out, store, trials, seed, set, variant, dry_run, allow_outside, quiet, scale, report, cameras
    )
    with RunMessages(quiet) as messages:
        return execute(options, messages)


def main(arguments: list[str]) -> int:
    """Parse the subcommand's own arguments and run it."""
    return int(tyro.cli(run, prog=f"{program_name()} measure", args=arguments))
