"""Localisation against images made without the renderer, its spread against the bound, and its own covariance."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from render.sensor import capture
from tests.helpers.exact_drawing import draw_exactly
from tests.helpers.synthetic import DICTIONARY, SENSOR, corners, homography, marker_electrons
from validate.markers.cramer_rao import centre_bound, draw_finely, pixel_sums
from validate.markers.localise import Refusal, localise, register

# (module in px, angle, squeeze, perspective, circle of confusion in px): sizes that the room shows, turned, tilted and
# defocused.
CASES = [
    (5.0, 12.0, 1.0, (0.0, 0.0), 0.0),
    (8.0, 33.0, 0.6, (2e-4, -1e-4), 0.0),
    (12.0, -20.0, 0.8, (-1e-4, 2e-4), 0.0),
    (9.0, 5.0, 0.9, (0.0, 0.0), 6.0),
    (6.0, 20.0, 0.8, (0.0, 0.0), 8.0),
]
# Frozen bias per axis: the drawing's own samples, and the step at which the fit stops, leave a few thousandths.
LARGEST_BIAS_PX = 0.006
# Of a Gaussian blur where the image's model has a disc.
LARGEST_BIAS_OF_ANOTHER_BLUR_PX = 0.01
TRIALS = 150
# Exactly drawn markers, RMS of a coordinate at random places in a pixel: at most 0.0013 at 4 px, by corners of modules.
LARGEST_RMS_BIAS_PX = 0.002
# (module in px, angle in degrees, circle of confusion in px): level and turned; small, large, and a whole number of px.
EXACT_CASES = [
    *((float(px), 0.0, 0.0) for px in (5, 8, 16, 32, 39)),
    *((px, angle, 0.0) for px, angle in ((4.0, 30.0), (5.3, 1.0), (12.7, 90.0), (25.0, 45.0), (16.0, 89.0))),
    *((px, angle, disc) for px, angle, disc in ((5.3, 0.0, 0.3), (12.0, 0.0, 1.0))),
]
DRAWINGS = 4
# Of 200,000 pixels reduced χ² is good to 0.003; the corners' approximation adds as much.
SAME_CHI2_OF_A_LARGE_MARKER = 0.02
# Squared error over the stated covariance, per axis, in all light: 360 captures give ± 0.05 at one standard deviation.
SMALLEST_NEES, LARGEST_NEES = 0.83, 1.17
# Claimed over measured variance, per case; 150 trials of two axes give ± 8 % at one standard deviation.
CLAIM_LOW, CLAIM_HIGH = 0.77, 1.3
# Bound over measured variance. The bound knows blur and shading; fitting them, too, costs a few per cent, the step at
# which the fit stops one, and 150 trials of two axes give ± 8 %.
LEAST_EFFICIENCY = 0.78
# Defocused as much as that, light from beyond the plate reaches the quiet zone's pixels, which are not used then.
LEAST_EFFICIENCY_DEFOCUSED = 0.6
# Level, sharp, and with lines a whole number of pixels apart: all edges lie at one place in their pixels.
LEAST_EFFICIENCY_LEVEL = 0.5
# Squared error over claim, of two coordinates, where a hidden strip is too narrow to show in the residuals.
WORST_CLAIM = 16.0
SIZE, SAMPLES = 160, 16
CENTRE = (79.37, 80.81)
LEVELS_E = (15.0, 250.0)
# Corners as a detector may find them, px.
ASTRAY = np.array([[0.6, -0.5], [-0.4, 0.7], [0.5, 0.4], [-0.6, -0.3]])


def _scene(px, angle, squeeze, skew, disc, levels=LEVELS_E):
    h = homography(px, CENTRE, angle, squeeze, skew)
    fine = draw_finely(DICTIONARY, 7, h, (SIZE, SIZE), levels, disc, SAMPLES)
    return h, fine, pixel_sums(fine, SAMPLES)[0]


def _dn(electrons):
    return (electrons / SENSOR.gain_e_per_dn + SENSOR.black_level_dn).astype(np.float32)


@functools.cache
def _repeated(case):
    """The bound (2, 2) of a case, and what was found in many captures of it, from corners astray."""
    h, fine, electrons = _scene(*case)
    rng = np.random.default_rng(11)
    start = corners(h) + ASTRAY
    found = [localise(capture(electrons, SENSOR, rng), start, 7, DICTIONARY, SENSOR) for _ in range(TRIALS)]
    return centre_bound(fine, SAMPLES, h, 6, SENSOR), found


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_centre_of_a_noise_free_marker_is_unbiased(case):
    """Registration finds the projected centre, also from corners that are a pixel off."""
    h, _, electrons = _scene(*case)
    found = localise(_dn(electrons), corners(h) + ASTRAY, 7, DICTIONARY, SENSOR)
    assert found is not None
    np.testing.assert_allclose(found.centre_px, CENTRE, atol=LARGEST_BIAS_PX)


def _exact(px, angle, disc, rng):
    """White's share of each pixel of an exactly drawn marker 7 at a random place, its homography and centre."""
    size = int(8 * 1.45 * px + disc) + 8
    centre = (size - 1) / 2 + rng.uniform(-0.5, 0.5, 2)
    h = homography(px, tuple(centre), angle, 1.0, (0.0, 0.0))
    return draw_exactly(DICTIONARY, 7, h, (size, size), disc), h, centre


