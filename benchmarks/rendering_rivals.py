"""What other renderers need for the noise that sampling by need is asked for: plain Mitsuba and Blender's Cycles.

Both have to reach what sampling by need shows by the same estimate, from as many replicates in the same pixels, or what
was asked, whichever is easier: few replicates widen the tail of all alike.
"""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.path_traced import path_traced_scene
from benchmarks.rendering_noise import Noise, Spent, Study, spent
from render.lens import thin_lens
from render.light.lit_scene import GlowMeshes

__all__ = ["NOISE_HEADER", "Needed", "compare_cycles", "compare_plain"]

Floats = NDArray[np.floating]

NOISE_HEADER = "median | RMS | 99.9th percentile"
# Mitsuba's samplers, and how many samples a pixel they are compared with. Left out: "orthogonal", which takes four
# times as long a sample as the others.
SAMPLERS = ("independent", "stratified", "multijitter", "ldsampler")
TRIED_WITH = 64
COUNTS = (16, 64, 256)
TRUE_SCENE_SAMPLES = 16
# Noise is measured in the middle of the image, a quarter of its pixels; time over the whole of it.
PART = 0.5
# Cycles: (threshold, most samples); it stops by whichever comes first.
CYCLES_JOBS = ((0.04, 4096), (0.01, 4096))
# Its image must be the same: largest shift in px and largest relative difference off the edges (median), of an image
# with so much noise.
SAME_PLACE_PX = 0.01
SAME_LIGHT = 2e-3


@dataclass(frozen=True)
class Needed:
    """What a renderer needs for the noise asked for, and how that was found."""

    name: str
    cost: Spent
    samples: float


def compare_plain(study: Study, replicates: int, view: str) -> list[Needed]:
    """`mi.render` with as many samples in every pixel: print what was measured, give what the bound takes.

    By the sampler that is best here and by the independent one, Mitsuba's default.
    """
    mi, camera = study.mi, study.camera
    scene = study.renderer._scene
    width, height = camera.resolution
    left, top = (int(n * (1 - PART) / 2) for n in (width, height))
    size = (int(width * PART), int(height * PART))
    part = slice(top, top + size[1]), slice(left, left + size[0])

    def images(
        sampler: str, samples: int, number: int, cropped: bool = True, loaded: object = scene, depth: int = 1
    ) -> list[Floats]:
        path = mi.load_dict({"type": "path", "max_depth": depth})
        sensor = thin_lens.sensor_dict(camera, mi) | {"sampler": {"type": sampler, "sample_count": samples}}
        if cropped:
            window = dict(zip(("crop_offset_x", "crop_offset_y"), (left, top), strict=True))
            sensor["film"] |= window | {"crop_width": size[0], "crop_height": size[1]}
        film = mi.load_dict(sensor)
        return [
            np.array(mi.render(loaded, sensor=film, spp=samples, seed=seed, integrator=path), dtype=np.float32)[..., 0]
            for seed in range(number)
        ]

    def cost_of(sampler: str, samples: float) -> Spent:
        images(sampler, TRIED_WITH, 1, cropped=False)
        _, cost = spent(lambda: images(sampler, TRIED_WITH, 1, cropped=False))
        print(f"{TRIED_WITH} a pixel take {cost.seconds:.1f} s, {cost.cpu_seconds:.1f} s of all cores (measured).")
        return Spent(cost.seconds * samples / TRIED_WITH, cost.cpu_seconds * samples / TRIED_WITH)

    tried = {sampler: study.noise(images(sampler, TRIED_WITH, replicates), part) for sampler in SAMPLERS}
    best = min(tried, key=lambda sampler: tried[sampler].rms)
    listed = ", ".join(f"{sampler} {noise.rms:.3f}" for sampler, noise in tried.items())
    print(f"\nPlain Mitsuba, {view}: RMS with {TRIED_WITH} samples a pixel by sampler: {listed}.\n")
    print(f"| samples a pixel | {NOISE_HEADER} |\n|---|---|---|---|")
    measured: list[Noise] = []
    for samples in COUNTS:
        measured.append(tried[best] if samples == TRIED_WITH else study.noise(images(best, samples, replicates), part))
        print(f"| {samples}, {best} | {measured[-1]} |", flush=True)
    print(f"| {TRIED_WITH}, independent | {tried['independent']} |")
    ours = study.noise([image[part] for image in study.replicates(replicates)], part)
    print(f"| by need | {ours} |\n")
    goal = max(ours.p999, study.sampling.noise_ratio)
    found = []
    exponent = np.polyfit(np.log(COUNTS), np.log([noise.p999 for noise in measured]), 1)[0]
    for sampler, count, noise, slope in (
        (best, COUNTS[-1], measured[-1], exponent),
        ("independent", TRIED_WITH, tried["independent"], -0.5),
    ):
        needed = count * (noise.p999 / goal) ** (-1 / slope)
        origin = "fitted" if sampler == best else "by the law of independent samples"
        print(f"{sampler}: exponent {slope:.2f} ({origin}), {needed:.0f} samples a pixel are needed (extrapolated);")
        found.append(Needed(f"plain Mitsuba ({sampler})", cost_of(sampler, needed), needed))
    state = study.renderer.state
    lit = path_traced_scene(state, np.zeros((0, 3)), np.zeros((0, 3)), mi)
    true = images("independent", TRUE_SCENE_SAMPLES, 2, loaded=lit, depth=-1)
    ratio = np.sqrt(np.mean(np.var(true, axis=0, ddof=1) / study.sigma[part] ** 2))
    many = TRUE_SCENE_SAMPLES * (ratio / study.sampling.noise_ratio) ** 2
    print(f"Path tracing of the lamps' light, without markers: RMS {ratio:.1f} over all pixels at {TRUE_SCENE_SAMPLES}")
    print(f"samples a pixel (measured); {many:.0f} would bring that to {study.sampling.noise_ratio} (extrapolated).")
    return found


