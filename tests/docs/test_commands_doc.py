"""docs/commands.md: what it names is there, and its quick examples run."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from pathlib import Path

import pytest

from validate.commands.subcommands import SUBCOMMANDS
from validate.comparison.matching import QUANTITIES
from validate.run_sweep import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
EXAMPLES = [
    line for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in block.splitlines() if line.strip()
]
# What takes longer than a test may, or needs what a long run leaves; why.
NOT_RUN = {
    "run_sweep.py my-room-sweep.toml": "renders",
    "run_sweep.py measure my-room.toml": "renders",
    "run_sweep.py compare results/zoom results/brighter": "needs runs",
    "run_sweep.py compare results/zoom results/brighter --rows correlation --table tex": "needs runs",
    "run_sweep.py figures --dry-run": "steers the cameras of the hallway for minutes",
    "run_sweep.py figures 1 2 3 --table tex": "renders",
    "run_sweep.py figures 4": "renders",
    "pss-testbed --tyro-write-completion bash ~/.local/share/bash-completion/completions/pss-testbed": "writes at home",
}
RUN = [example for example in EXAMPLES if example not in NOT_RUN]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the examples run: results/reference is there, as in a clone."""
    place = tmp_path_factory.mktemp("examples")
    (place / "results").mkdir()
    shutil.copytree(ROOT / "results" / "reference", place / "results" / "reference")
    return place


@pytest.mark.slow
def test_the_quick_examples_run_in_order(folder, capsys, monkeypatch):
    """Each as it stands on the page, in one folder: the first ones write what the next ones read."""
    monkeypatch.chdir(folder)
    assert len(RUN) >= 9
    for example in RUN:
        program, *arguments = shlex.split(example)
        assert program == "run_sweep.py"
        assert main(arguments) == 0, (example, capsys.readouterr().err)
    assert (folder / "results" / "check" / "room.png").exists()
    assert (folder / "results" / "check" / "wider.svg").exists()
    assert sorted(os.listdir(folder)) == ["my-room-sweep.toml", "my-room.toml", "results"]


def test_what_is_not_run_is_on_the_page():
    """The list of exceptions does not go stale."""
    assert set(NOT_RUN) <= set(EXAMPLES)


def test_the_page_names_every_command_and_comparison():
    """And pictures and links lead somewhere."""
    for name in (*SUBCOMMANDS, *QUANTITIES, "settings"):
        assert f"`{name}`" in PAGE, name
    for link in re.findall(r"\]\(([^)#:]+)\)", PAGE):
        assert (ROOT / "docs" / link).exists(), link
