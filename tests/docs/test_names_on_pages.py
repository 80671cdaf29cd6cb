"""Files and folders of the project that pages name are there: README, CONTRIBUTING, docs, benchmarks, changelog."""

from __future__ import annotations

import re

import pytest

from tests.helpers.documents import PAGES, ROOT

ALL = (*PAGES, ROOT / "benchmarks" / "README.md", ROOT / "CHANGELOG.md")
NAMED = re.compile(r"(?<![\w./-])(?:pss|render|scenes|validate|tests|benchmarks|docs)/[\w/.-]*\w/?")
# What a command writes.
WRITTEN = ("docs/_build",)


def missing(text: str) -> list[str]:
    """The paths in `text` that are not there."""
    found = dict.fromkeys(NAMED.findall(text))
    return [path for path in found if not path.startswith(WRITTEN) and not (ROOT / path).exists()]


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_paths_on_a_page_exist(page):
    """Of the changelog the newest release: older ones name what was there then."""
    text = page.read_text(encoding="utf-8")
    if page.name == "CHANGELOG.md":
        text = text.partition("\n## ")[2].partition("\n## ")[0]
    assert not missing(text)


def test_a_path_that_is_not_there_is_found():
    assert missing("See `validate/absent.py`, `pss/noise/` and scenes/room.toml.") == ["validate/absent.py"]


@pytest.mark.parametrize("package", ["pss", "render", "scenes", "validate"])
def test_contributing_has_every_room(package):
    """In the table of rooms, in the rows of its package."""
    table = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("| package | room |")[2]
    rows = re.split(r"^\| `(\w+)/` \|", table.partition("\n\n")[0], flags=re.MULTILINE)
    of_package = dict(zip(rows[1::2], rows[2::2], strict=True))[package]
    named = {name for cells in of_package.splitlines() for name in re.findall(r"`(\w+)`", cells)}
    assert named == {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
