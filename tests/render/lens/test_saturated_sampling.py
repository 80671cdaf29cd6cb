"""Samples are not spent where every capture saturates, and what is not light of this world is refused."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

import scenes
from pss import ImageSensor
from render.certificate import certify
from render.lens.sampling import Sampling, sample_image
from render.sensor import capture, surely_saturated
from scenes import SceneError

ROOT = Path(__file__).parents[3]
SIZE = 32
SENSOR = ImageSensor()
# Of the dark stripe between two bright ones.
DARK_E = 100.0
# Captures of each pixel, of which none may be below saturation.
CAPTURES = 2000


def stripes(white_e: float, black_e: float):
    """A sampler of stripes, white and black, whose lines cross pixels; values in electrons."""
    edges = np.arange(0, SIZE + 8, 7.3)

    def sampler(pixels, count, rng):
        x = (pixels % SIZE)[:, None] + rng.random((len(pixels), count))
        value = np.where(np.searchsorted(edges, x) % 2 == 0, white_e, black_e).astype(np.float32)
        return value.mean(axis=1), value.var(axis=1, ddof=1)

    return sampler


def sampled(white_e: float, black_e: float, aware: bool = True, sampler=None):
    """The image of such stripes."""
    return sample_image(
        sampler or stripes(white_e, black_e),
        (SIZE, SIZE),
        lambda image: np.asarray(SENSOR.noise_electrons(image), dtype=np.float32),
        Sampling(most=512),
        np.random.default_rng(1),
        (lambda image: surely_saturated(image, SENSOR)) if aware else None,
    )


def test_saturated_edges_get_the_fewest_samples():
    """As many as a pixel without any edge; before, each took hundreds."""
    settings, everywhere = Sampling(), SIZE * SIZE
    assert sampled(1e7, 1e5).samples == everywhere * (settings.pilot + settings.fewest)
    assert sampled(1e7, 1e5, aware=False).samples > 5 * everywhere * (settings.pilot + settings.fewest)


def test_edges_towards_what_is_not_saturated_keep_their_samples():
    """A dark stripe beside a saturated one: its pixels and those that touch them have all samples at an edge."""
    counts = np.zeros(SIZE * SIZE, dtype=int)
    drawn = stripes(1e7, DARK_E)

    def counting(pixels, count, rng):
        counts[pixels] = np.maximum(counts[pixels], count)
        return drawn(pixels, count, rng)

    image = sampled(1e7, DARK_E, sampler=counting)
    seen = maximum_filter(~surely_saturated(image.mean, SENSOR), size=3)
    edges = seen & (maximum_filter(image.variance, size=3) > 0)
    assert edges.any()
    assert counts.reshape(SIZE, SIZE)[edges].min() == Sampling(most=512).most / 2


def test_images_below_saturation_stay_the_same():
    """Bit by bit: the usual scenes know nothing of it."""
    below = 0.9 * SENSOR.saturation_e
    np.testing.assert_array_equal(sampled(below, DARK_E).mean, sampled(below, DARK_E, aware=False).mean)


@pytest.mark.parametrize("prnu", [0.0, 0.05])
def test_surely_saturated_pixels_saturate_in_every_capture(prnu):
    """By captures of half of the least such mean, which a mean that is wrong by two comes to."""
    sensor = dataclasses.replace(SENSOR, prnu_share=prnu)
    levels = np.geomspace(sensor.saturation_e, 20 * sensor.saturation_e, 400)
    least = levels[surely_saturated(levels, sensor)].min()
    assert least < 4 * sensor.saturation_e
    rng = np.random.default_rng(2)
    responses = 1 + prnu * rng.standard_normal((CAPTURES, 1))
    numbers = capture(least / 2 * responses, sensor, rng)
    full = int(np.rint(sensor.saturation_e / sensor.gain_e_per_dn + sensor.black_level_dn))
    # The well is full in each; what is read of it has the read noise.
    assert numbers.min() > full - 6 * sensor.read_noise_e / sensor.gain_e_per_dn


def test_the_certificate_leaves_saturated_pixels_out():
    """Few samples there are no lack of any."""
    image = sampled(1e7, 1e5)
    marker = np.zeros((SIZE, SIZE), dtype=np.int32)

    def noise(electrons):
        return np.asarray(SENSOR.noise_electrons(electrons), dtype=np.float32)

    reported = certify(image, noise, marker, 1.0, surely_saturated(image.mean, SENSOR))
    assert np.isnan(reported.edge_p999)
    assert reported.meets(0.25)
    assert not certify(image, noise, marker, 1.0).meets(0.25)


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("light.radiance_w_per_m2_sr", "1e30", r"at most 2e\+07"),
        ("light.radiance_w_per_m2_sr", "2.1e7", r"at most 2e\+07"),
        ("sensor.exposure_ms", "1e30", r"from 1e-06 to 3\.6e\+06, in milliseconds"),
        ("sensor.exposure_ms", "1e-9", r"from 1e-06 to 3\.6e\+06, in milliseconds"),
        ("sensor.longest_exposure_ms", "1e30", "in milliseconds"),
        ("sensor.pixel_pitch_um", "4.65e-6", r"from 0\.1 to below 1000, in micrometres"),
    ],
)
def test_light_of_no_world_is_refused(key, value, allowed):
    """Brighter than the sun's disc, exposures of years, pixels smaller than light: a line with the value."""
    with pytest.raises(SceneError, match=rf"{key} = \S+ \(override\); allowed: .*{allowed}"):
        scenes.load(ROOT / "scenes" / "bench.toml", [f"{key}={value}"])


def test_the_sun_itself_is_allowed():
    """The bound belongs to what is allowed, and has the sun's figures: 1361 W/m² from a disc of 0.2666° radius."""
    scene = scenes.load(ROOT / "scenes" / "bench.toml", ["light.radiance_w_per_m2_sr=2e7"])
    disc_sr = np.pi * np.sin(np.radians(0.2666)) ** 2
    assert scene.state.light.radiance_w_per_m2_sr == pytest.approx(1361 / disc_sr, rel=0.01)
