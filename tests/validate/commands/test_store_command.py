"""`run_sweep.py store`: what is listed, verified and pruned, and what never is touched."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from pss import RangeError
from render.store.checksums import sum_path
from render.store.folder import Store, StoreError
from validate.commands import command_line
from validate.commands.store_codes import codes_here
from validate.commands.store_upkeep import bytes_of, prune_list, seconds_of, stored_files
from validate.markers.view_measurement import measure_code
from validate.run_sweep import main

DAY_S = 86400.0


@pytest.fixture
def store(tmp_path):
    """Light and a measurement of yesterday and last month, one of now, and what others left."""
    store = Store(tmp_path / "store")
    for path, age_s in (
        (store.light("old"), 40 * DAY_S),
        (store.measurement("aa11", "d", 1, 2), 2 * DAY_S),
        (store.measurement("bb22", "d", 1, 2), 2 * DAY_S + 60),
        (store.light("new"), 0),
    ):
        store.save(path, {"x": np.arange(100)}, "test 1")
        age(path, age_s)
    (store.folder / "light" / ".begun.npz").write_text("half")
    (store.folder / "light" / ".abandoned.npz").write_text("half")
    age(store.folder / "light" / ".abandoned.npz", 2 * DAY_S)
    return store


def age(path, seconds):
    """Turn a file's time back."""
    os.utime(path, (time.time() - seconds,) * 2)


def test_list_counts_by_kind_and_code(store, capsys):
    """Files, bytes with their sums, oldest and newest; temporary files are none."""
    assert main(["store", "--store", str(store.folder), "list"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    light = [store.light("old"), store.light("new")]
    size = sum(path.stat().st_size + sum_path(path).stat().st_size for path in light)
    assert lines[1][:7] == ["light", "other", "code", "test", "1", "2", f"{size:,}"]
    assert lines[2][:6] == ["measurements", "other", "code", "test", "1", "2"]
    assert lines[3][:2] == ["all", "4"]
    assert " ".join(lines[4]).startswith("other code or libraries made 4 files, ")


def files_of_two_codes(folder):
    """A store of last month: of each kind a file that this code made, and one of other code."""
    store, here = Store(folder), codes_here()
    view, other_view = 16 * "a" + here.views, 16 * "a" + 8 * "0"
    measured = measure_code().digest
    mine = [
        (store.view(view), here.views),
        (store.light(f"abc-{here.light}-x86_64_v3"), here.light),
        (store.measurement(view, "d", 1, 2), measured),
        (store.folder / "pixel-noise" / "aa" / f"{view}.npz", here.views),
    ]
    other = [
        (store.view(other_view), 8 * "0"),
        (store.light(f"abc-{8 * '0'}"), 8 * "0"),
        (store.light("abc"), "render 6"),
        # Of a view that this code names otherwise, and of another way to measure.
        (store.measurement(other_view, "d", 1, 2), measured),
        (store.measurement(view, "d", 2, 2), "registration-6"),
        (store.folder / "pixel-noise" / "aa" / f"{other_view}.npz", 8 * "0"),
    ]
    for path, version in mine + other:
        store.save(path, {"x": np.arange(10)}, version)
        age(path, 30 * DAY_S)
    return store, [path for path, _ in mine], [path for path, _ in other]


def test_what_other_code_made_is_reported_and_pruned(tmp_path, capsys):
    """And nothing else, of any kind."""
    store, mine, other = files_of_two_codes(tmp_path / "store")
    assert main(["store", "list", "--store", str(store.folder)]) == 0
    output = capsys.readouterr().out
    assert "other code or libraries made 6 files, " in output
    assert sum("this code" in line for line in output.splitlines()) == 4
    assert main(["store", "prune", "--store", str(store.folder), "--stale", "--yes"]) == 0
    assert {stored.path for stored in stored_files(store.folder)} == set(mine)
    assert not any(path.exists() for path in other)
    assert main(["store", "list", "--store", str(store.folder)]) == 0
    assert "other code" not in capsys.readouterr().out


def test_code_prints_what_names_cover(capsys):
    """Each kind of file with its digest, libraries and modules."""
    assert main(["store", "code"]) == 0
    output = capsys.readouterr().out
    assert f"views: code {codes_here().views}\n" in output
    assert "  validate.markers.localise\n" in output
    assert f"numpy {np.__version__}" in output


def test_stale_files_of_the_last_hour_stay(tmp_path):
    """Another installation may be at work in the same store."""
    store, _, other = files_of_two_codes(tmp_path / "store")
    age(other[0], 0)
    assert main(["store", "prune", "--store", str(store.folder), "--stale", "--yes"]) == 0
    assert [path for path in other if path.exists()] == other[:1]


def test_verify_checks_all_and_sets_damaged_ones_aside(store, capsys, caplog):
    """Exit code 1 the first time; then all is whole."""
    assert command_line.run(["store", "verify", "--store", str(store.folder)]) == 0
    assert "4 files checked, 0 damaged" in capsys.readouterr().out
    path = store.light("old")
    status = path.stat()
    data = path.read_bytes()
    path.write_bytes(data[:60] + bytes([data[60] ^ 1]) + data[61:])
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))  # as a disk would
    assert command_line.run(["store", "verify", "--store", str(store.folder)]) == 1
    assert "4 files checked, 1 damaged and set aside" in capsys.readouterr().out
    assert len(caplog.messages) == 1
    assert command_line.run(["store", "verify", "--store", str(store.folder)]) == 0
    assert "3 files checked, 0 damaged" in capsys.readouterr().out


