"""Solved light in a store, verified to belong to its scene state; solved if missing."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from render import backend
from render.keys import light_code, light_key, state_key
from render.light.lit_scene import GlowMeshes, bake
from render.light.radiosity import solve_light
from render.store.arrays import Arrays, check_arrays
from render.store.folder import Store, StoreError
from render.world.state import SceneState

__all__ = ["baked", "lit", "load_light", "save_light"]

# Lit scenes that a process caches for further views and predictions of the same states.
MOST_KEPT = 2

_kept: dict[str, GlowMeshes] = {}


def load_light(store: Store, key: str, state: SceneState) -> GlowMeshes | None:
    """The lit scene stored under a key; None if it is missing or damaged.

    Raises:
        StoreError: a damaged file cannot be set aside.
    """
    arrays = store.load(store.light(key), lambda arrays: _check(arrays, state))
    return None if arrays is None else GlowMeshes(**arrays)


def save_light(store: Store, key: str, meshes: GlowMeshes, code: str, seconds: float) -> None:
    """Store a lit scene, with the digest of the code that solved it and the seconds it took.

    Raises:
        StoreError: the store cannot be written, or the disk is full.
    """
    arrays = {name: np.asarray(value) for name, value in vars(meshes).items()}
    store.save(store.light(key), arrays, code, {"seconds": seconds})


def lit(state: SceneState, store: Store | None = None, chosen: backend.Backend | None = None) -> GlowMeshes:
    """The lit scene of a state: from the store, else from this process's cache, else solved now.

    Args:
        store: the store to read and write; None to use this process's cache only.
        chosen: the backend that traces rays for occlusion by meshes; None for the default one.

    Raises:
        StoreError: the store cannot be used, or lacks the light and cannot be written.
    """
    key = light_key(state)
    if store is not None:
        meshes = baked(state, store, chosen or backend.choose())
    elif key in _kept:
        meshes = _kept.pop(key)
    else:
        meshes = bake(state, solve_light(state, backend.start(chosen or backend.choose())))
    while len(_kept) >= MOST_KEPT:
        del _kept[next(iter(_kept))]
    _kept[key] = meshes
    return meshes


def baked(
    state: SceneState,
    store: Store,
    chosen: backend.Backend | None = None,
    solved: Callable[[str, float], None] = lambda key, took_s: None,
) -> GlowMeshes:
    """The lit scene of a state, from the store, or solved now and stored.

    Args:
        chosen: the backend that traces rays for occlusion by meshes; None without meshes.
        solved: called with the state's hash and the seconds it took, if the light had to be solved.

    Raises:
        StoreError: the light is missing from a store that cannot be written.
    """
    key = light_key(state)
    meshes = load_light(store, key, state)
    if meshes is None:
        if not store.writable:
            raise StoreError(
                f"{store.light(key)} is missing, and its folder cannot be written; allowed is one that has it"
            )
        begin = time.perf_counter()
        meshes = bake(state, solve_light(state, backend.start(chosen) if chosen else None))
        took_s = time.perf_counter() - begin
        save_light(store, key, meshes, light_code().digest, took_s)
        solved(state_key(state), took_s)
    return meshes


def _check(arrays: Arrays, state: SceneState) -> None:
    """Check that arrays are those of `GlowMeshes`, with the markers of `state`.

    Raises:
        ValueError: they are not; one line.
    """
    vertices, markers = len(arrays["vertices_m"]), len(state.markers)
    texels = arrays["textures"].shape[-1]
    shapes: dict[str, tuple[int | None, ...]] = {
        "vertices_m": (vertices, 3),
        "faces": (None, 3),
        "radiance": (vertices,),
        "plates_m": (markers, 4, 3),
        "textures": (markers, texels, texels),
        "marker_ids": (markers,),
        "vertex_objects": (vertices,),
        "plate_objects": (markers,),
    }
    check_arrays(arrays, shapes)
    for name in ("faces", "marker_ids", "vertex_objects", "plate_objects"):
        if arrays[name].dtype.kind != "i":
            raise ValueError(f"{name} is {arrays[name].dtype}; allowed: whole numbers")
    if not ((arrays["faces"] >= 0) & (arrays["faces"] < vertices)).all():
        raise ValueError(f"faces have corners that are not there; allowed: 0 to {vertices - 1}")
    if arrays["marker_ids"].tolist() != [marker.id for marker in state.markers]:
        raise ValueError("its markers are not those of the scene")
    if not all(np.isfinite(arrays[name]).all() for name in ("vertices_m", "radiance", "plates_m", "textures")):
        raise ValueError("it has a value that is not a finite number")
