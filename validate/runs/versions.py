"""Versions of all libraries that a run's numbers depend on."""

from __future__ import annotations

import importlib.metadata
import platform

__all__ = ["versions"]


def versions() -> dict[str, str]:
    """Of Python and of the packages that a run's numbers depend on."""
    packages = ("mitsuba", "drjit", "opencv-contrib-python-headless", "numpy", "scipy", "OpenImageIO", "pss-testbed")
    return {name: _version(name) for name in packages} | {"python": platform.python_version()}


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
