"""Stores at an address: what programs need comes to a folder here, checked, and what is made here is handed on."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from pss import MissingLibraryError
from render.store.checksums import sum_path
from render.store.folder import Store, StoreError
from render.store.remote import is_address, open_store

ARRAYS = {"x": np.arange(1000)}


@pytest.fixture(params=["file", "memory"])
def place(request, tmp_path, monkeypatch):
    """Opens the same address, each time from another machine: with another folder for what is fetched."""
    fsspec = pytest.importorskip("fsspec", reason="the extra `cloud` is not installed")
    address = {"file": f"file://{tmp_path / 'far' / 'store'}", "memory": f"memory://{tmp_path.name}/store"}[
        request.param
    ]

    def from_machine(name):
        monkeypatch.setenv("PSS_STORE_CACHE", str(tmp_path / name))
        return open_store(address)

    from_machine.files, from_machine.root = fsspec.core.url_to_fs(address)
    return from_machine


def far(place, path, store):
    """Where a file of a store lies at the address."""
    return f"{place.root.rstrip('/')}/{path.relative_to(store.folder).as_posix()}"


def test_what_one_machine_makes_another_finds(place):
    """With what its sum says of it, and checked."""
    one, other = place("one"), place("other")
    path = one.light("abc")
    assert not one.has(path)
    assert one.load(path) is None
    one.save(path, ARRAYS, "test 1")
    there = other.light("abc")
    assert there != path
    assert other.has(there)
    assert other.facts(there) == {"version": "test 1"}
    np.testing.assert_array_equal(other.load(there)["x"], ARRAYS["x"])
    # What programs and measuring processes work on is a store like any other.
    np.testing.assert_array_equal(Store(other.folder).load(there)["x"], ARRAYS["x"])


def test_what_is_damaged_here_is_fetched_again(place):
    """It is set aside here; the other end has it whole."""
    store = place("one")
    path = store.light("abc")
    store.save(path, ARRAYS)
    path.write_bytes(b"damaged")
    np.testing.assert_array_equal(store.load(path)["x"], ARRAYS["x"])
    assert (store.folder / "damaged" / "light" / "abc.npz").read_bytes() == b"damaged"


@pytest.mark.parametrize("way", ["content", "sum"])
def test_what_is_damaged_there_is_set_aside_there_and_made_again(place, caplog, way):
    """It never gets its name here."""
    one, other = place("one"), place("other")
    path = one.light("abc")
    one.save(path, ARRAYS)
    name = far(place, path, one)
    folder = name.rpartition("/")[0]
    (sum_name,) = [each for each in place.files.ls(folder, detail=False) if str(each).endswith(".sum")]
    victim = name if way == "content" else sum_name
    data = place.files.cat_file(victim)
    place.files.pipe_file(victim, data[:50] + bytes([data[50] ^ 1]) + data[51:])
    assert other.load(other.light("abc")) is None
    assert not other.light("abc").exists()
    assert len(caplog.messages) == 1
    assert any("damaged" in str(each) for each in place.files.find(place.root))
    other.save(other.light("abc"), ARRAYS)
    third = place("third")
    assert third.load(third.light("abc")) is not None


def test_a_store_that_was_copied_there_as_it_is_works(place, tmp_path):
    """With its own sums, and without any, as one of an older version."""
    source = Store(tmp_path / "source")
    store = place("one")
    for name in ("new", "old"):
        source.save(source.light(name), ARRAYS, name)
        target = far(place, store.light(name), store)
        place.files.makedirs(target.rpartition("/")[0], exist_ok=True)
        place.files.pipe_file(target, source.light(name).read_bytes())
        if name == "new":
            place.files.pipe_file(f"{target}.sum", sum_path(source.light(name)).read_bytes())
    assert store.facts(store.light("new")) == {"version": "new"}
    assert store.facts(store.light("old")) is None
    assert store.load(store.light("old")) is not None
    assert store.facts(store.light("old")) == {"adopted": True}


def test_what_the_store_has_is_not_sent_again(place):
    """Two machines made the same: the first one's stays."""
    one, other = place("one"), place("other")
    path = one.light("abc")
    one.save(path, {"x": np.zeros(10)})
    other.save(other.light("abc"), {"x": np.ones(10)})
    third = place("third")
    assert third.load(third.light("abc"))["x"].sum() == 0


def test_an_address_is_told_from_a_folder():
    """By its scheme; a Windows drive is none."""
    assert all(is_address(each) for each in ("s3://b/x", "memory://x", "file:///x", "simplecache::s3://b/x"))
    assert not any(is_address(each) for each in ("results/store", "C:\\store", "./a:b", "s3"))


def test_without_fsspec_one_line_says_what_to_install(monkeypatch):
    """A folder needs nothing."""
    monkeypatch.setitem(sys.modules, "fsspec", None)
    assert type(open_store("results/store")) is Store
    with pytest.raises(MissingLibraryError, match=r"s3://bucket/x needs fsspec: pip install 'pss-testbed\[cloud\]'"):
        open_store("s3://bucket/x")


def test_a_kind_of_address_that_is_not_known_is_one_line():
    """fsspec's own words, and what is allowed."""
    pytest.importorskip("fsspec", reason="the extra `cloud` is not installed")
    with pytest.raises(StoreError, match=r"nowhere://x.*allowed is a folder"):
        open_store("nowhere://x")
