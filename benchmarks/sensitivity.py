"""How far the constants that the paper leaves open move its prediction: `python benchmarks/sensitivity.py`.

Each constant is taken ten times larger and smaller. Printed: by how much the mean PSS over the configurations of the
shipped sweeps changes, and Spearman's ρ between the configurations' ranks before and after, sweep by sweep.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import spearmanr

import scenes
from pss import RandomWalk, evaluate_many, noise_model
from scenes import Scene, known_sweeps, load_sweep

Change = Callable[[float], dict[str, object]]


def constants(scene: Scene, model: str) -> dict[str, Change]:
    """What may be changed, by name: from a factor to arguments of `evaluate_many`."""
    ccd = scene.sensor.ccd_noise
    return {
        "scale of Eq. 11 (1 px²/m²)": lambda by: {"noise": noise_model(model, ccd_noise=ccd, px2_per_m2=by)},
        f"CCDnoise of Eqs. 12, 13 ({ccd:g})": lambda by: {"noise": noise_model(model, ccd_noise=ccd * by)},
        "process noise q ((1 mm)² a frame)": lambda by: {
            "noise": noise_model(model, ccd_noise=ccd),
            "process": RandomWalk(1e-3 * by**0.5),
        },
    }


def main() -> None:
    """Print a row for each model, constant and direction."""
    # A sweep of one factor isolates one constant; how the others move its ranks says nothing of cameras to choose from.
    sweeps = [sweep for sweep in map(load_sweep, known_sweeps()) if not sweep.varies_scene]
    rooms = [scenes.load(sweep.scene_path) for sweep in sweeps]
    print("| model | constant | times | PSS | " + " | ".join(f"ρ {sweep.name}" for sweep in sweeps) + " |")
    print("|---" * (4 + len(sweeps)) + "|")
    for model in ("as-printed", "corrected"):
        for name in constants(rooms[0], model):
            before = []
            for by in (1.0, 0.1, 10.0):
                values = []
                for sweep, scene in zip(sweeps, rooms, strict=True):
                    state = scene.state
                    values.append(
                        evaluate_many(
                            [configuration.cameras for configuration in sweep.configurations(scene)],
                            state.points_m,
                            state.normals,
                            occluder=state.occluders,
                            **constants(scene, model)[name](by),  # type: ignore[arg-type]
                        ).pss
                    )
                if by == 1.0:
                    before = values
                    continue
                ratio = np.concatenate(values).mean() / np.concatenate(before).mean()
                ranks = [float(spearmanr(a, b).statistic) for a, b in zip(values, before, strict=True)]
                print(f"| {model} | {name} | {by:g} | × {ratio:.2f} | " + " | ".join(f"{r:.2f}" for r in ranks) + " |")


if __name__ == "__main__":
    main()
