"""Runs on a disk that is full, that cannot be written or whose clock was set back: a line each, and nothing is lost."""

from __future__ import annotations

import os
import time

import pytest

from tests.helpers.disks import remounted, small_file_system
from tests.helpers.whole_files import check_all_whole, tables, temporary_files, uninterrupted, with_sweep

pytestmark = pytest.mark.slow

# Room for the light and for one of two views of 250 kB each; and for all.
TOO_SMALL, ENOUGH = "520k", "4m"
YEAR_S = 365 * 86400


@pytest.fixture(scope="module")
def whole(runs, tmp_path_factory):
    """A finished run: its folder and its tables."""
    folder = tmp_path_factory.mktemp("whole")
    return folder, uninterrupted(runs, folder, workers=False)[0]


@pytest.fixture
def small_disk(tmp_path):
    """A folder with the sweep, whose store is a file system too small for it, where this process may mount one."""
    folder = with_sweep(tmp_path / "run")
    with small_file_system(folder / "store", TOO_SMALL):
        yield folder


def the_line(output):
    """The one line of an error, without the console's breaks."""
    lines = [line for line in output.splitlines() if line.startswith("run_sweep.py: ")]
    assert len(lines) == 1, output
    assert "Traceback" not in output
    return lines[0]


def test_files_of_the_future_are_as_good_as_others(runs, whole):
    """A clock that was set back: nothing is rendered again, and the tables are the same."""
    folder, expected = whole
    ahead = time.time() + YEAR_S
    for path in (folder / "store").rglob("*"):
        os.utime(path, (ahead, ahead))
    code, output = runs.run(folder, "again")
    assert code == 0, output
    assert "0 rendered, 0 measured now" in output
    assert "set aside" not in output
    assert tables(folder / "again") == expected


@pytest.mark.acceptance
def test_a_run_on_a_full_disk_says_what_it_needs_and_goes_on_when_there_is_room(runs, whole, small_disk):
    """What was stored before stays whole, and is not made again."""
    code, output = runs.run(small_disk)
    assert code == 2
    line = the_line(output)
    print(line.replace(str(small_disk), "…"))
    assert "the disk is full; the file needs " in line
    assert " are free; " in line
    assert not temporary_files(small_disk)
    check_all_whole(small_disk, whole[1])
    stored = {path: path.stat().st_mtime_ns for path in (small_disk / "store").rglob("*.exr")}
    remounted(small_disk / "store", f"size={ENOUGH}")
    code, output = runs.run(small_disk)
    assert code == 0, output
    assert "set aside" not in output
    assert tables(small_disk / "out") == whole[1]
    assert {path: path.stat().st_mtime_ns for path in stored} == stored
    assert len(stored) == 1


@pytest.mark.acceptance
def test_a_run_on_a_store_that_cannot_be_written_uses_what_is_there(runs, whole, small_disk):
    """With all of it, as ever; with a view missing, or one damaged, a line, and nothing is touched."""
    remounted(small_disk / "store", f"size={ENOUGH}")
    assert runs.run(small_disk)[0] == 0
    remounted(small_disk / "store", "ro")
    code, output = runs.run(small_disk, "again")
    assert code == 0, output
    assert tables(small_disk / "again") == whole[1]
    view = next((small_disk / "store").rglob("*.exr"))
    remounted(small_disk / "store", "rw")
    content = view.read_bytes()
    view.unlink()
    remounted(small_disk / "store", "ro")
    code, output = runs.run(small_disk, "again")
    assert (code, "cannot be written, and 1 of 2 views are missing" in the_line(output)) == (2, True)
    remounted(small_disk / "store", "rw")
    view.write_bytes(content[:-1])
    remounted(small_disk / "store", "ro")
    code, output = runs.run(small_disk, "again")
    print(the_line(output).replace(str(small_disk), "…"))
    assert (code, "cannot be set aside" in the_line(output)) == (2, True)
    assert view.read_bytes() == content[:-1]
    assert tables(small_disk / "again") == whole[1]