@pytest.mark.parametrize(("px", "angle", "disc"), EXACT_CASES)
def test_exactly_drawn_markers_are_unbiased_at_every_angle_and_size(px, angle, disc):
    """Level markers have all their edges at the same place in a pixel: an error of the ideal image there is a bias."""
    rng = np.random.default_rng(2)
    errors = []
    for _ in range(DRAWINGS if disc == 0 else 2):
        white, h, centre = _exact(px, angle, disc, rng)
        found = localise(_dn(9000 * (1 + 16 * white) / 17), corners(h) + ASTRAY, 7, DICTIONARY, SENSOR)
        errors.append(found.centre_px - centre)
    assert np.sqrt(np.mean(np.square(errors))) < LARGEST_RMS_BIAS_PX


@pytest.mark.slow
@pytest.mark.parametrize(("px", "angle"), [(5.0, 0.0), (8.0, 0.0), (8.0, 37.0), (12.0, 90.0)])
def test_the_stated_covariance_is_that_of_the_errors_in_every_light(px, angle):
    """NEES of markers that are level or not, white at 100 to 9,000 electrons; bias counts as an error."""
    rng = np.random.default_rng(3)
    nees = []
    for white_e in (100.0, 1000.0, 9000.0):
        for _ in range(20):
            white, h, centre = _exact(px, angle, 0.0, rng)
            for _ in range(6):
                numbers = capture(white_e * (1 + 16 * white) / 17, SENSOR, rng)
                found = localise(numbers, corners(h) + ASTRAY / 2, 7, DICTIONARY, SENSOR)
                error = found.centre_px - centre
                nees.append(error @ np.linalg.solve(found.covariance_px2, error) / 2)
    assert SMALLEST_NEES < np.mean(nees) < LARGEST_NEES


def test_large_sharp_markers_are_fitted_to_the_end():
    """The fit of modules of 60 px begins with a blur of 4 px; once that has settled, the residuals are the noise."""
    rng = np.random.default_rng(7)
    for _ in range(6):
        white, h, centre = _exact(60.0, 0.0, 0.0, rng)
        found = localise(capture(3000 * (1 + 16 * white) / 17, SENSOR, rng), corners(h) + ASTRAY, 7, DICTIONARY, SENSOR)
        error = found.centre_px - centre
        assert error @ np.linalg.solve(found.covariance_px2, error) < WORST_CLAIM
        assert found.residual_chi2 == pytest.approx(1, abs=SAME_CHI2_OF_A_LARGE_MARKER)


