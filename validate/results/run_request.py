"""What is requested of a run of sweeps: files, overrides, and where views and results are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pss import RangeError
from pss.inputs import number
from scenes import Scene, SweepFile, known_sweeps
from scenes.reading.document import SWEEP_PREFIX
from validate.acquire.options import HERE, Scale
from validate.markers.detector_table import DEFAULT_DETECTOR, detector_called
from validate.runs.file_names import check_default_folder, check_names, sweep_name
from validate.runs.input_files import load_measurement_of, load_sweeps
from validate.runs.outputs import check_folders
from validate.stats.measured_errors import check_trials

__all__ = ["RunRequest"]


@dataclass(frozen=True)
class RunRequest:
    """A run of sweeps, as the command line or `validate.sweep` names it; recorded in run.json as its options."""

    sweeps: tuple[str, ...]
    scene: Path | None = None
    out: Path | None = None
    store: str = "results/store"
    trials: int | None = None
    seed: int | None = None
    set: tuple[str, ...] = ()
    variant: str | None = None
    dry_run: bool = False
    allow_outside: bool = False
    quiet: bool = False
    scale: Scale = HERE
    report: bool = True
    cameras: tuple[str, ...] | None = None
    """Of `scene`, which is measured as it is, without sweeps: those that take part, all if there are none."""
    detector: str = DEFAULT_DETECTOR
    """Name of the one that measures the views."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the sweeps, or of the scene that is measured."""
        if self.cameras is None:
            return tuple(map(sweep_name, self.sweeps))
        return (sweep_name(str(self.scene)),)

    @property
    def folder(self) -> Path:
        """Where the results go: those of other detectors than the default below its folder."""
        own = Path("results") / ("-".join(self.names) if self.cameras is None else f"measure/{self.names[0]}")
        folder = self.out or own
        return folder if self.detector == DEFAULT_DETECTOR else folder / "detectors" / self.detector

    @property
    def overrides(self) -> tuple[str, ...]:
        """All that is to be changed in the files."""
        given = {"trials": self.trials, "seed": self.seed}
        return (*self.set, *(f"sweep.{key}={value}" for key, value in given.items() if value is not None))

    def check(self) -> None:
        """Refuse what is wrong before any file is read.

        Raises:
            RangeError: no sweep, one twice, no such detector, or a number that is not allowed.
            MissingLibraryError: workers are requested, and Dask is missing.
        """
        if not self.sweeps and self.cameras is None:
            raise RangeError(f"no sweep given; allowed: {', '.join(known_sweeps())}, or the paths of .toml files")
        if self.trials is not None:
            check_trials(self.trials, f"--trials {self.trials}")
        if self.seed is not None and number(self.seed, "seed") < 0:
            raise RangeError(f"--seed {self.seed}; allowed: 0 or more")
        detector_called(self.detector)
        check_names(self.names)
        self.scale.check()

    def check_folder(self) -> None:
        """Refuse a folder of results that the run could not write, before it takes its time.

        Raises:
            RangeError: no folder was given, and the sweeps' own is another command's.
            StoreError: the folder cannot be written, or a file is in the way.
        """
        if self.out is None and self.cameras is None:
            check_default_folder(self.names, self.folder)
        check_folders(self.folder, self.store)

    def load(self, scene: Scene | None = None) -> list[tuple[SweepFile, Scene]]:
        """The sweeps with their scenes, or the scene that is measured, as a sweep of one step.

        Args:
            scene: of all sweeps, in place of a file.

        Raises:
            RangeError: an override of a scene file, where there is none.
            SceneError: with every problem of all files, a line each.
        """
        if self.cameras is None:
            for each in self.overrides if scene is not None else ():
                if not each.strip().startswith(SWEEP_PREFIX):
                    raise RangeError(f"override {each!r}; allowed with a scene object: {SWEEP_PREFIX}KEY=VALUE")
            return load_sweeps(self.sweeps, scene or self.scene, self.overrides, self.allow_outside)
        assert self.scene is not None
        return [load_measurement_of(self.scene, self.cameras, self.overrides, self.allow_outside)]
