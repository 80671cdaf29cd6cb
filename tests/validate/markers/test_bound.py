"""The Cramér–Rao bound of a marker's centre: against closed forms, and the ideal image against its fine drawing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr

from pss import ImageSensor
from render.world.marker_print import pattern
from tests.helpers.exact_drawing import draw_exactly
from tests.helpers.synthetic import DICTIONARY, SENSOR, homography
from validate.markers.blurred_step import blurred_steps, reach
from validate.markers.cramer_rao import centre_bound, draw_finely, fisher_information, pixel_sums
from validate.markers.marker_image import MarkerImage

SAMPLES, SIZE, CENTRE = 16, 110, (54.37, 55.81)
LEVELS_E = (15.0, 250.0)
# Read noise alone: the same in every pixel.
EVEN = ImageSensor(550.0, 0.5, 4.0, 1e9, 1e5, 16, 64)
# A slope summed over a pixel's width is that of an edge blurred by the pixel, to second order in pixel over blur.
CLOSED_FORM = 0.01
# Share of the contrast: of level edges, every pixel along one takes the same samples of the fine drawing.
SAME_DRAWING_LEVEL, SAME_DRAWING = 0.52 / SAMPLES, 0.01
# Share of the contrast, in which two numerical integrals of a few hundred points a side and a closed form agree.
SAME_STEP = 0.003
# Share of the contrast, RMS: the drawing's samples are black or white (most felt by the sharp image at 45°), and the
# image's corners are an approximation.
SAME_IMAGE, SAME_SKEWED_IMAGE = 0.007, 0.012


@pytest.mark.parametrize("blur_px", [1.0, 2.0, 4.0])
def test_a_straight_edge_has_its_closed_form(blur_px):
    """An upright edge of length l, contrast Δ and blur s under noise σ: variance 2√π s σ²/(Δ² l)."""
    length, contrast = 20, 1000.0
    x = (np.arange(64 * SAMPLES) + 0.5) / SAMPLES - 0.5
    fine = np.tile(contrast * ndtr((x - 31.3) / blur_px), (length * SAMPLES, 1))
    electrons, by_x, by_y = pixel_sums(fine, SAMPLES)
    information = fisher_information(electrons.ravel(), np.stack([by_x.ravel(), by_y.ravel()]), EVEN)
    noise = float(EVEN.noise_electrons(np.zeros(())))
    blurred = math.sqrt(blur_px**2 + 1 / 12)
    expected = contrast**2 * length / (2 * math.sqrt(math.pi) * blurred * noise**2)
    assert information[0, 0] * noise**2 == pytest.approx(expected * noise**2, rel=CLOSED_FORM)
    # Along itself an edge fixes nothing.
    assert information[1, 1] < 1e-9 * information[0, 0]


def test_derivatives_are_those_of_a_shifted_image():
    """Pixel sums of the same drawing, moved by a sample to either side."""
    h = homography(9.0, CENTRE, 25.0, 0.7, (1e-4, 0.0))
    fine = draw_finely(DICTIONARY, 7, h, (SIZE, SIZE), LEVELS_E, 3.0, SAMPLES)
    _, by_x, by_y = pixel_sums(fine, SAMPLES)
    for axis, derivative in ((1, by_x), (0, by_y)):
        ahead, behind = (pixel_sums(np.roll(fine, shift, axis), SAMPLES)[0] for shift in (-1, 1))
        difference = (ahead - behind) * SAMPLES / 2
        np.testing.assert_allclose(derivative[2:-2, 2:-2], difference[2:-2, 2:-2], atol=1e-9)


def test_bound_scales_with_noise_light_and_size():
    """Variance goes with the noise's, and the pattern at twice its size has twice the edge: variance one half."""
    variances = {}
    for px, sensor in ((6.0, EVEN), (12.0, EVEN), (6.0, ImageSensor(550.0, 0.5, 4.0, 1e9, 2e5, 16, 64))):
        h = homography(px, CENTRE, 25.0, 0.9, (0.0, 0.0))
        fine = draw_finely(DICTIONARY, 7, h, (SIZE, SIZE), LEVELS_E, 2.0, SAMPLES)
        variances[px, sensor.read_noise_e] = np.trace(centre_bound(fine, SAMPLES, h, 6, sensor))
    assert variances[6.0, 2e5] == pytest.approx(4 * variances[6.0, 1e5], rel=0.02)
    assert variances[12.0, 1e5] == pytest.approx(variances[6.0, 1e5] / 2, rel=0.1)


def test_bound_knows_the_sensor():
    """Photon noise raises it, and so does the fixed pattern, which one capture cannot tell from the scene."""
    h = homography(9.0, CENTRE, 25.0, 0.7, (0.0, 0.0))
    fine = draw_finely(DICTIONARY, 7, h, (SIZE, SIZE), LEVELS_E, 0.0, SAMPLES)
    plain, patterned = (
        np.trace(centre_bound(fine, SAMPLES, h, 6, sensor))
        for sensor in (SENSOR, ImageSensor(550.0, 0.5, 4.0, 10000.0, 6.0, 12, 64, prnu_share=0.05, dsnu_e=10.0))
    )
    assert patterned > 1.5 * plain


