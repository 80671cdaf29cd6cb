"""Versions of all that a run's numbers hang on."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
from functools import cache
from pathlib import Path

__all__ = ["code_digest", "versions"]

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("pss", "render", "scenes", "validate")


def versions() -> dict[str, str]:
    """Of Python and of the packages that a run's numbers hang on."""
    packages = ("mitsuba", "drjit", "opencv-contrib-python-headless", "numpy", "scipy", "OpenImageIO", "pss-testbed")
    return {name: _version(name) for name in packages} | {"python": platform.python_version()}


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


@cache
def code_digest() -> str:
    """Stands for this project's own code: the same for the same modules, wherever they lie."""
    content = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            content.update(f"{path.relative_to(ROOT).as_posix()}\n".encode())
            content.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return content.hexdigest()[:12]
