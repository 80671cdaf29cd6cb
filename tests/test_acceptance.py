"""What `make test` has no time for: the paper's three experiments at full size (`make acceptance`)."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.acceptance

ROOT = Path(__file__).parents[1]
TABLES = ("configurations.csv", "points.csv", "views.csv", "correlation.csv", "detection.csv", "claims.csv")
# Sampling noise over sensor noise at the edges of markers, RMS, in the median view.
RENDER_NOISE_RATIO = 0.5


def rows(path):
    """A CSV file as a list of dictionaries."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def run(folder, out):
    """Run the three sweeps of the paper."""
    arguments = ["zoom", "focus", "selection", "--store", str(folder / "store"), "--out", str(folder / out)]
    script = [sys.executable, str(ROOT / "validate" / "run_sweep.py"), *arguments]
    return subprocess.run(script, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A folder with the finished first run."""
    folder = tmp_path_factory.mktemp("paper")
    done = run(folder, "first")
    print(done.stdout)
    assert done.returncode == 0, done.stderr
    return folder


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


def test_a_repeated_run_says_the_same(first):
    """Nothing is rendered again, and the tables are the same byte for byte."""
    done = run(first, "second")
    assert done.returncode == 0, done.stderr
    assert "0 rendered, 0 measured now" in done.stdout
    for name in TABLES:
        assert (first / "first" / name).read_bytes() == (first / "second" / name).read_bytes(), name
