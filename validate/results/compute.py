"""Compute a run of sweeps: load, plan, acquire, assess."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from render.store.folder import StoreError
from scenes import Scene, SweepFile
from scenes.reading.document import check_overrides
from validate.acquire.messages import RunMessages
from validate.acquire.options import HERE, Scale
from validate.acquire.source import ViewSource, open_source
from validate.markers.detector_table import DEFAULT_DETECTOR
from validate.results.run_request import RunRequest
from validate.results.run_result import RunResult
from validate.sweeps.plan_and_assess import assessed, planned, requested_views

__all__ = ["compute", "sweep"]


def compute(
    request: RunRequest, loaded: Sequence[tuple[SweepFile, Scene]], source: ViewSource, began: float | None = None
) -> RunResult:
    """Plan, acquire and assess: the result of a run.

    Args:
        loaded: the sweeps of the request with their scenes.
        began: s, of `time.perf_counter`, when the run began (default: now).

    Raises:
        StoreError: the disk is full, or something is missing from a store that cannot be written.
        ScaleError: workers are requested that cannot be used.
    """
    began = time.perf_counter() if began is None else began
    plans = planned(loaded, source, detector=request.detector)
    requested = requested_views(plans)
    acquired = source.acquire(requested)
    after_views = time.perf_counter()
    results = assessed(plans, acquired)
    seconds = {"views": after_views - began, "assessment": time.perf_counter() - after_views}
    return RunResult(request, tuple(results), tuple(requested), acquired, source, seconds)


def sweep(
    *sweeps: str | Path,
    trials: int | None = None,
    store: str | Path = "results/store",
    scene: str | Path | Scene | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    variant: str | None = None,
    allow_outside: bool = False,
    quiet: bool = True,
    scale: Scale = HERE,
    detector: str = DEFAULT_DETECTOR,
) -> RunResult:
    """Predict and measure sweeps of camera settings: what the command `run_sweep.py SWEEP…` computes.

    Views that the store has are taken from there; the rest is rendered and measured, and stored.

    Args:
        sweeps: names of files in scenes/sweeps, or paths of such files.
        trials: noisy captures of each view, in place of the sweeps' own number.
        store: folder of rendered views and measurements, shared by all runs, or an address (docs/store.md).
        scene: scene, or path of a scene file, to use in place of the sweeps' own.
        overrides: "KEY=VALUE" of the scene file, or "sweep.KEY=VALUE" of the sweep file.
        seed: of the run, in place of the sweeps' own.
        variant: Mitsuba's variant (default: LLVM if a libLLVM is found, else scalar).
        allow_outside: let files name others outside their folder.
        quiet: whether no progress is printed.
        scale: where views are rendered and measured.
        detector: name of the one that measures the views (docs/own-detector.md); stored views are not rendered again.

    Raises:
        RangeError: no sweep, one twice, or a number that is not allowed.
        SceneError: with every problem of all files.
        StoreError: the store cannot be used, or the disk is full.
    """
    check_overrides(overrides)
    request = RunRequest(
        tuple(map(str, sweeps)),
        Path(scene.path if isinstance(scene, Scene) else scene) if scene is not None else None,
        None,
        str(store),
        trials,
        seed,
        tuple(overrides),
        variant,
        allow_outside=allow_outside,
        scale=scale,
        detector=detector,
    )
    request.check()
    if Path(request.store).is_file():
        raise StoreError(f"store {store} is a file; allowed is a folder")
    began, loaded = time.perf_counter(), request.load(scene if isinstance(scene, Scene) else None)
    with RunMessages(quiet) as messages:
        return compute(request, loaded, open_source(request.store, variant, messages, scale), began)
