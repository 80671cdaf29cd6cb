"""Limits of detection: found again from detections that keep them, with misses and finds at random."""

from __future__ import annotations

import numpy as np
import pytest

from pss import RangeError
from pss.cameras.views import Views
from pss.visibility.points import visible_in
from pss.visibility.targets import TARGET_VISIBILITY, Legible
from tests.helpers.markers_before_cameras import world
from validate.prediction.limits import fit_limits

TRIALS = 20
# Trials in which a marker is missed within the limits, and found beyond them.
MISSED, LUCKY = 0.03, 0.05
# Steps of the search are 0.1 px and 0.05 modules; some hundred markers lie within a few steps of each limit.
MODULE_PX, BLUR = 0.15, 0.1


@pytest.mark.parametrize("truth", [(2.3, 1.0), (3.7, 0.6)])
def test_planted_limits_are_found(truth):
    views = world(1)
    rng = np.random.default_rng(2)
    legible = visible_in(views, (), (*TARGET_VISIBILITY, Legible(*truth)))
    rate = rng.binomial(TRIALS, np.where(legible, 1 - MISSED, LUCKY)) / TRIALS
    found = fit_limits(views, (), rate)
    assert found.smallest_module_px == pytest.approx(truth[0], abs=MODULE_PX)
    assert found.largest_blur_modules == pytest.approx(truth[1], abs=BLUR)
    assert found.found_within == pytest.approx(1 - MISSED, abs=0.01)
    assert found.found_beyond == pytest.approx(LUCKY, abs=0.02)
    assert sum(found.pairs) == visible_in(views, (), TARGET_VISIBILITY).sum()
    assert found.limits == {
        "smallest_module_px": found.smallest_module_px,
        "largest_blur_modules": found.largest_blur_modules,
    }


def test_what_is_not_whole_has_no_say():
    """Cut and hidden markers are missed for another reason than their size."""
    views = world(3)
    whole = visible_in(views, (), TARGET_VISIBILITY)
    rate = np.where(visible_in(views, (), (*TARGET_VISIBILITY, Legible(2.0, 1.5))), 1.0, 0.0)
    changed = np.where(whole, rate, 1.0 - rate)
    assert fit_limits(views, (), rate) == fit_limits(views, (), changed)


def test_without_whole_markers_there_is_nothing_to_fit():
    views = world(4)
    behind = Views(views.cameras, views.points_m * (1, -1, 1), views.normals, views.appearance)
    with pytest.raises(RangeError, match="no view has a whole marker in it; allowed: at least one"):
        fit_limits(behind, (), np.zeros((12, 200)))
