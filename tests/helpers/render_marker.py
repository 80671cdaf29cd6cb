"""The marker `render`: who carries it, and a guard that stops every other test from starting Mitsuba.

A test carries the marker if it is written above it, or if it uses one of the fixtures in `FIXTURES`. The guard makes
the first `import mitsuba` of a test without the marker fail, in the process of the tests and in those that they start.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import pytest

# Fixtures that start Mitsuba or solve the light of the shipped room.
FIXTURES = frozenset({"mi", "room_store", "room_renderer"})
# Acceptance tests run whole commands, and none of them is part of `make quick`.
MAY_RENDER = ("render", "acceptance")
STAND_IN = Path(__file__).parent / "without_renderer"


def mark(items: Sequence[pytest.Item]) -> None:
    """Add the marker to the tests that use one of `FIXTURES`, directly or through another fixture.

    And to acceptance tests, most of which run the whole command.
    """
    for item in items:
        if FIXTURES & set(getattr(item, "fixturenames", ())) or item.get_closest_marker("acceptance"):
            item.add_marker(pytest.mark.render)


class Guard:
    """A finder of modules for `sys.meta_path` that refuses Mitsuba while a test without the marker runs."""

    def __init__(self) -> None:
        self._test = ""

    def enter(self, item: pytest.Item) -> None:
        """Begin with a test: refuse Mitsuba here and in new processes, unless the test carries one of `MAY_RENDER`."""
        path = [part for part in os.environ.get("PYTHONPATH", "").split(os.pathsep) if part and part != str(STAND_IN)]
        self._test = "" if any(item.get_closest_marker(name) for name in MAY_RENDER) else item.nodeid
        os.environ["PYTHONPATH"] = os.pathsep.join(([str(STAND_IN)] if self._test else []) + path)

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Fail the running test if it has no marker and `name` is Mitsuba; otherwise let other finders search."""
        if name == "mitsuba" and self._test:
            pytest.fail(f"{self._test} starts the renderer; mark it `render`", pytrace=False)
        return None