@pytest.mark.parametrize("seed", [0, 1, 8, 9])
def test_no_large_sharp_marker_is_lost_for_pixels_on_its_edges(seed):
    """The first step thins the pixels; one in 145 of a marker of 60 px a module leaves an edge's direction unknown."""
    rng = np.random.default_rng(seed)
    white, h, centre = _exact(60.0, 85.0, 0.0, rng)
    numbers = capture(1000 * (1 + 16 * white) / 17, SENSOR, rng)
    found = localise(numbers, corners(h) + rng.uniform(-0.5, 0.5, (4, 2)), 7, DICTIONARY, SENSOR)
    assert found is not None
    error = found.centre_px - centre
    assert error @ np.linalg.solve(found.covariance_px2, error) < WORST_CLAIM


def test_another_blur_than_the_models_leaves_little_bias():
    """A Gaussian blur, of a lens in focus, is fitted by a disc of the same width."""
    h = homography(9.0, CENTRE, 25.0, 0.8, (0.0, 0.0))
    electrons = marker_electrons(7, h, SIZE, 250.0, 15.0, 1.2)
    found = localise(_dn(electrons), corners(h), 7, DICTIONARY, SENSOR)
    np.testing.assert_allclose(found.centre_px, CENTRE, atol=LARGEST_BIAS_OF_ANOTHER_BLUR_PX)


def test_a_gradient_of_the_light_does_not_move_the_centre():
    """Light that falls off by a fifth from one side of the marker to the other is part of the model."""
    h, _, electrons = _scene(*CASES[2])
    across = 1 + 0.2 * (np.arange(SIZE) - CENTRE[0]) / (6 * CASES[2][0])
    found = localise(_dn(electrons * across), corners(h), 7, DICTIONARY, SENSOR)
    np.testing.assert_allclose(found.centre_px, CENTRE, atol=LARGEST_BIAS_PX)


@pytest.mark.parametrize("white", [9_900.0, 15_000.0])
def test_saturated_white_does_not_move_the_centre(white):
    """What the well or the converter cuts off is neither light nor noise; the edges are what is left of it."""
    h, _, electrons = _scene(*CASES[2], levels=(white / 17, white))
    found = localise(capture(electrons, SENSOR, np.random.default_rng(4)), corners(h), 7, DICTIONARY, SENSOR)
    np.testing.assert_allclose(found.centre_px, CENTRE, atol=LARGEST_BIAS_PX)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_covariance_is_that_of_repeated_captures(case):
    """The covariance that a detection claims from its one image is that of the centres over many captures."""
    _, found = _repeated(case)
    assert None not in found
    centres = np.array([f.centre_px for f in found])
    claimed = np.mean([f.covariance_px2 for f in found], axis=0)
    ratio = np.trace(claimed) / np.trace(np.cov(centres.T))
    assert CLAIM_LOW < ratio < CLAIM_HIGH


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_spread_is_near_the_bound(case):
    """The centres scatter hardly more than the Cramér–Rao bound says that they must."""
    bound, found = _repeated(case)
    least = LEAST_EFFICIENCY if case[-1] < case[0] else LEAST_EFFICIENCY_DEFOCUSED
    assert np.trace(bound) / np.trace(np.cov(np.array([f.centre_px for f in found]).T)) > least


def test_a_level_and_sharp_marker_is_localised_every_time():
    """All lines of this one cross their pixels at one place: the least that an image can tell of blur and place."""
    bound, found = _repeated((10.0, 0.0, 1.0, (0.0, 0.0), 0.0))
    assert None not in found
    assert np.trace(bound) / np.trace(np.cov(np.array([f.centre_px for f in found]).T)) > LEAST_EFFICIENCY_LEVEL


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_residuals_are_the_sensors_noise(case):
    """Reduced χ² of the fits: 1, over all captures of a case."""
    _, found = _repeated(case)
    assert np.mean([f.residual_chi2 for f in found]) == pytest.approx(1, abs=0.03)


def test_fixed_pattern_is_part_of_the_noise():
    """PRNU and DSNU are as unknown in one capture as the noise: the claimed covariance holds them."""
    h, _, electrons = _scene(*CASES[1])
    patterned = dataclasses.replace(SENSOR, prnu_share=0.05, dsnu_e=10.0)
    numbers = capture(electrons, SENSOR, np.random.default_rng(5))
    plain, more = (localise(numbers, corners(h), 7, DICTIONARY, sensor) for sensor in (SENSOR, patterned))
    assert np.trace(more.covariance_px2) > 1.5 * np.trace(plain.covariance_px2)
    assert more.residual_chi2 < plain.residual_chi2


