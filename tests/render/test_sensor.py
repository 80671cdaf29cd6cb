"""The sensor: its numbers by hand, its noise by Z-tests with fixed seeds, its gain from the photon transfer line."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.constants
import scipy.stats

from pss import ImageSensor, PSSError, PTZCamera, RangeError
from render.sensor import capture, expected_electrons, relative_illumination
from tests.helpers.z_scores import largest_z

# Relative; a few roundings in double precision.
SAME_TO_ROUNDING = 1e-12
# Relative, of the light that captures show at an angle against cos⁴ θ. The rings' own noise is a tenth of it.
FALL_OFF = 0.02
# Pixels at each light level: the mean is known to σ/300, the standard deviation to σ/420.
PIXELS = 90_000
# Electrons from darkness to three quarters of the full well, where nothing is clipped.
LEVELS_E = np.array([0.0, 3.0, 30.0, 150.0, 700.0, 2500.0, 5000.0, 7500.0])

SENSOR = ImageSensor(
    wavelength_nm=550.0,
    quantum_efficiency=0.5,
    exposure_ms=4.0,
    full_well_e=10_000.0,
    read_noise_e=6.0,
    bits=12,
    black_level_dn=64,
)
# v = 5 mm, f = 1/200.5 m, a = 1/401 m (tests/pss/cameras/test_camera.py has this lens by hand).
CAMERA = PTZCamera((0, 0, 0), 0, 0, resolution=(1000, 800), pixel_pitch_m=1e-5, focus_distance_m=2, f_number=2)


def capture_at(level_e: float, sensor: ImageSensor = SENSOR, seed: int = 0, pixels: int = PIXELS) -> np.ndarray:
    """Digital numbers above the black level."""
    rng = np.random.default_rng(np.random.SeedSequence([20, seed]))
    return capture(np.full((1, pixels), level_e), sensor, rng).astype(float) - sensor.black_level_dn


# ---- light to electrons ----------------------------------------------------------------------------------------------


def test_electrons_by_hand():
    """Convention: irradiance is L·π/4·(a/v)²·cos⁴θ.

    (a/v)² = (200/401)² = 0.248755; times π/4: 0.195372 sr. Times (10 µm)², 4 ms and 0.2 W/(m² sr): 1.56297e-14 J. A
    photon of 550 nm has 3.61172e-19 J: 43 275 photons, 21 637 electrons, on the axis.
    """
    electrons = expected_electrons(np.full((800, 1000), 0.2), CAMERA, SENSOR)
    assert electrons.shape == (800, 1000)
    # The four pixels about the axis are half a pixel's diagonal off it: cos⁴ differs from 1 by 4e-6.
    assert electrons[400, 500] == pytest.approx(21_637, rel=5e-5)
    joules = 0.2 * math.pi / 4 * (200 / 401) ** 2 * 1e-10 * 4e-3 / (1 + 0.5 / 500**2) ** 2
    photon = scipy.constants.h * scipy.constants.c / 550e-9
    assert electrons[400, 500] == pytest.approx(joules / photon * 0.5, rel=1e-9)


def test_illumination_falls_with_the_fourth_power_of_the_cosine():
    """Convention: cos⁴ θ of the ray through each pixel's centre, with OpenCV's pixel coordinates."""
    camera = PTZCamera((0, 0, 0), 0, 0, zoom=1.5, resolution=(41, 31))
    light = relative_illumination(camera)
    assert light.shape == (31, 41)
    v, u = np.mgrid[:31, :41]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.intrinsic_matrix).T
    points = rays @ camera.rotation
    np.testing.assert_allclose(light, camera.cos_off_axis(points) ** 4, rtol=SAME_TO_ROUNDING)
    assert light[15, 20] == 1
    np.testing.assert_allclose(light, light[::-1, ::-1], rtol=SAME_TO_ROUNDING)


def test_the_corner_of_a_right_angle_lens_gets_a_quarter_at_its_sides():
    """θ = 45° at the middle of the left edge of a 90° lens: cos⁴ = 1/4, half a pixel inside it a little more."""
    light = relative_illumination(PTZCamera((0, 0, 0), 0, 0, zoom=1, resolution=(2001, 3)))
    assert light[1, 0] == pytest.approx(0.25, rel=2e-3)
    assert light[1, 0] > 0.25


def test_captures_of_a_white_wall_fall_off_as_the_fourth_power_of_the_cosine():
    """Rings of equal θ, 0° to 50° of a 90° lens, in noisy captures: their mean over the middle's is cos⁴ θ."""
    camera = PTZCamera((0, 0, 0), 0, 0, zoom=1, resolution=(400, 300))
    electrons = expected_electrons(np.full((300, 400), 0.25), camera, SENSOR)
    assert electrons.max() < 0.9 * SENSOR.full_well_e
    # The angle by another route than the code's: from the rays of the camera matrix.
    v, u = np.mgrid[:300, :400]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.intrinsic_matrix).T
    angle_deg = np.degrees(np.arctan(np.hypot(rays[..., 0], rays[..., 1])))
    ring = (angle_deg // 5).astype(int)
    frames = [capture(electrons, SENSOR, np.random.default_rng(seed)) for seed in range(4)]
    signal = np.mean(frames, axis=0) - SENSOR.black_level_dn
    shown = np.array([signal[ring == number].mean() for number in range(10)])
    law = np.array([(np.cos(np.radians(angle_deg[ring == number])) ** 4).mean() for number in range(10)])
    noise = [signal[ring == number].std() / math.sqrt((ring == number).sum()) for number in range(10)]
    assert (np.array(noise) < FALL_OFF / 10 * shown).all()
    np.testing.assert_allclose(shown / shown[0], law / law[0], rtol=FALL_OFF)
    assert law[-1] / law[0] < 0.25


def test_exposure_follows_aperture_and_image_distance():
    """(a/v)²: twice the f-number a quarter of the light; focusing near shortens f and a at a fixed v and darkens."""
    radiance = np.full((800, 1000), 0.1)

    def on_axis(camera: PTZCamera, sensor: ImageSensor = SENSOR) -> float:
        return float(expected_electrons(radiance, camera, sensor)[400, 500])

    reference = on_axis(CAMERA)
    assert on_axis(dataclasses.replace(CAMERA, f_number=4)) == pytest.approx(reference / 4, rel=SAME_TO_ROUNDING)
    for focus_distance_m in (0.05, 0.5, 20):
        camera = dataclasses.replace(CAMERA, focus_distance_m=focus_distance_m)
        # a/v = f/(N v) = 1/(N (1 + v/d))
        expected = reference * ((1 + 5e-3 / 2) / (1 + 5e-3 / focus_distance_m)) ** 2
        assert on_axis(camera) == pytest.approx(expected, rel=1e-9)
    for change in ({"exposure_ms": 8.0}, {"quantum_efficiency": 1.0}, {"wavelength_nm": 1100.0}):
        assert on_axis(CAMERA, dataclasses.replace(SENSOR, **change)) == pytest.approx(2 * reference, rel=1e-9)
    # An equal scene through a longer lens of the same f-number is as bright: the f-number is what counts, but for v/d.
    tele = dataclasses.replace(CAMERA, zoom=2, focus_distance_m=1e6)
    wide = dataclasses.replace(CAMERA, zoom=1, focus_distance_m=1e6)
    assert on_axis(tele) == pytest.approx(on_axis(wide), rel=1e-5)


# ---- electrons to digital numbers ------------------------------------------------------------------------------------


def test_properties_by_hand():
    """gain = full well over the numbers above black: 10 000 e⁻ / (4095 − 64)."""
    assert SENSOR.largest_dn == 4095
    assert SENSOR.gain_e_per_dn == pytest.approx(10_000 / 4031, rel=SAME_TO_ROUNDING)
    assert SENSOR.ccd_noise == pytest.approx(6e-4, rel=SAME_TO_ROUNDING)
    gain = 10_000 / 4031
    np.testing.assert_allclose(
        SENSOR.noise_electrons(np.array([0.0, 100.0, -5.0])),
        np.sqrt([36 + gain**2 / 12, 136 + gain**2 / 12, 36 + gain**2 / 12]),
        rtol=SAME_TO_ROUNDING,
    )


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_captures_have_the_mean_and_the_variance_that_noise_electrons_says(bits):
    """Z-tests over all levels as one family. Quantisation as noise of 1/12 DN² holds from σ = 0.5 DN upwards."""
    sensor = dataclasses.replace(SENSOR, bits=bits, black_level_dn=64 * 2 ** (bits - 12) if bits > 8 else 8)
    if bits == 8:
        sensor = dataclasses.replace(sensor, read_noise_e=40.0)  # 0.99 DN; 6 e⁻ would drown in steps of 40 e⁻
    gain, bound = sensor.gain_e_per_dn, largest_z(2 * len(LEVELS_E))
    for seed, level in enumerate(LEVELS_E):
        numbers = capture_at(level, sensor, seed=bits * 100 + seed) * gain
        sigma = float(sensor.noise_electrons(np.array(level)))
        z_mean = (numbers.mean() - level) / (sigma / math.sqrt(PIXELS))
        # Var(s²) = σ⁴ (2 + excess kurtosis)/n, with the Poisson part's fourth cumulant equal to its mean.
        kurtosis = level / sigma**4
        z_variance = (numbers.var(ddof=1) - sigma**2) / (sigma**2 * math.sqrt((2 + kurtosis) / PIXELS))
        assert abs(z_mean) < bound, level
        assert abs(z_variance) < bound, level


def test_the_photon_transfer_line_has_the_slope_of_one_over_the_gain():
    """Variance against mean, both in DN: slope 1/gain, intercept read noise² /gain² + 1/12 (EMVA 1288)."""
    gain = SENSOR.gain_e_per_dn
    captures = np.array([capture_at(level, seed=50 + i).ravel() for i, level in enumerate(LEVELS_E)])
    mean, variance = captures.mean(axis=1), captures.var(axis=1, ddof=1)
    # Weighted least squares with the sampling error of each variance; it also gives the error of the line.
    error = variance * math.sqrt(2 / PIXELS)
    design = np.column_stack([mean, np.ones_like(mean)]) / error[:, None]
    line, *_ = np.linalg.lstsq(design, variance / error, rcond=None)
    line_error = np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    expected = np.array([1 / gain, (6 / gain) ** 2 + 1 / 12])
    assert (np.abs(line - expected) / line_error < largest_z(2)).all()
    # The test would notice a gain that is off by a percent.
    assert line_error[0] * gain < 0.003


def test_pixels_are_independent_and_so_are_captures():
    first, second = capture_at(500.0, seed=1), capture_at(500.0, seed=2)
    pairs = [(first[0, 1:], first[0, :-1]), (first[0], second[0]), (first[0, 300:], first[0, :-300])]
    for a, b in pairs:
        assert abs(np.corrcoef(a, b)[0, 1]) * math.sqrt(len(a)) < largest_z(len(pairs))


def test_the_full_well_and_the_converter_both_clip():
    """Electrons end at the full well, and read noise on top of that at the converter's largest number."""
    bright = capture_at(5 * SENSOR.full_well_e, pixels=10_000) + SENSOR.black_level_dn
    assert bright.max() == SENSOR.largest_dn
    # The full well fills the converter's range: read noise alone takes half of the pixels below it.
    assert 0.35 < (bright < SENSOR.largest_dn).mean() < 0.5
    assert bright.min() > SENSOR.largest_dn - 6 * 6 / SENSOR.gain_e_per_dn
    silent = dataclasses.replace(SENSOR, read_noise_e=0.0)
    assert (capture_at(5 * SENSOR.full_well_e, silent, pixels=1000) == SENSOR.largest_dn - 64).all()


def test_the_black_level_keeps_the_noise_in_the_dark():
    """Without it half of the dark noise would be cut off at zero and the mean would rise."""
    dark = capture_at(0.0, pixels=10_000)
    assert dark.min() < 0
    cut = capture_at(0.0, dataclasses.replace(SENSOR, black_level_dn=0), pixels=10_000)
    assert cut.min() == 0
    assert cut.mean() > dark.mean() + 0.5


def test_a_silent_sensor_in_the_dark_says_black():
    silent = dataclasses.replace(SENSOR, read_noise_e=0.0)
    np.testing.assert_array_equal(capture_at(0.0, silent, pixels=100), 0)


def test_a_capture_is_a_function_of_its_generator():
    """Randomness: the same seed the same numbers; nothing is drawn from the global state."""
    electrons = np.full((20, 30), 300.0)
    state = np.random.get_state()[1].copy()  # noqa: NPY002 (that it stays untouched is the point)
    first, again, other = (capture(electrons, SENSOR, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first.dtype == np.uint16
    assert first.shape == (20, 30)
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002
    np.testing.assert_array_equal(electrons, 300.0)


# ---- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("wavelength_nm", 0.0, "above 0"),
        ("exposure_ms", -1.0, "above 0"),
        ("exposure_ms", math.nan, "above 0"),
        ("full_well_e", math.inf, "above 0"),
        ("quantum_efficiency", 0.0, "above 0, at most 1"),
        ("quantum_efficiency", 1.01, "above 0, at most 1"),
        ("read_noise_e", -0.1, "0 or more"),
        ("read_noise_e", math.nan, "0 or more"),
        ("bits", 7, "8 to 16"),
        ("bits", 17, "8 to 16"),
        ("black_level_dn", -1, "0 to 4094"),
        ("black_level_dn", 4095, "0 to 4094"),
        ("dark_current_e_per_s", -1.0, "0 or more"),
        ("dark_current_e_per_s", math.inf, "0 or more"),
        ("prnu_share", -0.01, "0 to 0.2"),
        ("prnu_share", 0.21, "0 to 0.2"),
        ("prnu_share", math.nan, "0 to 0.2"),
        ("dsnu_e", -1.0, "0 or more"),
        ("dsnu_e", math.nan, "0 or more"),
        ("system_gain_dn_per_e", 0.0, "above 0, or None"),
        ("system_gain_dn_per_e", math.inf, "above 0, or None"),
    ],
)
def test_a_value_out_of_range_is_named_with_what_is_allowed(field, value, allowed):
    with pytest.raises(RangeError) as caught:
        dataclasses.replace(SENSOR, **{field: value})
    assert f"ImageSensor.{field} = {value!r}; allowed: {allowed}" == str(caught.value)
    assert isinstance(caught.value, PSSError)
