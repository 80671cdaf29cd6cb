"""The command: predict and measure sweeps of camera settings, and leave tables and figures behind.

    python validate/run_sweep.py zoom focus selection

Heavy imports come after the command line is parsed, so that --help and a misspelt option answer at once.
"""

from __future__ import annotations

import importlib
import sys
import traceback
from pathlib import Path
from typing import Annotated, Literal

if __package__ in (None, ""):  # run as a script: the project's root is the parent of this file's folder
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import tyro

from validate.acquire.options import HERE, Scale
from validate.commands import overview
from validate.runs.exit_codes import EXIT_BROKEN, EXIT_CODES, EXIT_DONE, EXIT_INTERRUPTED, EXIT_MISTAKE
from validate.runs.interruption import remember_interrupts
from validate.runs.program import named_as_called, output_is_closed, program_name, version_line, with_quiet_end

__all__ = ["main", "run_sweep"]

DESCRIPTION = f"""Predict and measure sweeps of camera settings; see README.md for what is left in the results folder.

Examples:
  run_sweep.py zoom focus selection
  run_sweep.py zoom --set sensor.exposure_ms=8 --set cameras.2.focus_distance_m=3.5
  run_sweep.py my_sweep.toml --out results/mine --trials 50

{EXIT_CODES}"""


def run_sweep(
    sweeps: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SWEEP…")],
    /,
    scene: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None,
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
    """Predict and measure sweeps of camera settings.

    Args:
        sweeps: names of files in scenes/sweeps, or paths of such files.
        scene: scene file to use in place of the sweeps' own.
        out: folder for the results (default: results/ and the sweeps' names).
        store: folder of rendered views and measurements, shared by all runs, or an address (docs/store.md).
        trials: noisy captures of each view, in place of the sweeps' own number.
        seed: of the run, in place of the sweeps' own.
        set: override a key of the scene file, or (sweep.KEY) of the sweep file; may be repeated.
        variant: Mitsuba's variant (default: LLVM if a libLLVM is found, else scalar).
        dry_run: say what would be done, how long it would take and how much it would fill, and stop.
        allow_outside: let files name others outside their folder (see "Files from others" in docs/scenes.md).
        quiet: print nothing but errors and the last line, which says where the results are.
        report: write report.html, which shows the run in a browser, and its scene as glTF.
        scale: where views are made (docs/scale.md).
    """
    from validate.acquire.messages import RunMessages
    from validate.commands.run import Options, execute

    options = Options(
        sweeps, scene, out, store, trials, seed, set, variant, dry_run, allow_outside, quiet, scale, report
    )
    with RunMessages(quiet) as messages:
        return execute(options, messages)


def main(arguments: list[str] | None = None) -> int:
    """Parse the command line, run, and give the exit code; the user's mistakes are one line."""
    if arguments is None:  # as a program, by either name
        remember_interrupts()
        return with_quiet_end(lambda: _main(sys.argv[1:]))
    return _main(arguments)


def _main(arguments: list[str]) -> int:
    if overview.wants_overview(arguments):
        print(named_as_called(overview.OVERVIEW))
        return EXIT_DONE
    if arguments == ["--version"]:
        print(version_line())
        return EXIT_DONE
    if arguments and (said := overview.misspelt(arguments[0])) is not None:
        print(f"{program_name()}: {said}", file=sys.stderr)
        return EXIT_MISTAKE
    try:
        if overview.wants_completion(arguments):
            overview.complete(arguments, run_sweep)
        if arguments and arguments[0] in overview.COMMANDS:
            command = importlib.import_module(overview.COMMANDS[arguments[0]])
            return int(command.main(arguments[1:]))
        return tyro.cli(run_sweep, prog=program_name(), description=named_as_called(DESCRIPTION), args=arguments)
    except KeyboardInterrupt:
        print("interrupted; what is rendered and measured stays in the store", file=sys.stderr)
        return EXIT_INTERRUPTED
    except Exception as error:
        if isinstance(error, BrokenPipeError) and output_is_closed():
            raise
        from pss import PSSError

        if not isinstance(error, PSSError):
            traceback.print_exc()
            return EXIT_BROKEN
        # Imported late: a mistake of the command line is answered at once.
        from validate.runs.console import printable

        print(f"{program_name()}: {printable(str(error))}", file=sys.stderr)
        return EXIT_MISTAKE


if __name__ == "__main__":
    sys.exit(main())
