"""Forecast of a run without rendering anything: what it would do, its time and its disk space.

Seconds and bytes are those of the store's own newest views, light and measurements, from their checksum files (those of
older versions do not); else those of two cores, which the benchmarks state, by the pixels of each view
(`validate.acquire.view_costs`); so is the memory. Files are looked up by name, and no image is opened.
"""

from __future__ import annotations

import heapq
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from render.keys import light_key
from render.store.atomic import free_bytes
from render.store.checksums import SUFFIX, FileSum, read_sums
from render.store.folder import Store
from scenes import Scene, SweepFile
from validate.acquire.acquire import Acquisition
from validate.acquire.auto_exposure import with_exposures
from validate.acquire.options import HERE, Scale
from validate.acquire.source import ViewSource
from validate.acquire.view_costs import machine_bytes, measure_bytes, measure_seconds, render_bytes, render_seconds
from validate.runs.progress import EXPECTED_LIGHT_SECONDS, clock

__all__ = ["Forecast", "announce", "exposures_assumed", "forecast"]

# Of each kind of file, the seconds of so many of the newest are read: more would only take time.
MOST_PAST_VIEWS = 200
# Views, light or measurements below which the benchmarks are a better estimate than their mean.
LEAST_KNOWN = 5
# Of a view, as the store's are: 9.0 MB on average at 1280 × 960.
VIEW_BYTES_A_PIXEL = 7.4
# Of the store's files, in the median; both are small beside a view.
LIGHT_BYTES, MEASUREMENT_BYTES = 1_000_000, 7_000


@dataclass(frozen=True)
class Forecast:
    """What a run would do.

    Attributes:
        views: different images that are requested.
        rendered, measured: images and measurements that the store has.
        to_render, to_measure, to_light: what it has not; light is solved once for each scene state.
        seconds: s, all of it, without tables and figures.
        needed_bytes: of what would be added to the store.
        past_views: past views whose seconds were taken; 0 where the benchmarks' were.
        render_bytes, measure_bytes: peak memory of a process that renders, and of one that measures, the largest of
            what is missing; 0 where nothing is.
    """

    views: int
    rendered: int
    measured: int
    to_render: int
    to_measure: int
    to_light: int
    seconds: float
    needed_bytes: int
    past_views: int
    render_bytes: int = 0
    measure_bytes: int = 0


def forecast(requested: Sequence[Acquisition], store: Store, renderer: str, workers: int) -> Forecast:
    """Count what is missing, and reckon how long it takes.

    Args:
        renderer: identity of what would render; past views of another one do not count.
        workers: processes that measure.
    """
    unique = list(dict.fromkeys(requested))
    images = {item.request.key: item for item in unique}
    to_render = [item for key, item in images.items() if not store.has(store.view(key))]
    missing = {item.request.key for item in to_render}
    to_measure = [item for item in unique if not store.has(item.task(store).path)]
    lights = dict.fromkeys(light_key(item.request.state) for item in unique)
    to_light = [key for key in lights if not store.has(store.light(key))]

    needed, past_views, render_s, measure_s = 0.0, 0, 0.0, 0.0
    views = [known for known in _newest(store.folder / "views") if known.facts.get("renderer") == renderer]
    for item in to_render:
        alike = _alike(views, item)
        past_views = max(past_views, len(alike))
        expected_s = render_seconds(_pixels(item), item.request.sampling.noise_ratio)
        render_s += _mean([_seconds(known) for known in alike], expected_s)
        needed += _mean([known.size_bytes for known in alike], VIEW_BYTES_A_PIXEL * _pixels(item))
    measurements = _newest(store.folder / "measurements")
    # What is measured while others are rendered holds nothing up; what is rendered already is all that is left to do.
    afterwards_s = 0.0
    for item in to_measure:
        alike = [known for known in _alike(measurements, item) if known.facts.get("trials")]
        rates = [_seconds(known) / known.facts["trials"] for known in alike]
        of_item = item.trials * _mean(rates, measure_seconds(_pixels(item)))
        measure_s += of_item
        afterwards_s += 0.0 if item.request.key in missing else of_item
    light_s = _mean([_seconds(known) for known in _newest(store.folder / "light")], EXPECTED_LIGHT_SECONDS)
    needed += LIGHT_BYTES * len(to_light) + MEASUREMENT_BYTES * len(to_measure)
    return Forecast(
        views=len(images),
        rendered=len(images) - len(to_render),
        measured=len(unique) - len(to_measure),
        to_render=len(to_render),
        to_measure=len(to_measure),
        to_light=len(to_light),
        seconds=light_s * len(to_light) + max(render_s + afterwards_s / workers, measure_s / workers),
        needed_bytes=round(needed),
        past_views=past_views,
        render_bytes=round(max((render_bytes(_pixels(item)) for item in to_render), default=0)),
        measure_bytes=round(max((measure_bytes(_pixels(item)) for item in to_measure), default=0)),
    )


