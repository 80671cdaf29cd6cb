"""Detection and triangulation know nothing of the truth: a scene other than the assumed one is measured as it is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import scenes
import validate.acquire.acquire as acquiring
from render.lens.sampling import Sampling
from render.renderer import RenderedView, ViewRequest
from render.store.folder import Store
from scenes import load_sweep
from tests.helpers.closet import SCENE, SWEEP
from tests.helpers.drawn_sweep import DrawingRenderer, drawn, stand_in
from tests.helpers.stored_views import no_progress
from validate.acquire.acquire import acquire
from validate.sweeps.sweep import assess_sweep, plan

# m, how far the board of the images stands from where the scene file has it: ten times the error of a detection.
MOVED_M = np.array([0.012, -0.02, 0.008])
# m, of a mean error: drawn markers are found to a few hundredths of a pixel, 0.1 mm across and 0.5 mm along a ray.
WITHIN_M = 1.5e-3
# Of the twelve markers, one that the scene file has and the images lack.
ABSENT = 5


class OtherSceneRenderer(DrawingRenderer):
    """Draws the board elsewhere and without one marker; all else of a view is as requested, its camera and ids too."""

    def render(self, request: ViewRequest) -> RenderedView:
        markers = tuple(
            dataclasses.replace(marker, centre_m=tuple(np.add(marker.centre_m, MOVED_M)))
            for marker in request.state.markers
            if marker.id != ABSENT
        )
        other = dataclasses.replace(request, state=dataclasses.replace(request.state, markers=markers))
        return dataclasses.replace(drawn(request), radiance=drawn(other).radiance)


@pytest.mark.parametrize(
    ("renderer", "expected_m"), [(DrawingRenderer, np.zeros(3)), (OtherSceneRenderer, MOVED_M)], ids=["same", "other"]
)
def test_the_errors_are_those_of_the_images(renderer, expected_m, tmp_path, monkeypatch):
    """All points are off by how far the board of the images is: a detector that knew the file's would be off by 0."""
    (tmp_path / "closet.toml").write_text(SCENE)
    (tmp_path / "zooming.toml").write_text(SWEEP.replace("values = [1.5, 2.0, 3.0]", "values = [2.0]"))
    stand_in(monkeypatch.setattr, workers=False)
    monkeypatch.setattr(acquiring, "Renderer", renderer)
    sweep = load_sweep(tmp_path / "zooming.toml")
    planned = plan(sweep, scenes.load(sweep.scene_path), "drawn", Sampling())
    acquired = acquire([item for views in planned.views for item in views], Store(tmp_path), None, no_progress)
    assert not acquired.failed
    (assessment,) = assess_sweep(planned, acquired).assessments
    errors = assessment.measured.errors
    found = errors.detection_rate == 1
    assert found.sum() >= 8
    np.testing.assert_allclose(errors.mean_error_m[found], np.tile(expected_m, (found.sum(), 1)), rtol=0, atol=WITHIN_M)
    assert errors.detection_rate[ABSENT] == (renderer is DrawingRenderer)
