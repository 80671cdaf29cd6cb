"""What the rendering tests share: the shipped room, lit once a session (15 s on two quiet cores)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.helpers import render_marker

GUARD = render_marker.Guard()
ROOM_FILE = Path(__file__).parents[1] / "scenes" / "room.toml"


@pytest.hookimpl(tryfirst=True)  # before `-m` selects
def pytest_collection_modifyitems(items):
    """Mark tests that render by their fixtures."""
    render_marker.mark(items)


def pytest_configure():
    """Watch imports of Mitsuba."""
    sys.meta_path.insert(0, GUARD)


def pytest_unconfigure():
    """Stop watching."""
    sys.meta_path.remove(GUARD)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Refuse the renderer to tests without the marker, before their fixtures of any scope are made."""
    GUARD.enter(item)


@pytest.fixture(scope="session")
def room():
    """The shipped room."""
    import scenes

    return scenes.load(ROOM_FILE)


@pytest.fixture(scope="session")
def room_store(room, tmp_path_factory):
    """A store that holds the room's light."""
    from render.store.folder import Store
    from render.store.light import baked

    # Workers of pytest-xdist have a folder each, beside each other.
    base = tmp_path_factory.getbasetemp()
    store = Store((base.parent if base.name.startswith("popen-") else base) / "room-store")
    baked(room.state, store)
    return store


@pytest.fixture(scope="session")
def mi():
    """Mitsuba, with a libLLVM that was asked for its version first."""
    from render import backend

    return backend.start(backend.choose())


@pytest.fixture(scope="session")
def room_renderer(room, room_store, mi):
    """A renderer of the shipped room."""
    from render import backend
    from render.renderer import Renderer
    from render.store.light import baked

    return Renderer(room.state, baked(room.state, room_store), backend.choose())


@pytest.fixture(scope="session")
def runs():
    """A process that starts runs whose views are drawn instead of rendered."""
    from tests.helpers.drawn_sweep import Runs

    with Runs() as runs:
        yield runs
