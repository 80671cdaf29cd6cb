"""The release is recorded alike in pyproject.toml, CITATION.cff and CHANGELOG.md."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
# What CFF 1.2.0 requires of every file.
REQUIRED = {"authors", "cff-version", "message", "title"}


def test_the_citation_is_of_this_release():
    """Version and date are those of the newest release in the changelog, the licence is that of the project."""
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    version, date = re.findall(r"^## (\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)$", changelog, re.MULTILINE)[0]
    assert PROJECT["version"] == CITATION["version"] == version
    assert CITATION["date-released"] == date
    assert CITATION["license"] == PROJECT["license"]


def test_the_citation_has_what_its_format_requires():
    assert CITATION.keys() >= REQUIRED
    assert CITATION["cff-version"] == "1.2.0"
    assert all(set(author) == {"name"} for author in CITATION["authors"])
    assert all({"type", "title", "authors"} <= reference.keys() for reference in CITATION["references"])
