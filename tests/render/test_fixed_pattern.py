"""PRNU and DSNU: a property of the camera's body, the same in all its frames, of the spread that the sensor states."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest
import scipy.stats

import render.captures
import validate.markers.view_measurement
from pss import ImageSensor, PTZCamera
from render.certificate import Certificate
from render.files.exr import write_view
from render.lens.sampling import Sampling
from render.renderer import RenderedView, ViewRequest
from render.sensor import capture, fixed_pattern
from render.store.folder import Store
from render.world.state import Light, MarkerPrint, Room, SceneState
from tests.helpers.z_scores import largest_z
from validate.markers.view_measurement import MeasureTask, measure

WIDTH, HEIGHT = 320, 240
PIXELS = WIDTH * HEIGHT
SENSOR = ImageSensor(550.0, 0.5, 4.0, 10_000.0, 6.0, 12, 64, prnu_share=0.02, dsnu_e=8.0)
CAMERA = PTZCamera((0.5, -1.25, 2.8), 10.0, -20.0, zoom=2.0, resolution=(WIDTH, HEIGHT), name="4")
# Single precision: products with σ of numbers around 1 differ in the last bits.
SAME_TO_SINGLE = 1e-6
# The pattern of CAMERA's first pixels in units of σ: stored measurements are made of such numbers. As with all frozen
# draws, they hold for the numpy of requirements.lock.
PINNED_PRNU = (0.023640576, -0.7459946, 0.034492946)
PINNED_DSNU = (-0.65952122, 0.40853801, -0.7366578)


def test_a_pattern_is_single_precision_of_the_images_shape():
    pattern = fixed_pattern(CAMERA, SENSOR)
    for array in (pattern.prnu, pattern.dsnu_e):
        assert array.dtype == np.float32
        assert array.shape == (HEIGHT, WIDTH)
    none = fixed_pattern(CAMERA, dataclasses.replace(SENSOR, prnu_share=0.0, dsnu_e=0.0))
    assert none.prnu.shape == none.dsnu_e.shape == (HEIGHT, WIDTH)
    assert not none.prnu.any()
    assert not none.dsnu_e.any()


def test_a_pattern_has_the_stated_spread_and_is_gaussian():
    """Z-tests of mean, variance, skewness and excess kurtosis of both, and of their independence, as one family."""
    pattern = fixed_pattern(CAMERA, SENSOR)
    prnu, dsnu = pattern.prnu.ravel() / 0.02, pattern.dsnu_e.ravel() / 8.0
    neighbours = [(prnu, dsnu), (prnu[1:], prnu[:-1]), (dsnu[1:], dsnu[:-1]), (prnu[WIDTH:], prnu[:-WIDTH])]
    bound = largest_z(8 + len(neighbours))
    for values in (prnu, dsnu):
        assert abs(values.mean()) < bound / math.sqrt(PIXELS)
        assert abs(values.var() - 1) < bound * math.sqrt(2 / PIXELS)
        assert abs(scipy.stats.skew(values)) < bound * math.sqrt(6 / PIXELS)
        assert abs(scipy.stats.kurtosis(values)) < bound * math.sqrt(24 / PIXELS)
    for a, b in neighbours:
        assert abs(np.corrcoef(a, b)[0, 1]) < bound / math.sqrt(PIXELS)


@pytest.mark.parametrize(
    "change",
    [
        {"pan_deg": 190.0},
        {"tilt_deg": 30.0},
        {"zoom": 7.0},
        {"focus_distance_m": 1.5},
        {"f_number": 4.0},
        {"name": "north"},
        {"position_m": np.array([0.5, -1.25, 2.8])},
    ],
    ids=lambda change: next(iter(change)),
)
def test_a_camera_that_moves_its_lens_is_the_same_body(change):
    moved = fixed_pattern(dataclasses.replace(CAMERA, **change), SENSOR)
    np.testing.assert_array_equal(moved.prnu, fixed_pattern(CAMERA, SENSOR).prnu)
    np.testing.assert_array_equal(moved.dsnu_e, fixed_pattern(CAMERA, SENSOR).dsnu_e)


def test_minus_nought_is_the_same_place():
    here, there = (dataclasses.replace(CAMERA, position_m=(x, 1.0, 2.0)) for x in (0.0, -0.0))
    np.testing.assert_array_equal(fixed_pattern(here, SENSOR).prnu, fixed_pattern(there, SENSOR).prnu)


def test_another_place_or_another_resolution_is_another_body():
    """Nothing of one pattern is in the other's: correlations of σ 1/√n."""
    others = [dataclasses.replace(CAMERA, position_m=place) for place in ((0.5, -1.25, 2.81), (-1.25, 0.5, 2.8))]
    patterns = [fixed_pattern(camera, SENSOR) for camera in (CAMERA, *others)]
    wide = fixed_pattern(dataclasses.replace(CAMERA, resolution=(WIDTH, HEIGHT + 1)), SENSOR)
    fields = [p.prnu.ravel() for p in patterns] + [p.dsnu_e.ravel() for p in patterns] + [wide.prnu[:-1].ravel()]
    correlation = np.corrcoef(fields) - np.eye(len(fields))
    assert np.abs(correlation).max() * math.sqrt(PIXELS) < largest_z(len(fields) * (len(fields) - 1) // 2)


def test_the_sensors_spread_scales_one_pattern():
    """Exposure, gain and the σ themselves don't draw new pixels: the same body with another σ is easy to compare."""
    twice = fixed_pattern(
        CAMERA, dataclasses.replace(SENSOR, prnu_share=0.04, dsnu_e=4.0, exposure_ms=1.0, system_gain_dn_per_e=1.0)
    )
    pattern = fixed_pattern(CAMERA, SENSOR)
    np.testing.assert_allclose(twice.prnu, 2 * pattern.prnu, rtol=SAME_TO_SINGLE)
    np.testing.assert_allclose(twice.dsnu_e, pattern.dsnu_e / 2, rtol=SAME_TO_SINGLE)


def test_no_pixel_responds_with_less_than_nothing():
    """At the largest PRNU, −1 is 5 σ away: of 20 million pixels some six would be beyond."""
    camera = dataclasses.replace(CAMERA, resolution=(5000, 4000))
    pattern = fixed_pattern(camera, ImageSensor(prnu_share=0.2))
    assert pattern.prnu.min() == -1
    assert (pattern.prnu == -1).sum() < 30


def test_a_pattern_is_the_same_in_another_process_and_pinned():
    """Nothing of a process is in it: workers and later runs, on other machines, have the same camera."""
    ask = (
        "from tests.render.test_fixed_pattern import *; p = fixed_pattern(CAMERA, SENSOR);"
        "print(*p.prnu[0, :3] / 0.02, *p.dsnu_e[0, :3] / 8)"
    )
    done = subprocess.run([sys.executable, "-c", ask], env={"PYTHONHASHSEED": "7"}, capture_output=True, check=True)
    np.testing.assert_allclose(
        [float(word) for word in done.stdout.split()], [*PINNED_PRNU, *PINNED_DSNU], rtol=SAME_TO_SINGLE
    )


# ---- in captures -----------------------------------------------------------------------------------------------------


def frames(level_e: float, count: int, sensor: ImageSensor = SENSOR) -> np.ndarray:
    """Electrons above black, (count, HEIGHT, WIDTH)."""
    pattern = fixed_pattern(CAMERA, sensor)
    electrons = np.full((HEIGHT, WIDTH), level_e, dtype=np.float32)
    captures = [capture(electrons, sensor, np.random.default_rng([7, i]), pattern) for i in range(count)]
    return (np.array(captures, dtype=float) - sensor.black_level_dn) * sensor.gain_e_per_dn


@pytest.mark.parametrize("level_e", [0.0, 5000.0])
def test_each_pixel_has_its_own_gain_and_offset(level_e):
    """A pixel's mean over frames is level · (1 + PRNU) + DSNU: the regression on the pattern has slope 1, offset 0.

    In the dark the PRNU must not show, and the DSNU must be the same in light and dark.
    """
    count = 12
    mean = frames(level_e, count).mean(axis=0).ravel()
    pattern = fixed_pattern(CAMERA, SENSOR)
    design = np.column_stack([np.ones(PIXELS), pattern.dsnu_e.ravel(), pattern.prnu.ravel() * 5000])
    values, *_ = np.linalg.lstsq(design, mean, rcond=None)
    sigma = float(SENSOR.noise_electrons(np.array(level_e))) / math.sqrt(count)
    error = sigma * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    expected = np.array([level_e, 1.0, level_e / 5000])
    assert (np.abs(values - expected) / error < largest_z(6)).all()
    # The regression would notice a wrong σ of a hundredth, and of the dark offset of a twentieth.
    assert error[2] < 0.0025
    assert error[1] < 0.0125
    # And nothing else is fixed: what is left has the temporal noise alone.
    left = mean - design @ values
    assert abs(left.var() / sigma**2 - 1) < largest_z(2) * math.sqrt(2 / PIXELS)


def test_the_pattern_cancels_in_the_difference_of_two_frames():
    """`noise_electrons` is temporal noise: that of a difference of frames, over √2. One frame alone has more."""
    first, second = frames(5000.0, 2)
    temporal = float(SENSOR.noise_electrons(np.array(5000.0))) ** 2
    bound = largest_z(1) * math.sqrt(2 / PIXELS)
    # PRNU² more in the mean of the pixels' shot noise is no more: the mean response is 1.
    assert abs((first - second).var() / 2 / temporal - 1) < bound
    assert first.var() > temporal + 0.9 * (5000 * 0.02) ** 2


def test_without_a_pattern_all_pixels_are_alike():
    electrons = np.full((HEIGHT, WIDTH), 5000.0)
    plain = dataclasses.replace(SENSOR, prnu_share=0.0, dsnu_e=0.0)
    np.testing.assert_array_equal(
        capture(electrons, SENSOR, np.random.default_rng(1)), capture(electrons, plain, np.random.default_rng(1))
    )


def test_a_measurement_has_one_pattern_for_all_trials(tmp_path, monkeypatch):
    """`render.captures` computes the pattern once a view, and every trial's capture has it."""
    state = SceneState(Room(6, 6, 3, 0.5, 0.5, 0.5), Light(0.2, ()), (), (), MarkerPrint("DICT_4X4_50", 1, 0.8, 0.1))
    request = ViewRequest(state, CAMERA, SENSOR, Sampling(), "none")
    flat = np.full((HEIGHT, WIDTH), 0.05, dtype=np.float32)
    view = RenderedView(
        request.key,
        CAMERA,
        SENSOR,
        flat,
        flat,
        np.dstack([flat] * 3),
        np.full((HEIGHT, WIDTH), -1, dtype=np.int32),
        np.zeros((HEIGHT, WIDTH), dtype=np.uint16),
        Certificate(0.1, 0.1, 0.1, 0.1, 0.1, 1, 0.0),
    )
    path = Store(tmp_path).view(request.key)
    path.parent.mkdir(parents=True)
    write_view(path, view, request)
    asked, seen = [], []
    monkeypatch.setattr(render.captures, "fixed_pattern", lambda *a: asked.append(a) or fixed_pattern(*a))
    real = validate.markers.view_measurement.measure_capture
    monkeypatch.setattr(
        validate.markers.view_measurement, "measure_capture", lambda dn, *a: seen.append(dn) or real(dn, *a)
    )
    measure(MeasureTask(tmp_path, request.key, "DICT_4X4_50", (1,), 0, 6))
    assert len(asked) == 1
    assert asked[0] == (CAMERA, SENSOR)
    assert len(seen) == 6
    expected = view.expected_electrons()
    pattern = fixed_pattern(CAMERA, SENSOR)
    excess = (np.mean(seen, axis=0) - 64) * SENSOR.gain_e_per_dn - expected
    fixed = expected * pattern.prnu + pattern.dsnu_e
    slope = (excess * fixed).sum() / (fixed**2).sum()
    noise = SENSOR.noise_electrons(expected) / math.sqrt(6)
    assert abs(slope - 1) < largest_z(1) * math.sqrt(((noise * fixed) ** 2).sum()) / (fixed**2).sum()
