"""What people call a view, whose own name is a hash: its camera, and the step of the sweep or the camera's settings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from render.renderer import ViewRequest
from validate.acquire.acquire import Acquisition
from validate.sweeps.sweep import Plan

__all__ = ["names_in_steps", "view_name", "view_names"]


def view_name(request: ViewRequest) -> str:
    """A view by its camera's settings: "the view of camera west (pan 12°, tilt -5.5°, zoom 2, focus 2.5 m)"."""
    camera = request.camera
    settings = f"pan {camera.pan_deg:.3g}°, tilt {camera.tilt_deg:.3g}°, zoom {camera.zoom:.3g}"
    return f"the view of camera {camera.name} ({settings}, focus {camera.focus_distance_m:.3g} m)"


def view_names(wanted: Iterable[Acquisition]) -> dict[str, str]:
    """The names of views by their hashes."""
    return {item.request.key: view_name(item.request) for item in wanted}


def names_in_steps(plans: Sequence[Plan]) -> dict[str, str]:
    """The names of sweeps' views by their hashes: "the view of camera west at zoom=2 of zoom (and 4 other steps)"."""
    steps: dict[str, list[str]] = {}
    for plan in plans:
        for configuration, views in zip(plan.configurations, plan.views, strict=True):
            for item in views:
                where = f"the view of camera {item.request.camera.name} at {configuration.label} of {plan.sweep.name}"
                steps.setdefault(item.request.key, []).append(where)
    return {key: first + _others(len(others)) for key, (first, *others) in steps.items()}


def _others(count: int) -> str:
    return f" (and {count} other step{'s' if count > 1 else ''})" if count else ""
