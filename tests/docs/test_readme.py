"""What the README says runs, and prints what it says."""

from __future__ import annotations

import importlib.metadata
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_is_short():
    """At most 8,000 bytes, one picture of results above the first heading, one block of numbers from tables."""
    assert len(README.encode("utf-8")) <= 8_000
    assert README.count("<!-- numbers:") == 1
    assert README.partition("\n## ")[0].count("![") == 1


def test_the_example_has_at_most_twelve_lines():
    """And is Python; the names in it are those of docs/library.md."""
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len([line for line in block.splitlines() if line.strip()]) <= 12
    compile(block, "README.md", "exec")


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
