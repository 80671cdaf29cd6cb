"""No number of the README is copied by hand: it is made from a table, or is a constant that is looked up here."""

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
from validate.runs import exit_codes
from validate.stats.intervals import LEVEL

ROOT = Path(__file__).parents[3]
REFERENCE = ROOT / "results" / "reference"
README = (ROOT / "README.md").read_text(encoding="utf-8")


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
    assert "1.507707" in text
    claims.write_text(text.replace("1.507707", "7.777"), encoding="utf-8")
    changed = readme_text(README, tmp_path / "reference")
    assert changed.count("7.78") == 1 > README.count("7.78")
    assert changed.replace("7.78", "1.51") == README


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
    (tmp_path / "README.md").write_text(re.sub("found: zoom [0-9,]*", "found: zoom 5", README), encoding="utf-8")
    write_pages(tmp_path, REFERENCE)
    assert (tmp_path / "README.md").read_text(encoding="utf-8") == README


def sweep(name: str) -> dict:
    return tomllib.loads((SWEEPS / f"{name}.toml").read_text(encoding="utf-8"))


def constants() -> list[str]:
    """Words with numbers that the README may have: made of the constants themselves, or names of the paper's parts."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    oldest = project["requires-python"].removeprefix(">=")
    focus = sweep("focus")["vary"]
    cameras = "cameras {}, {} and {}".format(*focus["cameras"])
    assert sweep("zoom-of-three")["active"] == focus["cameras"]
    codes = exit_codes
    return [
        f"python3 ({oldest} or newer)",
        f"libLLVM of version {OLDEST_LLVM} or newer",
        f"{100 * LEVEL:.0f} % intervals",
        f"{cameras} as their focus moves from {focus['values'][0]:g} m to {focus['values'][-1]:g} m",
        f"{cameras} are alone",
        f"At {1000 * scenes.load(SWEEPS.parent / 'room.toml').process.step_std_m:g} mm of process noise a frame",
        (
            f"over {claims.CONFIGURATIONS} configurations of three and of four cameras has an interval above "
            f"{claims.BOUND:g}"
        ),
        f"turned by {claims.TURN_DEG:g}°",
        f"Exit codes: {codes.EXIT_DONE} done; {codes.EXIT_FAILED} done with failed views",
        (
            f"{codes.EXIT_MISTAKE} your mistake, or a full disk; {codes.EXIT_BROKEN} an error of the program; "
            f"{codes.EXIT_INTERRUPTED} interrupted"
        ),
        "Linux x86_64",
        "the paper's Eq. 10",
        "Figures 1 to 3",
        "the paper's Figure 1",
        "(section 4.2, Figure 4)",
        "Apache 2.0",
    ]


def prose(text: str) -> str:
    """Without what tables make, blocks of code (which run), code in a line, numbers of a list, targets of links."""
    for pattern in (r"<!-- numbers:.*?<!-- end -->", r"^```.*?^```$", r"`[^`\n]*`", r"^\d\. "):
        text = re.sub(pattern, "", text, flags=re.DOTALL | re.MULTILINE)
    return " ".join(re.sub(r"\]\([^)]*\)", "]", text).split())


def test_every_other_number_is_a_constant():
    """What is left without these has no digit but that of "3D"."""
    left = prose(README)
    for words in constants():
        assert words in left, words
        left = left.replace(words, "")
    assert not re.findall(r"\S*\d\S*", re.sub(r"\b3D\b", "", left))


def test_counts_in_words():
    """The gate's counts are written out."""
    assert claims.COUNTS == (3, 4)
    assert "sixteen small views" in " ".join(README.split())
