"""Pixels of a schedule's markers drawn from the physical noise model, in place of rendered and detected ones."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from pss import Appearance
from pss.cameras.views import Views
from pss.visibility.points import visible_in
from pss.visibility.targets import TARGET_VISIBILITY
from render.keys import state_key
from validate.acquire.acquire import Acquired
from validate.markers.view_measurement import ViewMeasurement
from validate.schedule.process_noise import levels_of_walk

TRIALS = 12
# A typical error of a marker of a single frame.
SIGMA_M = 5e-5


def appearance(scene):
    """Markers under the same light everywhere."""
    modules = np.array([marker.module_m for marker in scene.state.markers])
    along = np.array([marker.right for marker in scene.state.markers])
    return Appearance(modules, 0.08, 0.004, along)


def drawn(scene, cameras, rng, trials=TRIALS, noise=1.0):
    """Detections of each camera, with the physical model's noise, of the markers in view as a whole."""
    state, target_appearance = scene.state, appearance(scene)
    views = Views(list(cameras), state.points_m, state.normals, target_appearance)
    (physical,) = (model for model in scene.noise_models if model.name == "physical")
    with np.errstate(all="ignore"):
        covariance = physical.of_views(views).matrix(len(cameras), len(state.points_m))
    visible = visible_in(views, state.occluders, TARGET_VISIBILITY)
    found = []
    for number, camera in enumerate(cameras):
        pixels = np.full((trials, len(state.points_m), 2), np.nan)
        own = np.full((trials, len(state.points_m), 2, 2), np.nan)
        seen = np.flatnonzero(visible[number])
        root = np.linalg.cholesky(covariance[number, seen])
        errors = (root @ rng.standard_normal((trials, len(seen), 2, 1)))[..., 0]
        pixels[:, seen] = camera.project(state.points_m[seen])[0] + noise * errors
        own[:, seen] = covariance[number, seen]
        found.append(ViewMeasurement(pixels, own, 0, 0.0))
    return found


def acquired_of(places, seed=3, noise=1.0):
    """What `acquire` would bring, of (scene, acquisitions) pairs."""
    rng, found = np.random.default_rng(seed), Acquired()
    for scene, requested in places:
        found.appearances[state_key(scene.state)] = appearance(scene)
        for item in requested:
            if item not in found.measured:
                (found.measured[item],) = drawn(scene, [item.request.camera], rng, noise=noise)
    return found


def levels_at(stage, sigma_m=SIGMA_M):
    """Levels of process noise as if training views had this error."""
    return levels_of_walk([SimpleNamespace(single_frame_sigma_m=np.array([sigma_m]))], stage.scene.process)


LIMITS = {"smallest_module_px": 1.5, "largest_blur_modules": 2.0}
