"""Files are whole or not there, and what is damaged is made again."""

from __future__ import annotations

import dataclasses
import errno
import os
import re
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from render.store.checksums import FileSum, add_sum, read_sums, sum_of, sum_path
from render.store.folder import Store, StoreError, atomic_path, write_text
from render.store.views import load_view, save_view
from tests.helpers.disks import remounted, small_file_system
from tests.helpers.views import an_awkward_view

ARRAYS = {"x": np.arange(1000)}
# By each of two processes: enough for renames and added sums to fall between each other's.
WRITES = 40
SMALL_DISK_BYTES = 2**20


def _fail_halfway(path):
    """Write half a file and fail."""

    def write():
        with atomic_path(path) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write()


def test_arrays_come_back_as_they_were(tmp_path):
    """What is saved is loaded bit for bit."""
    store = Store(tmp_path)
    path = store.measurement("abc", "detector", 1, 20)
    arrays = {"pixels": np.array([[1.5, np.nan]]), "count": np.array(3)}
    store.save(path, arrays)
    loaded = store.load(path)
    assert set(loaded) == {"pixels", "count"}
    np.testing.assert_array_equal(loaded["pixels"], arrays["pixels"])


def test_nothing_is_nothing(tmp_path):
    """A path without a file loads as None."""
    assert Store(tmp_path).load(tmp_path / "absent.npz") is None


def damages(data):
    """Every way of damage that a file is tried with, by name."""
    middle = len(data) // 2
    return {
        "cut": data[:middle],
        "flipped": data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :],
        "emptied": b"",
        "longer": data + b"x",
    }


@pytest.mark.parametrize("way", ["cut", "flipped", "emptied", "longer"])
def test_a_damaged_file_is_set_aside_with_one_line_and_can_be_made_again(tmp_path, caplog, way):
    """It is no file for whoever reads it, and not lost."""
    store = Store(tmp_path)
    path = store.light("abc")
    store.save(path, ARRAYS)
    damaged = damages(path.read_bytes())[way]
    path.write_bytes(damaged)
    assert store.load(path) is None
    assert not path.exists()
    aside = tmp_path / "damaged" / "light" / "abc.npz"
    assert aside.read_bytes() == damaged
    (line,) = caplog.messages
    assert line.startswith(f"{path}: ")
    assert str(aside) in line
    store.save(path, ARRAYS)
    np.testing.assert_array_equal(store.load(path)["x"], ARRAYS["x"])
    assert len(caplog.messages) == 1


@pytest.mark.parametrize("way", ["cut", "flipped", "emptied"])
def test_a_damaged_sum_proves_nothing(tmp_path, caplog, way):
    """The file beside it may be whole, and is made again all the same; both are set aside."""
    store = Store(tmp_path)
    path = store.light("abc")
    store.save(path, ARRAYS)
    sum_path(path).write_bytes(damages(sum_path(path).read_bytes())[way])
    assert store.facts(path) is None
    assert len(caplog.messages) == 1
    assert store.load(path) is None
    assert sorted(aside.name for aside in (tmp_path / "damaged" / "light").iterdir()) == ["abc.npz", "abc.npz.sum"]
    store.save(path, ARRAYS)
    assert store.load(path) is not None


def test_a_second_damage_does_not_overwrite_the_first(tmp_path):
    """What is set aside stays."""
    store = Store(tmp_path)
    path = store.light("abc")
    for content in (b"first", b"second", b"third"):
        store.save(path, ARRAYS)
        path.write_bytes(content)
        assert store.load(path) is None
    kept = sorted(aside.read_bytes() for aside in (tmp_path / "damaged" / "light").iterdir())
    assert kept == [b"first", b"second", b"third"]


def test_a_file_of_an_older_version_is_read_whole_once_and_given_a_sum(tmp_path, caplog):
    """Its bytes and its time of change stay; from then on the sum guards it."""
    store = Store(tmp_path)
    path = store.light("abc")
    path.parent.mkdir()
    np.savez_compressed(path, **ARRAYS)
    before, status = path.read_bytes(), path.stat()
    np.testing.assert_array_equal(store.load(path)["x"], ARRAYS["x"])
    assert (path.read_bytes(), path.stat().st_mtime_ns) == (before, status.st_mtime_ns)
    assert store.facts(path) == {"adopted": True}
    assert len(caplog.messages) == 1
    assert "older version" in caplog.messages[0]
    path.write_bytes(damages(before)["flipped"])
    assert store.load(path) is None


