"""What a page gives as the cause of a missed marker is true of that marker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scenes
from pss.visibility.targets import WholeTarget, blur_modules, narrow_side_px
from render.light.estimated_light import estimated_appearance
from validate.pages.causes import BLURRED, COVERED, CUT, SMALL, causes, in_words
from validate.prediction.foresight import LARGEST_BLUR_MODULES, SMALLEST_MODULE_PX
from validate.prediction.predict import predict

# A module's narrow side is taken at the marker's centre there and of its whole outline here: near a limit, and where
# markers are very oblique, the two may be on different sides of it.
NEAR_LIMIT = 0.05


@pytest.fixture(scope="module")
def room():
    return scenes.load("scenes/room.toml")


@pytest.mark.parametrize(("zoom", "focus_m"), [(2.0, None), (6.0, 1.5)])
def test_causes_are_those_of_the_prediction(room, zoom, focus_m):
    """All pairs of cameras and markers in view, by the metric's own tests of whole and legible targets."""
    changes = {"zoom": zoom} | ({} if focus_m is None else {"focus_distance_m": focus_m})
    cameras = [replace(camera, **changes) for camera in room.cameras]
    evaluation = next(iter(predict(room, cameras, estimated_appearance(room.state)).values()))
    views, state = evaluation.views, room.state
    whole = WholeTarget().passed(views, evaluation.visible, state.occluders)
    module_px, blur = narrow_side_px(views), blur_modules(views)
    seen = set()
    for c, camera in enumerate(cameras):
        for n in np.flatnonzero(evaluation.visible[c]):
            found = causes(state.markers[n], camera, state)
            seen |= set(found)
            assert bool({CUT, COVERED} & set(found)) == (not whole[c, n]), (camera.name, n)
            if abs(module_px[c, n] / SMALLEST_MODULE_PX - 1) > NEAR_LIMIT:
                assert (SMALL in found) == (module_px[c, n] < SMALLEST_MODULE_PX), (camera.name, n)
            if abs(blur[c, n] / LARGEST_BLUR_MODULES - 1) > NEAR_LIMIT:
                assert (BLURRED in found) == (blur[c, n] > LARGEST_BLUR_MODULES), (camera.name, n)
    print(seen)
    assert seen


def test_the_sentence_counts_what_is_shown():
    """One marker with two causes is counted with each; one without is named so."""
    words = in_words([(CUT,), (CUT, SMALL), ()])
    assert words.startswith(
        f"Of the 3 shown that were never found: 2 {CUT}, 1 {SMALL}, 1 neither cut, covered, small nor blurred."
    )
    assert in_words([]) == ""
