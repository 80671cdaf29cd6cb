"""Files are whole or not there, and what is damaged is made again."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from validate.store import Store, StoreError, atomic_path, write_text


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


def test_a_file_cut_short_is_removed_and_made_again(tmp_path):
    """Half a file is no file."""
    store = Store(tmp_path)
    path = store.light("abc")
    store.save(path, {"x": np.arange(1000)})
    path.write_bytes(path.read_bytes()[:200])
    assert store.load(path) is None
    assert not path.exists()


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
    """ENOSPC becomes the project's own error, which names the file."""
    with pytest.raises(StoreError, match="disk is full"), atomic_path(tmp_path / "file.txt"):
        raise OSError(errno.ENOSPC, "No space left on device")


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
