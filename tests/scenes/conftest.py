"""Fixtures of several topics."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers.foreign_files import crate


@pytest.fixture
def home(tmp_path) -> Path:
    """A folder with a scene's folder in it, and a mesh and a picture beside that."""
    crate(tmp_path / "crate.ply")
    (tmp_path / "mine").mkdir()
    return tmp_path
