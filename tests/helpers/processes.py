"""Processes that tests start."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]


def environment(**variables: str) -> dict[str, str]:
    """The variables of this process, with the project first of what is imported, and `variables`.

    What is on the path already stays: `tests.helpers.render_marker` puts a stand-in for Mitsuba there.
    """
    path = os.pathsep.join(part for part in (os.environ.get("PYTHONPATH"), str(ROOT)) if part)
    return os.environ | {"PYTHONPATH": path} | variables
