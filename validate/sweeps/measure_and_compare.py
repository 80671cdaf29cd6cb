"""Measure cameras of a scene as they are, and compare a prediction with what was measured."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pss import Evaluation, PSSError, PTZCamera, RangeError, ShapeError
from pss.hints import Floats, Integers, Row
from pss.inputs import having, members, number
from scenes import Scene
from scenes.steps.measurement import measurement_of
from validate.acquire.messages import RunMessages
from validate.acquire.source import open_source
from validate.markers.detector_table import DEFAULT_DETECTOR, detector_called
from validate.points.configuration import Measured
from validate.runs.console import Console
from validate.stats.measured_errors import MeasuredErrors, check_trials
from validate.sweeps.plan_and_assess import assessed, planned, requested_views
from validate.sweeps.single_step import comparison_row
from validate.sweeps.single_step_summary import error_line, ratio_table
from validate.sweeps.sweep import SweepResult

__all__ = ["Comparison", "FailedViewError", "Measurement", "compare", "measure"]

# m, by which a scene that was saved and loaded may be another.
SAME_POINT_M = 1e-9
# Columns of a table that is printed as text.
WIDTH = 120


class FailedViewError(PSSError, RuntimeError):
    """A view could not be rendered or measured."""


@dataclass(frozen=True, eq=False, repr=False)
class Measurement:
    """Measurements of N markers in the images of C cameras over T trials.

    Attributes:
        result: a sweep of one step, with plan, views, predictions and resamples.
    """

    result: SweepResult

    @property
    def scene(self) -> Scene:
        """As it was measured: an exposure of "auto" is a number here."""
        return self.result.configurations[0].scene

    @property
    def cameras(self) -> tuple[PTZCamera, ...]:
        """C, in the order in which they were given."""
        return self.result.assessments[0].cameras

    @property
    def measured(self) -> Measured:
        """Triangulated and tracked points of all trials, with their errors."""
        return self.result.assessments[0].measured

    @property
    def errors(self) -> MeasuredErrors:
        """Errors of single-frame triangulation: `errors_m` (T, N, 3), `rms_m` (N,), `detection_rate` (N,) and more."""
        return self.measured.errors

    @property
    def ids(self) -> tuple[int, ...]:
        """N, numbers of the markers, in the order of all arrays."""
        return tuple(marker.id for marker in self.scene.state.markers)

    @property
    def view_detection_rate(self) -> Floats:
        """(C, N), share of the trials in which each camera detected each marker."""
        return self.result.assessments[0].view_detection_rate

    @property
    def views(self) -> Integers:
        """(T, N), number of views each point was triangulated from; 0 where it was not."""
        return self.measured.triangulated.views

    @property
    def pss_single_frame(self) -> float:
        """1/m, measured PSS of the single-frame kind: beside `pss.Evaluation.pss_single_frame`."""
        return self.errors.pss()

    @property
    def pss_filter(self) -> float:
        """1/m, measured PSS of the filter kind: beside `pss.Evaluation.pss`."""
        return self.measured.pss_filter

    def __repr__(self) -> str:
        """How large the errors are, in one sentence."""
        return error_line(self.result)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Predicted against measured PSS: `print` shows it as a table.

    Attributes:
        name: of the scene.
        rows: one for each noise model and kind of PSS, with the columns of `measurement.csv`: predicted and measured
            PSS in 1/m, their ratio (measured over predicted) and NEES/3, each with its 95 % interval.
    """

    name: str
    rows: tuple[Row, ...]

    def __str__(self) -> str:
        """The table as text."""
        text = io.StringIO()
        # Not as HTML, which the base class shows by itself in a notebook.
        Console(file=text, width=WIDTH, force_jupyter=False, force_terminal=False).print(
            ratio_table(self.name, self.rows)
        )
        return text.getvalue().rstrip("\n")

    __repr__ = __str__