@pytest.mark.parametrize(
    ("angle", "squeeze", "skew", "disc_px", "same"),
    [
        (0.0, 1.0, (0.0, 0.0), 0.0, SAME_DRAWING_LEVEL),
        (13.0, 1.0, (0.0, 0.0), 0.0, SAME_DRAWING),
        (33.0, -0.6, (2e-4, -1e-4), 0.0, SAME_DRAWING),
        (33.0, 0.6, (2e-4, -1e-4), 5.0, SAME_DRAWING),
    ],
)
def test_the_exact_drawing_is_the_limit_of_fine_ones(angle, squeeze, skew, disc_px, same):
    """Areas by Green's theorem against samples, pixel by pixel; a mirrored marker is as black as any."""
    h = homography(8.0, CENTRE, angle, squeeze, skew)
    exact = draw_exactly(DICTIONARY, 7, h, (SIZE, SIZE), disc_px)
    fine = pixel_sums(draw_finely(DICTIONARY, 7, h, (SIZE, SIZE), (0.0, 1.0), disc_px, SAMPLES), SAMPLES)[0]
    np.testing.assert_allclose(exact, fine, atol=same)


def test_the_exact_drawing_holds_all_of_the_marker_or_none():
    """The black area is the modules' own, wherever and however blurred; a marker cut by the image's edge is refused."""
    black = (~pattern(DICTIONARY, 7)).sum()
    for disc_px in (0.0, 3.0):
        h = homography(7.3, CENTRE, 21.0, 1.0, (0.0, 0.0))
        assert (1 - draw_exactly(DICTIONARY, 7, h, (SIZE, SIZE), disc_px)).sum() == pytest.approx(black * 7.3**2)
    with pytest.raises(ValueError, match="beyond the image of 40 × 110"):
        draw_exactly(DICTIONARY, 7, h, (SIZE, 40))


@pytest.mark.parametrize("blur_px2", [0.0, 0.01, 0.5, 9.0])
@pytest.mark.parametrize("per_px", [(0.1, 0.0), (0.1, 0.03), (-0.05, 0.05)])
def test_a_blurred_step_is_its_kernel_summed(per_px, blur_px2):
    """The closed form against sums over a sampled pixel and a sampled disc, and its slopes against differences."""
    axis = np.array([per_px, per_px])
    places = np.linspace(-1.1, 1.1, 41) * reach(axis[0], blur_px2)
    steps = blurred_steps(np.stack([places, places]), axis, np.array([blur_px2]))[0, :, 0]
    side = (np.arange(400) + 0.5) / 400 - 0.5
    pixel = np.sort((side[:, None] * per_px[0] + side * per_px[1]).ravel())
    across = (np.arange(500) + 0.5) / 250 - 1
    chord = np.sqrt(1 - across**2) / np.sqrt(1 - across**2).sum()
    radius = 2 * np.sqrt(blur_px2) * np.hypot(*per_px)
    summed = np.searchsorted(pixel, places[:, None] + radius * across) / pixel.size @ chord
    np.testing.assert_allclose(steps[0], summed, atol=SAME_STEP)
    # Where the kernel has no kink between two places, slopes are differences.
    tiny = 1e-6
    for order in (0, 1) if blur_px2 > 0 else ():
        ahead, behind = (blurred_steps(np.stack([places + d] * 2), axis, np.array([blur_px2])) for d in (tiny, -tiny))
        slope = ((ahead - behind) / (2 * tiny))[0, order, 0]
        np.testing.assert_allclose(steps[order + 1], slope, atol=0.01 * np.abs(steps[order + 1]).max())


@pytest.mark.parametrize("disc_px", [0.0, 2.0, 5.0])
@pytest.mark.parametrize(("px", "angle", "squeeze"), [(10.0, 33.0, 0.6), (8.0, 10.0, 0.9), (6.0, 45.0, 0.7)])
def test_ideal_image_is_the_fine_drawing(px, angle, squeeze, disc_px):
    """The registration's image, from tables along two axes, against samples on the image: two routes to one picture."""
    h = homography(px, CENTRE, angle, squeeze, (2e-4, -1e-4))
    assert _difference(h, disc_px) < SAME_IMAGE


@pytest.mark.parametrize("disc_px", [0.0, 2.0, 5.0])
def test_ideal_image_of_a_marker_that_is_foreshortened_along_its_diagonal(disc_px):
    """There the kernel's projections on the two axes go together: what corners get of that is in the image."""
    h = homography(10.0, CENTRE, 20.0, 0.6, (0.0, 0.0))
    turn = homography(1.0, (0.0, 0.0), 45.0, 1.0, (0.0, 0.0))
    assert _difference(h @ turn, disc_px) < SAME_SKEWED_IMAGE


def _difference(h, disc_px):
    """RMS over the marker and three quarters of a module around it, in units of the contrast."""
    drawn = pixel_sums(draw_finely(DICTIONARY, 7, h, (SIZE, SIZE), (0.0, 1.0), disc_px, SAMPLES), SAMPLES)[0]
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    u, v, w = np.einsum("ij,jhw->ihw", np.linalg.inv(h), np.stack([x, y, np.ones_like(x)]))
    inside = np.maximum(np.abs(u / w), np.abs(v / w)) < 3.75
    centre = h[:2, 2] / h[2, 2]
    scale = (h[:2, :2] - np.outer(centre, h[2, :2])) / h[2, 2]
    image = MarkerImage(DICTIONARY, 7, np.linalg.inv(scale), (disc_px / 4) ** 2)
    seen = image.at((u / w)[inside].astype(np.float32), (v / w)[inside].astype(np.float32))
    return float(np.sqrt(np.mean((seen.value - drawn[inside]) ** 2)))
