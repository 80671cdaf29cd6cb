"""How the sampling error of edge pixels falls with their samples: `python benchmarks/sampling_convergence.py`.

RMS over 4000 pixels with contrast, in units of the pixel's sensor noise, against a reference of 32768 samples; beside
it what independent samples would give. Sharp (camera 4 as in the room) and defocused (camera 2 focused at 1.4 m).
"""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

import scenes
from render import backend
from render.lens import thin_lens
from render.lens.sampling import pixel_means
from render.light import lit_scene
from render.light.radiosity import solve_radiosity
from render.sensor import expected_electrons

PIXELS = 4000
REFERENCE = 16384
EDGE_CONTRAST = 3.0


def main() -> None:
    """Print the table and the fitted exponents."""
    scene = scenes.load(Path(__file__).parents[1] / "scenes" / "room.toml")
    chosen = backend.choose()
    mi = backend.start(chosen)
    loaded = lit_scene.load_scene(lit_scene.bake(scene.state, solve_radiosity(scene.state)), mi)
    print(chosen)
    sharp = scene.camera("4")
    defocused = dataclasses.replace(scene.camera("2"), focus_distance_m=1.4)
    for name, camera in (("sharp", sharp), ("defocused", defocused)):
        sampler = pixel_means(loaded, thin_lens.load_sensor(camera, mi), mi)
        width, height = camera.resolution
        per_radiance = np.asarray(expected_electrons(np.ones((height, width)), camera, scene.sensor))
        rng = np.random.default_rng(0)
        begin = time.perf_counter()
        image = sampler(np.arange(width * height, dtype=np.uint32), 16, rng)[0].reshape(height, width)
        rate = 16 * width * height / (time.perf_counter() - begin)
        sigma = scene.sensor.noise_electrons(image * per_radiance) / per_radiance
        contrast = (maximum_filter(image, 3) - minimum_filter(image, 3)) / sigma
        edges = np.flatnonzero(contrast > EDGE_CONTRAST)
        pixels = rng.choice(edges, PIXELS, replace=False).astype(np.uint32)
        reference, variance = sampler(pixels, REFERENCE, rng)
        reference = (reference + sampler(pixels, REFERENCE, rng)[0]) / 2
        scale = sigma.ravel()[pixels]
        counts, ratios = 2 ** np.arange(3, 12), []
        for count in counts:
            error = (sampler(pixels, int(count), rng)[0] - reference) / scale
            ratios.append(np.sqrt((error**2).mean()))
            independent = np.sqrt((variance / scale**2).mean() / count)
            print(f"{name:10s} {count:5d} samples  RMS {ratios[-1]:.3f}  independent {independent:.3f}")
        slope = np.polyfit(np.log(counts), np.log(ratios), 1)[0]
        print(f"{name:10s} exponent {slope:.2f}; {rate / 1e6:.1f} M samples/s")


if __name__ == "__main__":
    main()
