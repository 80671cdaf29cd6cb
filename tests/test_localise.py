"""Localisation against images made without the renderer, and its covariance against repeated noise."""

from __future__ import annotations

import numpy as np
import pytest

from render.sensor import capture
from tests.synthetic import DICTIONARY, SENSOR, corners, homography, marker_electrons
from validate.detect import find_markers
from validate.localise import BIAS_FLOOR_PX, localise

# (module in px, angle, squeeze, perspective, blur in px): sizes that the room shows, turned, tilted and defocused.
CASES = [
    (5.0, 12.0, 1.0, (0.0, 0.0), 0.0),
    (8.0, 33.0, 0.6, (2e-4, -1e-4), 0.0),
    (12.0, -20.0, 0.8, (-1e-4, 2e-4), 0.0),
    (9.0, 5.0, 0.9, (0.0, 0.0), 2.5),
]
# Frozen bias per axis, from linear interpolation and from the template: three times the RMS of benchmarks/README.md.
LARGEST_BIAS_PX = 0.03
TRIALS = 120
# Claimed over measured variance, per case: the sandwich leaves out that interpolation smooths noise (it claims up to
# 1.7 times too much); 120 trials of two axes give ± 9 % at one standard deviation.
CLAIM_LOW, CLAIM_HIGH = 0.75, 2.2
SIZE = 160
CENTRE = (79.37, 80.81)


def _scene(px, angle, squeeze, skew, blur, white=250.0, black=15.0):
    h = homography(px, CENTRE, angle, squeeze, skew)
    return h, marker_electrons(7, h, SIZE, white, black, blur)


def _dn(electrons):
    return (electrons / SENSOR.gain_e_per_dn + SENSOR.black_level_dn).astype(np.float32)


@pytest.mark.parametrize("case", CASES)
def test_centre_of_a_noise_free_marker_is_unbiased(case):
    """Registration finds the projected centre, also from corners that are a pixel off."""
    h, electrons = _scene(*case)
    start = corners(h) + np.array([[0.6, -0.5], [-0.4, 0.7], [0.5, 0.4], [-0.6, -0.3]])
    found = localise(_dn(electrons), start, 7, DICTIONARY, SENSOR)
    assert found is not None
    np.testing.assert_allclose(found.centre_px, CENTRE, atol=LARGEST_BIAS_PX)


@pytest.mark.parametrize("case", CASES)
def test_covariance_is_that_of_repeated_captures(case):
    """The covariance that a detection claims from its one image is that of the centres over many captures."""
    h, electrons = _scene(*case)
    rng = np.random.default_rng(11)
    found = [localise(capture(electrons, SENSOR, rng), corners(h), 7, DICTIONARY, SENSOR) for _ in range(TRIALS)]
    assert None not in found
    centres = np.array([f.centre_px for f in found])
    claimed = np.mean([f.covariance_px2 for f in found], axis=0) - BIAS_FLOOR_PX**2 * np.eye(2)
    ratio = np.trace(claimed) / np.trace(np.cov(centres.T))
    assert CLAIM_LOW < ratio < CLAIM_HIGH


def test_less_light_means_a_larger_claimed_covariance():
    """A quarter of the light more than doubles the claimed variance (photon noise alone: four times)."""
    h, bright = _scene(*CASES[1])
    variances = []
    for electrons in (bright, bright / 4):
        found = localise(capture(electrons, SENSOR, np.random.default_rng(0)), corners(h), 7, DICTIONARY, SENSOR)
        variances.append(np.trace(found.covariance_px2) - 2 * BIAS_FLOOR_PX**2)
    assert 2 < variances[1] / variances[0] < 16


def test_squeezed_marker_is_less_certain_in_world_than_facing_one():
    """Foreshortening loses pixels across the squeezed direction and so raises the claimed variance."""
    variances = []
    for squeeze in (1.0, 0.4):
        h, electrons = _scene(9.0, 0.0, squeeze, (0.0, 0.0), 0.0)
        found = localise(_dn(electrons), corners(h), 7, DICTIONARY, SENSOR)
        variances.append(np.trace(found.covariance_px2))
    assert variances[1] > 1.3 * variances[0]


def test_a_marker_that_is_not_what_was_decoded_is_refused():
    """Registering another marker's template does not pass for a localisation."""
    h, electrons = _scene(*CASES[1])
    others = [localise(_dn(electrons), corners(h), other, DICTIONARY, SENSOR) for other in range(20) if other != 7]
    exact = localise(_dn(electrons), corners(h), 7, DICTIONARY, SENSOR)
    assert all(found is None or found.correlation < exact.correlation - 0.1 for found in others)


def test_a_marker_cut_by_the_image_edge_is_refused():
    """The template has to lie inside the image as a whole."""
    h = homography(9.0, (20.0, 80.0), 0.0, 1.0, (0.0, 0.0))
    electrons = marker_electrons(7, h, SIZE, 250.0, 15.0)
    assert localise(_dn(electrons), corners(h), 7, DICTIONARY, SENSOR) is None


def test_noise_alone_is_refused():
    """A place without a marker has no centre."""
    h = homography(9.0, CENTRE, 0.0, 1.0, (0.0, 0.0))
    noise = capture(np.full((SIZE, SIZE), 100.0), SENSOR, np.random.default_rng(0))
    assert localise(noise, corners(h), 7, DICTIONARY, SENSOR) is None


def test_markers_are_found_in_a_dim_capture_beside_a_lamp():
    """A lamp a hundred times as bright as paper does not blind the search."""
    _h, electrons = _scene(*CASES[2])
    large = np.full((400, 400), 60.0)
    large[150 : 150 + SIZE, 150 : 150 + SIZE] = electrons
    large[:20, :60] = 9000.0
    found = find_markers(capture(large, SENSOR, np.random.default_rng(1)), DICTIONARY)
    assert found.ids.tolist() == [7]
    np.testing.assert_allclose(found.corners_px[0].mean(axis=0), np.array(CENTRE) + 150, atol=1.5)


def test_a_number_that_is_found_twice_is_left_out():
    """Two markers of one number name at least one wrong place."""
    _h, electrons = _scene(*CASES[2])
    both = np.full((200, 400), 60.0)
    both[20 : 20 + SIZE, 20 : 20 + SIZE] = electrons
    both[20 : 20 + SIZE, 220 : 220 + SIZE] = electrons
    assert find_markers(capture(both, SENSOR, np.random.default_rng(1)), DICTIONARY).ids.size == 0


def test_nothing_found_in_an_empty_capture():
    """An image without markers is a result, not an error."""
    empty = capture(np.full((200, 300), 80.0), SENSOR, np.random.default_rng(2))
    found = find_markers(empty, DICTIONARY)
    assert found.ids.shape == (0,)
    assert found.corners_px.shape == (0, 4, 2)
