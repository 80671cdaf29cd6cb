"""Readable names of views, whose own names are hashes: the camera and its settings."""

from __future__ import annotations

from collections.abc import Iterable

from render.renderer import ViewRequest
from validate.acquire.request import Acquisition

__all__ = ["view_name", "view_names"]


def view_name(request: ViewRequest) -> str:
    """A view by its camera's settings: "the view of camera west (pan 12°, tilt -5.5°, zoom 2, focus 2.5 m)"."""
    camera = request.camera
    settings = f"pan {camera.pan_deg:.3g}°, tilt {camera.tilt_deg:.3g}°, zoom {camera.zoom:.3g}"
    return f"the view of camera {camera.name} ({settings}, focus {camera.focus_distance_m:.3g} m)"


def view_names(requested: Iterable[Acquisition]) -> dict[str, str]:
    """The names of views by their hashes."""
    return {item.request.key: view_name(item.request) for item in requested}
