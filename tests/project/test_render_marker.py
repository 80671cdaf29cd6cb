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


@pytest.mark.parametrize(
    "text", [IN_THIS_PROCESS, IN_ANOTHER_PROCESS, IN_A_FIXTURE], ids=["here", "another process", "fixture"]
)
def test_the_renderer_is_refused_to_a_test_without_the_marker(text, tmp_path):
    code, output = outcome(text, tmp_path)
    assert code == pytest.ExitCode.TESTS_FAILED
    assert "test_made_up.py::test_it" in output
    assert "starts the renderer; mark it `render`" in output


def test_a_test_with_the_marker_may_start_it(tmp_path):
    code, output = outcome(MARKED, tmp_path)
    assert code == pytest.ExitCode.OK, output


def outcome(text, folder):
    """The exit code and the output of pytest on a file with this text, under the project's conftest."""
    path = folder / "test_made_up.py"
    path.write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "-p", "no:cacheprovider", str(path)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=folder, env=environment(), timeout=300
    )
    return done.returncode, done.stdout + done.stderr
