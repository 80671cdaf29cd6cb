"""At which contrast over noise markers stop being found: searches on drawn markers, from bright to dark.

    PYTHONPATH=. .venv/bin/python benchmarks/detection_limit.py [--captures 60]

Markers are drawn without the renderer, at random angles and phases, slightly tilted, sharp, on a grey surround; each
capture has noise of the sensor's own model. Contrast over noise is (white − black) over σ of one capture at white, in
one pixel. Printed for each module size and read noise: the contrast over noise at which half of the markers, and nine
tenths of what the search finds in bright light, are found, interpolated over its logarithm.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys

import cv2
import numpy as np

from pss import ImageSensor
from render.sensor import capture
from render.world.marker_print import predefined_dictionary
from tests.helpers.synthetic import DICTIONARY, homography, marker_electrons
from validate.markers.detect import find_markers

MODULES_PX = (4.0, 6.0, 10.0)
READ_NOISES_E = (1.0, 6.0)
CONTRASTS = np.geomspace(0.8, 10.0, 10)
BLACK_OVER_WHITE = 0.04 / 0.85
# Of the image's side over the marker's: as a marker among others lies in a view.
SURROUND = 1.5


def white_of(contrast: float, sensor: ImageSensor) -> float:
    """Electrons of white at which (white − black) is `contrast` times σ at white; by bisection."""
    low, high = 1e-6, sensor.full_well_e
    for _ in range(80):
        middle = (low * high) ** 0.5
        ratio = middle * (1 - BLACK_OVER_WHITE) / float(sensor.noise_electrons(np.array(middle)))
        low, high = (middle, high) if ratio < contrast else (low, middle)
    return high


def stock(capture_dn: np.ndarray, sensor: ImageSensor) -> set[int]:
    """What OpenCV's stock parameters find in the linear image, white at 250 of 255."""
    lit = capture_dn.astype(np.float32) - sensor.black_level_dn
    eight_bit = np.clip(lit * (250 / max(np.percentile(lit, 99), 1.0)), 0, 255).astype(np.uint8)
    _, ids, _ = cv2.aruco.ArucoDetector(predefined_dictionary(DICTIONARY)).detectMarkers(eight_bit)
    return set() if ids is None else set(np.ravel(ids).tolist())


def found_shares(module_px: float, sensor: ImageSensor, captures: int) -> dict[str, np.ndarray]:
    """Share of the captures in which each search finds the marker, at each of CONTRASTS."""
    rng = np.random.default_rng(int(module_px * 10))
    size = int(np.ceil(8 * module_px * SURROUND))
    shares = {name: np.zeros(len(CONTRASTS)) for name in ("stock", "search")}
    for _ in range(captures):
        marker = int(rng.integers(100))
        centre = (size / 2 + rng.uniform(-1, 1), size / 2 + rng.uniform(-1, 1))
        h = homography(module_px, centre, rng.uniform(0, 90), rng.uniform(0.8, 1.0), np.zeros(2))
        unit = marker_electrons(marker, h, size, 1.0, BLACK_OVER_WHITE)
        for step, contrast in enumerate(CONTRASTS):
            numbers = capture(unit * white_of(contrast, sensor), sensor, rng)
            shares["stock"][step] += marker in stock(numbers, sensor)
            shares["search"][step] += marker in find_markers(numbers, DICTIONARY).ids
    return {name: value / captures for name, value in shares.items()}


def crossing(share: np.ndarray, level: float) -> float:
    """The contrast from which on the share of markers found stays at `level` or above; nan if it never does."""
    below = np.flatnonzero(share < level)
    if not len(below):
        return float(CONTRASTS[0])
    last = below[-1]
    if last + 1 == len(share):
        return float("nan")
    part = (level - share[last]) / (share[last + 1] - share[last])
    return float(np.exp(np.interp(part, [0, 1], np.log(CONTRASTS[last : last + 2]))))


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--captures", type=int, default=60)
    captures = parser.parse_args().captures
    print("| module in px | read noise in e⁻ | search | half found from | nine tenths found from |")
    print("|---:|---:|---|---:|---:|")
    for read_noise in READ_NOISES_E:
        sensor = dataclasses.replace(ImageSensor(), read_noise_e=read_noise)
        for module_px in MODULES_PX:
            for name, share in found_shares(module_px, sensor, captures).items():
                half, most = crossing(share, 0.5), crossing(share, 0.9 * share.max())
                print(
                    f"| {module_px:g} | {read_noise:g} | {name} | {half:.2f} | {most:.2f} |", flush=True
                )  # nan: never
    return 0


if __name__ == "__main__":
    sys.exit(main())
