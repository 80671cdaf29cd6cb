"""`timings.csv`: what each view took, whichever run made it, and which that was."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from render.store.folder import Store
from render.store.views import render_seconds_of, save_view
from tests.helpers.views import an_awkward_view
from validate.acquire.acquire import _certified
from validate.acquire.request import Acquired, Acquisition
from validate.markers.view_measurement import ViewMeasurement
from validate.sweeps.rows import timing_rows

MEASURED = ViewMeasurement(np.zeros((2, 0, 2)), np.zeros((2, 0, 2, 2)), 0, 0.75)


def test_a_repeated_run_has_the_seconds_of_the_run_that_made_its_views(tmp_path):
    """Rendered for 12.5 s by another run and measured by it, and both by this one."""
    store = Store(tmp_path)
    request, view = an_awkward_view()
    save_view(store, view, request, 12.5)
    item = Acquisition(request, 0, 2)
    acquired = Acquired({item: MEASURED})
    assert _certified(item, store, acquired)
    assert timing_rows([item], acquired) == [
        {
            "view": request.key,
            "render_seconds": 12.5,
            "detect_seconds": 0.75,
            "rendered_in": "another run",
            "measured_in": "another run",
        }
    ]
    acquired.render_seconds[request.key] = 3.25
    acquired.measured_items.add(item)
    (row,) = timing_rows([item], acquired)
    assert (row["render_seconds"], row["rendered_in"], row["measured_in"]) == (3.25, "this run", "this run")


def test_a_view_that_was_stored_without_its_seconds_has_none(tmp_path):
    """An empty field, and no 0."""
    store = Store(tmp_path)
    request, view = an_awkward_view()
    save_view(store, view, request)
    assert render_seconds_of(store, request) is None
    item = Acquisition(dataclasses.replace(request), 0, 2)
    acquired = Acquired({item: MEASURED})
    assert _certified(item, store, acquired)
    assert math.isnan(timing_rows([item], acquired)[0]["render_seconds"])
