"""The detector of docs/own-detector.md, installed as the page shows it, measures drawn views of its own package."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

import scenes
import validate.acquire.acquire as acquiring
from render.lens.sampling import Sampling
from render.store.folder import Store
from scenes import load_sweep
from tests.helpers.closet import SCENE, SWEEP
from tests.helpers.drawn_sweep import DrawingRenderer, stand_in
from tests.helpers.installed import EXAMPLES, own_detector
from tests.helpers.stored_views import no_progress
from validate.acquire.acquire import acquire
from validate.markers.detector_table import DETECTORS
from validate.sweeps.sweep import assess_sweep, plan

# m: unrefined corners are good to a quarter of a pixel, and a pixel is 3 mm and more on the board.
WITHIN_M = 0.03


@pytest.fixture
def stock(tmp_path):
    site = tmp_path / "site"
    site.mkdir()
    with warnings.catch_warnings(), own_detector(site) as name:
        warnings.simplefilter("error")
        assert name in DETECTORS
        yield name


def test_stored_views_are_measured_again_without_rendering(stock, tmp_path, monkeypatch):
    """With the default, a built-in detector and the page's, each with measurements of its own."""
    (tmp_path / "closet.toml").write_text(SCENE)
    (tmp_path / "zooming.toml").write_text(SWEEP.replace("values = [1.5, 2.0, 3.0]", "values = [2.0]"))
    stand_in(monkeypatch.setattr, workers=False)
    monkeypatch.setattr(acquiring, "Renderer", DrawingRenderer)
    sweep = load_sweep(tmp_path / "zooming.toml")
    scene = scenes.load(sweep.scene_path)
    rendered, rms_m = [], []
    for name in ("registration", "aruco-subpix", stock):
        planned = plan(sweep, scene, "drawn", Sampling(), name)
        acquired = acquire([item for views in planned.views for item in views], Store(tmp_path), None, no_progress)
        assert not acquired.failed
        assert acquired.measured_items
        rendered.append(acquired.rendered)
        (assessment,) = assess_sweep(planned, acquired).assessments
        assert (assessment.measured.errors.detections > 0).sum() >= 8
        rms_m.append(assessment.measured.errors.pooled_rms_m)
    assert rendered[0] > 0
    assert rendered[1:] == [0, 0]
    assert len(set(rms_m)) == 3
    assert max(rms_m) < WITHIN_M


def test_an_edited_detector_has_other_measurements(stock, tmp_path):
    before = DETECTORS.content(stock)
    assert before.startswith("stock-aruco stock-aruco=1.0 numpy=" + np.__version__)
    assert "opencv-contrib-python-headless=" in before
    module = tmp_path / "site" / "stock_aruco.py"
    module.write_text(module.read_text().replace("255", "254"))
    DETECTORS.reload_entry_points()
    assert DETECTORS.content(stock) != before


def test_the_page_shows_the_files_of_the_example():
    """Each to the letter: test_docs.py compares the blocks; here, that the package has no further file."""
    assert sorted(path.name for path in (EXAMPLES / "own-detector").iterdir() if path.is_file()) == [
        "pyproject.toml",
        "stock_aruco.py",
    ]
    assert [field.name for field in dataclasses.fields(type(DETECTORS["registration"]))] == ["name", "targets"]
