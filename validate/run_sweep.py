"""The command: predict and measure sweeps of camera settings, and write tables and figures.

    python validate/run_sweep.py zoom focus selection

Heavy imports come after the command line is parsed, so that --help and a misspelt option answer at once.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

if __package__ in (None, ""):  # run as a script: the project's root is the parent of this file's folder
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from validate.commands import command_line
from validate.runs.exit_codes import EXIT_BROKEN, EXIT_DONE, EXIT_INTERRUPTED, EXIT_MISTAKE
from validate.runs.interruption import remember_interrupts
from validate.runs.program import output_is_closed, program_name, version_line, with_quiet_end

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code; the user's mistakes are one line on standard error.

    Args:
        arguments: those of the command line (default: the program's own).

    Raises:
        SystemExit: the help was printed (code 0), or options that the parser does not accept (code 2).
    """
    if arguments is None:  # as a program, by either name
        remember_interrupts()
        return with_quiet_end(lambda: _main(sys.argv[1:]))
    return _main(arguments)


def _main(arguments: Sequence[str]) -> int:
    if list(arguments) == ["--version"]:
        print(version_line())
        return EXIT_DONE
    try:
        return command_line.run(arguments)
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
