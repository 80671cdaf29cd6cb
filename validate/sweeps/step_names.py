"""Readable names of a sweep's views, whose own names are hashes: the camera and the step of the sweep."""

from __future__ import annotations

from collections.abc import Sequence

from validate.sweeps.sweep import Plan

__all__ = ["names_in_steps"]


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