def announce(
    counts: Sequence[str],
    requested: Sequence[Acquisition],
    source: ViewSource,
    folder: Path,
) -> Forecast:
    """Print what a run would do, and warn if the disk has no room for it.

    Args:
        counts: lines with the numbers of configurations, or of runs and steps.
        source: of the views. The time is that of this machine alone, wherever views would be made.
        folder: of the results.
    """
    store, chosen, scale, messages = source.store, source.backend, source.scale, source.messages
    workers = max(1, os.cpu_count() or 1)
    made_by = f"{workers} measuring processes"
    if scale != HERE:
        made_by = f"the workers of {scale.cluster}" if scale.cluster else f"{scale.workers} workers"
    estimate = forecast(requested, store, chosen.identity, workers)
    free = free_bytes(store.folder / "views")
    past = estimate.past_views
    rates = f"as {past} past views of this store" if past else "at the rates of two cores (docs/runs.md)"
    here = "" if source.address == str(store.folder) else f", on this machine {store.folder}"
    memory = _memory(estimate, scale, workers)
    library = f", {chosen.libllvm}" if chosen.libllvm else ""
    to_render = f"{estimate.to_render} to render ({estimate.rendered} stored)"
    to_measure = f"{estimate.to_measure} to measure ({estimate.measured} stored)"
    to_light = f"light of {estimate.to_light} scene states to solve"
    lines = [
        *counts,
        f"{estimate.views} views: {to_render}, {to_measure}; {to_light}",
        f"about {clock(estimate.seconds)} and {_megabytes(estimate.needed_bytes)}, {rates}"
        if estimate.seconds
        else "nothing to do",
        *([memory.line] if estimate.seconds else []),
        f"{chosen.identity}{library}; {made_by}",
        f"store {source.address}{here}: {_megabytes(free)} free; results would be in {folder}",
    ]
    for line in lines:
        messages.console.print(line, markup=False, soft_wrap=True)
    if estimate.needed_bytes > free:
        messages.errors.print(
            f"the disk is too small: {_megabytes(estimate.needed_bytes)} would be added to {store.folder}, "
            f"{_megabytes(free)} are free",
            style="red",
            markup=False,
            soft_wrap=True,
        )
    if memory.machine_bytes and memory.together_bytes > memory.machine_bytes:
        messages.errors.print(
            f"memory is too small: about {_gigabytes(memory.together_bytes)} would be needed at once, this machine has "
            f"{_gigabytes(memory.machine_bytes)}; a smaller sensor.resolution_px needs less",
            style="red",
            soft_wrap=True,
        )
    return estimate


@dataclass(frozen=True)
class _Memory:
    """Bytes of memory: what a run would need at once on this machine, what that has (0: unknown), and both in words."""

    together_bytes: int
    machine_bytes: int
    line: str


def _memory(estimate: Forecast, scale: Scale, processes: int) -> _Memory:
    render, measure, machine = estimate.render_bytes, estimate.measure_bytes, machine_bytes()
    if scale == HERE:
        workers = min(processes, estimate.to_measure)
        together = render + workers * measure
        parts = [f"{_gigabytes(render)} to render"] if render else []
        parts += [f"{_gigabytes(measure)} for each of {workers} measuring processes"] if measure else []
        words = " and ".join(parts)
    else:  # a worker renders a view, then measures it
        each = max(render, measure)
        together = 0 if scale.cluster else each * (scale.workers or 1)
        words = f"{_gigabytes(each)} for each worker"
    here = f"; this machine has {_gigabytes(machine)}" if machine and not scale.cluster else ""
    return _Memory(together, machine, f"memory: about {words}{here}")


def exposures_assumed(loaded: Sequence[tuple[SweepFile, Scene]], source: ViewSource) -> list[tuple[SweepFile, Scene]]:
    """The same sweeps with exposures of "auto" chosen, as far as the light is solved already.

    Where it is not, the longest exposure stands in: the views have no names yet, and all of them count as missing.
    """
    found = []
    store, messages = source.store, source.messages
    for sweep, scene in loaded:
        if scene.auto_exposure is None or store.has(store.light(light_key(scene.state))):
            found.append((sweep, scene))
            continue
        messages.note(
            f"{scene.path.name}: the exposure is chosen by light that is not solved yet; all views count as missing"
        )
        found.append((sweep, scene.with_exposure(scene.auto_exposure.longest_ms)))
    return with_exposures(
        found,
        store,
        lambda line: messages.console.print(line, markup=False, soft_wrap=True),
        messages.note,
        source.backend,
    )


def _newest(folder: Path) -> list[FileSum]:
    """The records of the newest files of a folder that have the seconds they took."""
    found = heapq.nlargest(MOST_PAST_VIEWS, _sums_of(folder))
    known = [(read_sums(Path(path.removesuffix(SUFFIX))) or [None])[-1] for _, path in found]
    return [each for each in known if each is not None and "seconds" in each.facts]


def _sums_of(folder: Path) -> Iterator[tuple[int, str]]:
    """Time of change in ns, and path, of the sums in a folder and its folders."""
    try:
        entries = list(os.scandir(folder))
    except OSError:
        return
    for entry in entries:
        try:
            if entry.is_dir():
                yield from _sums_of(Path(entry.path))
            elif entry.name.endswith(SUFFIX):
                yield entry.stat().st_mtime_ns, entry.path
        except FileNotFoundError:  # pruned meanwhile
            continue


def _alike(known: Sequence[FileSum], item: Acquisition) -> list[FileSum]:
    """Those of as many pixels; none if they are too few for a mean."""
    found = [each for each in known if each.facts.get("pixels") == _pixels(item)]
    return found if len(found) >= LEAST_KNOWN else []


def _pixels(item: Acquisition) -> int:
    width, height = item.request.camera.resolution
    return width * height


def _seconds(known: FileSum) -> float:
    return float(known.facts["seconds"])


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise


def _gigabytes(size_bytes: int) -> str:
    return f"{size_bytes / 1e9:,.1f} GB"


def _megabytes(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:,.0f} MB"
