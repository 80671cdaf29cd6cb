"""A view by one call: from the store, or rendered with its light solved, and stored."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor, PTZCamera, RangeError
from pss.inputs import having, number
from render import backend
from render.captures import captures
from render.lens.sampling import Sampling
from render.light.exposure import AutoExposure
from render.renderer import RenderedView, Renderer, ViewRequest
from render.store.folder import Store
from render.store.light import lit
from render.store.remote import open_store
from render.store.views import load_view, save_view
from render.world.state import SceneState

__all__ = ["NOISE_RATIO", "View", "Viewable", "view"]

NOISE_RATIO = 0.6
"""Bound on the sampling noise at the edges of markers, in units of the sensor's noise (σ): that of the project's
sweeps, whose views are then the same."""


class Viewable(Protocol):
    """A scene that can be rendered: `scenes.Scene`, or any object with these attributes."""

    @property
    def state(self) -> SceneState:
        """Room, light, objects and markers."""

    @property
    def sensor(self) -> ImageSensor:
        """The sensor of all cameras."""

    @property
    def auto_exposure(self) -> AutoExposure | None:
        """None if the sensor's exposure is a number."""


@dataclass(frozen=True, eq=False)
class View(RenderedView):
    """A rendered view, with its captures. Images are numpy arrays, (height, width).

    Attributes:
        key: hash of everything that determines the view, its name in the store.
        camera, sensor: those of the request.
        radiance: W/(m² sr), float32, noise-free up to the sampling noise that `certificate` states.
        depth_m: m, float32, along the optical axis, for each pixel's centre, from the lens; inf where nothing is hit.
        normal: (height, width, 3), float32, unit, in the world.
        marker_id: int32, id of the marker whose plate is visible, −1 elsewhere.
        capture_dn: uint16, the capture that is stored with the view.
        certificate: the view's sampling noise.
    """

    def capture(self, seed: int = 1, trial: int = 0) -> NDArray[np.uint16]:
        """One noisy exposure in digital numbers, (height, width): photon, dark and read noise, and the pixels' pattern.

        Args:
            seed: of the random numbers, 0 or more.
            trial: number of the capture, from 0; trial t of `validate.measure` with the same seed is the same image.

        Raises:
            RangeError: a seed or a trial below 0.
        """
        for name, value in (("seed", seed), ("trial", trial)):
            if value < 0:
                raise RangeError(f"{name} = {value}; allowed: 0 or more")
        return next(captures(self, seed, [trial]))


def view(
    scene: Viewable,
    camera: PTZCamera,
    store: str | Path | Store | None = None,
    *,
    noise_ratio: float = NOISE_RATIO,
    variant: str | None = None,
) -> View:
    """The view of a scene in a camera.

    A view in the store is read (tens of milliseconds); a missing one is rendered (seconds to minutes) and stored, under
    the same name as by the commands. The scene's light is solved once for each scene state, 15 s for the shipped room
    on two cores, and stored likewise; without a store it is cached for this process's further views of the same state.

    Args:
        scene: state, sensor and exposure.
        camera: one of the scene's, or any other with any settings.
        store: folder of rendered views, or an address that fsspec knows, such as "s3://…".
        noise_ratio: bound on the sampling noise of the noisiest pixels at the edges of markers, in units of their
            sensor noise (σ). Half of it takes four times as long.
        variant: Mitsuba's variant, "llvm_ad_mono", "cuda_ad_mono" or "scalar_rgb"; None for LLVM if libLLVM is
            available, else scalar.

    Raises:
        RangeError: the scene's exposure is "auto", or a value that is not allowed.
        StoreError: the store cannot be used, or the disk is full.
        MissingLibraryError: the variant, or the kind of store, needs a library that is not installed.
    """
    having(scene, "state", "scene", "a scene, such as scenes.load returns")
    having(camera, "focal_px", "camera", "a camera, such as scene.camera returns")
    if scene.auto_exposure is not None:
        raise RangeError(
            'sensor.exposure_ms = "auto", and a single view does not determine it; allowed: a number of ms, such as '
            "scene.with_exposure(8.0)"
        )
    if not 0 < number(noise_ratio, "noise_ratio") <= 10:
        raise RangeError(f"noise_ratio = {noise_ratio!r}; allowed: above 0, at most 10")
    chosen = backend.choose(variant)
    request = ViewRequest(scene.state, camera, scene.sensor, Sampling(noise_ratio=noise_ratio), chosen.identity)
    if store is None:
        return _view(Renderer(scene.state, lit(scene.state, None, chosen), chosen).render(request))
    opened = store if isinstance(store, Store) else open_store(store)
    found = load_view(opened, request.key)
    if found is None:
        renderer = Renderer(scene.state, lit(scene.state, opened, chosen), chosen)
        begin = time.perf_counter()
        found = renderer.render(request)
        save_view(opened, found, request, time.perf_counter() - begin)
    return _view(found)


def _view(rendered: RenderedView) -> View:
    return View(**vars(rendered))
