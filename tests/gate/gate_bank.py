"""The gate's own small bank of views, which `make test` renders."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import scenes
from pss import Appearance, NoiseModel, evaluate_many
from render.lens.sampling import Sampling
from render.renderer import ViewRequest
from scenes import Scene
from scenes.steps.sweep_file import SWEEPS
from validate.acquire.acquire import Acquired, Acquisition
from validate.points.configuration import triangulated_errors

__all__ = [
    "GATE_OVERRIDES",
    "GATE_VIEWS",
    "Bank",
    "gate_bank",
    "measured_points",
    "predicted_points",
    "turned_view",
]

Floats = NDArray[np.float64]

# The room at half its resolution with the same fields of view, light enough that blur and not darkness decides what is
# found, and with a screen before the board in place of the plinth, so that occlusion decides much: a prediction that
# sees through everything has ρ = 0.6 with one that does not.
GATE_OVERRIDES = (
    "sensor.resolution_px=[640, 480]",
    "sensor.pixel_pitch_um=9.3",
    "sensor.exposure_ms=8.0",
    "objects.plinth.lowest_m=[-1.0, 0.6, 0.0]",
    "objects.plinth.highest_m=[0.3, 0.7, 2.4]",
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
    scene = scenes.load(SWEEPS.parent / "room.toml", GATE_OVERRIDES)
    views = []
    for name, zoom, focus in GATE_VIEWS:
        camera = dataclasses.replace(scene.camera(name), zoom=zoom, focus_distance_m=focus)
        request = ViewRequest(scene.state, camera, scene.sensor, Sampling(noise_ratio=GATE_NOISE_RATIO), renderer)
        views.append(Acquisition(request, GATE_SEED, GATE_TRIALS))
    return Bank(scene, tuple(views))


def turned_view(bank: Bank, view: int, turn_deg: float) -> Acquisition:
    """A view of the bank with its camera panned by `turn_deg`: what an installer's hand would do, unnoticed."""
    item = bank.views[view]
    camera = dataclasses.replace(item.request.camera, pan_deg=item.request.camera.pan_deg + turn_deg)
    return dataclasses.replace(item, request=dataclasses.replace(item.request, camera=camera))


def predicted_points(
    bank: Bank,
    configurations: Sequence[Sequence[int]],
    model: NoiseModel,
    appearance: Appearance | None = None,
    occluded: bool = True,
) -> Floats:
    """1/m, (K, N), what each point adds to the predicted single-frame PSS; 0 where unobservable.

    Args:
        occluded: False for a prediction that sees through everything.
    """
    state = bank.scene.state
    cameras = [view.request.camera for view in bank.views]
    evaluations = evaluate_many(
        [[cameras[view] for view in chosen] for chosen in configurations],
        state.points_m,
        state.normals,
        noise=model,
        process=bank.scene.process,
        occluder=state.occluders if occluded else (),
        appearance=appearance,
    )
    return np.nan_to_num(1 / evaluations.single_frame_sigma_m)


def measured_points(bank: Bank, configurations: Sequence[Sequence[int]], acquired: Acquired) -> Floats:
    """1/m, (K, N), what each point adds to the measured single-frame PSS."""
    rows = []
    for chosen in configurations:
        requested = [bank.views[view] for view in chosen]
        cameras = [item.request.camera for item in requested]
        _, errors = triangulated_errors(bank.scene, cameras, [acquired.measured[item] for item in requested])
        rows.append(errors.inverse_sigma)
    return np.array(rows)
