"""σ and bias of rendered markers against `physical`, up to 8,000 electrons: `python benchmarks/bright_markers.py`.

The laboratory of `run_sweep.py pixel-noise` (one marker, any roll, 4 m before a camera with a ring light), rendered for
each light with the sampling noise that the bank's views have. Squares are means over poses, in px² per axis; the bias
is less what noise leaves in the mean of so many captures. NEES/2 is of (σ² + bias²) under `physical` and under what
each detection states, with the standard error over poses.
"""

from __future__ import annotations

import argparse
import dataclasses
import math

import numpy as np

from render import backend
from render.lens.sampling import Sampling
from render.renderer import Renderer, ViewRequest
from render.sensor import capture, expected_electrons, fixed_pattern
from validate.bank.design import BankDesign
from validate.markers.view_measurement import measure_capture
from validate.pixel_noise.laboratory import DICTIONARY, Factors, Pose, Setup, draw_poses

SIZES_PX, WHITES_E = (6.0, 10.0, 20.0), (120.0, 1000.0, 4000.0, 8000.0)
POSES, CAPTURES = 12, 10
FEWEST_FOUND = 3


def of_pose(factors: Factors, pose: Pose, chosen: backend.Backend, rng: np.random.Generator) -> list[np.ndarray] | None:
    """px², (2, 2) each: of the noise, of the bias, `physical`, as stated; None if it is hardly found."""
    setup = Setup(factors, pose)
    sampling = Sampling(noise_ratio=BankDesign().noise_ratio)
    request = ViewRequest(setup.state, setup.camera, setup.sensor, sampling, chosen.identity)
    view = Renderer(setup.state, setup.baked(), chosen).render(request)
    electrons = np.asarray(expected_electrons(view.radiance, setup.camera, setup.sensor), dtype=np.float32)
    pattern = fixed_pattern(setup.camera, setup.sensor)
    errors, stated = [], []
    for _ in range(CAPTURES):
        numbers = capture(electrons, setup.sensor, rng, pattern)
        pixels, covariance, _ = measure_capture(numbers, DICTIONARY, (pose.marker_id,), setup.sensor)
        if np.isfinite(pixels).all():
            errors.append(pixels[0] - setup.truth_px)
            stated.append(covariance[0])
    if len(errors) < FEWEST_FOUND:
        return None
    noise, mean = np.cov(np.transpose(errors)), np.mean(errors, axis=0)
    return [noise, np.outer(mean, mean) - noise / len(errors), setup.physical_px2(), np.mean(stated, axis=0)]


def main() -> None:
    """Print a row for each size and light."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=list(SIZES_PX), help="px per module")
    parser.add_argument("--whites", type=float, nargs="+", default=list(WHITES_E), help="electrons of white")
    parser.add_argument("--incidence", type=float, default=20.0, help="degrees")
    parser.add_argument("--level", action="store_true", help="edges along rows and columns, leaning away to the right")
    options = parser.parse_args()
    chosen, poses = backend.choose(None), draw_poses(POSES, np.random.default_rng(5))
    if options.level:
        poses = [dataclasses.replace(pose, roll_deg=0.0, azimuth_deg=0.0) for pose in poses]
    rng = np.random.default_rng(7)
    print("module px  white e-   σ, bias, physical, stated in 0.001 px   NEES/2: physical, stated")
    for size in options.sizes:
        for white in options.whites:
            factors = Factors(module_px=size, white_e=white, incidence_deg=options.incidence)
            found = [of_pose(factors, pose, chosen, rng) for pose in poses]
            parts = np.array([each for each in found if each is not None]).swapaxes(0, 1)
            squares = np.trace(parts, axis1=2, axis2=3).mean(axis=1) / 2
            lengths = " ".join(f"{1000 * math.copysign(math.sqrt(abs(value)), value):6.2f}" for value in squares)
            ratios = [np.trace(np.linalg.solve(r, parts[0] + parts[1]), axis1=1, axis2=2) / 2 for r in parts[2:]]
            output = "   ".join(f"{ratio.mean():.2f} ± {ratio.std() / math.sqrt(len(ratio)):.2f}" for ratio in ratios)
            print(f"{size:9g}  {white:8g}   {lengths}   {output}", flush=True)


if __name__ == "__main__":
    main()
