"""The prediction of a scene's cameras by each of the scene's noise models, from settings alone: nothing is rendered."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from pss import Appearance, Evaluation, PTZCamera, RangeError, evaluate
from pss.inputs import having, members
from render.light import lit_scene
from render.light.exposure import choose_exposure
from render.store.folder import Store
from render.store.light import lit
from render.store.remote import open_store
from scenes import Scene

__all__ = ["exposed", "predict"]


def predict(
    scene: Scene,
    cameras: Sequence[PTZCamera],
    appearance: Appearance | None = None,
    *,
    store: str | Path | Store | None = None,
) -> dict[str, Evaluation]:
    """The metric of a configuration of cameras, at the centres of the scene's markers.

    The models that need it are given how the markers look in the scene's solved light, as in every run: solving it
    takes 15 s for the shipped room on two cores, once for each scene state in a process, and once for all with a store.
    `scene.appearance()`, an estimate with shadows but without shadows of reflected light, takes a hundredth of that.

    Args:
        scene: points, noise models, process model, visibility tests and occluders. An exposure of "auto" is chosen for
            these cameras.
        cameras: one or more, the scene's own or others.
        appearance: how the markers look; None for that in the solved light.
        store: folder or address of the store that has the light, or is to have it; None to solve it, unless this
            process has it from its last views or predictions.

    Returns:
        By the name of each of `scene.noise_models`, σ∞, C and PSS with the arrays behind them (`pss.Evaluation`).

    Raises:
        RangeError: no camera, or a value that a noise model does not allow.
        StoreError: the store cannot be used.

    Source: Eqs. 2 to 15 of the paper, equation by equation in docs/metric.md.
    """
    having(scene, "state", "scene", "a scene, such as scenes.load returns")
    cameras = members(cameras, "cameras", "focal_px", "cameras, such as scene.select returns")
    if not cameras:
        raise RangeError("cameras = (); allowed: one or more")
    state = scene.state
    if appearance is None:
        opened = store if store is None or isinstance(store, Store) else open_store(store)
        appearance = lit_scene.appearance(state, lit(state, opened))
    scene = exposed(scene, cameras, appearance)
    return {
        model.name: evaluate(
            cameras,
            state.points_m,
            state.normals,
            noise=model,
            process=scene.process,
            occluder=state.occluders,
            appearance=appearance,
            visibility=scene.visibility,
        )
        for model in scene.noise_models
    }


def exposed(scene: Scene, cameras: Iterable[PTZCamera], appearance: Appearance) -> Scene:
    """The scene with an exposure in numbers: its own, or where that is "auto", the one chosen for these cameras."""
    if scene.auto_exposure is None:
        return scene
    points, normals = scene.state.points_m, scene.state.normals
    choice = choose_exposure(appearance, points, normals, cameras, scene.sensor, scene.auto_exposure)
    return scene.with_exposure(choice.exposure_ms)
