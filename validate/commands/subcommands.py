"""The program's commands: what each may be passed on the command line, and its help.

A command `NAME` is carried out by `execute` in `validate.commands.NAME`, which is imported once its options are parsed:
nothing that is slow is loaded here, so that `--help` answers at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from validate.acquire.options import HERE, Scale
from validate.commands.options import (
    DIR,
    FILE,
    FLAT,
    REPEATED,
    STORE,
    AllowOutside,
    BankViews,
    Detectors,
    N,
    Rendering,
    RunOptions,
    SceneFiles,
    StepOptions,
    StoreFolder,
    TableForm,
)

__all__ = [
    "SUBCOMMANDS",
    "Bank",
    "CalibrationError",
    "Check",
    "Compare",
    "Figures",
    "Measure",
    "NewScene",
    "PixelNoise",
    "Report",
    "Schedule",
    "Store",
    "StoreCode",
    "StoreList",
    "StorePrune",
    "StoreVerify",
    "Sweep",
]

STRATEGY = tyro.conf.arg(metavar="FILE:FUNCTION")


@dataclass(frozen=True)
class NewScene:
    """Write a scene and a sweep to start from: NAME.toml and NAME-sweep.toml.

    The scene is a room with five cameras; comments explain every key with its unit. What is there is not overwritten.

    Attributes:
        name: of the scene.
        out: folder for the two files.
    """

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")] = "my-room"
    out: Annotated[Path, DIR] = Path(".")


@dataclass(frozen=True)
class Check:
    """Report what each camera of a scene will see, and draw the plan; nothing is rendered.

    The light on the markers is estimated. Sizes are in pixels (px), σ in millimetres (mm), PSS in 1/m.

    Attributes:
        scene: path of a scene file, or the name of one in scenes/.
        out: file of the drawing, .png, .pdf or .svg (default: results/check/ and the scene's name, .png).
        table: print one table in this form, and nothing else on stdout.
        rows: which one: of cameras, of markers, or of noise models.
    """

    scene: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    out: Annotated[Path | None, FILE] = None
    table: TableForm | None = None
    rows: Literal["cameras", "markers", "models"] = "cameras"
    files: Annotated[SceneFiles, FLAT] = field(default_factory=SceneFiles)


@dataclass(frozen=True)
class Sweep:
    """Predict and measure sweeps of camera settings; the word `sweep` may be left out.

    docs/runs.md describes the files of the results' folder.

    Attributes:
        sweeps: names of files in scenes/sweeps, or paths of such files.
        scene: scene file to use in place of the sweeps' own.
        out: folder for the results (default: results/ and the sweeps' names).
        trials: noisy captures of each view, in place of the sweeps' own number.
        seed: of the run, in place of the sweeps' own.
        report: write report.html, which shows the run in a browser, and its scene as glTF.
    """

    sweeps: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SWEEP…")]
    scene: Annotated[Path | None, FILE] = None
    out: Annotated[Path | None, DIR] = None
    trials: Annotated[int | None, N] = None
    seed: Annotated[int | None, N] = None
    detector: Detectors = ()
    report: bool = True
    run: Annotated[StepOptions, FLAT] = field(default_factory=StepOptions)


@dataclass(frozen=True)
class Measure:
    """Measure a scene as it is: the error of each marker in mm, beside what each noise model predicts.

    A sweep of one step: views, measurements and tables are those of sweeps, and shared with them.

    Attributes:
        scene: path of a scene file, or the name of one in scenes/.
        cameras: names of the cameras that take part (default: all of the scene).
        out: folder for the results (default: results/measure/ and the scene's name).
        trials: noisy captures of each view (default: 20).
        seed: of the run (default: 2011, as the project's sweeps have).
        report: write report.html, which shows the run in a browser, and its scene as glTF.
    """

    scene: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    cameras: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME…")] = ()
    out: Annotated[Path | None, DIR] = None
    trials: Annotated[int | None, N] = None
    seed: Annotated[int | None, N] = None
    detector: Detectors = ()
    report: bool = True
    run: Annotated[RunOptions, FLAT] = field(default_factory=RunOptions)


@dataclass(frozen=True)
class Compare:
    """Set the tables of two or more runs side by side, with differences from the first and 95 % intervals.

    A RUN is a folder of results, or some of its rows: results/zoom@noise_model=physical, results/bank@metric=pss.
    Ratios and differences have intervals as of independent runs: too wide, if runs share markers or seeds.

    Attributes:
        runs: results of runs; the first is what the others are compared with.
        rows: what is compared (default: what differs in the settings, what was measured, and the correlations).
        table: print one table in this form, with all its rows, and nothing else (default of --rows: measured).
        out: the page (default: results/compare/compare.html, which --rows and --table leave as it is).
        report: write the page, which shows the comparison in a browser.
    """

    runs: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN…")]
    rows: (
        Literal["settings", "measured", "predicted", "correlation", "leaderboard", "agreement", "strategies", "slopes"]
        | None
    ) = None
    table: TableForm | None = None
    out: Annotated[Path | None, FILE] = None
    report: bool = True


@dataclass(frozen=True)
class Figures:
    """Draw the paper's figures from our own runs: 1 zoom, 2 focus, 3 camera selection, 4 two people in a hallway.

    Each as PDF and SVG, 7 inches wide. What is not in the store is rendered: eight to ten minutes for Figures 1 to 3,
    half an hour for Figure 4.

    Attributes:
        figures: which.
        out: folder for the files.
        table: also write the numbers of each figure's curves as a table in this form.
        dry_run: print how many views are missing, and stop.
    """

    figures: Annotated[tuple[int, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FIGURE…")] = (1, 2, 3, 4)
    out: Annotated[Path, DIR] = Path("results/figures")
    table: TableForm | None = None
    dry_run: bool = False
    rendering: Annotated[Rendering, FLAT] = field(default_factory=Rendering)


@dataclass(frozen=True)
class Schedule:
    """Predict and measure how strategies steer cameras at two people who pass each other.

    Exit codes are those of sweeps (--help, docs/runs.md).

    Attributes:
        schedule: name of a file in scenes/schedules, or the path of such a file.
        scene: scene file to use in place of the schedule's own.
        out: folder for the results (default: results/ and the schedule's name).
        trials: noisy captures of each view, in place of the schedule's own number.
        seed: of the run, in place of the schedule's own.
        strategy: a strategy of one's own beside the schedule's: a Python file, which is run, and a function in it.
        real_walk: whether to render and track the walk frame by frame as well, if the schedule asks for it.
        report: write report.html, which shows the run in a browser and plays it, and its scene as glTF.
    """

    schedule: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCHEDULE")] = "hallway"
    scene: Annotated[Path | None, FILE] = None
    out: Annotated[Path | None, DIR] = None
    trials: int | None = None
    seed: int | None = None
    strategy: Annotated[tuple[str, ...], REPEATED, STRATEGY] = ()
    real_walk: bool = True
    report: bool = True
    run: Annotated[StepOptions, FLAT] = field(default_factory=StepOptions)


@dataclass(frozen=True)
class Bank:
    """Judge all metrics and noise models on configurations drawn from a bank of views.

    Exit codes are those of sweeps (--help, docs/runs.md).

    Attributes:
        scene: scene file (default: the room).
        second_scene: another room, in which the calibration is judged without refitting (default: the atrium; with
            --calibration or --set: none).
        calibration: judge with this calibration as it is ("calibrated" for the shipped one); no training views are
            rendered and nothing is fitted.
        out: folder for the results.
        configurations: of each of 2, 3, 4 and 6 cameras.
    """

    scene: Annotated[Path | None, FILE] = None
    second_scene: Annotated[Path | None, FILE] = None
    calibration: Annotated[Path | None, FILE] = None
    out: Annotated[Path, DIR] = Path("results/bank")
    configurations: int = 500
    views: Annotated[BankViews, FLAT] = field(default_factory=BankViews)
    run: Annotated[RunOptions, FLAT] = field(default_factory=RunOptions)


@dataclass(frozen=True)
class CalibrationError:
    """Rank configurations of four cameras whose pan, tilt, focal length and place are off by unknown errors.

    It shares its views with `bank`, whose options these are; with another scene or other options it renders its own.

    Attributes:
        scene: scene file (default: the room).
        out: folder for the results.
        configurations: of four cameras.
    """

    scene: Annotated[Path | None, FILE] = None
    out: Annotated[Path, DIR] = Path("results/calibration-error")
    configurations: int = 200
    views: Annotated[BankViews, FLAT] = field(default_factory=BankViews)
    allow_outside: AllowOutside = False
    rendering: Annotated[Rendering, FLAT] = field(default_factory=Rendering)
    scale: Annotated[Scale, FLAT] = HERE


@dataclass(frozen=True)
class PixelNoise:
    """Measure bias and σ of a marker's centre against blur, size, incidence and signal; see docs/pixel-noise.md.

    Attributes:
        out: folder for the results.
        seed: of poses, combinations and noise.
        trials: noisy captures of each render (default: 20; with --quick 6).
        quick: few levels and poses, to see that all works.
    """

    out: Annotated[Path, DIR] = Path("results/pixel-noise")
    store: StoreFolder = STORE
    seed: Annotated[int, N] = 0
    trials: Annotated[int | None, N] = None
    quick: bool = False


@dataclass(frozen=True)
class Report:
    """Make report.html and scene.glb of a finished run again, from its CSV files and the store.

    Of what the folder's run.json names, sweeps and scenes of the project, files in the folder and results/store are
    used. All else is passed anew: the folder may come from elsewhere.

    Attributes:
        folder: results of a run of sweeps or of a schedule.
        store: folder of rendered views and measurements, or an address.
        scene: scene file that was given to the run in place of the sweeps' own.
        file: sweep or schedule file of one's own that was given to the run; may be repeated.
        strategy: a schedule's strategies of one's own, as they were given to it: their files are run.
        allow_outside: let the folder and files name others outside (see "Files from others" in docs/scenes.md).
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    store: Annotated[str | None, DIR] = None
    scene: Annotated[Path | None, FILE] = None
    file: Annotated[tuple[Path, ...], REPEATED, FILE] = ()
    strategy: Annotated[tuple[str, ...], REPEATED, STRATEGY] = ()
    allow_outside: bool = False


@dataclass(frozen=True)
class StoreList:
    """Report how many files and bytes there are of each kind and code that made them, and how old they are."""


@dataclass(frozen=True)
class StoreVerify:
    """Read every file and compare it with its checksum. Exit code 1 if any is damaged; those are set aside."""


@dataclass(frozen=True)
class StorePrune:
    """Report what would be removed, or remove it with --yes. What is younger than an hour always stays.

    Several options together remove only what meets them all. Temporary files older than a day go in any case.

    Attributes:
        older_than: age, such as 30d or 12h.
        keep_below: size of all that stays, such as 20GB; the oldest goes first.
        unused_by: results of runs: views and measurements that none of them uses.
        stale: what other code or other versions of libraries made, so that no run of this installation uses it.
        yes: remove it.
    """

    older_than: Annotated[str | None, tyro.conf.arg(metavar="AGE")] = None
    keep_below: Annotated[str | None, tyro.conf.arg(metavar="SIZE")] = None
    unused_by: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="RUN")] = ()
    stale: bool = False
    yes: bool = False


@dataclass(frozen=True)
class StoreCode:
    """Print which modules and libraries the names of stored files cover; a change in one of them makes new files."""


@dataclass(frozen=True)
class Store:
    """List, check and prune what is stored.

    Attributes:
        store: folder of rendered views and measurements; of an address, what is on this machine.
    """

    action: tyro.conf.OmitArgPrefixes[
        Annotated[StoreList, tyro.conf.subcommand("list", prefix_name=False)]
        | Annotated[StoreVerify, tyro.conf.subcommand("verify", prefix_name=False)]
        | Annotated[StorePrune, tyro.conf.subcommand("prune", prefix_name=False)]
        | Annotated[StoreCode, tyro.conf.subcommand("code", prefix_name=False)]
    ]
    store: Annotated[str, DIR, tyro.conf.CascadeSubcommandArgs] = STORE


SUBCOMMANDS: dict[str, type] = {
    "new-scene": NewScene,
    "check": Check,
    "sweep": Sweep,
    "measure": Measure,
    "compare": Compare,
    "figures": Figures,
    "schedule": Schedule,
    "bank": Bank,
    "calibration-error": CalibrationError,
    "pixel-noise": PixelNoise,
    "report": Report,
    "store": Store,
}
"""The options of each command, by its word on the command line, in the order of the help."""
