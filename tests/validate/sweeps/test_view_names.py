"""People read of cameras and steps, never of hashes: a view's hash is for files alone."""

from __future__ import annotations

import re

import pytest

import scenes
from render.lens.sampling import Sampling
from render.store.folder import Store, StoreError
from scenes import load_sweep
from tests.helpers.closet import SCENE, SWEEP
from validate.acquire.view_names import view_name
from validate.pages.stored import stored_measurements
from validate.sweeps.step_names import names_in_steps
from validate.sweeps.sweep import plan

HASH = re.compile(r"[0-9a-f]{12}")


@pytest.fixture
def planned(tmp_path):
    """A sweep over the zoom of two of three cameras."""
    (tmp_path / "closet.toml").write_text(SCENE)
    (tmp_path / "zooming.toml").write_text(SWEEP)
    sweep = load_sweep(tmp_path / "zooming.toml")
    return plan(sweep, scenes.load(sweep.scene_path), "renderer", Sampling())


def test_a_view_goes_by_camera_and_step(planned):
    names = names_in_steps([planned])
    views = planned.views
    assert [names[item.request.key] for item in views[1]] == [
        "the view of camera west at zoom=2 of zooming",
        "the view of camera middle at zoom=1.5 of zooming (and 2 other steps)",
        "the view of camera east at zoom=2 of zooming",
    ]
    assert set(names) == {item.request.key for step in views for item in step}
    assert not [name for name in names.values() if HASH.search(name)]


def test_a_view_without_a_step_goes_by_its_settings(planned):
    assert re.fullmatch(
        r"the view of camera west \(pan \S+°, tilt \S+°, zoom 1\.5, focus 2\.5 m\)",
        view_name(planned.views[0][0].request),
    )


def test_a_report_names_the_view_that_the_store_lacks(planned, tmp_path):
    with pytest.raises(StoreError, match=r"the view of camera west \(pan .*\) is not in the store ") as caught:
        stored_measurements(planned.views[0], Store(tmp_path / "store"))
    assert not HASH.search(str(caught.value).replace(str(tmp_path), ""))
