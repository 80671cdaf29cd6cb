"""What has a place in a store and a checksum that fits, and is still not what belongs there: it is made again."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

from render.keys import light_key
from render.light import lit_scene
from render.light.radiosity import UnitLight, solve_light
from render.store.arrays import check_arrays
from render.store.checksums import LINE_DIGITS, FileSum, add_sum, read_sums, sum_of, sum_path
from render.store.folder import Store
from render.store.light import load_light, save_light
from render.store.views import certificate_of, load_view, save_view
from render.world.state import Light, Marker, MarkerPrint, Panel, Room, SceneState
from tests.helpers.views import an_awkward_view
from validate.markers.view_measurement import MeasureTask, load_measurement
from validate.run_sweep import main

TRIALS, MARKERS = 3, 2


def a_measurement() -> dict[str, np.ndarray]:
    pixels = np.full((TRIALS, MARKERS, 2), 4.0)
    pixels[0, 1] = np.nan
    covariance = np.broadcast_to(np.eye(2), (TRIALS, MARKERS, 2, 2)).copy()
    covariance[0, 1] = np.nan
    return {"pixels": pixels, "covariance": covariance, "strangers": np.array(0), "seconds": np.array(0.5)}


@pytest.fixture
def task(tmp_path):
    return MeasureTask(tmp_path, "ab" * 12, "DICT_4X4_100", (3, 7), 0, TRIALS)


def test_a_measurement_comes_back(task):
    Store(task.store).save(task.path, a_measurement())
    assert load_measurement(task).detected.tolist() == [[True, False], [True, True], [True, True]]


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("another key", lambda m: {"pixel": m.pop("pixels"), **m}),
        ("a key more", lambda m: m | {"more": np.zeros(2)}),
        ("no key", lambda m: {}),
        ("other trials", lambda m: m | {"pixels": m["pixels"][:2]}),
        ("other markers", lambda m: m | {"pixels": m["pixels"][:, :1], "covariance": m["covariance"][:, :1]}),
        ("no matrices", lambda m: m | {"covariance": m["covariance"][..., 0]}),
        ("text", lambda m: m | {"pixels": np.full((TRIALS, MARKERS, 2), "4.0")}),
        ("complex", lambda m: m | {"pixels": m["pixels"] + 1j}),
        ("a list of strangers", lambda m: m | {"strangers": np.zeros(3)}),
        ("fewer than no strangers", lambda m: m | {"strangers": np.array(-1)}),
        ("endless seconds", lambda m: m | {"seconds": np.array(np.inf)}),
        ("a pixel without covariance", lambda m: m | {"covariance": np.full_like(m["covariance"], np.nan)}),
    ],
)
def test_a_measurement_of_other_keys_or_shapes_is_set_aside(task, caplog, what, change):
    """Until now a KeyError, exit code 70, on each run."""
    Store(task.store).save(task.path, change(a_measurement()))
    assert load_measurement(task) is None
    assert not task.path.exists()
    (line,) = caplog.messages
    assert line.startswith(f"{task.path}: ")
    assert "set aside" in line


@pytest.fixture(scope="module")
def lit():
    """A small state and its light."""
    state = SceneState(
        Room(4.0, 4.0, 2.5, 0.5, 0.5, 0.5),
        Light(1.0, (Panel((0.0, 0.0), (0.5, 0.5)),)),
        (),
        (Marker(5, "wall", (0.0, -1.0, 1.3), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.02),),
        MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04),
    )
    dark = dataclasses.replace(state, light=Light(0.0, (), 1.0))
    assert isinstance(solve_light(dark), UnitLight)
    return state, lit_scene.bake(state, solve_light(dark))


def test_light_comes_back(lit, tmp_path):
    state, meshes = lit
    key = light_key(state)
    save_light(Store(tmp_path), key, meshes, "abc", 1.0)
    found = load_light(Store(tmp_path), key, state)
    for name, array in vars(meshes).items():
        np.testing.assert_array_equal(getattr(found, name), array)


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("no key", lambda m: {}),
        ("a key more", lambda m: m | {"more": np.zeros(2)}),
        ("corners that are not there", lambda m: m | {"faces": m["faces"] + 10_000}),
        ("corners before the first", lambda m: m | {"faces": m["faces"] - 1}),
        ("corners between corners", lambda m: m | {"faces": m["faces"] + 0.5}),
        ("fewer radiances", lambda m: m | {"radiance": m["radiance"][1:]}),
        ("nan", lambda m: m | {"radiance": m["radiance"] * np.nan}),
        ("another marker", lambda m: m | {"marker_ids": m["marker_ids"] + 1}),
        ("textures of another shape", lambda m: m | {"textures": m["textures"][0]}),
        ("a number", lambda m: m | {"vertices_m": np.array(1.0)}),
    ],
)
def test_light_of_other_keys_or_shapes_is_set_aside(lit, tmp_path, caplog, what, change):
    state, meshes = lit
    store, key = Store(tmp_path), light_key(state)
    store.save(store.light(key), change(dict(vars(meshes))))
    assert load_light(store, key, state) is None
    assert not store.light(key).exists()
    assert "set aside" in caplog.text


def test_arrays_are_checked_by_name_shape_and_kind():
    check_arrays({"a": np.zeros((3, 2))}, {"a": (None, 2)})
    with pytest.raises(ValueError, match=r"a is float64 of shape \(3, 2\); allowed: numbers of shape \(any, 3\)"):
        check_arrays({"a": np.zeros((3, 2))}, {"a": (None, 3)})


# ---- sums ------------------------------------------------------------------------------------------------------------


def with_checksum(content: str) -> str:
    return f"{content} {hashlib.sha256(content.encode()).hexdigest()[:LINE_DIGITS]}"


GOOD = {"bytes": 3, "sha256": "a", "changed_ns": 5, "facts": {"seconds": 1.5, "certificate": {}}}


@pytest.mark.parametrize(
    "content",
    [
        "[]", "1", "null", "{}", "nothing", "[" * 3000, '"' + "9" * 5000 + '"', "9" * 5000,
        *(json.dumps({key: value for key, value in GOOD.items() if key != left_out}) for left_out in GOOD),
        *(json.dumps(GOOD | change) for change in (
            {"bytes": "3"}, {"bytes": True}, {"sha256": 5}, {"changed_ns": 1.5}, {"facts": []},
            {"facts": {"seconds": "1"}}, {"facts": {"certificate": 1}}, {"facts": {"pixels": 1.5}},
            {"facts": {"renderer": 3}}, {"facts": {"trials": None}}, {"facts": {"version": {}}},
        )),
    ],
)  # fmt: skip
def test_a_line_of_a_sum_that_fits_its_checksum_and_has_other_keys_is_none(content):
    """Until now a KeyError at each look at the file."""
    assert FileSum.from_line(with_checksum(json.dumps(GOOD))) is not None
    assert FileSum.from_line(with_checksum(content)) is None


@pytest.mark.parametrize("certificate", [{}, {"edge_rms": "x"}, {"edge_rms": 1.0}])
def test_a_sum_with_another_certificate_is_set_aside_with_its_view(tmp_path, caplog, certificate):
    """It is rendered again, once, and not asked in vain at each run."""
    store = Store(tmp_path)
    request, view = an_awkward_view()
    save_view(store, view, request)
    path = store.view(request.key)
    sum_path(path).unlink()
    add_sum(path, sum_of(path, {"certificate": certificate}))
    assert certificate_of(store, request) is None
    assert not path.exists()
    assert not sum_path(path).exists()
    assert "set aside" in caplog.text
    save_view(store, view, request)
    assert certificate_of(store, request).samples == view.certificate.samples


# ---- what is no plain file -------------------------------------------------------------------------------------------


def a_pipe(path: Path) -> None:
    os.mkfifo(path)


def a_link_to_a_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def a_folder(path: Path) -> None:
    path.mkdir()


@pytest.fixture
def limited_memory():
    """Of 2 GiB more than now: who reads an endless device fails here, and takes no other process with it."""
    resource = pytest.importorskip("resource")
    status = Path("/proc/self/statm")
    before = resource.getrlimit(resource.RLIMIT_AS)
    if status.exists():
        now = int(status.read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + 2**31, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


ODD = pytest.mark.parametrize("odd", [a_pipe, a_link_to_a_device, a_folder])


@ODD
@pytest.mark.usefixtures("limited_memory")
def test_what_is_no_plain_file_is_set_aside_and_never_waited_for(task, tmp_path, caplog, odd):
    """As a measurement, as a view and as light."""
    store = Store(tmp_path)
    request, view = an_awkward_view()
    for path in (task.path, store.view(request.key), store.light("abc")):
        path.parent.mkdir(parents=True, exist_ok=True)
        odd(path)
    assert load_measurement(task) is None
    assert certificate_of(store, request) is None
    assert load_view(store, request.key) is None
    assert store.load(store.light("abc")) is None
    assert len(caplog.messages) == 3
    save_view(store, view, request)
    assert certificate_of(store, request).samples == view.certificate.samples


@ODD
@pytest.mark.usefixtures("limited_memory")
def test_a_sum_that_is_no_plain_file_proves_nothing(task, tmp_path, odd):
    """With its file, and alone: then the file is written all the same."""
    store = Store(tmp_path)
    store.save(task.path, a_measurement())
    sum_path(task.path).unlink()
    odd(sum_path(task.path))
    assert read_sums(task.path) == []
    assert store.facts(task.path) is None
    assert not os.path.lexists(task.path)
    assert not os.path.lexists(sum_path(task.path))
    odd(sum_path(task.path))
    store.save(task.path, a_measurement())
    assert load_measurement(task) is not None


@ODD
@pytest.mark.usefixtures("limited_memory")
def test_verify_sets_aside_what_is_no_plain_file(task, tmp_path, capsys, odd):
    store = Store(tmp_path)
    task.path.parent.mkdir(parents=True)
    odd(task.path)
    assert main(["store", "list", "--store", str(tmp_path)]) == 0
    if odd is not a_folder:
        assert main(["store", "verify", "--store", str(tmp_path)]) == 1
        assert "1 damaged and set aside" in capsys.readouterr().out
        assert not os.path.lexists(task.path)
    assert store.load(task.path) is None


def test_links_to_plain_files_are_read(task, tmp_path):
    """As a store that was put together from others."""
    store = Store(tmp_path)
    store.save(task.path, a_measurement())
    elsewhere = tmp_path / "elsewhere.npz"
    task.path.rename(elsewhere)
    task.path.symlink_to(elsewhere)
    assert load_measurement(task) is not None
