"""The sensor's stages one by one: each does its own part, in its place, and with nothing new nothing changes."""

from __future__ import annotations

import dataclasses
import hashlib
import math

import numpy as np
import pytest
import scipy.constants

from pss import ImageSensor, PTZCamera
from render.sensor import (
    amplify,
    capture,
    digitise,
    expected_electrons,
    fill_well,
    fixed_pattern,
    mean_charge,
    read_out,
    saturated_share,
    shot_noise,
)
from tests.helpers.z_scores import largest_z

# Relative; a few roundings in double precision.
SAME_TO_ROUNDING = 1e-12
SENSOR = ImageSensor(550.0, 0.5, 4.0, 10_000.0, 6.0, 12, 64)
COARSE = ImageSensor(550.0, 0.5, 4.0, 10_000.0, 0.0, 8, 0)
CAMERA = PTZCamera((0, 0, 0), 0, 0, resolution=(1024, 64))
PIXELS = 90_000

# SHA-256 of captures by the code before dark current and fixed pattern came in: stored results are made of such bytes.
# They hold for the numpy of requirements.lock (NEP 19 lets a new numpy draw other normal variates from one seed).
FROZEN = {
    SENSOR: "cf30656a56f85d243263fa9127f64a9a5ef548456c61d64fd20d2da6f959b728",
    COARSE: "4df2fa71050ab76bc55a9bea0d0dc4e91f4486a8e4130a3b3c6517d52d4dbcf6",
}


def ramp() -> np.ndarray:
    """Electrons, exact in single precision: 0 to 16 376, so from darkness to beyond the full well, sixteen times."""
    return np.tile(np.arange(4096, dtype=np.float32) ** 2 / np.float32(1024), 16).reshape(64, 1024)


def digest(sensor: ImageSensor, **arguments: object) -> str:
    rng = np.random.default_rng(np.random.SeedSequence([1288, 4]))
    return hashlib.sha256(capture(ramp(), sensor, rng, **arguments).astype("<u2").tobytes()).hexdigest()


@pytest.mark.parametrize("sensor", FROZEN, ids=["12 bit", "8 bit"])
def test_without_dark_current_and_pattern_a_capture_is_what_it_was(sensor):
    """Bit for bit, with and without a pattern handed in; the derived gain said outright is the same gain."""
    assert digest(sensor) == FROZEN[sensor]
    assert digest(sensor, pattern=fixed_pattern(CAMERA, sensor)) == FROZEN[sensor]
    twin_sensor = dataclasses.replace(sensor, system_gain_dn_per_e=1 / sensor.gain_e_per_dn)
    assert twin_sensor.gain_e_per_dn == pytest.approx(sensor.gain_e_per_dn, rel=SAME_TO_ROUNDING)
    for change in ({"dark_current_e_per_s": 100.0}, {"read_noise_e": 6.5}, {"system_gain_dn_per_e": 0.5}):
        assert digest(dataclasses.replace(sensor, **change)) != FROZEN[sensor]
    # A pattern changes nothing where the sensor says that it has none, and everything where it has.
    uneven = dataclasses.replace(sensor, prnu_share=0.02, dsnu_e=5.0)
    assert digest(sensor, pattern=fixed_pattern(CAMERA, uneven)) == FROZEN[sensor]
    assert digest(uneven, pattern=fixed_pattern(CAMERA, uneven)) != FROZEN[sensor]


def test_a_capture_is_its_stages_one_after_the_other():
    sensor = dataclasses.replace(SENSOR, dark_current_e_per_s=5000.0, prnu_share=0.02, dsnu_e=10.0)
    pattern = fixed_pattern(CAMERA, sensor)
    electrons = ramp()
    captured = capture(electrons, sensor, np.random.default_rng(1), pattern)
    rng = np.random.default_rng(1)
    collected = fill_well(shot_noise(mean_charge(electrons, sensor, pattern), rng), sensor)
    assert collected.max() == sensor.full_well_e
    numbers = amplify(read_out(collected, sensor, rng, pattern), sensor)
    np.testing.assert_array_equal(digitise(numbers, sensor), captured)
    np.testing.assert_array_equal(electrons, ramp())


# ---- photons, charge, gain, by hand ----------------------------------------------------------------------------------


def test_photons_become_electrons_by_the_quantum_efficiency():
    """E A t/(hc/λ) photons by CODATA's constants, times the efficiency: what `expected_electrons` has on the axis."""
    camera = PTZCamera((0, 0, 0), 0, 0, resolution=(3, 3), zoom=1)
    irradiance = 0.1 * math.pi / 4 * (camera.aperture_diameter_m / camera.image_distance_m) ** 2
    joules = irradiance * camera.pixel_pitch_m**2 * SENSOR.exposure_ms * 1e-3
    photons = joules / (scipy.constants.h * scipy.constants.c / 550e-9)
    electrons = expected_electrons(np.full((3, 3), 0.1), camera, SENSOR)[1, 1]
    assert SENSOR.quantum_efficiency * photons == pytest.approx(electrons, rel=1e-9)


