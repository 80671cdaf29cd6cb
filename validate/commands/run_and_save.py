"""Run sweeps, or a scene as it is, for the commands: save the result, print it, and return the exit code."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pss import RangeError
from validate.acquire.forecast import announce
from validate.acquire.messages import RunMessages
from validate.acquire.source import end_run, open_source, warn_of_quality
from validate.commands.subcommands import Measure, Sweep
from validate.markers.detector_table import DEFAULT_DETECTOR
from validate.prediction.own_metrics import failures_of
from validate.results.compute import compute
from validate.results.run_request import RunRequest
from validate.runs.exit_codes import EXIT_DONE
from validate.runs.progress import clock
from validate.sweeps import summary
from validate.sweeps.plan_and_assess import planned, requested_views
from validate.sweeps.step_names import names_in_steps

__all__ = ["execute", "run"]


def run(
    options: Sweep | Measure, sweeps: tuple[str, ...], scene: Path | None, cameras: tuple[str, ...] | None = None
) -> int:
    """What a command's options request of these sweeps, or of these cameras of a scene; the exit code.

    Raises:
        PSSError: the user's mistake.
    """
    shared = options.run
    request = RunRequest(
        sweeps,
        scene,
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
        cameras,
    )
    return _execute_each(request, options.detector)


def _execute_each(request: RunRequest, detectors: Sequence[str]) -> int:
    """Run a request with each of the detectors, or with the default where none is named; the largest exit code.

    The first one renders what is missing; the others find its views in the store.

    Raises:
        PSSError: the user's mistake; all requests are checked before the first begins.
    """
    names = tuple(detectors) or (DEFAULT_DETECTOR,)
    if len(set(names)) < len(names):
        raise RangeError(f"--detector {' '.join(names)}; allowed: each once")
    requests = [replace(request, detector=name) for name in names]
    for each in requests:
        each.check()
    codes = []
    for each in requests:
        with RunMessages(request.quiet) as messages:
            codes.append(execute(each, messages))
    return max(codes)


def execute(request: RunRequest, messages: RunMessages) -> int:
    """Compute, save and print; the exit code.

    Raises:
        PSSError: the user's mistake; nothing was rendered yet.
    """
    began = time.perf_counter()
    request.check()
    request.check_folder()
    loaded = request.load()
    source = open_source(request.store, request.variant, messages, request.scale)
    if request.dry_run:
        plans = planned(loaded, source, forecast=True, detector=request.detector)
        counts = [f"{each.sweep.name}: {len(each.configurations)} configurations" for each in plans]
        announce(counts, requested_views(plans), source, request.folder)
        return EXIT_DONE
    command = "sweeps" if request.cameras is None else "measure"
    messages.start(request.folder, command, sweeps=request.names, store=request.store)
    result = compute(request, loaded, source, began)
    seconds, acquired = result.write(request), result.acquired
    scores = [each for of_sweep in result.sweeps for of_model in of_sweep.own_scores.values() for each in of_model]
    for line in failures_of(scores):
        messages.warn(line)
    summary.show(result.sweeps, acquired, messages.console)
    names = names_in_steps([each.plan for each in result.sweeps])
    warn_of_quality(result.requested, acquired, messages, names)
    messages.failed(acquired.failed, names)
    for each in result.sweeps:
        for label, cause in each.skipped:
            messages.left_out(f"{each.plan.sweep.name} {label}: left out, a view failed ({cause})")
    return end_run(
        f"{len({item.request.key for item in result.requested})} views ({acquired.rendered} rendered, "
        f"{len(acquired.measured_items)} measured now) in {clock(seconds)}; results in {request.folder}",
        acquired,
        messages,
    )