def test_prune_says_what_would_go_and_removes_it_if_told(store, capsys):
    """Old files and abandoned ones with their sums; nothing else."""
    arguments = ["prune", "--store", str(store.folder), "--older-than", "30d"]
    before = sorted(store.folder.rglob("*"))
    assert command_line.run(["store", *arguments]) == 0
    printed_text = capsys.readouterr().out.splitlines()
    assert printed_text[:2] == ["light/old.npz", "light/.abandoned.npz"]
    assert printed_text[2].startswith("2 files would be removed, ")
    assert sorted(store.folder.rglob("*")) == before
    assert command_line.run(["store", *arguments, "--yes"]) == 0
    gone = [store.light("old"), sum_path(store.light("old")), store.folder / "light" / ".abandoned.npz"]
    assert sorted(set(before) - set(store.folder.rglob("*"))) == sorted(gone)


def test_a_size_to_keep_takes_the_oldest_first_and_never_the_youngest(store):
    """Even a size of nothing leaves what is younger than an hour, and what a wrong clock put into the future."""
    age(store.light("new"), -DAY_S)
    files, now = list(stored_files(store.folder)), time.time()
    everything = [stored.path for stored in prune_list(files, now, keep_below_bytes=0)]
    assert everything == [
        store.light("old"),
        store.measurement("bb22", "d", 1, 2),
        store.measurement("aa11", "d", 1, 2),
    ]
    total = sum(stored.size_bytes for stored in files)
    assert [stored.path for stored in prune_list(files, now, keep_below_bytes=total - 1)] == everything[:1]
    assert prune_list(files, now, keep_below_bytes=total) == []


def test_what_runs_use_stays(store, tmp_path, capsys):
    """A run's views/ names its views; their measurements stay with them, and light is nobody's."""
    (tmp_path / "run" / "views").mkdir(parents=True)
    (tmp_path / "run" / "views" / "aa11.exr").symlink_to("nowhere.exr")
    assert (
        command_line.run(
            ["store", "prune", "--store", str(store.folder), "--unused-by", str(tmp_path / "run"), "--yes"]
        )
        == 0
    )
    left = {stored.path.name for stored in stored_files(store.folder)}
    assert left == {"old.npz", "new.npz", store.measurement("aa11", "d", 1, 2).name}
    with pytest.raises(StoreError, match="allowed is a folder that a run left"):
        command_line.run(["store", "prune", "--store", str(store.folder), "--unused-by", str(tmp_path)])


@pytest.mark.parametrize("arguments", [[], ["--older-than", "30"], ["--keep-below", "20 elephants"]])
def test_wishes_that_say_nothing_are_refused(store, arguments):
    """One line with the value and what is allowed."""
    with pytest.raises(RangeError, match="allowed"):
        command_line.run(["store", "prune", "--store", str(store.folder), *arguments])


def test_units():
    """Seconds and bytes."""
    assert seconds_of("1.5h", "--older-than") == 5400
    assert bytes_of("20GB", "--keep-below") == 20e9


def test_a_store_that_is_not_there_is_the_users_mistake(tmp_path, capsys):
    """Exit code 2."""
    assert main(["store", "list", "--store", str(tmp_path / "none")]) == 2
    assert "none" in capsys.readouterr().err
