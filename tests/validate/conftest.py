"""Fixtures of several rooms."""

from __future__ import annotations

import dataclasses

import pytest

import validate.acquire.acquire as acquiring
from render.world.state import Light, Panel
from tests.helpers.stored_views import MARKER, REQUEST, ZOOMS, NoiseRenderer, QueueOfThisProcess
from validate.acquire.acquire import Acquisition


@pytest.fixture
def requested(monkeypatch):
    """Views of one camera at three zooms, in a room with a lamp and a marker; made by the stand-ins."""
    monkeypatch.setattr(acquiring, "Renderer", NoiseRenderer)
    monkeypatch.setattr(acquiring, "WorkerQueue", QueueOfThisProcess)
    NoiseRenderer.rendered = []
    state = dataclasses.replace(REQUEST.state, light=Light(0.2, (Panel((0.0, 0.0), (0.6, 0.6)),)), markers=(MARKER,))
    requests = [
        dataclasses.replace(REQUEST, state=state, camera=dataclasses.replace(REQUEST.camera, zoom=zoom))
        for zoom in ZOOMS
    ]
    return [Acquisition(request, 1, 2) for request in requests]
