"""Views by worker processes beside one process: `python benchmarks/scale.py [--pairs N] [--workers N] [--sweep NAME]`.

Seconds of the views of one sweep, made in one process and by workers in turns, each from nothing but the solved light;
the ratio of the shortest, and of each pair. Before it, what a job costs that does nothing: processor time of client and
scheduler together, and seconds from one job to the next, with and without a scene of meshes sent along.
"""

from __future__ import annotations

import json
import os
import pickle
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import tyro

import scenes
from render import backend
from render.store.folder import Store
from render.store.light import baked
from scenes import load_sweep
from scenes.steps.sweep_file import SWEEPS
from validate.acquire import dask_workers
from validate.acquire.job import Job, Made, Place
from validate.acquire.options import Scale

ROOT = Path(__file__).resolve().parents[1]
JOBS = 500
JOBS_WITH_A_STATE = 50


def nothing(job: bytes, state: bytes | None) -> Made:
    """In the place of a real job."""
    return Made()


def job_costs(number: int) -> str:
    """What jobs cost that do nothing, on `number` workers, in lines."""
    dask_workers.call = nothing
    chosen = backend.choose()
    job = Job(Place("store", chosen.variant, chosen.identity, 1), "state", "view")
    scene = pickle.dumps(scenes.load(SWEEPS.parent / "hallway.toml").state)
    lines = []
    with dask_workers.workers_of(Scale(workers=number)) as workers:
        for count, state in ((JOBS, None), (JOBS_WITH_A_STATE, scene)):
            begin, used, left = time.perf_counter(), time.process_time(), count
            while left or workers.busy():
                for address in sorted(workers.live() - workers.busy())[:left]:
                    workers.start(address, job, state)
                    left -= 1
                for _, _, made in workers.finished(1):
                    assert isinstance(made, Made), made
            wall, used = time.perf_counter() - begin, time.process_time() - used
            sent = f"{len(state) / 1e6:.2f} MB of scene state" if state else "no scene state"
            lines.append(
                f"{count} jobs with {sent} on {number} workers: {1e3 * used / count:.2f} ms of processor "
                f"time of client and scheduler a job, {1e3 * wall / count:.2f} ms from job to job"
            )
    return "\n".join(lines)


def view_seconds(folder: Path, lit: Path, name: str, sweep: str, *arguments: str) -> tuple[float, float, int]:
    """Seconds that a run spends on views, of all cores in the whole run, and the bytes stored, from stored light on."""
    store, out = folder / f"store-{name}", folder / f"out-{name}"
    shutil.copytree(lit, store)
    before = stored_bytes(store)
    script = [sys.executable, str(ROOT / "validate" / "run_sweep.py"), sweep, "--store", str(store)]
    environment: dict[str, Any] = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    used = processor_seconds()
    subprocess.run([*script, "--out", str(out), *arguments], env=environment, check=True, capture_output=True)
    found = float(json.loads((out / "run.json").read_text())["seconds"]["views"])
    written = stored_bytes(store) - before
    shutil.rmtree(store)
    return found, processor_seconds() - used, written


def processor_seconds() -> float:
    """Of all processes that this one has started and that have ended, with theirs."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def stored_bytes(store: Path) -> int:
    """Bytes of all files."""
    return sum(path.stat().st_size for path in store.rglob("*") if path.is_file())


def main(
    pairs: int = 3, workers: int = 2, sweep: str = "selection", trials: int = 20, jobs_alone: bool = False
) -> None:
    """Print the figures.

    Args:
        pairs: runs of each kind.
        workers: processes beside the one.
        sweep: whose views are made.
        trials: noisy captures of each view.
        jobs_alone: leave the views out.
    """
    print(job_costs(workers), flush=True)
    if jobs_alone:
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begin = time.perf_counter()
        baked(scenes.load(load_sweep(sweep).scene_path).state, Store(folder / "lit"))
        size = stored_bytes(folder / "lit")
        print(f"light of the scene: {time.perf_counter() - begin:.1f} s, {size / 1e6:.2f} MB", flush=True)
        one, several = [], []
        for pair in range(pairs):
            more = ("--trials", str(trials))
            one.append(view_seconds(folder, folder / "lit", f"one-{pair}", sweep, *more))
            more = (*more, "--workers", str(workers))
            several.append(view_seconds(folder, folder / "lit", f"several-{pair}", sweep, *more))
            print(compared(f"{sweep}, {workers} workers", one[-1], several[-1]), flush=True)
        shortest = [tuple(min(values) for values in zip(*runs, strict=True)) for runs in (one, several)]
        print(compared(f"shortest of {pairs}", *shortest))


def compared(what: str, one: tuple[float, ...], several: tuple[float, ...]) -> str:
    """Two results of `view_seconds` in a line."""
    return (
        f"{what}: {several[0]:.1f} s, one process {one[0]:.1f} s, ratio {several[0] / one[0]:.2f}; of all cores "
        f"{several[1]:.1f} s, {one[1]:.1f} s, ratio {several[1] / one[1]:.2f}; {one[2] / 1e6:.1f} MB stored"
    )


if __name__ == "__main__":
    tyro.cli(main)
