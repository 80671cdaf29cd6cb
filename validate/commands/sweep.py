"""`run_sweep.py SWEEP…`: predict, render, measure and compare the steps of sweeps."""

from __future__ import annotations

from validate.commands import run_and_save
from validate.commands.subcommands import Sweep

__all__ = ["execute"]


def execute(options: Sweep) -> int:
    """Run the sweeps, save and print the results; the exit code.

    Raises:
        PSSError: the user's mistake.
    """
    return run_and_save.run(options, options.sweeps, options.scene)
