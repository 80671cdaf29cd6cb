"""Exposures of "auto": chosen once the files are read and before any view is named, from the scenes' solved light."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from render.backend import Backend
from render.keys import light_key, state_key
from render.light import lit_scene
from render.light.exposure import ExposureChoice, choose_exposure
from render.store.folder import Store
from render.store.light import baked
from scenes import Scene, SweepFile

__all__ = ["with_exposures"]

Loaded = tuple[SweepFile, Scene]


def with_exposures(
    loaded: Sequence[Loaded],
    store: Store,
    report: Callable[[str], None],
    note: Callable[[str], None],
    chosen_backend: Backend | None = None,
    solved: Callable[[str, float], None] = lambda key, took_s: None,
) -> list[Loaded]:
    """The same sweeps, with an exposure for every scene whose exposure is "auto".

    Sweeps of one scene have one exposure, the same for all their cameras and configurations: they share views.

    Args:
        report: called with each choice, in one line.
        note: called before what takes a while.
        chosen_backend, solved: as of `render.store.light.baked`.
    """
    open_scenes: dict[object, list[Loaded]] = {}
    for sweep, scene in loaded:
        if scene.auto_exposure is not None:
            group = state_key(scene.state), scene.sensor, scene.auto_exposure
            open_scenes.setdefault(group, []).append((sweep, scene))
    chosen = {}
    for group, members in open_scenes.items():
        scene = members[0][1]
        if not store.has(store.light(light_key(scene.state))):
            note("solving the scene's light, by which the exposure is chosen")
        choice = _choose(members, store, chosen_backend, solved)
        chosen[group] = choice.exposure_ms
        where = f" of {scene.path.name}" if len(open_scenes) > 1 else ""
        report(f"exposure{where}: {_described(choice, scene)}")
    return [
        (sweep, scene)
        if scene.auto_exposure is None
        else (sweep, scene.with_exposure(chosen[state_key(scene.state), scene.sensor, scene.auto_exposure]))
        for sweep, scene in loaded
    ]


def _choose(
    members: Sequence[Loaded], store: Store, chosen_backend: Backend | None, solved: Callable[[str, float], None]
) -> ExposureChoice:
    scene = members[0][1]
    state = scene.state
    cameras = (
        camera
        for sweep, with_its_cameras in members
        for configuration in sweep.configurations(with_its_cameras)
        for camera in configuration.cameras
    )
    marker_appearance = lit_scene.appearance(state, baked(state, store, chosen_backend, solved))
    assert scene.auto_exposure is not None
    return choose_exposure(marker_appearance, state.points_m, state.normals, cameras, scene.sensor, scene.auto_exposure)


def _described(choice: ExposureChoice, scene: Scene) -> str:
    wish = scene.auto_exposure
    assert wish is not None
    chosen = f"{choice.exposure_ms:g} ms chosen" + (", the longest allowed" if choice.longest else "")
    if choice.camera is None:
        return f"{chosen} (no camera has a marker in view)"
    marker = scene.state.markers[choice.point].id
    return (
        f"{chosen} (brightest marker at {choice.share:.0%} of saturation, requested: {wish.share:.0%}; "
        f"it is {marker} in camera {choice.camera.name})"
    )
