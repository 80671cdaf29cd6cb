"""What a view costs by its size: seconds of all cores and peak memory of rendering and of measuring it.

    PYTHONPATH=. .venv/bin/python benchmarks/view_size.py [--sizes 640x480 1280x960 2560x1920]

The room's camera 4, with the sweeps' bound on sampling noise, the same field of view and as many electrons a pixel at
each size. Each job runs in a process of its own, so that the peak is its alone: render and store a view, or load it and
measure two captures. The last lines fit straight lines over the pixels, which `validate/acquire/view_costs.py` reckons
with.
"""

from __future__ import annotations

import argparse
import dataclasses
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import scenes
from render import backend
from render.lens.sampling import Sampling
from render.renderer import Renderer
from render.store.folder import Store
from render.store.light import baked
from render.store.views import save_view
from scenes.steps.sweep_file import SweepSpec
from validate.markers.view_measurement import MeasureTask, measure

ROOT = Path(__file__).parents[1]
# Bytes of ru_maxrss, which Linux counts in KiB.
KIB = 1024


def job(kind: str, width: int, height: int, folder: Path) -> str:
    """Do one job in this process: CPU seconds and peak bytes, in a line."""
    scene = scenes.load(ROOT / "scenes" / "room.toml")
    camera = scene.camera("4")
    camera = dataclasses.replace(
        camera,
        resolution=(width, height),
        pixel_pitch_m=camera.pixel_pitch_m * camera.resolution[0] / width,
        f_number=camera.f_number * camera.resolution[0] / width,
    )
    if kind == "light":
        baked(scene.state, Store(folder))
        begin, before = time.process_time(), 0
    elif kind == "render":
        chosen = backend.choose(None)
        state = scene.state
        renderer = Renderer(state, baked(state, Store(folder)), chosen)
        sampling = Sampling(noise_ratio=SweepSpec.model_fields["render_noise_ratio"].default)
        begin, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        request = renderer.request(camera, scene.sensor, sampling)
        save_view(Store(folder), renderer.render(request), request)
        (folder / f"{width}.key").write_text(request.key)
    else:
        before = 0
        ids = tuple(marker.id for marker in scene.state.markers)
        key = (folder / f"{width}.key").read_text()
        begin = time.process_time()
        measure(MeasureTask(folder, key, scene.state.print.dictionary, ids, 1, 2))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return f"{time.process_time() - begin} {max(peak, before) * KIB}"


def main() -> int:
    """Print the table and the fits."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", default=["640x480", "1280x960", "2560x1920"])
    parser.add_argument("--job", nargs=4)
    arguments = parser.parse_args()
    if arguments.job:
        kind, width, height, folder = arguments.job
        print(job(kind, int(width), int(height), Path(folder)))
        return 0
    found: dict[str, list[tuple[float, float, float]]] = {"render": [], "measure": []}
    print("| size | render, CPU s | peak GB | two captures, CPU s | peak GB |\n|---|---:|---:|---:|---:|")
    with TemporaryDirectory() as folder:
        # Solved apart, so that its memory is not taken for a view's.
        subprocess.run(
            [sys.executable, __file__, "--job", "light", "640", "480", folder], check=True, capture_output=True
        )
        for size in arguments.sizes:
            width, height = map(int, size.split("x"))
            cells = []
            for kind, rows in found.items():
                command = [sys.executable, __file__, "--job", kind, str(width), str(height), folder]
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                seconds, peak = map(float, done.stdout.split()[-2:])
                rows.append((width * height, seconds, peak))
                cells.append(f"{seconds:.2f} | {peak / 1e9:.2f}")
            print(f"| {width} × {height} | {' | '.join(cells)} |", flush=True)
    for kind, rows in found.items():
        pixels, seconds, peak = np.array(rows).T
        rate, start = np.polyfit(pixels, seconds, 1)
        slope, least = np.polyfit(pixels, peak, 1)
        memory = f"peak {least / 1e9:.2f} GB + {slope:.0f} bytes a pixel"
        print(f"{kind}: {start:.2f} CPU s + {1e6 * rate:.2f} per million pixels; {memory}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
