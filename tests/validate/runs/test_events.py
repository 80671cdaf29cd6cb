"""What a run tells programs: its events, whatever becomes of the run and of the disk, and its exit codes."""

from __future__ import annotations

import datetime
import errno
import json
import os

import pytest

import validate.acquire.acquire as acquiring
import validate.commands.run_and_save
from pss import RangeError
from render.store.folder import Store, StoreError
from tests.helpers.stored_views import ZOOMS, NoiseRenderer
from validate import run_sweep
from validate.acquire.acquire import Acquired, acquire
from validate.acquire.messages import RunMessages
from validate.acquire.view_names import view_names
from validate.runs.events import EVENTS, EventFile
from validate.runs.exit_codes import EXIT_BROKEN, EXIT_DONE, EXIT_FAILED, EXIT_INTERRUPTED, EXIT_MISTAKE

# ms, between the clock that is written and the one that is read: both are of this machine.
CLOCK_MS = 60_000


def events(folder):
    """All whole lines."""
    found = []
    for line in (folder / EVENTS).read_text(encoding="utf-8").splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            continue
    return found


def go(requested, folder, out):
    """A run with events, over the store in `folder`; gives what it acquired."""
    with RunMessages(quiet=True) as messages:
        messages.start(out, "test")
        acquired = acquire(requested, Store(folder / "store"), None, messages)
        messages.failed(acquired.failed, view_names(requested))
        messages.end(EXIT_FAILED if acquired.failed else EXIT_DONE, "results", acquired)
    return acquired


class FailsAtTheSecond(NoiseRenderer):
    """Renders all zooms but one."""

    def render(self, request):
        """One zoom is refused."""
        if request.camera.zoom == ZOOMS[1]:
            raise RangeError("not this zoom")
        return super().render(request)


def test_the_events_of_a_run_with_a_failed_view_and_of_the_one_that_goes_on(requested, tmp_path, monkeypatch):
    """Each view's story is told once, counts end at their total, and the second run adds to the first's file."""
    monkeypatch.setattr(acquiring, "Renderer", FailsAtTheSecond)
    go(requested, tmp_path, tmp_path / "out")
    first = events(tmp_path / "out")
    keys = [item.request.key for item in requested]
    assert [e["event"] for e in first] == [
        "started", "light-solved", "view-rendered", "view-measured", "view-failed", "view-rendered", "view-measured",
        "finished",
    ]  # fmt: skip
    assert [e["number"] for e in first] == list(range(len(first)))
    reported = {
        kind: [e for e in first if e["event"] == kind] for kind in ("view-rendered", "view-measured", "view-failed")
    }
    assert [e["view"] for e in reported["view-measured"]] == [keys[0], keys[2]]
    assert [e["view"] for e in reported["view-failed"]] == [keys[1]]
    assert reported["view-failed"][0]["cause"] == "RangeError: not this zoom"
    assert [(e["done"], e["total"]) for e in first if "done" in e] == [(0, 3), (1, 3), (2, 3), (2, 3), (3, 3)]
    assert {e["camera"] for e in first if "camera" in e} == {requested[0].request.camera.name}
    assert all(e["took_s"] >= 0 for kind in ("view-rendered", "view-measured") for e in reported[kind])
    assert {"exit_code": 1, "rendered": 2, "measured": 2, "failed": 1}.items() <= first[-1].items()
    times = [datetime.datetime.fromisoformat(e["time"]) for e in first]
    assert times == sorted(times)
    assert {t.utcoffset() for t in times} == {datetime.timedelta(0)}
    assert abs((datetime.datetime.now(datetime.UTC) - times[-1]).total_seconds()) * 1000 < CLOCK_MS

    monkeypatch.setattr(acquiring, "Renderer", NoiseRenderer)
    go(requested, tmp_path, tmp_path / "out")
    both = events(tmp_path / "out")
    assert both[: len(first)] == first
    second = both[len(first) :]
    assert {e["run"] for e in first}.isdisjoint(e["run"] for e in second)
    assert [e["event"] for e in second] == [
        "started", "view-found", "view-found", "view-rendered", "view-measured", "finished",
    ]  # fmt: skip
    assert [e["view"] for e in second if e["event"] == "view-found"] == [keys[0], keys[2]]
    assert [(e["done"], e["total"]) for e in second if "done" in e] == [(1, 3), (2, 3), (2, 3), (3, 3)]


