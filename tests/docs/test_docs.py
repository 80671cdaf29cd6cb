"""What the pages of docs and the README show runs as written: Python, TOML and commands.

A comment `<!-- block: … -->` right before a block says how it is treated: `file X` (it is docs/X, to the letter),
`into X` (a part of the file X), `into object N of X` (keys of one object of it), `with own-metric installed`, or
`first lines of a run` (printed by a run; see test_docs_pages.py).
"""

from __future__ import annotations

import contextlib
import importlib
import io
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import pytest

import pss
import scenes
from pss.metric.table import MetricTable
from pss.metrics import OF_THE_PAPER
from scenes import load_sweep
from tests.helpers.documents import BLOCKS, DOCS, PAGES, ROOT, shell_lines, toml_file
from tests.helpers.installed import own_detector
from validate import run_sweep
from validate.bank import judge
from validate.commands.subcommands import SUBCOMMANDS
from validate.sweeps import correlation

# Pages whose Python needs what another test gives it.
RUN_ELSEWHERE = {
    "README.md": "tests/docs/test_readme.py::test_the_example_runs",
    "docs/library.md": "tests/docs/test_library_doc.py::test_the_notebooks_code_prints_what_is_stored",
    "docs/scenes.md": "tests/render/files/test_exr.py::test_the_documented_way_to_read_a_view_runs",
}
# Beginnings of lines of the `sh` blocks that this file does not run, and why not. What is a sweep or a subcommand is
# parsed all the same, with its files, up to the point where the work would begin.
SLOW = {
    "make sweep": "eight to ten minutes; the tables of docs/results.md are its output",
    "make .venv/installed": "is what `make test` begins with",
    "make test": "is what runs these tests",
    "make quick": "runs most of these tests",
    "make acceptance": "the longest tests",
    "make docs": "the fixture `site` of test_docs_pages.py builds the same",
    "make notebook": "test_the_notebook_runs_in_a_kernel of test_library_doc.py runs it",
    ".venv/bin/python validate/run_sweep.py bank": "half an hour; tests/validate/bank/test_bank.py runs a small one",
    ".venv/bin/python validate/run_sweep.py calibration-error": "needs the bank's views",
    ".venv/bin/python validate/run_sweep.py schedule hallway": "half an hour and as long again for the real walk",
    ".venv/bin/python validate/run_sweep.py exposure-motion": "renders the hallway with motion blur for minutes",
    ".venv/bin/python validate/run_sweep.py pixel-noise": "about six minutes",
    ".venv/bin/python validate/run_sweep.py zoom --set sensor.exposure_ms=8": "renders forty views",
    ".venv/bin/python validate/run_sweep.py new-scene": "tests/docs/test_commands_doc.py runs it",
    ".venv/bin/python validate/run_sweep.py check": "the same",
    ".venv/bin/python validate/run_sweep.py zoom --detector": "two minutes; test_own_detector.py measures drawn views",
    ".venv/bin/python validate/run_sweep.py zoom --trials 5": "a minute and a half; an acceptance test runs it",
    ".venv/bin/python validate/run_sweep.py docs/examples/lab-zoom.toml": "the same",
    ".venv/bin/python -m pip install --no-deps": "builds a package; an acceptance test installs it",
    ".venv/bin/python -m validate.findings": "tests/validate/findings/ compares its output with the page",
    ".venv/bin/oiiotool": "needs a run's views; tests/render/files/test_exr.py reads the same layers",
    "pip install": "fetches packages",
    "python validate/run_sweep.py zoom focus selection --workers": "eight minutes; test_scale.py runs less",
    "python validate/run_sweep.py bank --cluster": "needs a cluster; tests/validate/acquire/test_scale.py starts one",
    "dask scheduler": "runs until it is stopped; tests/validate/acquire/test_scale.py starts it",
    "dask worker": "the same",
    "python validate/run_sweep.py zoom --store s3": "needs a bucket",
}
QUICK_WORDS = ("--dry-run", "--help", "store")


def quick(line: str) -> bool:
    return "run_sweep.py" in line and any(word in shlex.split(line) for word in QUICK_WORDS)


