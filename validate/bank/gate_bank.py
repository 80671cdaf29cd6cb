"""A bank of views from which configurations are drawn: many configurations for few rays. The gate's own small bank.

A configuration takes views of different cameras, since one camera has one setting at a time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pss import Appearance, NoiseModel, evaluate_many
from render.sampling import Sampling
from render.view import ViewRequest
from scenes import Scene, load_scene
from scenes.sweep_file import SWEEPS
from validate.acquire import Acquired, Acquisition
from validate.assess import triangulated_errors

__all__ = [
    "GATE_OVERRIDES",
    "GATE_VIEWS",
    "Bank",
    "draw_configurations",
    "gate_bank",
    "measured_points",
    "predicted_points",
]

Floats = NDArray[np.float64]

# The room at half its resolution with the same fields of view, and light enough that blur and not darkness decides what
# is found.
GATE_OVERRIDES = (
    "sensor.resolution_px=[640, 480]",
    "sensor.pixel_pitch_um=9.3",
    "sensor.exposure_ms=8.0",
)
# Of the sampling's noise, as in the sweeps.
GATE_NOISE_RATIO = 0.45
# (camera, zoom, focus distance in m): each camera once focused on the scene and once well in front of it (circles of
# confusion of 3 to 8 px), at zooms that show about the same part of it; two cameras a third time.
GATE_VIEWS = (
    ("1", 3.5, 3.3), ("1", 4.0, 1.6),
    ("2", 3.5, 3.9), ("2", 4.0, 1.6), ("2", 3.0, 2.2),
    ("3", 3.5, 4.2), ("3", 4.0, 1.6),
    ("4", 3.5, 3.8), ("4", 4.0, 1.6),
    ("5", 3.5, 4.2), ("5", 4.0, 1.6),
    ("6", 3.5, 3.9), ("6", 4.0, 1.6), ("6", 3.0, 2.2),
    ("7", 3.5, 3.3), ("7", 4.0, 1.6),
)  # fmt: skip
GATE_TRIALS = 10
GATE_SEED = 7


@dataclass(frozen=True, eq=False)
class Bank:
    """A scene and the views that configurations are drawn from."""

    scene: Scene
    views: tuple[Acquisition, ...]

    @property
    def camera_names(self) -> tuple[str, ...]:
        """The camera of each view."""
        return tuple(view.request.camera.name for view in self.views)


def gate_bank(renderer: str) -> Bank:
    """The bank that `make test` renders."""
    scene = load_scene(SWEEPS.parent / "room.toml", GATE_OVERRIDES)
    views = []
    for name, zoom, focus in GATE_VIEWS:
        camera = dataclasses.replace(scene.camera(name), zoom=zoom, focus_distance_m=focus)
        request = ViewRequest(scene.state, camera, scene.sensor, Sampling(noise_ratio=GATE_NOISE_RATIO), renderer)
        views.append(Acquisition(request, GATE_SEED, GATE_TRIALS))
    return Bank(scene, tuple(views))


def draw_configurations(
    camera_names: Sequence[str], size: int, count: int, rng: np.random.Generator
) -> list[tuple[int, ...]]:
    """Draw `count` different configurations of `size` views, each of another camera, as indices of views."""
    possible = [
        chosen
        for chosen in combinations(range(len(camera_names)), size)
        if len({camera_names[view] for view in chosen}) == size
    ]
    picked = rng.choice(len(possible), size=min(count, len(possible)), replace=False)
    return [possible[number] for number in np.sort(picked)]


def predicted_points(
    bank: Bank, configurations: Sequence[tuple[int, ...]], model: NoiseModel, appearance: Appearance | None = None
) -> Floats:
    """1/m, (K, N), what each point adds to the predicted single-frame PSS; 0 where unobservable."""
    state = bank.scene.state
    cameras = [view.request.camera for view in bank.views]
    evaluations = evaluate_many(
        [[cameras[view] for view in chosen] for chosen in configurations],
        state.points_m,
        state.normals,
        noise=model,
        process=bank.scene.process,
        occluder=state.occluders,
        appearance=appearance,
    )
    return np.nan_to_num(1 / evaluations.single_frame_sigma_m)


def measured_points(bank: Bank, configurations: Sequence[tuple[int, ...]], acquired: Acquired) -> Floats:
    """1/m, (K, N), what each point adds to the measured single-frame PSS."""
    rows = []
    for chosen in configurations:
        wanted = [bank.views[view] for view in chosen]
        cameras = [item.request.camera for item in wanted]
        _, errors = triangulated_errors(bank.scene, cameras, [acquired.measured[item] for item in wanted])
        rows.append(errors.inverse_sigma)
    return np.array(rows)