@pytest.mark.parametrize("way", ["cut", "flipped", "emptied"])
def test_a_damaged_file_of_an_older_version_is_not_given_a_sum(tmp_path, way):
    """The archive's own check finds what its contents have lost."""
    store = Store(tmp_path)
    path = store.light("abc")
    path.parent.mkdir()
    np.savez_compressed(path, **ARRAYS)
    path.write_bytes(damages(path.read_bytes())[way])
    assert store.load(path) is None
    assert not path.exists()
    assert not sum_path(path).exists()


def test_facts_need_no_look_at_the_file_unless_it_has_changed(tmp_path, monkeypatch):
    """Size and time of change are enough for what the sum says itself; a copy with another time is hashed, once."""
    store = Store(tmp_path)
    path = store.light("abc")
    store.save(path, ARRAYS, "test 1")
    hashed = []
    monkeypatch.setattr("render.store.folder.sum_of", lambda path: hashed.append(path) or sum_of(path))
    assert store.facts(path) == {"version": "test 1"}
    assert hashed == []
    os.utime(path, ns=(1, 1))  # a clock set back, or a backup
    assert store.facts(path) == store.facts(path) == {"version": "test 1"}
    assert hashed == [path]


def test_bytes_that_rot_without_a_change_of_time_are_never_used(tmp_path):
    """A disk that turns a bit tells no clock: reading hashes, whatever the time says."""
    store = Store(tmp_path)
    path = store.light("abc")
    store.save(path, ARRAYS)
    status = path.stat()
    path.write_bytes(damages(path.read_bytes())["flipped"])
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert store.load(path) is None


def test_a_sum_comes_before_its_file(tmp_path):
    """Whoever sees the file finds its sum; a sum without a file is nothing."""
    store = Store(tmp_path)
    path = store.light("abc")

    def write(temporary):
        assert not sum_path(path).exists()
        temporary.write_text("whole")

    real_replace = Path.replace

    def replace(self, target):
        assert sum_path(path).exists()
        assert store.load(path) is None
        return real_replace(self, target)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "replace", replace)
        store.write(path, write)
    assert store.read(path, Path.read_text) == "whole"


def test_a_line_that_a_full_disk_cut_off_spoils_no_other(tmp_path):
    """The next line begins on a line of its own."""
    path = tmp_path / "x"
    first, second = FileSum(1, "a", 2), FileSum(3, "b", 4, {"version": "é"})
    sum_path(path).write_text(first.to_line()[:20])
    add_sum(path, second)
    add_sum(path, first)
    assert read_sums(path) == [second, first]


def test_a_whole_file_made_meanwhile_is_not_set_aside(tmp_path, monkeypatch):
    """One process finds damage while another has already made the file anew."""
    store = Store(tmp_path)
    path = store.light("abc")
    store.save(path, ARRAYS)
    path.write_bytes(b"damaged")

    def hashed_then_replaced(path):
        found = sum_of(path)
        monkeypatch.setattr("render.store.folder.sum_of", sum_of)
        store.save(path, ARRAYS)
        return found

    monkeypatch.setattr("render.store.folder.sum_of", hashed_then_replaced)
    np.testing.assert_array_equal(store.load(path)["x"], ARRAYS["x"])
    assert not (tmp_path / "damaged").exists()


def _write_again_and_again(folder, seed):
    """Store other bytes under one name, as two renders may differ in the last bit."""
    store = Store(folder)
    for number in range(WRITES):
        store.save(store.light("abc"), {"x": np.full(2000, seed), "y": np.array(number)})


@pytest.mark.slow
def test_writers_of_one_name_and_readers_do_not_hurt_each_other(tmp_path, caplog):
    """Two processes write it at the same time; every read gives what one of them wrote, and nothing is set aside."""
    store = Store(tmp_path)
    path = store.light("abc")
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        writers = [pool.submit(_write_again_and_again, tmp_path, seed) for seed in (1, 2)]
        reads, seen = 0, set()
        while not all(writer.done() for writer in writers):
            arrays = store.load(path)
            if arrays is not None:
                assert len(set(arrays["x"].tolist())) == 1
                seen.add(int(arrays["x"][0]))
                reads += 1
        for writer in writers:
            writer.result()
    assert reads > 0
    assert store.load(path) is not None
    assert not (tmp_path / "damaged").exists()
    assert caplog.messages == []
    assert len(read_sums(path)) == 2 * WRITES
    assert [each for each in path.parent.iterdir() if each.name.startswith(".")] == []


def test_a_block_that_fails_leaves_nothing(tmp_path):
    """Neither the target nor a temporary file stays behind an exception."""
    _fail_halfway(tmp_path / "a" / "file.txt")
    assert list((tmp_path / "a").iterdir()) == []