def reason(line: str) -> str:
    """The longest beginning of `line` in SLOW; "" if there is none."""
    return max((start for start in SLOW if line.startswith(start)), key=len, default="")


def arguments(line: str) -> list[str]:
    """What follows `run_sweep.py` in a line."""
    words = shlex.split(line)
    return words[words.index("validate/run_sweep.py") + 1 :]


@pytest.fixture(scope="module")
def own_metrics(tmp_path_factory):
    """A table of metrics beside which docs/examples/own-metric is installed: its module and its entry point."""
    source, site = DOCS / "examples" / "own-metric", tmp_path_factory.mktemp("site")
    shutil.copy(source / "share_within.py", site)
    project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    record = site / f"share_within-{project['version']}.dist-info"
    record.mkdir()
    (record / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    entries = project["entry-points"]["pss.metrics"]
    lines = ["[pss.metrics]", *(f"{name} = {value}" for name, value in entries.items())]
    (record / "entry_points.txt").write_text("\n".join(lines) + "\n")
    sys.path.insert(0, str(site))
    importlib.invalidate_caches()
    try:
        table = MetricTable(OF_THE_PAPER)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            list(table)
        yield table
    finally:
        sys.path.remove(str(site))
        sys.modules.pop("share_within", None)


PYTHON_PAGES = sorted({block.page for block in BLOCKS if block.language == "python"} - RUN_ELSEWHERE.keys())


@pytest.mark.parametrize("page", PYTHON_PAGES)
def test_python_runs_and_prints_what_the_page_says(page, own_metrics, monkeypatch):
    """The blocks of a page in order, in one namespace, from the project's root."""
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    for block in (block for block in BLOCKS if block.page == page and block.language == "python"):
        if block.treatment.startswith("file "):
            continue
        if block.treatment.startswith("needs "):  # what no machine of a developer has
            compile(block.text, str(block), "exec")
            continue
        if block.treatment == "with own-metric installed":
            monkeypatch.setattr(pss, "METRICS", own_metrics)
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(block.text, str(block), "exec"), names)
        if block.output is not None:
            expected = [line.rstrip() for line in block.output.splitlines()]
            assert [line.rstrip() for line in printed.getvalue().splitlines()] == expected, block


def test_the_bank_asks_metrics_of_ones_own(own_metrics, monkeypatch):
    """docs/own-metric.md: every metric of the table, with the calibrated model; of ours a sweep keeps to four."""
    monkeypatch.setattr(judge, "METRICS", own_metrics)
    assert {(judge.CALIBRATED_LIMITS, name) for name in own_metrics} <= set(judge.requested_pairs([]))
    assert "share-within-5-mm" in own_metrics
    assert len(correlation.COMPARED) == 4
    assert "pss" in correlation.COMPARED


def test_python_that_runs_elsewhere_does():
    for page, place in RUN_ELSEWHERE.items():
        file, _, name = place.partition("::")
        source = (ROOT / file).read_text(encoding="utf-8")
        assert f"def {name}(" in source
        assert Path(page).name in source


FILES = [block for block in BLOCKS if block.treatment.startswith("file ")]


