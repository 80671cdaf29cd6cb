"""Every stored file of a run damaged in turn: each is noticed and made again, none is used, and the result is the same.

The renderer is a stand-in that draws noise, and measuring is done in this process, so that it is about the store alone;
`tests/validate/sweeps/test_store_sweep.py` does the same with the real ones.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest

import render.store.light as lighting
from pss import PTZCamera
from render.files.exr import write_view
from render.keys import state_key
from render.store.folder import Store, StoreError
from render.store.views import DamagedViewError, certificate_of, load_view, save_view, stored_view
from render.world.state import Light
from tests.helpers.stored_views import REQUEST, VIEW, WAYS, ZOOMS, NoiseRenderer, damaged, no_progress, stored
from validate.acquire.acquire import acquire, with_whole_views
from validate.acquire.queue import WorkerQueue


def made(requested, store):
    """Acquire, and give what came of it with what was rendered for it."""
    before = len(NoiseRenderer.rendered)
    acquired = acquire(requested, store, None, no_progress)
    return acquired, NoiseRenderer.rendered[before:]


def result_of(acquired):
    """All that a run makes its tables from, but for seconds."""
    return (
        {item.request.key: measured.pixels.tobytes() for item, measured in acquired.measured.items()},
        {key: dataclasses.astuple(certificate) for key, certificate in sorted(acquired.certificates.items())},
        {key: np.asarray(look.white_w_per_m2_sr).tobytes() for key, look in acquired.appearances.items()},
        acquired.failed,
    )


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_every_file_damaged_in_turn_is_noticed_and_made_again(requested, tmp_path, caplog, way):
    """Views, light, measurements and the sums of all of them."""
    original = Store(tmp_path / "original")
    first, rendered = made(requested, original)
    assert len(rendered) == len(ZOOMS)
    assert first.failed == {}
    assert set(first.measured) == set(requested)
    assert len(first.appearances) == 1
    files = stored(original.folder)
    assert len(files) == 2 * (2 * len(ZOOMS) + 1)
    for number, file in enumerate(files):
        store = Store(tmp_path / f"{way}-{number}")
        shutil.copytree(original.folder, store.folder)
        path = store.folder / file.relative_to(original.folder)
        path.write_bytes(damaged(path.read_bytes(), way))
        caplog.clear()
        again, rendered = made(requested, store)
        assert repr(result_of(again)) == repr(result_of(first)), path
        (line,) = caplog.messages
        assert path.name.removesuffix(".sum") in line
        aside = store.folder / "damaged" / path.relative_to(store.folder)
        assert aside.read_bytes() == damaged(file.read_bytes(), way)
        assert len(rendered) == ("views" in path.parts)
        # Now all is whole.
        caplog.clear()
        _, rendered = made(requested, store)
        assert (rendered, caplog.messages) == ([], [])


def test_a_view_that_rots_without_a_change_of_time_is_found_when_it_is_measured(requested, tmp_path, caplog):
    """Its sum vouches for the certificate, not for the pixels: those are hashed, and the view is rendered again."""
    store = Store(tmp_path)
    first, _ = made(requested, store)
    path = store.view(requested[0].request.key)
    status = path.stat()
    path.write_bytes(damaged(path.read_bytes(), "flipped"))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    measurement = requested[0].task(store).path
    measurement.unlink()
    again, rendered = made(requested, store)
    assert rendered == [requested[0].request.key]
    assert repr(result_of(again)) == repr(result_of(first))
    assert len(caplog.messages) == 1


def test_a_reader_of_views_that_finds_one_damaged_has_it_rendered_again(requested, tmp_path):
    """Contact sheets and films read views after all is acquired."""
    store = Store(tmp_path)
    made(requested, store)
    for item in requested[:2]:
        path = store.view(item.request.key)
        status = path.stat()
        path.write_bytes(damaged(path.read_bytes(), "cut").ljust(status.st_size))
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    before = len(NoiseRenderer.rendered)

    def use():
        return [stored_view(store, item.request.key).radiance.sum() for item in requested]

    found = with_whole_views(use, requested, store, None, no_progress)
    assert len(NoiseRenderer.rendered) - before == 2
    assert found == use()
    store.view(requested[0].request.key).unlink()
    with pytest.raises(DamagedViewError, match="has to be rendered again"):
        use()


def test_a_store_of_an_older_version_renders_nothing(requested, tmp_path, caplog):
    """Without any sum, all is found, given sums, and the same; one line says so."""
    store = Store(tmp_path)
    first, _ = made(requested, store)
    for path in stored(tmp_path):
        if path.suffix == ".sum":
            path.unlink()
    again, rendered = made(requested, store)
    assert rendered == []
    assert repr(result_of(again)) == repr(result_of(first))
    assert len(caplog.messages) == 1
    assert len([path for path in stored(tmp_path) if path.suffix == ".sum"]) == 2 * len(ZOOMS) + 1


def test_an_older_view_of_another_camera_is_not_believed(tmp_path, caplog):
    """Its header has no checksum of its own: it has to say what was asked for."""
    store = Store(tmp_path)
    path = store.view(REQUEST.key)
    path.parent.mkdir(parents=True)
    write_view(path, dataclasses.replace(VIEW, camera=PTZCamera((0, 0, 1), 0, 0, resolution=(37, 23))), REQUEST)
    assert certificate_of(store, REQUEST) is None
    assert len(caplog.messages) == 1
    write_view(path, VIEW, REQUEST)
    assert repr(certificate_of(store, REQUEST)) == repr(VIEW.certificate)


def test_a_stored_view_comes_back(tmp_path):
    """Bytes are those of `write_view`: a sum changes nothing of them."""
    store = Store(tmp_path / "store")
    save_view(store, VIEW, REQUEST)
    write_view(tmp_path / "plain.exr", VIEW, REQUEST)
    assert store.view(REQUEST.key).read_bytes() == (tmp_path / "plain.exr").read_bytes()
    np.testing.assert_array_equal(load_view(store, REQUEST.key).capture_dn, VIEW.capture_dn)
    assert repr(certificate_of(store, REQUEST)) == repr(VIEW.certificate)


def test_what_is_missing_from_a_store_that_cannot_be_written_is_one_line(requested, tmp_path, monkeypatch):
    """Before anything is rendered; with all stored, nothing is said."""
    store = Store(tmp_path)
    made(requested[:2], store)
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    _, rendered = made(requested[:2], store)
    assert rendered == []
    with pytest.raises(StoreError, match="1 of 3 views are missing from it"):
        made(requested, store)
    assert len(NoiseRenderer.rendered) == 2


def test_light_that_cannot_be_solved_fails_the_views_of_its_state_alone(requested, tmp_path, monkeypatch):
    """It is tried once, and another state's views go on."""
    dark = dataclasses.replace(requested[0].request.state, light=Light(0.1, requested[0].request.state.light.panels))
    other = [dataclasses.replace(item, request=dataclasses.replace(item.request, state=dark)) for item in requested[:2]]
    tried = []
    solve = lighting.solve_light

    def solve_or_fail(state, mi=None):
        tried.append(state_key(state))
        if state_key(state) == state_key(dark):
            raise MemoryError("no room for the light")
        return solve(state, mi)

    monkeypatch.setattr(lighting, "solve_light", solve_or_fail)
    acquired, rendered = made([*other, *requested], Store(tmp_path))
    assert set(acquired.failed) == {item.request.key for item in other}
    assert set(acquired.failed.values()) == {"the scene's light cannot be solved: MemoryError: no room for the light"}
    assert set(acquired.measured) == set(requested)
    assert tried.count(state_key(dark)) == 1
    assert rendered == [item.request.key for item in requested]


def _die_if_first(path: Path):
    """Kill this worker the first time."""
    with contextlib.suppress(FileExistsError):
        path.touch(exist_ok=False)
        os._exit(1)
    return os.getpid()


def _die():
    os._exit(1)


@pytest.mark.slow
def test_a_worker_that_dies_takes_no_other_call_with_it(tmp_path):
    """Killed once, a call is made again; one that kills its worker each time has failed, and the others are done."""
    found = {}

    def done(item, result, error):
        found[item] = (result, error)

    with WorkerQueue(2, 4, done) as queue:
        queue.submit("deadly", _die)
        queue.submit("once", _die_if_first, tmp_path / "mark")
        queue.submit("harmless", os.getpid)
        queue.drain()
        queue.submit("later", os.getpid)
        queue.drain()
    assert isinstance(found.pop("deadly")[1], BrokenProcessPool)
    assert set(found) == {"once", "harmless", "later"}
    assert all(error is None and result != os.getpid() for result, error in found.values())
