"""What a view costs for the noise that it is asked for: `python benchmarks/rendering.py`.

Sampling by need beside plain Mitsuba and Blender's Cycles at the same noise, in focus and defocused; cost against
resolution and against the bound; peak memory of a large view. Tables in Markdown. Cycles needs an environment of its
own, `python -m venv cycles && cycles/bin/pip install bpy numpy`, and the option `--bpy-python cycles/bin/python`.
"""

from __future__ import annotations

import argparse
import dataclasses
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import scenes
from benchmarks.rendering_noise import Spent, Study, spent
from benchmarks.rendering_rivals import NOISE_HEADER, Needed, compare_cycles, compare_plain
from pss import ImageSensor, PTZCamera
from render import backend
from render.lens.sampling import Sampling
from render.renderer import Renderer
from render.store.folder import Store
from render.store.light import baked
from scenes import Scene

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("ours", "plain", "cycles", "resolution", "bound", "memory")
BOUND = 0.25
BOUNDS = (1.0, 0.5, 0.25, 0.1)
# Renders of each view that are timed for the comparison; the median counts.
TIMED = 3
# Camera 2, focused so near that the circles of confusion at the markers are 7 to 9 px wide.
NEAR_FOCUS_M = 1.25
RESOLUTIONS = ((640, 480), (1280, 960), (2592, 1944))
LARGE = RESOLUTIONS[-1]
# Rivals are slow: fewer replicates; Cycles fewer still.
RIVAL_REPLICATES, CYCLES_REPLICATES = 4, 2

# First cell, camera, sensor and bound of a row.
Case = tuple[str, PTZCamera, ImageSensor, float]


def resized(camera: PTZCamera, resolution: tuple[int, int]) -> PTZCamera:
    """The camera with other pixels on the same sensor area: the same field of view and the same lens."""
    pitch = camera.pixel_pitch_m * camera.resolution[0] / resolution[0]
    return dataclasses.replace(camera, resolution=resolution, pixel_pitch_m=pitch)


def as_bright(sensor: ImageSensor, camera: PTZCamera, other: PTZCamera) -> ImageSensor:
    """The sensor with the exposure that gives the pixels of `other` as many electrons as those of `camera`."""
    area = (other.pixel_pitch_m / camera.pixel_pitch_m) ** 2
    return dataclasses.replace(sensor, exposure_ms=sensor.exposure_ms / area)


def views(scene: Scene) -> dict[str, PTZCamera]:
    """The view in focus and the defocused one."""
    near = dataclasses.replace(scene.camera("2"), focus_distance_m=NEAR_FOCUS_M)
    circles = near.circle_of_confusion_px(scene.state.points_m[near.in_frustum(scene.state.points_m)])
    return {"in focus": scene.camera("4"), f"defocused by {np.median(circles):.1f} px": near}


def timed(study: Study, times: int = 1) -> Spent:
    """A view, rendered warm: the median of so many `times`."""
    renderer, sensor = study.renderer, study.request.sensor
    costs = []
    for number in range(times):
        # Another request, so that not a single random number is known.
        sampling = dataclasses.replace(study.sampling, noise_ratio=study.sampling.noise_ratio * (1 + 1e-6 * number))
        costs.append(spent(lambda s=sampling: renderer.render(renderer.request(study.camera, sensor, s)))[1])
    return Spent(*(float(np.median([getattr(c, name) for c in costs])) for name in ("seconds", "cpu_seconds")))


def compare(options: argparse.Namespace, scene: Scene, renderer: Renderer, mi: Any, meshes: Any) -> None:
    """Ours, plain Mitsuba and Cycles in both views."""
    ours_rows, rivals = [], []
    for view, camera in views(scene).items():
        study = Study(renderer, mi, resized(camera, options.resolution), scene.sensor, Sampling(noise_ratio=BOUND))
        cost = timed(study, TIMED)
        if "ours" in options.parts:
            found = study.noise(study.replicates(options.replicates))
            certified = renderer.render(study.request).certificate.edge_p999
            counts = f"{study.samples / 1e6:.0f} M | {study.of_marker.sum()}"
            ours_rows.append(f"| {view} | {cost} | {counts} | {found} | {certified:.3f} |")
        found_rivals: list[Needed] = []
        if "plain" in options.parts:
            found_rivals += compare_plain(study, RIVAL_REPLICATES, view)
        if "cycles" in options.parts:
            found_rivals.append(compare_cycles(study, meshes, options.bpy_python, CYCLES_REPLICATES, view))
        rivals += [
            f"| {view} | {rival.name} | {rival.cost} | {rival.cost.seconds / cost.seconds:.0f} "
            f"| {rival.cost.cpu_seconds / cost.cpu_seconds:.0f} |"
            for rival in found_rivals
        ]
    if ours_rows:
        print(f"\nSampling by need, {BOUND} asked, {options.replicates} replicates:\n")
        print("| view | seconds | of all cores | samples | edge pixels of markers", end="")
        print(f" | {NOISE_HEADER} | certified |\n|---|---|---|---|---|---|---|---|---|")
        print("\n".join(ours_rows), flush=True)
    if rivals:
        print("\nThe same noise, extrapolated:\n\n| view | | seconds | of all cores | times ours | by all cores |")
        print("|---|---|---|---|---|---|\n" + "\n".join(rivals), flush=True)