@pytest.mark.parametrize("block", FILES, ids=str)
def test_a_block_that_is_a_file_is_that_file(block):
    assert block.text == (DOCS / block.treatment.removeprefix("file ")).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A copy of the project's scenes and of docs/examples, into whose files parts are put."""
    folder = tmp_path_factory.mktemp("files")
    for name in ("scenes", "docs/examples"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.py"))
    return folder


def with_part(document: dict, part: dict, treatment: str) -> dict:
    """A file's document with a block of a page in it: tables in place of its own, items of lists by name or id."""
    found = re.fullmatch(r"into object (\S+) of .*", treatment)
    if found:
        (item,) = (item for item in document["objects"] if item["name"] == found[1])
        item.update(part)
        return document
    for key, value in part.items():
        if key == "objects":
            names = [item["name"] for item in value]
            document[key] = [item for item in document[key] if item["name"] not in names] + value
        elif key == "markers":
            document[key] |= value
        else:
            document[key] = value
    return document


TOML = [block for block in BLOCKS if block.language == "toml" and "pyproject" not in block.treatment]


@pytest.mark.parametrize("block", TOML, ids=str)
def test_toml_loads(block, files):
    """Whole files as they are; parts within the file that their comment names, or else within the room."""
    document = tomllib.loads(block.text)
    if block.treatment.startswith("file "):
        path = files / "docs" / block.treatment.removeprefix("file ")
    elif "room" in document:
        path = files / "scenes" / "whole.toml"
        path.write_text(block.text, encoding="utf-8")
    else:
        base = files / (block.treatment.rpartition(" ")[2] or "scenes/room.toml")
        whole = with_part(tomllib.loads(base.read_text(encoding="utf-8")), document, block.treatment)
        path = base.with_name("part-" + base.name)
        path.write_text(toml_file(whole), encoding="utf-8")
    (load_sweep if "vary" in tomllib.loads(path.read_text(encoding="utf-8")) else scenes.load)(path)


def test_every_command_is_run_or_known_to_be_slow():
    lines = shell_lines()
    unknown = [f"{page}: {line}" for line, page in lines.items() if not quick(line) and not reason(line)]
    assert not unknown, unknown
    unused = SLOW.keys() - {reason(line) for line in lines} - {"make notebook"}  # in the notebook's own text
    assert not unused, unused
    assert all(len(why) >= 8 for why in SLOW.values())


@pytest.mark.parametrize("line", [line for line in shell_lines() if quick(line)])
def test_quick_commands_run(line, tmp_path, monkeypatch, capsys):
    """In a folder of their own, with an empty store and empty folders for the runs that are named."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results" / "store").mkdir(parents=True)
    (tmp_path / "docs").symlink_to(DOCS)
    for named in re.findall(r"results/\w+", line):
        (tmp_path / named / "views").mkdir(parents=True, exist_ok=True)
    assert run_sweep.main(arguments(line)) == 0, capsys.readouterr().err


SWEEPS = [line for line in shell_lines() if not quick(line) and "run_sweep.py" in line and "s3:" not in line]


@pytest.mark.parametrize("line", SWEEPS)
def test_slow_commands_are_understood(line, monkeypatch, tmp_path):
    """Options exist and files load; the work itself is left out."""
    with own_detector(tmp_path):
        understood(line, monkeypatch)


def understood(line: str, monkeypatch) -> None:
    from validate.commands import run_and_save

    monkeypatch.chdir(ROOT)
    begun = []
    monkeypatch.setattr(run_and_save, "execute", lambda request, messages: begun.append(request.load()) or 0)
    words = arguments(line)
    if words[0] in SUBCOMMANDS and words[0] not in ("sweep", "measure"):
        command = importlib.import_module(f"validate.commands.{words[0].replace('-', '_')}")
        monkeypatch.setattr(command, "execute", lambda options: begun.append(options) or 0)
    assert run_sweep.main(words) == 0
    assert len(begun) == max(1, words.count("--detector"))


def without_blocks(page: Path) -> str:
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """What a repository browser calls the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", without_blocks(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_lead_somewhere(page):
    """In a repository browser; on the site, its build looks."""
    for link, heading in re.findall(r"\]\(([^)#:]*)(?:#([^)]*))?\)", without_blocks(page)):
        target = page.parent / link if link else page
        assert target.exists(), link
        assert not heading or heading in anchors(target), f"{link}#{heading}"


@pytest.mark.acceptance
def test_the_own_metric_installs_as_the_page_says(tmp_path):
    """By pip, into a folder of its own, without an index."""
    source = tmp_path / "own-metric"
    shutil.copytree(DOCS / "examples" / "own-metric", source)
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--no-deps", "--no-build-isolation", "--no-index"]
        + ["--target", str(tmp_path / "site"), str(source)],
        check=True,
        timeout=600,
    )
    script = "import pss; print('share-within-5-mm' in pss.METRICS, len(pss.METRICS))"
    paths = f"import sys; sys.path[:0] = [{str(tmp_path / 'site')!r}, {str(ROOT)!r}]; "
    done = subprocess.run(
        [sys.executable, "-c", paths + script], capture_output=True, text=True, check=True, timeout=600
    )
    assert done.stdout.startswith("True ")