def test_a_torn_last_line_does_not_spoil_the_next_runs_first(tmp_path):
    """A power cut leaves half a line."""
    EventFile(tmp_path, pytest.fail).write("started")
    with (tmp_path / EVENTS).open("a", encoding="utf-8") as file:
        file.write('{"time": "20')
    EventFile(tmp_path, pytest.fail).write("started", which="second")
    lines = (tmp_path / EVENTS).read_text(encoding="utf-8").splitlines()
    assert len(lines) == 3
    assert json.loads(lines[0])["event"] == "started"
    assert json.loads(lines[2])["which"] == "second"


def test_a_full_disk_leaves_events_out_and_not_the_run(tmp_path, monkeypatch):
    """One line says so; when there is room again, the next event is whole, and the numbers show what is missing."""
    warnings = []
    file = EventFile(tmp_path, warnings.append)
    file.write("first")
    real, calls = os.write, []

    def half(handle, data):
        calls.append(data)
        if len(calls) % 2:
            return real(handle, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("validate.runs.events.os.write", half)
    file.write("second")
    file.write("third")
    monkeypatch.setattr("validate.runs.events.os.write", real)
    file.write("fourth")
    assert [(e["event"], e["number"]) for e in events(tmp_path)] == [("first", 0), ("fourth", 3)]
    (warning,) = warnings
    assert "No space left" in warning
    assert EVENTS in warning


def test_a_folder_that_takes_no_events_does_not_end_the_run(requested, tmp_path, capsys):
    """Here a folder has the file's name."""
    (tmp_path / "out" / EVENTS).mkdir(parents=True)
    acquired = go(requested, tmp_path, tmp_path / "out")
    assert len(acquired.measured) == len(requested)
    (line,) = capsys.readouterr().err.splitlines()
    assert "events are left out" in line


@pytest.mark.parametrize(
    ("error", "event", "code"),
    [
        (KeyboardInterrupt(), "interrupted", EXIT_INTERRUPTED),
        (StoreError("the disk is full"), "finished", EXIT_MISTAKE),
        (ValueError("a bug"), "finished", EXIT_BROKEN),
    ],
)
def test_exceptions_are_the_last_event_and_the_exit_code(tmp_path, monkeypatch, capsys, error, event, code):
    """What ends a run early is in its events, and the command's exit code is the same."""

    def execute(options, messages):
        messages.start(tmp_path, "sweeps")
        raise error

    monkeypatch.setattr(validate.commands.run_and_save, "execute", execute)
    assert run_sweep.main(["zoom"]) == code
    last = events(tmp_path)[-1]
    assert (last["event"], last["exit_code"]) == (event, code)
    if event == "finished":
        assert str(error) in last["cause"]
    # Of a mistake one line, of a bug all that finds it.
    assert ("Traceback" in capsys.readouterr().err) == (code == EXIT_BROKEN)


def test_before_its_start_a_run_leaves_nothing(tmp_path):
    """A mistake that is found before any work makes no folder."""
    with pytest.raises(RangeError), RunMessages():
        raise RangeError("a mistake")
    assert list(tmp_path.iterdir()) == []


def test_quiet_prints_errors_and_the_last_line_alone(tmp_path, capsys):
    """Warnings are for the events; nothing else is lost that way."""
    acquired = Acquired(failed={"ab": "ValueError: no"})
    with RunMessages(quiet=True) as messages, messages(2) as progress:
        messages.start(tmp_path, "test")
        messages.console.print("a table")
        messages.note("steering")
        messages.warn("too bright")
        progress.advance("measured")
        progress.advance("measured")
        messages.failed(acquired.failed, {"ab": "the view of camera 1"})
        messages.left_out("a run: left out")
        assert messages.end(EXIT_FAILED, "results in x", acquired) == EXIT_FAILED
    printed = capsys.readouterr()
    assert printed.out == "results in x\n"
    assert printed.err.splitlines() == ["the view of camera 1 failed: ValueError: no", "a run: left out"]
    assert [e["text"] for e in events(tmp_path) if e["event"] == "warning"] == ["too bright"]


def test_help_names_the_exit_codes(capsys):
    """In short; docs/runs.md has the rest."""
    with pytest.raises(SystemExit) as caught:
        run_sweep.main(["--help"])
    assert caught.value.code == 0
    output = " ".join(capsys.readouterr().out.split())
    for code in (EXIT_DONE, EXIT_FAILED, EXIT_MISTAKE, EXIT_BROKEN, EXIT_INTERRUPTED):
        assert f" {code} " in output