def test_an_old_file_survives_a_failed_rewrite(tmp_path):
    """What is there is replaced by something whole or not at all."""
    path = tmp_path / "file.txt"
    write_text(path, "old")
    _fail_halfway(path)
    assert path.read_text() == "old"


def test_full_disk_is_one_clear_line(tmp_path):
    """ENOSPC becomes the project's own error, which names the file and how much it needs."""
    expected = pytest.raises(StoreError, match=r"disk is full; the file needs 1,234 bytes, [\d,]+ are free")
    with expected, atomic_path(tmp_path / "file.txt", needed_bytes=1234):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def _full_after(size):
    """A flush that finds the disk full if the file is larger than `size` bytes."""

    def flush_or_not(path):
        if path.is_file() and path.stat().st_size > size:
            raise OSError(errno.ENOSPC, "No space left on device")

    return flush_or_not


def test_a_full_disk_leaves_what_is_stored(tmp_path, monkeypatch):
    """The file that does not fit is not there, and says how large it is; the one before is whole."""
    store = Store(tmp_path)
    store.save(store.light("small"), {"x": np.arange(10)})
    monkeypatch.setattr("render.store.atomic.flush", _full_after(5000))
    noise = np.random.default_rng(0).random(2000)
    with pytest.raises(StoreError, match="disk is full") as raised:
        store.save(store.light("large"), {"x": noise})
    needed = int(re.search(r"needs ([\d,]+) bytes", str(raised.value))[1].replace(",", ""))
    assert noise.nbytes / 2 < needed < 2 * noise.nbytes
    assert store.load(store.light("small")) is not None
    assert store.load(store.light("large")) is None


@pytest.fixture
def small_disk(tmp_path):
    """A file system of one megabyte, where this process may mount one."""
    with small_file_system(tmp_path / "disk", str(SMALL_DISK_BYTES)) as folder:
        yield folder


@pytest.mark.acceptance
def test_a_disk_that_is_really_full_leaves_what_is_stored(small_disk):
    """Arrays and views that do not fit raise one line with their size, and leave neither files nor halves."""
    store = Store(small_disk)
    rng = np.random.default_rng(0)
    store.save(store.light("small"), {"x": rng.random(1000)})
    with pytest.raises(StoreError, match=r"disk is full; the file needs [78],\d{3},\d{3} bytes, [\d,]+ are free"):
        store.save(store.light("large"), {"x": rng.random(10**6 + 10**5 // 2)})
    request, view = an_awkward_view()
    shape = 500, 700
    large = dataclasses.replace(
        view,
        radiance=rng.random(shape, dtype=np.float32),
        depth_m=rng.random(shape, dtype=np.float32),
        normal=rng.random((*shape, 3), dtype=np.float32),
        marker_id=np.zeros(shape, dtype=np.int32),
        capture_dn=np.zeros(shape, dtype=np.uint16),
    )
    with pytest.raises(StoreError, match=r"disk is full; the file needs up to 7,700,000 bytes, [\d,]+ are free"):
        save_view(store, large, request)
    assert load_view(store, request.key) is None
    save_view(store, view, request)
    assert load_view(store, request.key) is not None
    assert store.load(store.light("small")) is not None
    assert not list(small_disk.rglob(".*"))


@pytest.mark.acceptance
def test_a_store_that_cannot_be_written_serves_what_it_has(small_disk, caplog):
    """It says nothing of it, not even of files of an older version; what is damaged cannot be set aside."""
    store = Store(small_disk)
    for name in ("whole", "older", "damaged"):
        store.save(store.light(name), ARRAYS)
    sum_path(store.light("older")).unlink()
    store.light("damaged").write_bytes(b"x")
    remounted(small_disk, "ro")
    assert not store.writable
    assert store.load(store.light("whole")) is not None
    assert store.load(store.light("older")) is not None
    assert caplog.messages == []
    with pytest.raises(StoreError, match="cannot be set aside"):
        store.load(store.light("damaged"))
    with pytest.raises(StoreError, match="allowed is a folder that can be written"):
        store.save(store.light("new"), ARRAYS)


def test_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path):
    """A file in the way is named."""
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="file"), atomic_path(tmp_path / "file" / "x.txt"):
        pass


def test_measurements_of_other_detectors_seeds_and_trials_lie_elsewhere(tmp_path):
    """Each thing that determines a measurement is in its name."""
    store = Store(tmp_path)
    paths = {
        store.measurement(*arguments)
        for arguments in (("v", "d", 1, 20), ("v", "e", 1, 20), ("v", "d", 2, 20), ("v", "d", 1, 21), ("w", "d", 1, 20))
    }
    assert len(paths) == 5