def measure(
    scene: Scene,
    cameras: Sequence[PTZCamera],
    trials: int = 10,
    seed: int = 1,
    store: str | Path = "results/store",
    *,
    variant: str | None = None,
    quiet: bool = True,
    detector: str = DEFAULT_DETECTOR,
) -> Measurement:
    """Measure the error of the scene's markers: render, capture, detect, triangulate and track.

    The same as the command `run_sweep.py measure`: views and measurements that the store has are taken from it; the
    rest is made by all cores, 2 to 20 s a view, and stored.

    Args:
        scene: as it stands while it is measured; an exposure of "auto" is chosen for these cameras.
        cameras: one or more with different names, the scene's own or others.
        trials: noisy captures of each view, 2 or more.
        seed: of all random numbers, 0 or more.
        store: folder of rendered views and measurements, or an address that fsspec supports.
        variant: Mitsuba's variant; None for LLVM if there is a libLLVM, else scalar.
        quiet: whether no progress is printed.
        detector: name of the one that measures the views (docs/own-detector.md).

    Raises:
        RangeError: no camera, a name twice, no such detector, or a number that is not allowed.
        StoreError: the store cannot be used, or the disk is full.
        FailedViewError: a view could not be rendered or measured; the line has its camera and the cause.
    """
    having(scene, "state", "scene", "a scene, such as scenes.load returns")
    cameras = members(cameras, "cameras", "focal_px", "cameras, such as scene.select returns")
    names = [camera.name for camera in cameras]
    if not names or len(set(names)) < len(names):
        raise RangeError(f"cameras {', '.join(names) or '()'}; allowed: one or more, each name once")
    check_trials(trials, f"trials = {trials}")
    if number(seed, "seed") < 0:
        raise RangeError(f"seed = {seed}; allowed: 0 or more")
    detector_called(detector)
    given = scene.replace(cameras=tuple(cameras))
    sweep = measurement_of(given, names, [f"sweep.trials={trials}", f"sweep.seed={seed}"])
    with RunMessages(quiet) as messages:
        source = open_source(str(store), variant, messages)
        plans = planned([(sweep, given)], source, detector=detector)
        requested = requested_views(plans)
        acquired = source.acquire(requested)
    for item in requested:
        if item.request.key in acquired.failed:
            cause = acquired.failed[item.request.key]
            raise FailedViewError(f"camera {item.request.camera.name}: {cause}; allowed: a view that can be made")
    (result,) = assessed(plans, acquired)
    return Measurement(result)


def compare(predicted: Mapping[str, Evaluation], measured: Measurement) -> Comparison:
    """Set predictions beside a measurement of the same points: PSS, ratio and NEES.

    The numbers are those of `measurement.csv`: a ratio's interval is over resampled trials and points (the Bayesian
    bootstrap of `validate.stats.intervals`); NEES is the mean of eᵀC⁻¹e over the trials, 3 where C is right.

    Args:
        predicted: by name, such as `validate.predict` returns, or of models of your own.
        measured: of the same cameras and points.

    Raises:
        ShapeError: a prediction is of another number of points or cameras.
        RangeError: it is of other points, or of cameras with other names or in another order.
    """
    points, names = len(measured.ids), [camera.name for camera in measured.cameras]
    points_m = measured.scene.state.points_m
    for name, evaluation in predicted.items():
        if evaluation.visible.shape != (len(measured.cameras), points):
            raise ShapeError(
                f"prediction {name!r} is of {evaluation.visible.shape}; allowed: (cameras, points) = "
                f"{(len(measured.cameras), points)}, as measured"
            )
        of_prediction = [camera.name for camera in evaluation.cameras]
        if of_prediction != names:
            raise RangeError(
                f"prediction {name!r} is of cameras {', '.join(of_prediction)}; "
                f"allowed: {', '.join(names)}, as measured"
            )
        if not np.allclose(evaluation.task.points_m, points_m, rtol=0, atol=SAME_POINT_M):
            raise RangeError(f"prediction {name!r} is of other points; allowed: the markers' centres, as measured")
    result = measured.result
    # Trials and points are resampled with the same weights for every model.
    replicates = next(iter(result.replicates.values()))
    sweep_name = result.plan.sweep.name
    return Comparison(
        sweep_name,
        tuple(
            comparison_row(sweep_name, name, evaluation, measured.measured, replicates, single_frame)
            for name, evaluation in predicted.items()
            for single_frame in (True, False)
        ),
    )
