"""A test that starts Mitsuba carries the marker `render`, or fails: `make quick` leaves out those that carry it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.helpers.processes import environment

IN_THIS_PROCESS = """
def test_it():
    from render import backend
    backend.start(backend.Backend("scalar_rgb", "", 0, ""))
"""
IN_ANOTHER_PROCESS = """
import subprocess, sys
def test_it():
    code = "from render import backend; backend.start(backend.Backend('scalar_rgb', '', 0, ''))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
"""
IN_A_FIXTURE = """
import pytest
@pytest.fixture(scope="module")
def view():
    import mitsuba
def test_it(view):
    pass
"""
MARKED = """
import pytest
@pytest.mark.render
def test_it():
    import os
    assert "without_renderer" not in os.environ["PYTHONPATH"]
"""


def test_the_renderer_is_refused_to_a_test_without_the_marker_alone(tmp_path):
    tests = {"here": IN_THIS_PROCESS, "process": IN_ANOTHER_PROCESS, "fixture": IN_A_FIXTURE, "marked": MARKED}
    for name, text in tests.items():
        (tmp_path / f"test_{name}.py").write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "-p", "no:cacheprovider", str(tmp_path)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=tmp_path, env=environment(), timeout=300
    )
    assert done.returncode == pytest.ExitCode.TESTS_FAILED
    assert "1 passed" in done.stdout
    for name in ("here", "process", "fixture"):
        assert f"test_{name}.py::test_it starts the renderer; mark it `render`" in done.stdout
