"""What statistics cost with the number of configurations: `python benchmarks/many_configurations.py`.

A hundred views of the room, 20 trials each, are there already: detections drawn around the true projections of the
markers that each view sees, so that nothing is rendered and nothing is detected. Configurations of four views are then
triangulated, predicted and ranked as the bank and the gate do it, in blocks, of which only each point's 1/σ is kept.
Printed for each number of configurations, each in a process of its own: seconds by the clock (after the detections are
drawn) and of all processors (from the start), and the peak memory of all processes together.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import scenes
from pss import noise_model
from pss.cameras.views import Views
from pss.visibility.points import VISIBILITY_TESTS, visible_in
from validate.bank.design import BankDesign, ViewBank, draw_configurations, held_out_views
from validate.bank.judge import predictions
from validate.bank.leaderboard import single_frame_terms
from validate.bank.measured import BankData, measure_all
from validate.prediction.contenders import Contender
from validate.stats.crossed import Resamples
from validate.stats.ranking import judge_against

Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
NUMBERS = (100, 1000, 10_000)
VIEWS, TRIALS, CAMERAS, SEED = 100, 20, 4, 1
# px, per axis: about what the markers of the room's views are localised with.
SIGMA_PX = 0.015
# Configurations whose errors are in memory at a time.
BLOCK = 2000
MODEL = "corrected"


def drawn_bank(views: int) -> tuple[ViewBank, BankData]:
    """The room's cameras at random settings, and detections around the projections of what each sees."""
    scene = scenes.load("scenes/room.toml")
    settings = -(-views // len(scene.cameras))
    bank = held_out_views(scene, BankDesign(settings=settings, turns=1, trials=TRIALS, seed=SEED), "none")
    bank = dataclasses.replace(bank, views=bank.views[:views])
    state, rng = scene.state, np.random.default_rng(SEED)
    seen = visible_in(Views(list(bank.cameras), state.points_m, state.normals), state.occluders, VISIBILITY_TESTS)
    pixels = np.full((views, TRIALS, len(state.points_m), 2), np.nan)
    for view, camera in enumerate(bank.cameras):
        true_px = camera.project(state.points_m[seen[view]])[0]
        pixels[view][:, seen[view]] = true_px + SIGMA_PX * rng.standard_normal((TRIALS, *true_px.shape))
    covariance = np.broadcast_to(SIGMA_PX**2 * np.eye(2), (*pixels.shape, 2))
    return bank, BankData(bank.cameras, state.points_m, pixels, covariance, scene.process, SEED)


def judged(bank: ViewBank, data: BankData, number: int) -> tuple[int, tuple[float, float, float]]:
    """How many of `number` configurations there are, and ρ of predicted with measured single-frame PSS over them."""
    names = [camera.name for camera in bank.cameras]
    chosen = draw_configurations(names, CAMERAS, number, np.random.default_rng(SEED))
    contender = Contender(MODEL, noise_model(MODEL, sensor=bank.scene.sensor, ccd_noise=bank.scene.sensor.ccd_noise))
    predicted: list[Floats] = []
    measured: list[Floats] = []
    for start in range(0, len(chosen), BLOCK):
        block = chosen[start : start + BLOCK]
        measured += [found.errors.inverse_sigma for found in measure_all(data, block.tolist())]
        predicted += [single_frame_terms(found[MODEL]) for found in predictions(bank, [contender], block, None)]
    resamples = Resamples.of_configurations(chosen, len(data.points_m), names)
    rho = judge_against(np.array(predicted), np.array(measured), resamples)
    return len(chosen), (rho.estimate, *rho.interval)


def one(number: int) -> None:
    """Print the middle of a row."""
    bank, data = drawn_bank(VIEWS)
    begin = time.perf_counter()
    found, (rho, low, high) = judged(bank, data, number)
    seconds = time.perf_counter() - begin
    print(f"{found} {seconds:.1f} {rho:+.3f} [{low:+.3f}, {high:+.3f}]")


def used_by(root: int, cpu_s: dict[int, float]) -> int:
    """Resident bytes of a process and its descendants now; their seconds of processor time go to `cpu_s` (Linux)."""
    parents, sizes, spent = {}, {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        pid = int(stat.parent.name)
        parents[pid] = int(fields[1])
        spent[pid] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        sizes[pid] = int(fields[21]) * os.sysconf("SC_PAGE_SIZE")
    family = {root}
    while grown := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= grown
    cpu_s.update({pid: spent[pid] for pid in family if pid in spent})
    return sum(sizes.get(pid, 0) for pid in family)


def row(number: int) -> str:
    """A process of its own for a number of configurations, watched from outside."""
    command = [sys.executable, __file__, "--one", str(number)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    cpu_s: dict[int, float] = {}
    peak = 0
    while process.poll() is None:
        peak = max(peak, used_by(process.pid, cpu_s))
        time.sleep(0.1)
    output, _ = process.communicate()
    if process.returncode:
        raise SystemExit(process.returncode)
    found, seconds, rho = output.strip().split(" ", 2)
    total = sum(cpu_s.values())
    return f"| {int(found):,} | {seconds} | {total:.0f} | {1e3 * total / int(found):.0f} | {peak / 1e9:.2f} | {rho} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--numbers", type=int, nargs="+", default=list(NUMBERS), help="of configurations")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one is not None:
        one(arguments.one)
        return
    print("| configurations | s | processor s | processor ms each | peak GB in all | ρ of PSS |\n" + "|---" * 6 + "|")
    for number in arguments.numbers:
        print(row(number), flush=True)


if __name__ == "__main__":
    main()
