"""No number of the README and of docs/results.md is copied by hand: a table has it, or it is a constant listed here."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest

import scenes
from pss.errors import RangeError
from render.backend import OLDEST_LLVM
from scenes.steps.sweep_file import SWEEPS
from tests.gate import claims
from validate.findings.readme import BLOCKS, numbered_pages, readme_text, write_pages
from validate.stats.intervals import LEVEL

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
REFERENCE = ROOT / "results" / "reference"
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", numbered_pages(), ids=lambda page: page.name)
def test_a_page_is_what_the_tables_make_of_it(page):
    """`python -m validate.findings --write` changes nothing."""
    text = page.read_text(encoding="utf-8")
    assert text == readme_text(text, REFERENCE)


def test_another_table_is_another_page(tmp_path):
    """A changed figure shows, in the block that it belongs to."""
    shutil.copytree(REFERENCE, tmp_path / "reference")
    claims = tmp_path / "reference" / "claims.csv"
    text = claims.read_text(encoding="utf-8")
    assert "1.501579" in text
    claims.write_text(text.replace("1.501579", "7.777"), encoding="utf-8")
    changed = readme_text(RESULTS, tmp_path / "reference")
    assert changed.count("7.78") == 1 > RESULTS.count("7.78")
    assert changed.replace("7.78", "1.50") == RESULTS


def test_blocks_and_parts_of_sentences(monkeypatch):
    """A comment on a line of its own holds a block, one within a line a part of it; the rest is left as it is."""
    monkeypatch.setitem(BLOCKS, "a number", lambda reference: "12")
    page = "Before <!-- numbers: a number -->old<!-- end --> after.\n\n<!-- numbers: a number -->\nold\n<!-- end -->\n"
    expected = (
        "Before <!-- numbers: a number -->12<!-- end --> after.\n\n<!-- numbers: a number -->\n\n12\n\n<!-- end -->\n"
    )
    assert readme_text(page, REFERENCE) == expected
    assert readme_text(expected, REFERENCE) == expected
    assert readme_text("No comment.", REFERENCE) == "No comment."


@pytest.mark.parametrize(
    ("page", "message"),
    [
        ("<!-- numbers: nothing -->1<!-- end -->", r"<!-- numbers: nothing -->; allowed: .*sweeps: ranks"),
        ("<!-- numbers: sweeps: ranks -->", r"1 comments <!-- numbers: … --> and 0 <!-- end -->"),
        ("<!-- numbers: sweeps: found -->\n<!-- numbers: sweeps: found --> <!-- end -->", "has no <!-- end -->"),
    ],
)
def test_mistakes_are_named(page, message):
    with pytest.raises(RangeError, match=message):
        readme_text(page, REFERENCE)


def test_pages_are_written_in_place(tmp_path):
    """The command's own function, on a copy with an old number."""
    (tmp_path / "docs").mkdir()
    pages = {
        "README.md": (README, "NEES/3 = [0-9.]*", "NEES/3 = 5"),
        "docs/results.md": (RESULTS, "visible: zoom [0-9,]*", "visible: zoom 5"),
    }
    for name, (text, pattern, old) in pages.items():
        assert re.search(pattern, text)
        (tmp_path / name).write_text(re.sub(pattern, old, text), encoding="utf-8")
    write_pages(tmp_path, REFERENCE)
    for name, (text, *_) in pages.items():
        assert (tmp_path / name).read_text(encoding="utf-8") == text


def sweep(name: str) -> dict:
    return tomllib.loads((SWEEPS / f"{name}.toml").read_text(encoding="utf-8"))


def of_the_readme() -> list[str]:
    """Words with numbers that the README may have: made of the constants themselves."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    oldest = project["requires-python"].removeprefix(">=")
    return [
        f"python3 ({oldest} or newer)",
        f"libLLVM of version {OLDEST_LLVM} or newer",
        "in about 90 s",
        "Linux x86_64",
        "Apache 2.0",
    ]


def of_the_results() -> list[str]:
    """The same for docs/results.md, with names of the paper's parts."""
    focus = sweep("focus")["vary"]
    cameras = "cameras {}, {} and {}".format(*focus["cameras"])
    assert sweep("zoom-of-three")["active"] == focus["cameras"]
    return [
        f"{100 * LEVEL:.0f} % intervals",
        f"{cameras} as their focus moves from {focus['values'][0]:g} m to {focus['values'][-1]:g} m",
        f"{cameras} are alone",
        f"At {1000 * scenes.load(SWEEPS.parent / 'room.toml').process.step_std_m:g} mm of process noise a frame",
        (
            f"over {claims.CONFIGURATIONS} configurations of three and of four cameras is at least "
            f"{claims.LEAST_RHO:g}, with an interval above {claims.BOUND:g}"
        ),
        f"turned by {claims.TURN_DEG:g}°",
        "paper's Eq. 10",
        "Figures 1 to 3",
        "paper's Figure 1",
        "(section 4.2, Figure 4)",
    ]


def prose(text: str) -> str:
    """Without what tables make, blocks of code (which run), code in a line, numbers of a list, targets of links."""
    for pattern in (r"<!-- numbers:.*?<!-- end -->", r"^```.*?^```$", r"`[^`\n]*`", r"^\d\. "):
        text = re.sub(pattern, "", text, flags=re.DOTALL | re.MULTILINE)
    return " ".join(re.sub(r"\]\([^)]*\)", "]", text).split())


@pytest.mark.parametrize(("page", "constants"), [(README, of_the_readme()), (RESULTS, of_the_results())])
def test_every_other_number_is_a_constant(page, constants):
    """What is left without these has no digit but that of "3D"."""
    left = prose(page)
    for words in constants:
        assert words in left, words
        left = left.replace(words, "")
    assert not re.findall(r"\S*\d\S*", re.sub(r"\b3D\b", "", left))


def test_counts_in_words():
    """The gate's counts are written out."""
    assert claims.COUNTS == (3, 4)
    assert "sixteen small views" in " ".join(RESULTS.split())
    assert "has six rows" in " ".join(RESULTS.split())
    (rows,) = re.findall(r"<!-- numbers: findings: six rows -->(.*?)<!-- end -->", README, re.DOTALL)
    assert len(rows.strip().splitlines()) == 2 + 6
