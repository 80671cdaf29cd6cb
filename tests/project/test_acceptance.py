"""What `make test` has no time for: the paper's three experiments at full size (`make acceptance`)."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from benchmarks.sweep import figures, repeated, timed

pytestmark = pytest.mark.acceptance

TABLES = ("configurations.csv", "points.csv", "views.csv", "correlation.csv", "detection.csv", "claims.csv")
# Sampling noise over sensor noise at the edges of markers, RMS, in the median view.
RENDER_NOISE_RATIO = 0.5


def rows(path):
    """A CSV file as a list of dictionaries."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with the first run in first/ and a repeated one in again/, and both runs' figures."""
    folder = tmp_path_factory.mktemp("paper")
    first, again = timed(folder, "first"), repeated(folder)
    assert first.code == 0, first.printed
    assert again.code == 0, again.printed
    print(first.printed)
    print(figures(folder, first, again))
    return folder, again


@pytest.fixture(scope="module")
def first(runs):
    """The folder of both runs."""
    return runs[0]


def test_sampling_noise_is_below_half_the_sensors(first):
    """The images are as good as their sensor lets one see."""
    ratios = [float(r["render_noise_ratio"]) for r in rows(first / "first" / "views.csv") if r["render_noise_ratio"]]
    print(f"render_noise_ratio: median {np.median(ratios):.3f}, largest {max(ratios):.3f}")
    assert np.median(ratios) <= RENDER_NOISE_RATIO


def test_nothing_is_detected_that_cannot_be_seen(first):
    """A marker that the scene hides from a camera is not found there: visibility is the same in metric and render."""
    for row in rows(first / "first" / "detection.csv"):
        assert int(row["hidden_detected"]) == 0
        assert int(row["visible_detected"]) > int(row["visible_missed"])


def test_the_default_scene_is_limited_by_noise(first):
    """Most of the mean squared error is spread from frame to frame, not frozen bias."""
    shares = [float(r["noise_share"]) for r in rows(first / "first" / "configurations.csv") if r["noise_share"]]
    print(f"noise share: median {np.median(shares):.2f}, from {min(shares):.2f}")
    assert np.median(shares) > 0.5


def test_each_view_was_rendered_once(first):
    """Zoom, focus and selection share their fixed cameras' views."""
    views = rows(first / "first" / "views.csv")
    assert len({row["view"] for row in views}) == len(views) == len(list((first / "store" / "views").rglob("*.exr")))


def test_a_repeated_run_says_the_same(runs):
    """Nothing is rendered again, and the tables are the same byte for byte."""
    folder, again = runs
    assert "0 rendered, 0 measured now" in again.printed
    for name in TABLES:
        assert (folder / "first" / name).read_bytes() == (folder / "again" / name).read_bytes(), name
