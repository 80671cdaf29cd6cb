"""`run_sweep.py measure`: predict, render and measure a scene as it is: the error in mm of each marker."""

from __future__ import annotations

from pathlib import Path

from scenes.reading.document import named_file
from validate.acquire.messages import RunMessages
from validate.commands import run_and_save
from validate.commands.subcommands import Measure
from validate.results.run_request import RunRequest

__all__ = ["execute"]

SCENES = Path(__file__).parents[2] / "scenes"


def execute(options: Measure) -> int:
    """Measure the scene, save and print the results; the exit code.

    Raises:
        PSSError: the user's mistake.
    """
    shared = options.run
    of_run = RunRequest(
        (),
        named_file(options.scene, SCENES, "scene"),
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
        options.cameras,
    )
    with RunMessages(shared.quiet) as messages:
        return run_and_save.execute(of_run, messages)
