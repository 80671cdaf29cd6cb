"""The metric's speed, each figure beside a loop over SciPy in the same run: `python benchmarks/metric.py`.

The loop is what one writes first: for each point the stacked Jacobians and noises of its cameras (made ready before the
clock starts), `scipy.linalg.solve_discrete_are`, the largest eigenvalue. It is timed over a few hundred points.
"""

from __future__ import annotations

import argparse
import dataclasses
import resource
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from pss import (
    ConstantAcceleration,
    ConstantVelocity,
    PTZCamera,
    RandomWalk,
    Rectangle,
    Sphere,
    evaluate,
    evaluate_many,
)
from pss.processes.process import ProcessModel

Floats = NDArray[np.float64]

PLACES = ((-2.8, 0.2), (-2.8, 1.6), (-1.7, 2.8), (0.0, 2.8), (1.7, 2.8), (2.8, 1.6), (2.8, 0.2))
TARGET = (0.0, -0.7, 1.3)
OCCLUDERS = (Sphere("ball", (0.25, 0.1, 1.25), 0.45), Rectangle("board", (0.0, -1.4, 1.3), 2.4, 1.8))
PROCESSES: dict[str, ProcessModel] = {
    "random walk (3 states)": RandomWalk(),
    "constant velocity (6 states)": ConstantVelocity(0.05),
    "constant acceleration (9 states)": ConstantAcceleration(0.3),
}
LOOP_POINTS = 300


@dataclass(frozen=True)
class Row:
    """What was timed, its median in seconds, and what it is per point."""

    what: str
    seconds: float
    points: int
    loop_us: float | None = None

    def __str__(self) -> str:
        each = self.seconds / self.points * 1e6
        ratio = "" if self.loop_us is None else f" | {self.loop_us / each:7.0f}"
        return f"{self.what:64} | {self.seconds * 1e3:9.2f} ms | {each:8.3f} µs a point{ratio}"


def cameras() -> list[PTZCamera]:
    """The room's seven, new objects at each call, as a controller makes them from new pan, tilt and zoom."""
    return [PTZCamera((x, y, 2.8), 0, 0, zoom=2, focus_distance_m=3.8).aimed_at(TARGET) for x, y in PLACES]


def points(count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Points about the target with normals towards the cameras' half of the room."""
    normals = rng.normal(size=(count, 3))
    normals[:, 1] = np.abs(normals[:, 1]) + 0.3
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.array(TARGET) + rng.uniform(-0.6, 0.6, (count, 3)), normals


def median_seconds(call: Callable[[], object], repeats: int) -> float:
    """Median over `repeats` calls, after one that is not counted."""
    call()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def scipy_loop_us(process: ProcessModel, rng: np.random.Generator) -> float:
    """µs a point of the loop over SciPy, from ready Jacobians to σ∞."""
    where, normals = points(LOOP_POINTS, rng)
    result = evaluate(cameras(), where, normals)
    systems = []
    for i in np.flatnonzero(result.observable):
        seen = result.visible[:, i]
        H = np.vstack(result.jacobian[seen, i])
        H = np.hstack([H, np.zeros((len(H), process.states - 3))])
        systems.append((H, scipy.linalg.block_diag(*result.noise_px2[seen, i])))
    begin = time.perf_counter()
    for H, R in systems:
        P = scipy.linalg.solve_discrete_are(process.A.T, H.T, process.Q, R)
        np.sqrt(np.linalg.eigvalsh(P[:3, :3])[-1])
    return (time.perf_counter() - begin) / len(systems) * 1e6


def candidates(count: int, rng: np.random.Generator) -> Sequence[Sequence[PTZCamera]]:
    """Configurations of seven cameras, each with its own pan, tilt and zoom."""
    start = cameras()
    return [
        [
            dataclasses.replace(
                c, pan_deg=c.pan_deg + rng.normal(), tilt_deg=c.tilt_deg + rng.normal(), zoom=rng.uniform(1.5, 3)
            )
            for c in start
        ]
        for _ in range(count)
    ]


def main() -> None:
    """Print a row for each figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=15)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    print(f"{'what':64} | {'median':>12} | {'':16} | ratio to a SciPy loop")
    for name, process in PROCESSES.items():
        loop = scipy_loop_us(process, rng)
        where, normals = points(10_000, rng)
        network = cameras()
        seconds = median_seconds(lambda: evaluate(network, where, normals, process=process).pss, options.repeats)  # noqa: B023
        print(Row(f"7 cameras × 10,000 points, {name}", seconds, 10_000, loop))
        print(f"{'  the loop':64} | {'':12} | {loop:8.1f} µs a point")
    where, normals = points(200, rng)
    seconds = median_seconds(lambda: evaluate(cameras(), where, normals, occluder=OCCLUDERS).pss, 10 * options.repeats)
    print(Row("a control loop's call: 7 new cameras × 200 points, with rays", seconds, 200))
    where, normals = points(100, rng)
    chosen = candidates(1000, rng)
    seconds = median_seconds(lambda: evaluate_many(chosen, where, normals).pss, 3)
    print(Row("1,000 configurations × 7 cameras × 100 points in one call", seconds, 100_000))
    where, normals = points(1_000_000, rng)
    begin = time.perf_counter()
    evaluate(cameras(), where, normals).pss  # noqa: B018
    print(Row("7 cameras × 1,000,000 points", time.perf_counter() - begin, 1_000_000))
    unit = 1024 if sys.platform != "darwin" else 1
    print(f"peak memory of the process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9:.2f} GB")


if __name__ == "__main__":
    main()
