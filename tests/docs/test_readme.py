"""What the README says runs, and prints what it says."""

from __future__ import annotations

import contextlib
import importlib.metadata
import io
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_example_prints_what_the_readme_says():
    """The block of Python under "The metric alone"."""
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(block, "README.md", "exec"), {})
    (promised,) = re.findall(r"prints `(PSS .*?)`", README)
    assert printed.getvalue().strip() == promised


def test_files_that_the_readme_shows_are_there():
    """Pictures and links lead somewhere."""
    for link in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / link).exists(), link


def test_the_installed_command_is_the_script():
    """`pss-testbed` and `python validate/run_sweep.py` are one function."""
    from validate import run_sweep

    found = [e for e in importlib.metadata.entry_points(group="console_scripts") if e.name == "pss-testbed"]
    if not found:
        pytest.skip("the project is not installed")
    assert found[0].load() is run_sweep.main
