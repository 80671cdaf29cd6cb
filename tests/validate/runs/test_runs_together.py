"""Two runs over one store at the same time: each view is rendered once, nothing is damaged, and both say the same."""

from __future__ import annotations

import json
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context

import pytest

from render.store import locks
from render.store.locks import in_turn
from tests.helpers.closet import DETERMINED, SWEEP
from tests.helpers.drawn_sweep import Runs
from tests.helpers.whole_files import check_all_whole, tables, temporary_files, with_sweep

pytestmark = pytest.mark.slow

# s, that each view takes: the second of two runs that start within a second of each other finds the first at work.
DRAWING_S = 0.3
VIEWS = 7


@pytest.fixture(scope="module")
def servers(runs):
    """Two processes that start runs."""
    with Runs() as other:
        yield runs, other


@pytest.mark.parametrize("killed", [False, True], ids=["both end", "one is killed"])
def test_two_runs_at_the_same_time_render_each_view_once(servers, tmp_path, killed):
    """One that is killed with a view in its hands leaves it to the other, which does not wait for ever."""
    folder = with_sweep(tmp_path)
    (folder / "zooming.toml").write_text(SWEEP)
    pids = {}

    def one(runs, out):
        return runs.run(
            folder, out, sweep="zooming.toml", drawing_s=DRAWING_S, during=lambda pid: pids.update({out: pid})
        )

    with ThreadPoolExecutor(2) as pool:
        both = [pool.submit(one, runs, out) for runs, out in zip(servers, ("first", "second"), strict=True)]
        if killed:
            while not list((folder / "store" / "views").rglob("*.exr")):
                time.sleep(DRAWING_S / 10)
            os.killpg(pids["first"], signal.SIGKILL)
        codes = [run.result()[0] for run in both]
    assert codes == [-signal.SIGKILL if killed else 0, 0]
    assert len(list((folder / "store" / "views").rglob("[!.]*.exr"))) == VIEWS
    assert set(tables(folder / "second")) == set(DETERMINED)
    check_all_whole(folder, tables(folder / "first"))
    if not killed:
        rendered = [json.loads((folder / out / "run.json").read_text())["rendered"] for out in ("first", "second")]
        assert sum(rendered) == VIEWS
        assert min(rendered) > 0
        assert tables(folder / "first") == tables(folder / "second")
        assert not temporary_files(folder)


def _hold(folder, name, held, go_on):
    for _ in in_turn([name], str, folder):
        held.set()
        go_on.wait()


@pytest.fixture
def other(tmp_path):
    """A process that has reserved "b", and the event that lets it go on."""
    context = get_context("spawn")
    held, go_on = context.Event(), context.Event()
    process = context.Process(target=_hold, args=(tmp_path, "b", held, go_on))
    process.start()
    held.wait()
    yield process, go_on
    go_on.set()
    process.join()


def test_what_another_process_has_comes_last_and_when_it_is_free(other, tmp_path):
    """The others keep their order."""
    process, go_on = other
    seen = []
    for name in in_turn("abcd", str, tmp_path):
        seen.append(name)
        if name == "d":
            assert process.is_alive()
            go_on.set()
    assert seen == list("acdb")


def test_a_process_that_is_held_up_is_not_waited_for(other, tmp_path, monkeypatch):
    """It has what it has for too long, and is rendered beside it."""
    monkeypatch.setattr(locks, "LONGEST_WAIT_S", 0.0)
    assert sorted(in_turn("abc", str, tmp_path)) == list("abc")
    assert other[0].is_alive()


def test_without_locks_all_come_in_their_order(tmp_path, monkeypatch):
    """A system without them, and a store that is not there and cannot be made."""
    (tmp_path / "file").write_text("")
    assert list(in_turn("abc", str, tmp_path / "file" / "store")) == list("abc")
    monkeypatch.setattr(locks, "fcntl", None)
    assert list(in_turn("abc", str, tmp_path)) == list("abc")
