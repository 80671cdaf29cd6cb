"""Bias and stated σ by in-plane angle and module size, without the renderer: `python benchmarks/level_markers.py`.

Markers are drawn exactly (`tests/helpers/exact_drawing.py`) at random places within a pixel, and registered from
corners that are half a pixel off. Bias: RMS per axis without noise, at each whole degree of a group, in focus and out
of it. NEES/2: mean squared error of noisy captures over the covariance that each one states, per axis; 1 where it is
right. `--against CHECKOUT` prints the time of a registration over that of another checkout of the project, in turns.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from pss import ImageSensor
from render.sensor import capture
from validate.markers.localise import Localised, register

DICTIONARY, MARKERS = "DICT_4X4_100", 50
SENSOR = ImageSensor()
SIZES_PX = (4, 5, 6, 8, 12, 16, 25, 40, 60)
ANGLES_DEG = {
    "0, 90": (0, 90),
    "1 to 5, 85 to 89": (*range(1, 6), *range(85, 90)),
    "6 to 84": tuple(range(6, 85)),
}
WHITES_E = (100.0, 1000.0, 9000.0)
# White over black, as in print.
CONTRAST = 17.0
DISCS_PX = (0.0, 0.3, 1.0, 3.0)
CORNERS_OFF_PX = 0.5
# Noisy captures of one drawing, and rounds of the timing.
CAPTURES, ROUNDS = 5, 5


def placed(px: float, angle_deg: float, disc_px: float, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """Homography from modules to pixels of a marker near the middle of an image, and the image's side in px."""
    side = math.ceil(8 * math.sqrt(2) * px + disc_px) + 8
    angle = math.radians(angle_deg)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    homography = np.eye(3)
    homography[:2, :2] = px * turn
    homography[:2, 2] = (side - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
    return homography, side


def drawing(px: float, angle_deg: float, disc_px: float, rng: np.random.Generator):
    """Share of white in each pixel of a marker, its number, its homography, and its corners as a detector's."""
    # Not at hand in an older checkout, which is timed alone.
    from tests.helpers.exact_drawing import draw_exactly

    homography, side = placed(px, angle_deg, disc_px, rng)
    marker = int(rng.integers(MARKERS))
    white = draw_exactly(DICTIONARY, marker, homography, (side, side), disc_px)
    ends = np.array([[[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]]])
    corners = cv2.perspectiveTransform(ends, homography)[0] + rng.uniform(-CORNERS_OFF_PX, CORNERS_OFF_PX, (4, 2))
    return white, marker, homography, corners


def electrons(white: np.ndarray, white_e: float) -> np.ndarray:
    """Mean electrons of pixels of which the share `white` is white."""
    return white_e * (1 / CONTRAST + (1 - 1 / CONTRAST) * white)


def bias(px: float, angles: tuple[int, ...], disc_px: float, rng: np.random.Generator) -> tuple[float, float]:
    """px, RMS and largest error of a coordinate without noise."""
    errors = []
    for angle in angles:
        white, marker, homography, corners = drawing(px, angle, disc_px, rng)
        numbers = electrons(white, WHITES_E[-1]) / SENSOR.gain_e_per_dn + SENSOR.black_level_dn
        found = register(numbers.astype(np.float32), corners, marker, DICTIONARY, SENSOR)
        errors.append(found.centre_px - homography[:2, 2] if isinstance(found, Localised) else [np.nan] * 2)
    return float(np.sqrt(np.mean(np.square(errors)))), float(np.abs(errors).max())


def consistency(px: float, angles: tuple[int, ...], white_e: float, captures: int, rng: np.random.Generator):
    """NEES/2, its standard error, RMS error and stated σ in px, and how many captures were refused."""
    nees, errors, stated, refused = [], [], [], 0
    for _ in range(captures // CAPTURES):
        white, marker, homography, corners = drawing(px, int(rng.choice(angles)), 0.0, rng)
        for _ in range(CAPTURES):
            numbers = capture(electrons(white, white_e), SENSOR, rng)
            found = register(numbers, corners, marker, DICTIONARY, SENSOR)
            if not isinstance(found, Localised):
                refused += 1
                continue
            error = found.centre_px - homography[:2, 2]
            nees.append(error @ np.linalg.solve(found.covariance_px2, error) / 2)
            errors.append(error)
            stated.append(np.trace(found.covariance_px2) / 2)
    spread = float(np.std(nees) / math.sqrt(len(nees)))
    return float(np.mean(nees)), spread, float(np.sqrt(np.mean(np.square(errors)))), math.sqrt(np.mean(stated)), refused


def table(sizes: list[float], captures: int) -> None:
    """Print a row for each size and group of angles."""
    discs = ", ".join(f"{disc:g}" for disc in DISCS_PX)
    lights = "   ".join(f"NEES/2 (σ px) at {white:.0f} e-" for white in WHITES_E)
    print(f"module px   angles deg         RMS bias px at circles of confusion of {discs} px    {lights}")
    for px in sizes:
        for name, angles in ANGLES_DEG.items():
            rng = np.random.default_rng([round(10 * px), *angles[:1]])
            # Two angles alone are few places within a pixel.
            drawn = angles * (10 if len(angles) == 2 else 1)
            biases = [bias(px, drawn[:: 1 if disc == 0 else 4], disc, rng)[0] for disc in DISCS_PX]
            row = f"{px:9g}   {name:18s} " + " ".join(f"{value:.4f}" for value in biases) + "  "
            # A large marker has many pixels, and as many captures take as much longer.
            count = max(round(captures * min(1.0, 10 / px)), 2 * CAPTURES)
            for white in WHITES_E:
                mean, spread, _, stated, refused = consistency(px, angles, white, count, rng)
                row += f"   {mean:.2f} ± {spread:.2f} ({stated:.4f})" + (f" {refused} refused" if refused else "")
            print(row, flush=True)


def time_registrations(path: Path) -> None:
    """Print the thread's seconds a registration of the captures stored in `path`."""
    with np.load(path) as file:
        stored = {name: file[name] for name in file.files}
    count, begin = int(stored["count"]), 0.0
    # The first round fills tables that are kept.
    for _ in range(2):
        begin = time.thread_time()
        for number in range(count):
            numbers, corners = stored[f"numbers {number}"], stored[f"corners {number}"]
            register(numbers, corners, int(stored[f"marker {number}"]), DICTIONARY, SENSOR)
    print((time.thread_time() - begin) / count)


def compare(other: Path, sizes: list[float]) -> None:
    """Print the time of a registration here over that in the checkout `other`, medians of pairs, by size."""
    print("module px   ms here   ratio to the other checkout")
    here = Path(__file__).resolve().parents[1]
    for px in sizes:
        rng = np.random.default_rng(round(10 * px))
        stored = {"count": max(4, round(300 / px))}
        for number in range(stored["count"]):
            white, marker, _, corners = drawing(px, rng.uniform(0, 90), 0.0, rng)
            stored[f"numbers {number}"] = capture(electrons(white, 1000.0), SENSOR, rng)
            stored |= {f"corners {number}": corners, f"marker {number}": np.array(marker)}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "captures.npz"
            np.savez(path, **stored)
            pairs = np.array([[_seconds(root, path) for root in (here, other)] for _ in range(ROUNDS)])
        ms, ratio = 1000 * np.median(pairs[:, 0]), np.median(pairs[:, 0] / pairs[:, 1])
        print(f"{px:9g}   {ms:7.2f}   {ratio:.2f}", flush=True)


def _seconds(root: Path, path: Path) -> float:
    environment = os.environ | {"PYTHONPATH": str(root), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--time", str(path)]
    return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Print the table, or the time against another checkout."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=list(SIZES_PX), help="px per module")
    parser.add_argument("--captures", type=int, default=1000, help="noisy captures of a size, angles and light")
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="another checkout, to compare times with")
    parser.add_argument("--time", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    if options.time is not None:
        time_registrations(options.time)
    elif options.against is not None:
        if not (options.against / "validate" / "localise.py").is_file():
            parser.error(f"--against {options.against} holds no validate/markers/localise.py; allowed: a checkout")
        compare(options.against, options.sizes)
    else:
        table(options.sizes, options.captures)


if __name__ == "__main__":
    main()
