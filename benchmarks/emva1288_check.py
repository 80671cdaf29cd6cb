"""The sensor before EMVA 1288: flat and dark frames of the named sensors, and what estimators read off them.

    python benchmarks/emva1288_check.py --official ../emva/bin/python

Our estimator is `tests/helpers/photon_transfer.py`. The standard's reference package (`emva1288` 1.0.2) needs a numpy
that still has `np.int`, so it runs in an environment of its own, whose interpreter `--official` names:

    python3 -m venv ../emva && ../emva/bin/pip install "numpy<1.24" "scipy<1.11" lxml pillow emva1288==1.0.2

Prints a table in Markdown for each sensor, draws photon-transfer.png, cos4.png and ring-light.png in docs/figures, and
exits with 1 if a figure is off by more than its uncertainty, or a law by more than 2 %.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

if __package__ in (None, ""):  # run as a script: the project's root is the parent of this file's folder
    sys.path[0] = str(Path(__file__).resolve().parents[1])

import scenes
from benchmarks.ring_light_figure import draw_ring_light
from benchmarks.sensor_figures import BAND, draw_fall_off, draw_photon_transfer
from pss import ImageSensor
from scenes.reading.sensor_file import known_sensors
from tests.helpers.photon_transfer import (
    BEYOND_SATURATION,
    Characterisation,
    Laboratory,
    Level,
    characterise,
    pair,
    stack,
)

ROOT = Path(__file__).resolve().parents[1]

# Of a normal estimate, 1 in 370 is further off than this many of its standard uncertainties.
COVERAGE = 3.0
# Largest of some forty levels' deviations, each of its own standard uncertainty: 1 series in 400 is beyond.
LINEARITY_COVERAGE = 4.0

OFFICIAL = """
import json, logging, sys
import numpy
from emva1288.process import Data1288, LoadImageData, ParseEmvaDescriptorFile, Results1288
quiet = {"loglevel": logging.ERROR}
images = LoadImageData(ParseEmvaDescriptorFile(sys.argv[1], **quiet).images, **quiet)
found = Results1288(Data1288(images.data, **quiet).data, **quiet)
print(json.dumps({
    "system_gain_dn_per_e": found.K,
    "quantum_efficiency": found.QE / 100,
    "dark_noise_e": found.sigma_d,
    "dark_current_e_per_s": found.u_I_mean,
    "prnu_share": found.PRNU1288 / 100,
    "dsnu_e": found.DSNU1288,
    "linearity_error": max(abs(found.LE_min), abs(found.LE_max)) / 100,
    "saturation_e": found.u_e_sat,
}))
"""
ROWS = {
    "system_gain_dn_per_e": ("system gain K", "DN/e⁻", 1),
    "quantum_efficiency": ("quantum efficiency η", "%", 100),
    "dark_noise_e": ("temporal dark noise σ_d", "e⁻", 1),
    "dark_current_e_per_s": ("dark current μ_I", "e⁻/s", 1),
    "prnu_share": ("PRNU", "%", 100),
    "dsnu_e": ("DSNU", "e⁻", 1),
}


class Recorder:
    """Takes a laboratory's frames and, for the reference package, writes them down with their descriptor."""

    def __init__(self, laboratory: Laboratory, folder: Path | None) -> None:
        self._laboratory, self._folder, self._lines, self._count = laboratory, folder, [], 0

    def frames(self, photons: float, exposure_s: float, count: int) -> Iterator[NDArray[np.uint16]]:
        """`count` equal exposures."""
        nanoseconds = exposure_s * 1e9
        self._lines.append(f"b {nanoseconds:.3f} {photons:.6f}" if photons else f"d {nanoseconds:.3f}")
        for _ in range(count):
            frame = self._laboratory.frame(photons, exposure_s)
            if self._folder is not None:
                self._count += 1
                name = f"{self._count:04}.png"
                cv2.imwrite(str(self._folder / name), frame, [cv2.IMWRITE_PNG_COMPRESSION, 1])
                self._lines.append(f"i {name}")
            yield frame

    def describe(self, bits: int, resolution: tuple[int, int]) -> Path:
        """Write the descriptor file that the package reads."""
        assert self._folder is not None
        path = self._folder / "descriptor.txt"
        path.write_text("\n".join(["v 4.0", f"n {bits} {resolution[0]} {resolution[1]}", *self._lines, ""]))
        return path


def measure(
    sensor: ImageSensor, options: argparse.Namespace, seed: int
) -> tuple[Characterisation, dict[str, float] | None]:
    """Our figures, and the reference package's from the same frames if its interpreter is known."""
    resolution = (options.width, options.height)
    laboratory = Laboratory(sensor, resolution, seed)
    with tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(laboratory, Path(folder) if options.official else None)
        levels = [
            Level(
                photons,
                seconds,
                pair(*recorder.frames(photons, seconds, 2)),
                pair(*recorder.frames(0.0, seconds, 2)),
            )
            for photons, seconds in laboratory.exposures(options.levels)
        ]
        photons, seconds = (value / BEYOND_SATURATION for value in laboratory.exposures(2)[0])
        bright, dark = (stack(recorder.frames(light, seconds, options.stack)) for light in (photons, 0.0))
        found = characterise(levels, bright, dark)
        if not options.official:
            return found, None
        path = recorder.describe(sensor.bits, resolution)
        done = subprocess.run(
            [options.official, "-c", OFFICIAL, str(path)], capture_output=True, text=True, env={"MPLBACKEND": "Agg"}
        )
        if done.returncode:
            raise SystemExit(f"{options.official}: the reference package failed\n{done.stderr}")
        return found, json.loads(done.stdout.splitlines()[-1])


