"""What the README says runs, and prints what it says."""

from __future__ import annotations

import importlib.metadata
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_is_short():
    """At most 8,000 bytes, one picture of results above the first heading, one block of numbers from tables."""
    assert len(README.encode("utf-8")) <= 8_000
    assert README.count("<!-- numbers:") == 1
    assert README.partition("\n## ")[0].count("![") == 1


# What makes README.md's example small enough for a test.
SMALLER = {
    '"sensor.exposure_ms=8"': '"sensor.exposure_ms=8", "sensor.resolution_px=[320, 240]"',
    "trials=10": "trials=2",
    "trials=5": 'trials=2, overrides=["sensor.resolution_px=[320, 240]", "sweep.vary.values=[1, 3]"]',
}


def example() -> str:
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    return block


def test_the_example_has_at_most_twelve_lines():
    assert len([line for line in example().splitlines() if line.strip()]) <= 12


@pytest.mark.render
def test_the_example_runs(tmp_path, monkeypatch, capsys):
    """README.md's Python, with smaller images and fewer steps: from a scene to saved tables."""
    monkeypatch.chdir(tmp_path)
    code = example()
    for long, short in SMALLER.items():
        assert code.count(long) == 1
        code = code.replace(long, short)
    names: dict[str, Any] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert names["image"].shape == names["view"].radiance.shape == (240, 320)
    assert len(names["found"].ids) > 0
    assert list(names["predicted"]) == [model.name for model in names["scene"].noise_models]
    printed = capsys.readouterr().out
    assert all(model in printed for model in names["predicted"])
    assert (tmp_path / "results" / "zoom" / "configurations.csv").exists()
    assert len(names["result"].table("configurations")) == 2 * len(names["predicted"])


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