def cost_row(study: Study) -> str:
    """Cost of a view beside its pixels and its edges."""
    cost, pixels, edges = timed(study), study.sigma.size, int(study.on_edge.sum())
    flat = (study.sampling.pilot + study.sampling.fewest) * pixels
    return (
        f"{pixels / 1e6:.1f} M | {cost} | {study.samples / 1e6:.0f} M | {study.of_marker.sum()} | {edges} "
        f"| {study.samples / pixels:.0f} | {(study.samples - flat) / edges:.0f} "
        f"| {1e6 * cost.cpu_seconds / study.samples:.3f} |"
    )


def tabulate(renderer: Renderer, mi: Any, head: str, cases: list[Case]) -> None:
    """A table of costs, one row for each case."""
    print(f"\n| {head} | pixels | seconds | of all cores | samples | edge pixels of markers | all edge pixels ", end="")
    print("| samples a pixel | beyond the flat rest's, an edge pixel | µs a sample |\n" + "|---" * 10 + "|")
    for first, camera, sensor, bound in cases:
        study = Study(renderer, mi, camera, sensor, Sampling(noise_ratio=bound))
        print(f"| {first} | {cost_row(study)}", flush=True)


def peak_bytes(store: Path, resolution: tuple[int, int]) -> tuple[int, int]:
    """Peak memory of a process that renders one view: before the view, and after it (Linux)."""
    scene, chosen = scenes.load(ROOT / "scenes" / "room.toml"), backend.choose()
    renderer = Renderer(scene.state, baked(scene.state, Store(store)), chosen)

    def peak() -> int:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * int(status.partition("VmHWM:")[2].split()[0])

    before = peak()
    renderer.render(renderer.request(resized(scene.camera("4"), resolution), scene.sensor, Sampling(noise_ratio=BOUND)))
    return before, peak()


def main() -> None:
    """Print the tables of the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=PARTS, help="all; Cycles only with --bpy-python")
    parser.add_argument("--bpy-python", type=Path, help="Python of an environment with bpy")
    parser.add_argument("--replicates", type=int, default=8, help="independent renders that confirm the bound")
    parser.add_argument("--resolution", type=int, nargs=2, default=(1280, 960), help="of the comparison, in pixels")
    parser.add_argument("--store", type=Path, default=Path("results/store"))
    options = parser.parse_args()
    options.resolution = tuple(options.resolution)
    if options.parts is None:
        options.parts = [part for part in PARTS if part != "cycles" or options.bpy_python]
    if "cycles" in options.parts and not options.bpy_python:
        parser.error("--parts cycles needs --bpy-python")
    scene, chosen = scenes.load(ROOT / "scenes" / "room.toml"), backend.choose()
    mi = backend.start(chosen)
    meshes, light = spent(lambda: baked(scene.state, Store(options.store)))
    renderer = Renderer(scene.state, meshes, chosen)
    print(f"{chosen}\nlight, solved once for all views (or read from the store): {light.seconds:.1f} s")
    _, first = spent(lambda: renderer.render(renderer.request(scene.camera("5"), scene.sensor, Sampling())))
    print(f"first view of the process, with all compilation: {first.seconds:.1f} s")
    if {"ours", "plain", "cycles"} & set(options.parts):
        compare(options, scene, renderer, mi, meshes)
    camera = scene.camera("4")
    if "resolution" in options.parts:
        cameras = [(f"{w} × {h}", resized(camera, (w, h))) for w, h in RESOLUTIONS]
        tabulate(renderer, mi, "resolution", [(*case, scene.sensor, BOUND) for case in cameras])
        print("\nThe same with exposures that give every pixel as many electrons:")
        tabulate(
            renderer, mi, "resolution", [(*case, as_bright(scene.sensor, camera, case[1]), BOUND) for case in cameras]
        )
    if "bound" in options.parts:
        tabulate(renderer, mi, "noise asked", [(f"{bound:g}", camera, scene.sensor, bound) for bound in BOUNDS])
    if "memory" in options.parts:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            before, after = pool.submit(peak_bytes, options.store, LARGE).result()
        print(f"\nPeak memory of one view of {LARGE[0]} × {LARGE[1]}: {after / 1e9:.2f} GB ", end="")
        print(f"({before / 1e9:.2f} GB before it).")


if __name__ == "__main__":
    main()
