"""Views in a store: writing, reading, and their certificates; everything is verified before use."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pss import RangeError
from render.certificate import Certificate
from render.files.exr import ImageFileError, ViewPlanes, read_planes, read_view, write_view
from render.keys import view_code
from render.renderer import RenderedView, ViewRequest
from render.store.atomic import disk_full, free_bytes
from render.store.folder import Store, StoreError

__all__ = [
    "DamagedViewError",
    "adopt_view",
    "certificate_of",
    "load_view",
    "render_seconds_of",
    "save_view",
    "stored_planes",
    "stored_view",
]

# Uncompressed bytes a pixel: four channels of four and three of two (`render.files.exr`).
BYTES_A_PIXEL = 22


class DamagedViewError(StoreError):
    """A view of the store is missing or was set aside: it has to be rendered again."""


def save_view(store: Store, view: RenderedView, request: ViewRequest, seconds: float | None = None) -> None:
    """Store a rendered view, with its certificate in its sum.

    Args:
        seconds: s, time of rendering, if known; stored with renderer and resolution for forecasts.

    Raises:
        StoreError: the store cannot be written, or the disk is full.
        ImageFileError: the image cannot be written for another reason.
    """
    path = store.view(request.key)

    def write(temporary: Path) -> None:
        try:
            write_view(temporary, view, request)
        except ImageFileError as error:
            # The image library gives no reason; no room for even the raw pixels means a full disk.
            most = BYTES_A_PIXEL * view.radiance.size
            written = temporary.stat().st_size if temporary.exists() else 0
            if free_bytes(path) + written < most:
                raise disk_full(path, f"up to {most:,}", written) from error
            raise

    rate = {"seconds": seconds, "pixels": int(view.radiance.size), "renderer": request.renderer}
    store.write(path, write, _facts(view) | (rate if seconds is not None else {}))


def load_view(store: Store, key: str) -> RenderedView | None:
    """A stored view; None if it is missing or damaged.

    Raises:
        StoreError: a damaged file cannot be set aside.
    """

    def read(path: Path) -> RenderedView:
        view = read_view(path)
        if view.key != key:
            raise ImageFileError(f"{path}: the header names view {view.key}")
        return view

    return store.read(store.view(key), read, _facts)


def stored_view(store: Store, key: str) -> RenderedView:
    """A stored view that is expected to exist.

    Raises:
        DamagedViewError: it does not, or not any more.
    """
    view = load_view(store, key)
    if view is None:
        raise DamagedViewError(f"view {key} is not in the store {store.folder}; it has to be rendered again")
    return view


def stored_planes(store: Store, key: str, names: Sequence[str]) -> ViewPlanes:
    """Some channels of a view that is expected to exist.

    Raises:
        DamagedViewError: it does not, or not any more.
    """

    def read(path: Path) -> ViewPlanes:
        planes = read_planes(path, names)
        if planes.key != key:
            raise ImageFileError(f"{path}: the header names view {planes.key}")
        return planes

    view = store.read(store.view(key), read)
    if view is None:
        raise DamagedViewError(f"view {key} is not in the store {store.folder}; it has to be rendered again")
    return view


def adopt_view(store: Store, path: Path) -> bool:
    """Whether the view at one of the store's paths is intact; a sum is added to one of an older version.

    Raises:
        StoreError: a damaged file cannot be set aside.
    """

    def read(path: Path) -> Certificate:
        view = read_view(path)
        if view.key != path.stem:
            raise ImageFileError(f"{path}: the header names view {view.key}")
        return view.certificate

    return store.read(path, read, lambda certificate: {"certificate": dataclasses.asdict(certificate)}) is not None


def certificate_of(store: Store, request: ViewRequest) -> Certificate | None:
    """The certificate of a stored view, from its sum; None if the view has to be rendered.

    Raises:
        StoreError: a damaged file cannot be set aside.
    """
    path = store.view(request.key)
    facts = store.facts(path)
    if facts is not None and "certificate" in facts:
        try:
            return Certificate.from_json(facts["certificate"])
        except RangeError as error:
            store.set_aside(path, f"its sum holds the {error}")
            return None

    def read(path: Path) -> RenderedView:
        # An older file: its header must match the request.
        view = read_view(path)
        if (view.key, view.camera, view.sensor) != (request.key, request.camera, request.sensor):
            raise ImageFileError(f"{path}: the header is that of another view")
        return view

    view = store.read(path, read, _facts)
    return None if view is None else view.certificate


def render_seconds_of(store: Store, request: ViewRequest) -> float | None:
    """s, time of rendering a stored view, by any machine; None if its sum has none.

    Raises:
        StoreError: as `certificate_of`.
    """
    seconds = (store.facts(store.view(request.key)) or {}).get("seconds")
    return None if seconds is None else float(seconds)


def _facts(view: RenderedView) -> dict[str, Any]:
    return {"version": view_code().digest, "certificate": dataclasses.asdict(view.certificate)}
