"""Views of a small room whose pixels are noise, and a store to keep them in."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from rich.console import Console

from render.random_streams import random_stream
from render.store.locks import RESERVATIONS
from render.world.state import Marker
from tests.helpers.views import an_awkward_view
from validate.runs.progress import ViewProgress

REQUEST, VIEW = an_awkward_view()
# Of the camera: enough views that some are whole while one is damaged.
ZOOMS = (1.5, 2.0, 3.0)
MARKER = Marker(5, "board", (0.0, 0.0, 1.3), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.02)
WAYS = ("cut", "flipped", "emptied")


def no_progress(total):
    """Progress that says nothing."""
    return ViewProgress(total, Console(quiet=True))


class QueueOfThisProcess:
    """A `WorkerQueue` without workers."""

    def __init__(self, workers, most_waiting, done):
        self._done = done

    def __enter__(self):
        return self

    def __exit__(self, *error):
        return None

    def submit(self, item, function, *arguments):
        """Make the call at once."""
        try:
            result, error = function(*arguments), None
        except Exception as raised:
            result, error = None, raised
        self._done(item, result, error)

    def drain(self, between=lambda: None):
        """Nothing is under way."""


class NoiseRenderer:
    """Renders a view's own noise."""

    rendered: ClassVar[list[str]] = []

    def __init__(self, state, meshes, chosen):
        assert meshes is not None

    def render(self, request):
        """The same request gives the same view."""
        self.rendered.append(request.key)
        rng = random_stream(0, request.key, "noise")
        radiance = rng.lognormal(-5, 1, VIEW.radiance.shape).astype(np.float32)
        return dataclasses.replace(VIEW, key=request.key, camera=request.camera, radiance=radiance)


def damaged(data, way):
    """Bytes cut, with one bit turned, or none."""
    middle = len(data) // 2
    turned = data[:middle] + bytes([data[middle] ^ 4]) + data[middle + 1 :]
    return {"cut": data[:middle], "flipped": turned, "emptied": b""}[way]


def stored(folder):
    """All files of a store but those set aside, and the one that is always empty."""
    files = (path for path in folder.rglob("*") if path.is_file() and "damaged" not in path.parts)
    return sorted(path for path in files if path.name != RESERVATIONS)
