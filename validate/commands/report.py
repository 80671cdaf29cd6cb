"""`run_sweep.py report`: create the report of a finished run again, from its tables and the store."""

from __future__ import annotations

import contextlib

from validate.commands.subcommands import Report
from validate.pages.named import Given
from validate.results.report_again import remade
from validate.runs.folder_lock import alone_in

__all__ = ["execute"]


def execute(options: Report) -> int:
    """Write the report of a finished run again, and print its path; the exit code."""
    folder, given = options.folder, Given(options.store, options.scene, options.file, options.allow_outside)
    with alone_in(folder) if folder.is_dir() else contextlib.nullcontext():
        print(remade(folder, given, options.strategy))
    return 0
