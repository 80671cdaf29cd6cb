"""The command line: words are parsed into a command's options, which its module carries out.

What `tyro` does not do: sweeps in the place of a command, one line for a misspelt word there, and `--version`.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tyro

from validate.commands.subcommands import SUBCOMMANDS, Sweep
from validate.runs.exit_codes import EXIT_CODES
from validate.runs.program import named_as_called, program_name

__all__ = ["parsed", "run"]

DESCRIPTION = f"""Predict how precisely cameras resolve 3D points, render and measure it, and compare the two.

Examples:
  run_sweep.py zoom focus selection
  run_sweep.py zoom --set sensor.exposure_ms=8 --set cameras.2.focus_distance_m=3.5 --out results/brighter
  run_sweep.py my_sweep.toml --out results/mine --trials 50
  run_sweep.py compare results/zoom results/brighter
  run_sweep.py new-scene my-room, then: run_sweep.py check my-room.toml

A key of --set KEY=VALUE ends in its unit, as exposure_ms does. COMMAND --help lists a command's options, and
--version the versions.

{EXIT_CODES}"""
SWEEPS = Path(__file__).parents[2] / "scenes" / "sweeps"


def run(arguments: Sequence[str]) -> int:
    """Carry out one command and return its exit code.

    Raises:
        PSSError: the user's mistake.
        SystemExit: the help was printed, or the parser does not accept an option.
    """
    options = parsed(arguments)
    word = next(word for word, kind in SUBCOMMANDS.items() if isinstance(options, kind))
    command = importlib.import_module(f"validate.commands.{word.replace('-', '_')}")
    return int(command.execute(options))


def parsed(arguments: Sequence[str]) -> Any:
    """The options that the command line passes: an instance of one of the classes in `SUBCOMMANDS`.

    Raises:
        RangeError: the first word is neither a command nor a sweep, and most like a command.
        SystemExit: the help was printed, or the parser does not accept an option.
    """
    name, first = program_name(), arguments[0] if arguments else ""
    if first in ("-h", "--help") or first.replace("_", "-").startswith("--tyro-"):  # or a shell's completion script
        return _overview(with_sweeps=first.replace("_", "-").startswith("--tyro-")).cli(
            prog=name, description=named_as_called(DESCRIPTION), args=arguments
        )
    words = list(arguments)
    if first not in SUBCOMMANDS:  # tyro has no command whose word can be left out
        if not first.startswith("-"):  # options may come before the sweeps
            _check_first_word(first)
        words.insert(0, "sweep")
    # Parsed by itself: beside a misspelt option tyro names those of all commands that it knows.
    return tyro.cli(SUBCOMMANDS[words[0]], prog=f"{name} {words[0]}", args=words[1:])


def _overview(with_sweeps: bool) -> tyro.extras.SubcommandApp:
    """All commands with a line of help each; a shell completes sweeps in their place as well, if tyro knows them."""
    app = tyro.extras.SubcommandApp()
    for word in _sweeps() if with_sweeps else ():
        app.command(Sweep, name=word)
    for word, kind in SUBCOMMANDS.items():
        app.command(kind, name=word, help=str(kind.__doc__).partition("\n")[0])
    return app


def _check_first_word(word: str) -> None:
    """Raise RangeError if a first word is no sweep and most likely a misspelt command.

    tyro lists its commands in a box where a word is none of them; it neither knows sweeps nor suggests a word.
    """
    sweeps = _sweeps()
    if not word or word.endswith(".toml") or len(Path(word).parts) != 1 or word in sweeps:
        return
    # Imported late: the help and most commands do without.
    from pss import RangeError
    from scenes.errors import nearest

    hint, found = nearest(word, [*SUBCOMMANDS, *sweeps])
    if found in SUBCOMMANDS:
        known = f"commands: {', '.join(SUBCOMMANDS)}; sweeps: {', '.join(sweeps)}"
        raise RangeError(f'there is no command or sweep "{word}"{hint}; {known}')


def _sweeps() -> list[str]:
    return sorted(file.stem for file in SWEEPS.glob("*.toml"))