def test_less_light_means_a_larger_claimed_covariance():
    """A quarter of the light more than doubles the claimed variance (photon noise alone: four times)."""
    h, _, bright = _scene(*CASES[1])
    variances = []
    for electrons in (bright, bright / 4):
        found = localise(capture(electrons, SENSOR, np.random.default_rng(0)), corners(h), 7, DICTIONARY, SENSOR)
        variances.append(np.trace(found.covariance_px2))
    assert 2 < variances[1] / variances[0] < 16


def test_squeezed_marker_is_less_certain_in_world_than_facing_one():
    """Foreshortening loses pixels across the squeezed direction and so raises the claimed variance."""
    variances = []
    for squeeze in (1.0, 0.4):
        h, _, electrons = _scene(9.0, 5.0, squeeze, (0.0, 0.0), 0.0)
        found = localise(_dn(electrons), corners(h), 7, DICTIONARY, SENSOR)
        variances.append(np.trace(found.covariance_px2))
    assert variances[1] > 1.3 * variances[0]


def test_a_marker_that_is_not_what_was_decoded_is_refused():
    """Registering another marker's image does not pass for a localisation, with noise or without."""
    h, _, electrons = _scene(*CASES[1])
    noisy = capture(electrons, SENSOR, np.random.default_rng(3))
    for numbers in (_dn(electrons), noisy):
        found = [localise(numbers, corners(h), other, DICTIONARY, SENSOR) for other in range(20)]
        assert [number for number, localised in enumerate(found) if localised is not None] == [7]


def test_a_marker_cut_by_the_image_edge_is_refused():
    """The marker has to lie inside the image as a whole."""
    h = homography(9.0, (20.0, 80.0), 0.0, 1.0, (0.0, 0.0))
    electrons = marker_electrons(7, h, SIZE, 250.0, 15.0)
    assert register(_dn(electrons), corners(h), 7, DICTIONARY, SENSOR) is Refusal.CUT
    assert localise(_dn(electrons), corners(h), 7, DICTIONARY, SENSOR) is None


def test_noise_alone_is_refused():
    """A place without a marker has no centre."""
    h = homography(9.0, CENTRE, 0.0, 1.0, (0.0, 0.0))
    for seed in range(10):
        noise = capture(np.full((SIZE, SIZE), 100.0), SENSOR, np.random.default_rng(seed))
        assert isinstance(register(noise, corners(h), 7, DICTIONARY, SENSOR), Refusal)


@pytest.mark.parametrize("end_modules", [-2.0, -1.0, 0.0])
def test_a_marker_behind_a_grey_stripe_is_refused(end_modules):
    """A stripe over a part of the marker, up to half of it: its residuals show it, without any truth."""
    h, _, electrons = _scene(*CASES[2])
    covered = electrons.copy()
    covered[:, : round(CENTRE[0] + end_modules * CASES[2][0])] = 120.0
    numbers = capture(covered, SENSOR, np.random.default_rng(6))
    assert isinstance(register(numbers, corners(h), 7, DICTIONARY, SENSOR), Refusal)


def test_what_a_narrow_stripe_does_is_refused_or_claimed():
    """From nothing to half a module of a hidden border: where it is not refused, the error is within its claim."""
    h, _, electrons = _scene(*CASES[2])
    left = corners(h)[:, 0].min()
    worst, refused = 0.0, 0
    for number, width in enumerate(np.linspace(-8, 6, 15)):
        covered = electrons.copy()
        covered[:, : int(left + width)] = 120.0
        found = localise(capture(covered, SENSOR, np.random.default_rng(number)), corners(h), 7, DICTIONARY, SENSOR)
        if found is None:
            refused += 1
            continue
        error = found.centre_px - CENTRE
        worst = max(worst, float(error @ np.linalg.solve(found.covariance_px2, error)))
    print(f"refused {refused} of 15; largest squared error over claim {worst:.1f}")
    assert refused >= 3
    assert worst < WORST_CLAIM