def test_properties_with_dark_current_and_gain_by_hand():
    """250 e⁻/s in 40 ms: 10 e⁻, so σ_d = √(36 + 10); K = 0.8: 1.25 e⁻ a number, the converter ends at 5038.75 e⁻."""
    sensor = dataclasses.replace(SENSOR, exposure_ms=40.0, dark_current_e_per_s=250.0, system_gain_dn_per_e=0.8)
    assert sensor.dark_signal_e == pytest.approx(10, rel=SAME_TO_ROUNDING)
    assert sensor.dark_noise_e == pytest.approx(math.sqrt(46), rel=SAME_TO_ROUNDING)
    assert sensor.ccd_noise == pytest.approx(math.sqrt(46) / 10_000, rel=SAME_TO_ROUNDING)
    assert sensor.gain_e_per_dn == pytest.approx(1.25, rel=SAME_TO_ROUNDING)
    assert sensor.saturation_e == pytest.approx(4031 * 1.25, rel=SAME_TO_ROUNDING)
    assert dataclasses.replace(sensor, system_gain_dn_per_e=0.1).saturation_e == 10_000
    assert (SENSOR.saturation_e, SENSOR.dark_noise_e) == (10_000, 6.0)
    noise = sensor.noise_electrons(np.array([0.0, 100.0, -5.0]))
    floor = 46 + 1.25**2 / 12
    np.testing.assert_allclose(noise, np.sqrt([floor, 100 + floor, floor]), rtol=SAME_TO_ROUNDING)


@pytest.mark.parametrize("level_e", [0.0, 40.0, 3000.0])
def test_dark_current_adds_its_mean_and_its_shot_noise(level_e):
    """Z-tests of mean and variance against `noise_electrons`, 120 e⁻ of dark current in them."""
    sensor = dataclasses.replace(SENSOR, dark_current_e_per_s=30_000.0)
    numbers = capture(np.full((1, PIXELS), level_e), sensor, np.random.default_rng(int(level_e) + 1))
    electrons = (numbers.astype(float) - 64) * sensor.gain_e_per_dn
    sigma = float(sensor.noise_electrons(np.array(level_e)))
    bound = largest_z(6)
    assert abs(electrons.mean() - (level_e + 120)) < bound * sigma / math.sqrt(PIXELS)
    spread = math.sqrt((2 + (level_e + 120) / sigma**4) / PIXELS)
    assert abs(electrons.var(ddof=1) / sigma**2 - 1) < bound * spread
    # The test would notice a current without its own shot noise.
    assert level_e > 1000 or 120 / sigma**2 > 10 * bound * spread


def test_a_long_exposure_in_the_dark_fills_the_well():
    """Dark current comes before the full well: 30 000 e⁻/s for a second are 10 000 e⁻ and no more."""
    sensor = dataclasses.replace(SENSOR, exposure_ms=1000.0, dark_current_e_per_s=30_000.0, read_noise_e=0.0)
    assert (capture(np.zeros((8, 8)), sensor, np.random.default_rng(0)) == sensor.largest_dn).all()


@pytest.mark.parametrize("gain_dn_per_e", [0.1, 0.8, 3.0])
def test_an_explicit_gain_scales_signal_and_noise_and_clips_at_the_converter(gain_dn_per_e):
    sensor = dataclasses.replace(SENSOR, system_gain_dn_per_e=gain_dn_per_e, read_noise_e=20.0)
    numbers = capture(np.full((1, PIXELS), 900.0), sensor, np.random.default_rng(3)).astype(float) - 64
    sigma_dn = math.sqrt(900 + 400 + 1 / (12 * gain_dn_per_e**2)) * gain_dn_per_e
    bound = largest_z(6)
    assert abs(numbers.mean() - 900 * gain_dn_per_e) < bound * sigma_dn / math.sqrt(PIXELS)
    assert abs(numbers.var(ddof=1) / sigma_dn**2 - 1) < bound * math.sqrt(2 / PIXELS)
    bright = capture(np.full((1, 1000), 50_000.0), sensor, np.random.default_rng(4))
    if gain_dn_per_e == 0.1:
        # The full well comes first: 1000 numbers above black, give or take 2 of read noise and a rounding.
        assert abs(bright.mean() - 1064) < bound * 2.1 / math.sqrt(1000)
    else:
        assert (bright == sensor.largest_dn).all()


# ---- saturation ------------------------------------------------------------------------------------------------------


def test_the_saturated_share_counts_pixels_at_or_above_saturation():
    electrons = np.array([[0.0, 9999.0], [10_000.0, 25_000.0]])
    assert saturated_share(electrons, SENSOR) == 0.5
    assert saturated_share(electrons, dataclasses.replace(SENSOR, dark_current_e_per_s=250.0)) == 0.75
    assert saturated_share(electrons, dataclasses.replace(SENSOR, system_gain_dn_per_e=0.2)) == 0.5
    assert saturated_share(np.array([0.0, 5000.0, 5100.0]), dataclasses.replace(SENSOR, system_gain_dn_per_e=0.8)) == (
        pytest.approx(1 / 3)
    )
    assert saturated_share(np.zeros((4, 5), dtype=np.float32), SENSOR) == 0.0
    assert saturated_share(np.zeros(0), SENSOR) == 0.0


def test_a_capture_shows_the_saturated_share():
    """Where half of the wall is three times too bright, half of a capture stands at the end of the range."""
    electrons = np.full((60, 80), 2000.0)
    electrons[:, 40:] = 30_000.0
    silent = dataclasses.replace(SENSOR, read_noise_e=0.0)
    captured = capture(electrons, silent, np.random.default_rng(0))
    assert (captured == silent.largest_dn).mean() == saturated_share(electrons, silent) == 0.5