def compare_cycles(study: Study, meshes: GlowMeshes, python: Path, replicates: int, view: str) -> Needed:
    """Cycles with adaptive sampling: check that it draws the same image, print what was measured."""
    camera = study.camera
    jobs = [f"{threshold}:{most}:{seed}" for threshold, most in CYCLES_JOBS for seed in range(1, replicates + 1)]
    with tempfile.TemporaryDirectory() as folder:
        archive, out = Path(folder, "scene.npz"), Path(folder, "view")
        np.savez(
            archive,
            **vars(meshes),
            resolution=camera.resolution,
            fov=math.radians(camera.horizontal_fov_deg),
            focus_distance_m=camera.focus_distance_m,
            aperture_diameter_m=camera.aperture_diameter_m,
            rotation=camera.rotation,
            position_m=camera.position_m,
        )
        script = Path(__file__).with_name("cycles_view.py")
        command = [str(python), str(script), str(archive), str(out), *jobs]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        costs = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        images = [np.load(f"{out}-{number}.npy") for number in range(len(jobs))]
    shift_px, light = _agreement(study, np.mean(images[-replicates:], axis=0))
    print(
        f"\nCycles, {view}: shifted by {shift_px[0]:+.4f}, {shift_px[1]:+.4f} px against ours; off the edges the light"
    )
    print(f"differs by {light:.1e} (median).\n")
    if np.abs(shift_px).max() > SAME_PLACE_PX or light > SAME_LIGHT:
        raise RuntimeError("Cycles draws another image; its time says nothing")
    print(f"| threshold | {NOISE_HEADER} | seconds | of all cores |\n|---|---|---|---|---|---|")
    measured, mean_costs = [], []
    for number, (threshold, _) in enumerate(CYCLES_JOBS):
        chosen = slice(number * replicates, (number + 1) * replicates)
        measured.append(study.noise(images[chosen]))
        mean_costs.append(Spent(*(float(np.mean([c[k] for c in costs[chosen]])) for k in ("seconds", "cpu_seconds"))))
        print(f"| {threshold} | {measured[-1]} | {mean_costs[-1]} |", flush=True)
    ours = study.noise(study.replicates(replicates))
    print(f"| ours | {ours} | | |")
    goal = max(ours.p999, study.sampling.noise_ratio)
    noise, cpu = np.log([n.p999 for n in measured]), np.log([c.cpu_seconds for c in mean_costs])
    slope = np.polyfit(cpu, noise, 1)[0]
    factor = (measured[-1].p999 / goal) ** (-1 / slope)
    print(
        f"\nThe 99.9th percentile falls with the time to the power of {slope:.2f}: {factor:.1f} times the last's time."
    )
    last = mean_costs[-1]
    return Needed("Cycles", Spent(last.seconds * factor, last.cpu_seconds * factor), math.nan)


def _agreement(study: Study, image: Floats) -> tuple[Floats, float]:
    """Shift of an image against ours in px, (2,), by gradients at markers' edges; median difference elsewhere."""
    ours = study.image.astype(float)
    down, across = np.gradient(ours)
    edges = study.of_marker
    slopes = np.stack([across[edges], down[edges]], axis=1) / study.sigma[edges][:, None]
    shift, *_ = np.linalg.lstsq(slopes, -((image - ours) / study.sigma)[edges], rcond=None)
    return shift, float(np.median(np.abs(image / ours - 1)[~study.on_edge]))