def given(sensor: ImageSensor) -> dict[str, float]:
    """What the sensor's file says, by the names of `Characterisation`."""
    return {
        "system_gain_dn_per_e": 1 / sensor.gain_e_per_dn,
        "quantum_efficiency": sensor.quantum_efficiency,
        "dark_noise_e": sensor.read_noise_e,
        "dark_current_e_per_s": sensor.dark_current_e_per_s,
        "prnu_share": sensor.prnu_share,
        "dsnu_e": sensor.dsnu_e,
    }


def table(name: str, sensor: ImageSensor, found: Characterisation, official: dict[str, float] | None) -> bool:
    """Print a sensor's table; whether every figure is within its uncertainty."""
    print(f"\n### {name}\n")
    print(f"| figure | unit | given | recovered ± U (k = {COVERAGE:g}) | z | emva1288 | z |")
    print("|---|---|---|---|---|---|---|")
    good = True
    for key, value in given(sensor).items():
        what, unit, scale = ROWS[key]
        estimate = getattr(found, key)
        digits = max(0, 1 - int(np.floor(np.log10(COVERAGE * estimate.error * scale))))
        values = [estimate.value] + ([official[key]] if official else [])
        scores = [(one - value) / estimate.error for one in values]
        good &= max(map(abs, scores)) <= COVERAGE
        cells = [
            f"{values[0] * scale:.{digits}f} ± {COVERAGE * estimate.error * scale:.{digits}f}",
            f"{scores[0]:+.2f}",
        ]
        cells += [f"{values[1] * scale:.{digits}f}", f"{scores[1]:+.2f}"] if official else ["", ""]
        print(f"| {what} | {unit} | {value * scale:.{digits}f} | {' | '.join(cells)} |")
    line = found.linearity_error
    good &= line.value <= LINEARITY_COVERAGE * line.error
    cells = [f"{line.value * 100:.4f}, a level's own {line.error * 100:.4f}", ""]
    cells += [f"{official['linearity_error'] * 100:.4f}", ""] if official else ["", ""]
    print(f"| linearity error, 5 to 95 % | % | 0 | {' | '.join(cells)} |")
    top = found.saturation_e
    cells = [f"{top.value:.0f} to {top.value + top.error:.0f}", ""]
    cells += [f"{official['saturation_e']:.0f}", ""] if official else ["", ""]
    print(f"| saturation, less dark current | e⁻ | {sensor.saturation_e:.0f} | {' | '.join(cells)} |")
    return bool(good)


def main() -> int:
    """Print the tables and draw the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sensors", nargs="*", default=known_sensors(), help="names (without: all)")
    parser.add_argument("--official", metavar="PYTHON", help="interpreter of the environment that has emva1288")
    parser.add_argument("--levels", type=int, default=50)
    parser.add_argument("--stack", type=int, default=32, help="frames for the spatial figures, bright and dark")
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    parser.add_argument("--seed", type=int, default=1288)
    parser.add_argument("--figures", type=Path, default=ROOT / "docs" / "figures", metavar="DIR")
    options = parser.parse_args()
    if options.levels < 20:
        parser.error(f"--levels {options.levels}; allowed: 20 or more")
    if unknown := set(options.sensors) - set(known_sensors()):
        parser.error(f"no sensor {', '.join(sorted(unknown))}; allowed: {', '.join(known_sensors())}")
    good = True
    for number, name in enumerate(options.sensors):
        sensor = scenes.load(ROOT / "scenes" / "room.toml", [f"sensor.name={name}"]).sensor
        good &= table(name, sensor, *measure(sensor, options, options.seed + number))
    options.figures.mkdir(parents=True, exist_ok=True)
    name = "machine-vision-global-shutter"
    sensor = scenes.load(ROOT / "scenes" / "room.toml", [f"sensor.name={name}"]).sensor
    law = draw_photon_transfer(options.figures / "photon-transfer.png", sensor, options.seed)
    fall_off = draw_fall_off(options.figures / "cos4.png", sensor, options.seed)
    ring_light = draw_ring_light(options.figures / "ring-light.png")
    print(f"\nphoton transfer law: within {law:.2%} at every level; cos⁴ θ: within {fall_off:.2%} at every ring")
    print(f"ring light: within {ring_light:.2%} of I cos α/D² at every distance and angle")
    return 0 if good and max(law, fall_off, ring_light) < BAND else 1


if __name__ == "__main__":
    sys.exit(main())
