"""`run_sweep.py SWEEP…`: predict, render, measure and compare the steps of sweeps."""

from __future__ import annotations

from validate.acquire.messages import RunMessages
from validate.commands import run_and_save
from validate.commands.subcommands import Sweep
from validate.results.run_request import RunRequest

__all__ = ["execute"]


def execute(options: Sweep) -> int:
    """Run the sweeps, save and print the results; the exit code.

    Raises:
        PSSError: the user's mistake.
    """
    shared = options.run
    of_run = RunRequest(
        options.sweeps,
        options.scene,
        options.out,
        shared.store,
        options.trials,
        options.seed,
        shared.set,
        shared.variant,
        shared.dry_run,
        shared.allow_outside,
        shared.quiet,
        shared.scale,
        options.report,
    )
    with RunMessages(shared.quiet) as messages:
        return run_and_save.execute(of_run, messages)
