"""A loaded run is not saved among the tables of another one."""

from __future__ import annotations

import pytest

import validate
from render.store.folder import StoreError


def test_tables_of_two_runs_are_not_mixed(tmp_path):
    """`validate.load` could not tell them apart; the run's own tables are written anew."""
    one, other = tmp_path / "one", tmp_path / "other"
    for folder, name in ((one, "points"), (other, "leaderboard")):
        folder.mkdir()
        (folder / f"{name}.csv").write_text("cameras\n2\n")
    with pytest.raises(StoreError, match=r"other has tables of another run, such as leaderboard\.csv; allowed is"):
        validate.load(one).save(other)
    assert [path.name for path in other.iterdir()] == ["leaderboard.csv"]
    third = validate.load(one).save(tmp_path / "third")
    (third / "points.csv").write_text("cameras\n3\n")
    validate.load(one).save(third)
    assert validate.load(third).written("points") == [{"cameras": "2"}]
