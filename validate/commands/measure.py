"""`run_sweep.py measure`: predict, render and measure a scene as it is: the error in mm of each marker."""

from __future__ import annotations

from pathlib import Path

from scenes.reading.document import named_file
from validate.commands import run_and_save
from validate.commands.subcommands import Measure

__all__ = ["execute"]

SCENES = Path(__file__).parents[2] / "scenes"


def execute(options: Measure) -> int:
    """Measure the scene, save and print the results; the exit code.

    Raises:
        PSSError: the user's mistake.
    """
    return run_and_save.run(options, (), named_file(options.scene, SCENES, "scene"), options.cameras)
