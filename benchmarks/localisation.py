"""Frozen bias and noise of the localisation over the room's seven views: `python benchmarks/localisation.py`.

Bias: registration of noise-free renders against the camera model. Noise: spread over trials, beside the σ that each
detection claims for itself. By module size in pixels.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import time
from pathlib import Path

import cv2
import numpy as np

from render import backend
from render.sampling import Sampling
from render.sensor import capture
from render.view import Renderer, random_stream
from scenes import load_scene
from validate.acquire import baked
from validate.detect import find_markers
from validate.localise import BIAS_FLOOR_PX, localise
from validate.measure import measure_capture
from validate.store import Store

SIZES_PX = (0, 4, 6, 8, 12, 40)


def main() -> None:
    """Print a row for each range of module sizes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--zooms", type=float, nargs="+", default=[2.0, 3.0, 5.0])
    parser.add_argument("--store", type=Path, default=Path("results/store"))
    options = parser.parse_args()
    cv2.setNumThreads(1)
    scene = load_scene(Path(__file__).parents[1] / "scenes" / "room.toml")
    ids = tuple(marker.id for marker in scene.state.markers)
    dictionary = scene.state.print.dictionary
    chosen = backend.choose()
    renderer = Renderer(scene.state, baked(scene.state, Store(options.store)), chosen)
    rows, seconds, registrations = [], 0.0, 0
    for zoom in options.zooms:
        for camera in scene.cameras:
            camera = dataclasses.replace(camera, zoom=zoom)
            request = renderer.request(camera, scene.sensor, Sampling())
            electrons = renderer.render(request).expected_electrons()
            truth, depth = camera.project(scene.state.points_m)
            clean = electrons / scene.sensor.gain_e_per_dn + scene.sensor.black_level_dn
            trials = [
                measure_capture(
                    capture(electrons, scene.sensor, random_stream(1, request.key, "capture", trial)),
                    dictionary,
                    ids,
                    scene.sensor,
                )[:2]
                for trial in range(options.trials)
            ]
            pixels, covariance = (np.array(part) for part in zip(*trials, strict=True))
            found = find_markers(np.rint(clean).astype(np.uint16), dictionary)
            for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
                begin = time.perf_counter()
                exact = localise(clean.astype(np.float32), corners, marker, dictionary, scene.sensor)
                seconds, registrations = seconds + time.perf_counter() - begin, registrations + 1
                n = ids.index(marker)
                if exact is None or np.isfinite(pixels[:, n, 0]).sum() < options.trials:
                    continue
                module = scene.state.markers[n].module_m * camera.focal_px / depth[n]
                claimed = covariance[:, n].trace(axis1=1, axis2=2).mean() / 2 - BIAS_FLOOR_PX**2
                rows.append((module, *(exact.centre_px - truth[n]), pixels[:, n].var(axis=0, ddof=1).mean(), claimed))
    table = np.array(rows)
    print(f"{chosen}\nmodule px   markers  mean bias x, y px   RMS bias px  noise σ px  claimed σ px")
    for low, high in itertools.pairwise(SIZES_PX):
        part = table[(table[:, 0] >= low) & (table[:, 0] < high)]
        if len(part):
            mean, rms = part[:, 1:3].mean(axis=0), np.sqrt((part[:, 1:3] ** 2).mean())
            noise, claimed = np.sqrt(part[:, 3].mean()), np.sqrt(part[:, 4].mean())
            print(
                f"{low:3d} to {high:2d}   {len(part):6d}   {mean[0]:+.4f} {mean[1]:+.4f}     {rms:.4f}       "
                f"{noise:.4f}      {claimed:.4f}"
            )
    print(f"{1000 * seconds / registrations:.1f} ms a registration")


if __name__ == "__main__":
    main()
