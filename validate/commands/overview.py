"""The command line as a whole: its commands, the help that fits a screen, misspelt names, and completion in a shell.

Nothing heavy is imported before it is known what is asked.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import tyro

__all__ = ["COMMANDS", "OVERVIEW", "complete", "misspelt", "wants_completion", "wants_overview"]

COMMANDS = {
    "bank": "validate.commands.bank",
    "calibration-error": "validate.commands.calibration_error",
    "check": "validate.commands.check",
    "compare": "validate.commands.compare",
    "figures": "validate.commands.figures",
    "measure": "validate.commands.measure",
    "new-scene": "validate.commands.new_scene",
    "pixel-noise": "validate.commands.pixel_noise",
    "report": "validate.commands.report",
    "schedule": "validate.commands.schedule",
    "store": "validate.commands.store",
}
"""Words in a sweep's place that are commands of their own; each module has a `main(arguments) -> exit code`."""

OVERVIEW = """usage: run_sweep.py SWEEP… [OPTIONS]    or    run_sweep.py COMMAND [OPTIONS]

Predict how precisely cameras resolve 3D points, render and measure it, and compare the two.

Commands (COMMAND --help has more; --version states which program this is):
  new-scene         write a commented scene and sweep to start from
  check             what the cameras of a scene will see, with a plan, before anything is rendered
  measure           a scene as it is: the error of each marker in mm, beside what is predicted
  compare           two or more runs side by side, with differences and intervals
  figures           the paper's Figures 1 to 4 from our runs, as PDF and SVG
  schedule          cameras follow two people who pass each other, by one strategy after the other
  bank              all metrics and noise models on configurations from a bank of views
  report, store, pixel-noise, calibration-error

Options of sweeps (zoom --help has all): --scene FILE  --out DIR  --store DIR  --trials N  --seed N
  --dry-run  --quiet  --workers N  --set KEY=VALUE (a key ends in its unit, as exposure_ms does)

Examples:
  run_sweep.py zoom focus selection
  run_sweep.py zoom --set sensor.exposure_ms=8 --out results/brighter
  run_sweep.py compare results/zoom results/brighter
  run_sweep.py new-scene my-room, then: run_sweep.py check my-room.toml

Exit: 0 done, 1 with failed views, 2 a mistake, 70 ours, 130 interrupted, 141 unread: docs/runs.md"""
SWEEPS = Path(__file__).parents[2] / "scenes" / "sweeps"
COMPLETION = ("--tyro-print-completion", "--tyro-write-completion")
# In every other command's module the function behind it is `run`.
WITH_COMMANDS_OF_ITS_OWN = "store"


def wants_overview(arguments: Sequence[str]) -> bool:
    """Whether help is asked for and nothing else."""
    return list(arguments) in (["-h"], ["--help"])


def wants_completion(arguments: Sequence[str]) -> bool:
    """Whether a shell's completion script is asked for."""
    return bool(arguments) and arguments[0].replace("_", "-") in COMPLETION


def misspelt(word: str) -> str | None:
    """What to say of a first word that is no sweep and most likely a misspelt command; None if it is none."""
    sweeps = _sweeps()
    if word.startswith("-") or word.endswith(".toml") or len(Path(word).parts) != 1 or word in (*COMMANDS, *sweeps):
        return None
    from scenes.errors import nearest

    hint, found = nearest(word, [*COMMANDS, *sweeps])
    if found not in COMMANDS:
        return None
    return f'there is no command or sweep "{word}"{hint}; commands: {", ".join(COMMANDS)}; sweeps: {", ".join(sweeps)}'


def complete(arguments: Sequence[str], of_sweeps: Callable[..., int]) -> None:
    """Print or write a shell's completion script for all commands and the project's sweeps, and exit.

    Args:
        arguments: of the command line, those of `tyro` ("--tyro-write-completion bash FILE").
        of_sweeps: the function behind sweeps, for their options.
    """

    def store(command: str, /) -> None:
        """List, check and prune what is stored."""

    functions: dict[str, Callable[..., Any]] = dict.fromkeys(_sweeps(), of_sweeps)
    for word, module in COMMANDS.items():
        own = word == WITH_COMMANDS_OF_ITS_OWN
        functions[word] = store if own else importlib.import_module(module).run
    tyro.extras.subcommand_cli_from_dict(functions, prog=Path(sys.argv[0]).name, args=list(arguments))


def _sweeps() -> list[str]:
    return sorted(file.stem for file in SWEEPS.glob("*.toml"))
