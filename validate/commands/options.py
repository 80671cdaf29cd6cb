"""Options that several commands share, each written once; the commands' own are in `subcommands`.

Loads nothing that is slow, so that `--help` answers at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from validate.acquire.options import HERE, Scale

__all__ = [
    "DIR",
    "FILE",
    "FLAT",
    "REPEATED",
    "STORE",
    "AllowOutside",
    "BankViews",
    "Detectors",
    "N",
    "Rendering",
    "RunOptions",
    "SceneFiles",
    "StepOptions",
    "StoreFolder",
    "TableForm",
]

# The fields of such an object are options of the command, without its name before them.
FLAT = tyro.conf.arg(name="")
# Placeholders in the help.
DIR, FILE, N = (tyro.conf.arg(metavar=word) for word in ("DIR", "FILE", "N"))
REPEATED = tyro.conf.UseAppendAction

STORE = "results/store"
TableForm = Literal["csv", "md", "tex"]
StoreFolder = Annotated[
    str,
    tyro.conf.arg(
        metavar="DIR",
        help="folder of rendered views and measurements, shared by all runs, or an address (docs/store.md).",
    ),
]
AllowOutside = Annotated[
    bool,
    tyro.conf.arg(help='let files name others outside their folder (see "Files from others" in docs/scenes.md).'),
]

Detectors = Annotated[
    tuple[str, ...],
    REPEATED,
    tyro.conf.arg(
        metavar="NAME",
        help="detector that measures the views (default: registration); may be repeated. Results of other detectors "
        "than the default go into detectors/NAME of the folder (docs/own-detector.md).",
    ),
]


@dataclass(frozen=True)
class SceneFiles:
    """How the scene file is read.

    Attributes:
        set: override a key of the scene file; may be repeated.
    """

    set: Annotated[tuple[str, ...], REPEATED, tyro.conf.arg(metavar="KEY=VALUE")] = ()
    allow_outside: AllowOutside = False


@dataclass(frozen=True)
class Rendering:
    """Where views are kept, and what renders them.

    Attributes:
        variant: Mitsuba's variant (default: LLVM if a libLLVM is found, else scalar).
    """

    store: StoreFolder = STORE
    variant: Literal["llvm_ad_mono", "cuda_ad_mono", "scalar_rgb"] | None = None


@dataclass(frozen=True)
class RunOptions(SceneFiles, Rendering):
    """What all commands share that render and measure views of a scene.

    Attributes:
        dry_run: print what would be done, how long it would take and how much it would fill, and stop.
        quiet: print nothing but errors and the last line, which names the folder of the results.
    """

    dry_run: bool = False
    quiet: bool = False
    scale: Annotated[Scale, FLAT] = HERE


@dataclass(frozen=True)
class BankViews:
    """Which views a bank has, for the commands that share it: fields of `validate.bank.design.BankDesign`.

    Attributes:
        settings: views of each camera.
        trials: noisy captures of each render.
        turns: renders of each view at slightly turned settings.
        seed: of settings, captures and draws.
    """

    settings: int = 10
    trials: int = 10
    turns: int = 2
    seed: int = 1


@dataclass(frozen=True)
class StepOptions(RunOptions):
    """The same, of commands that read a file of steps beside the scene: a sweep or a schedule.

    Attributes:
        set: override a key of the scene file, or (sweep.KEY) of the sweep or schedule file; may be repeated.
    """

    set: Annotated[tuple[str, ...], REPEATED, tyro.conf.arg(metavar="KEY=VALUE")] = ()
