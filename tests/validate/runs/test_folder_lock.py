"""Two runs do not write into one folder at the same time; a killed one blocks nobody."""

from __future__ import annotations

import os
import signal
from multiprocessing import get_context

import pytest

from render.store.folder import StoreError
from tests.helpers.few_rows import a_run
from validate.acquire.messages import RunMessages
from validate.run_sweep import main
from validate.runs import folder_lock
from validate.runs.folder_lock import IN_USE, alone_in


def _hold(folder, held, go_on):
    with alone_in(folder):
        held.set()
        go_on.wait()


@pytest.fixture
def held(tmp_path):
    """A folder of results that another process uses, and that process."""
    folder = tmp_path / "results"
    context = get_context("spawn")
    begun, go_on = context.Event(), context.Event()
    process = context.Process(target=_hold, args=(folder, begun, go_on))
    process.start()
    assert begun.wait(60)
    yield folder, process
    if process.is_alive():  # of a killed one, the event waits for an answer
        go_on.set()
        process.join()


def test_a_folder_in_use_is_refused_with_its_process_and_time(held):
    """One line, again and again; when that process has ended, the folder is free."""
    folder, process = held
    for _ in range(2):
        with pytest.raises(StoreError) as caught, alone_in(folder):
            raise AssertionError
        line = str(caught.value)
        assert line.startswith(f"{folder} is in use by another run (process {process.pid}, since 2")
        assert "allowed: another --out" in line


def test_a_killed_process_blocks_nobody(held):
    """It leaves the file, and no lock."""
    folder, process = held
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    assert (folder / IN_USE).exists()
    with alone_in(folder):
        pass
    assert not (folder / IN_USE).exists()


def test_two_of_one_process_are_refused_as_well(tmp_path):
    """As two threads of a notebook are."""
    with alone_in(tmp_path), pytest.raises(StoreError, match=f"process {os.getpid()}"), alone_in(tmp_path):
        raise AssertionError
    with alone_in(tmp_path):
        pass


def test_a_run_that_is_refused_leaves_nothing(held):
    """Not even an event among those of the other."""
    folder, _ = held
    before = sorted(path.name for path in folder.iterdir())
    with pytest.raises(StoreError, match="in use"), RunMessages(quiet=True) as messages:
        messages.start(folder, "sweeps")
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.mark.parametrize(
    "arguments",
    [
        ["focus", "--out", "OUT", "--store", "STORE"],
        ["schedule", "hallway", "--out", "OUT", "--store", "STORE"],
        ["bank", "--out", "OUT", "--store", "STORE"],
        ["calibration-error", "--out", "OUT", "--store", "STORE"],
        ["pixel-noise", "--out", "OUT", "--store", "STORE"],
        ["figures", "1", "--out", "OUT", "--store", "STORE"],
        ["report", "OUT"],
        ["measure", "room", "--out", "OUT", "--store", "STORE"],
        ["compare", "RUN/one", "RUN/two", "--out", "OUT/compare.html"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_every_command_that_writes_into_a_folder_is_refused(tmp_path, capsys, monkeypatch, arguments):
    """Exit code 2 and one line, before anything is rendered; here a thread of the same process has the folder."""
    for slow in ("steered_runs", "training_views", "design_of", "real_walk_of"):
        monkeypatch.setattr(f"validate.tracked_walk.path.{slow}", lambda *_: ())
    if arguments[0] == "compare":
        a_run(tmp_path / "one"), a_run(tmp_path / "two")
    places = {
        "OUT": tmp_path / "out",
        "STORE": tmp_path / "s",
        "RUN/one": tmp_path / "one",
        "RUN/two": tmp_path / "two",
    }
    with alone_in(tmp_path / "out"):
        before = sorted((tmp_path / "out").iterdir())
        words = arguments
        for short, place in places.items():
            words = [word.replace(short, str(place)) for word in words]
        assert main(words) == 2
        assert sorted((tmp_path / "out").iterdir()) == before
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert f"{tmp_path / 'out'} is in use by another run" in line
    assert not (tmp_path / "s").exists()


def test_listing_and_dry_runs_are_not_refused(tmp_path, capsys):
    """They write nothing."""
    with alone_in(tmp_path / "out"):
        assert main(["focus", "--dry-run", "--out", str(tmp_path / "out"), "--store", str(tmp_path / "store")]) == 0


def test_without_locks_nothing_is_refused(tmp_path, monkeypatch):
    """A system without them, and a folder that cannot be made."""
    (tmp_path / "file").write_text("")
    with alone_in(tmp_path / "file" / "out"):
        pass
    monkeypatch.setattr(folder_lock, "fcntl", None)
    with alone_in(tmp_path), alone_in(tmp_path):
        pass
    assert not (tmp_path / IN_USE).exists()


def test_what_is_named_as_the_lock_and_is_none_is_not_followed(tmp_path):
    """A link, in a folder of somebody else's, leads nowhere that is written to."""
    (tmp_path / "elsewhere").write_text("mine")
    (tmp_path / IN_USE).symlink_to(tmp_path / "elsewhere")
    with alone_in(tmp_path):
        pass
    assert (tmp_path / "elsewhere").read_text() == "mine"
