"""`render.view`: a view by one call, the same that commands make and find."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import render
import scenes
from pss import RangeError
from render import backend
from render.lens.sampling import Sampling
from render.random_streams import random_stream
from render.sensor import capture, fixed_pattern
from render.store.views import stored_view
from scenes import load_sweep
from tests.helpers.views import an_awkward_view
from validate.acquire.request import views_of
from validate.markers.detector import Targets
from validate.markers.view_measurement import MeasureTask, load_measurement, measure, measure_capture

CAMERA = "4"
SMALL = ["sensor.resolution_px=[480, 270]", "sensor.pixel_pitch_um=13.8"]


@pytest.fixture(scope="module")
def small():
    """The shipped room on a sensor of few large pixels."""
    return scenes.load("room", SMALL)


@pytest.fixture(scope="module")
def seen(small, room_store):
    """A view of it, rendered into the store that has the room's light."""
    return render.view(small, small.camera(CAMERA), store=str(room_store.folder))


def test_importing_render_loads_no_renderer():
    """Most that is imported from it is plain data."""
    code = "import sys, render; assert not {'render.renderer', 'numpy', 'mitsuba'} & set(sys.modules); render.view"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stderr == ""
    assert {"View", "view"} <= set(dir(render))
    with pytest.raises(AttributeError, match="no attribute 'vieww'"):
        _ = render.vieww


def test_images_are_those_of_the_camera(seen, small):
    """Shapes and kinds as documented, and every marker number is one of the scene's."""
    width, height = small.camera(CAMERA).resolution
    for image, kind in ((seen.radiance, np.float32), (seen.depth_m, np.float32), (seen.marker_id, np.int32)):
        assert (image.shape, image.dtype) == ((height, width), kind)
    assert set(np.unique(seen.marker_id)) <= {-1, *(marker.id for marker in small.state.markers)}
    assert (seen.marker_id >= 0).any()


def test_the_view_is_the_one_that_sweeps_ask_for(seen, small, room_store):
    """The same name, so that a command finds it and it finds a command's."""
    sweep = load_sweep("zoom")
    sampling = Sampling(noise_ratio=sweep.render_noise_ratio)
    (requested,) = views_of(small, [small.camera(CAMERA)], sampling, backend.choose().identity, 1, 2)
    assert seen.key == requested.request.key
    assert (stored_view(room_store, requested.request.key).radiance == seen.radiance).all()


def test_a_stored_view_is_read_and_not_rendered(seen, small, room_store, monkeypatch):
    monkeypatch.setattr("render.viewing.Renderer", None)
    again = render.view(small, small.camera(CAMERA), store=room_store)
    assert (again.radiance == seen.radiance).all()
    assert again.certificate == seen.certificate


def test_without_a_store_the_view_is_the_same(seen, small, room_store, monkeypatch):
    """And the light is solved once for all views of a state; here the store's stands in for it."""
    from render.keys import light_key
    from render.store.light import load_light

    calls = []

    def solved(state, mi):
        calls.append(state)

    monkeypatch.setattr("render.store.light._kept", {})
    monkeypatch.setattr("render.store.light.solve_light", solved)
    monkeypatch.setattr("render.store.light.bake", lambda state, _: load_light(room_store, light_key(state), state))
    for _ in range(2):
        view = render.view(small, small.camera(CAMERA))
        assert (view.radiance == seen.radiance).all()
    assert len(calls) == 1


def test_a_capture_is_the_trial_that_is_measured(seen, small, room_store):
    """By hand from the sensor's stages, and through the stored measurement's detections."""
    electrons, pattern = seen.expected_electrons(), fixed_pattern(seen.camera, seen.sensor)
    for trial in (0, 1):
        by_hand = capture(electrons, seen.sensor, random_stream(3, seen.key[:16], "capture", trial), pattern)
        assert by_hand.dtype == np.uint16
        assert (seen.capture(seed=3, trial=trial) == by_hand).all()
    assert (seen.capture(seed=3) != seen.capture(seed=4)).any()
    ids = tuple(marker.id for marker in small.state.markers)
    task = MeasureTask(room_store.folder, seen.key, small.state.print.dictionary, ids, 3, 2)
    measure(task)
    targets = Targets(small.state.print.dictionary, ids)
    pixels, _, _ = measure_capture(seen.capture(seed=3, trial=1), targets, seen.sensor)
    assert np.isfinite(pixels).any()
    assert np.array_equal(load_measurement(task).pixels[1], pixels, equal_nan=True)


def test_what_is_not_allowed_is_one_line(small, tmp_path):
    camera = small.cameras[0]
    with pytest.raises(RangeError, match=r"noise_ratio = 0; allowed: above 0"):
        render.view(small, camera, noise_ratio=0)
    auto = scenes.load("room", ["sensor.exposure_ms=auto"])
    with pytest.raises(RangeError, match=r"exposure_ms = \"auto\".*allowed: a number of ms"):
        render.view(auto, camera, store=tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_seed_below_zero_is_refused():
    view = render.View(**vars(an_awkward_view()[1]))
    with pytest.raises(RangeError, match="seed = -1; allowed: 0 or more"):
        view.capture(seed=-1)
    with pytest.raises(RangeError, match="trial = -1; allowed: 0 or more"):
        view.capture(trial=-1)
