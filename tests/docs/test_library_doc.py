"""docs/library.md and docs/notebook.ipynb: the library from Python, as a page and as cells that run."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import re
import runpy
import subprocess
import sys

import pytest

import render
import scenes
import validate
from tests.helpers.documents import BLOCKS, DOCS, ROOT

NOTEBOOK = DOCS / "notebook.ipynb"
# Render, detect and compare.
MOST_LINES = 15
# A number, and what it is aligned and framed with.
NUMBER = re.compile(r"[-−+]?\d[\d.,]*(e[-+]?\d+)?|–|\bnan\b")


def code_cells() -> list[dict]:
    return [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


def source(cell: dict) -> str:
    return "".join(cell["source"])


def printed(cell: dict) -> str:
    """What a cell has printed on standard output."""
    outputs = (output for output in cell["outputs"] if output.get("name") == "stdout")
    return "".join("".join(output["text"]) for output in outputs)


def without_numbers(text: str) -> list[str]:
    """The words of a text: a capture's noise differs between kinds of processor, and with it every measured number."""
    return [word for word in re.split(r"[\s│┃┏┓└┘┡┩━─┴┬┳╇]+", NUMBER.sub("#", text)) if word not in ("", "#")]


def test_one_capture_and_the_comparison_take_few_lines():
    """The notebook's first cell, which the page shows as well."""
    (first, *_) = code_cells()
    called = {ast.unparse(node.func) for node in ast.walk(ast.parse(source(first))) if isinstance(node, ast.Call)}
    for needed in ("render.view", "view.capture", "validate.detect", "validate.measure", "validate.compare"):
        assert needed in called
    lines = [line for line in source(first).splitlines() if line.strip()]
    print(f"{len(lines)} lines")
    assert len(lines) <= MOST_LINES
    (shown, _) = (block for block in BLOCKS if block.page == "docs/library.md" and block.language == "python")
    assert shown.text.strip() == source(first).strip()


def test_the_scene_of_tables_is_made_and_saved(tmp_path, monkeypatch):
    """The page's own example, and what it prints."""
    monkeypatch.chdir(tmp_path)
    (_, block) = (block for block in BLOCKS if block.page == "docs/library.md" and block.language == "python")
    names: dict[str, object] = {}
    with contextlib.redirect_stdout(io.StringIO()) as output:
        exec(compile(block.text, str(block), "exec"), names)
    assert output.getvalue() == block.output
    assert scenes.load("mine.toml").state == names["scene"].state


def test_the_page_has_every_public_function():
    page = (DOCS / "library.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\.\. auto\w+:: (\S+)", page, re.MULTILINE))
    documented = {f"{package.__name__}.{name}" for package in (render, validate) for name in package.__all__}
    assert documented | {"scenes.load", "scenes.Scene"} <= named | {"validate.FailedViewError"}


@pytest.mark.slow
@pytest.mark.render
def test_the_notebooks_code_prints_what_is_stored(tmp_path, monkeypatch):
    """Its cells in order, in this process: the same words, as many numbers, and as many pictures."""
    import matplotlib.pyplot as plt

    (tmp_path / "docs").mkdir()
    monkeypatch.chdir(tmp_path / "docs")
    plt.switch_backend("agg")  # no windows, wherever the tests run
    plt.close("all")
    names: dict[str, object] = {}
    pictures = 0
    for number, cell in enumerate(code_cells()):
        with contextlib.redirect_stdout(io.StringIO()) as output:
            exec(compile(source(cell), f"notebook-{number}", "exec"), names)
        assert without_numbers(output.getvalue()) == without_numbers(printed(cell)), number
        stored = sum("image/png" in each.get("data", {}) for each in cell["outputs"])
        assert len(plt.get_fignums()) == stored, number
        pictures += stored
        plt.close("all")
    assert pictures == 2
    assert len(names["found"]) >= 10
    assert len(names["points"]) >= 10
    assert names["errors_mm"].max() < 5
    physical = next(
        row for row in validate.compare(names["predicted"], names["measured"]).rows if row["noise_model"] == "physical"
    )
    assert 0.5 < physical["ratio"] < 1.5


@pytest.mark.acceptance
@pytest.mark.render
def test_the_notebook_runs_in_a_kernel():
    """As `make notebook` runs it; the words of its outputs are those stored."""
    again = runpy.run_path(str(DOCS / "run_notebook.py"))["executed"]()
    for one, other in zip((cell for cell in again.cells if cell.cell_type == "code"), code_cells(), strict=True):
        assert without_numbers(printed(one)) == without_numbers(printed(other))


def test_the_library_leaves_the_users_backend_of_figures():
    """As ipykernel sets it, or as a script has it; a command, which has neither, draws without a screen."""
    for before, environment, expected in (
        ("", {"MPLBACKEND": "svg"}, "svg"),
        ("import matplotlib.pyplot; matplotlib.pyplot.switch_backend('pdf')", {}, "pdf"),
        ("", {}, "agg"),
    ):
        code = f"{before}\nimport validate.plots.drawing, matplotlib; print(matplotlib.get_backend().lower())"
        inherited = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=inherited | environment
        )
        assert done.stdout.strip() == expected, done.stderr
