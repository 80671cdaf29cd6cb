"""The named sensors before EMVA 1288's estimator, which sees frames alone: it finds what their files say.

`tests/helpers/photon_transfer.py` has the estimator; `benchmarks/emva1288_check.py` asks the standard's own package
too.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

import scenes
from pss import ImageSensor
from tests.helpers.photon_transfer import (
    BEYOND_SATURATION,
    Characterisation,
    Laboratory,
    Level,
    characterise,
    fitted,
    pair,
    saturating,
    stack,
)
from tests.helpers.z_scores import largest_z

ROOM = Path(__file__).parents[2] / "scenes" / "room.toml"
NAMES = ("surveillance-ptz", "machine-vision-global-shutter", "low-light-large-pixel")
LEVELS, STACK = 24, 16
# Relative, of a level's variance against the photon transfer law. A level of 320 × 240 pixels has a σ of 0.5 % itself.
LAW = 0.02
# Of what it estimates, the largest standard uncertainty that is worth a test.
WORTH = {"system_gain_dn_per_e": 0.004, "quantum_efficiency": 0.004, "dark_noise_e": 0.02, "prnu_share": 0.01}
WORTH |= {"dsnu_e": 0.02, "dark_current_e_per_s": 0.005}


def named(name: str) -> ImageSensor:
    return scenes.load(ROOM, [f"sensor.name={name}"]).sensor


def series(laboratory: Laboratory, levels: int) -> list[Level]:
    """A bright and a dark pair at each exposure."""
    frame = laboratory.frame
    return [
        Level(
            photons,
            seconds,
            pair(*(frame(photons, seconds) for _ in range(2))),
            pair(*(frame(0, seconds) for _ in range(2))),
        )
        for photons, seconds in laboratory.exposures(levels)
    ]


def report(sensor: ImageSensor, seed: int, levels: int = LEVELS, resolution: tuple[int, int] = (320, 240)):
    laboratory = Laboratory(sensor, resolution, seed)
    measured = series(laboratory, levels)
    photons, seconds = (value / BEYOND_SATURATION for value in laboratory.exposures(2)[0])
    bright, dark = (stack(laboratory.frame(light, seconds) for _ in range(STACK)) for light in (photons, 0.0))
    return measured, characterise(measured, bright, dark)


def given(sensor: ImageSensor) -> dict[str, float]:
    return {
        "system_gain_dn_per_e": (sensor.largest_dn - sensor.black_level_dn) / sensor.full_well_e,
        "quantum_efficiency": sensor.quantum_efficiency,
        "dark_noise_e": sensor.read_noise_e,
        "dark_current_e_per_s": sensor.dark_current_e_per_s,
        "prnu_share": sensor.prnu_share,
        "dsnu_e": sensor.dsnu_e,
    }


def z_scores(sensor: ImageSensor, found: Characterisation) -> dict[str, float]:
    return {
        name: (getattr(found, name).value - value) / getattr(found, name).error for name, value in given(sensor).items()
    }


@pytest.fixture(scope="module", params=NAMES)
def sensor_and_report(request):
    sensor = named(request.param)
    return sensor, *report(sensor, seed=NAMES.index(request.param))


def test_the_estimator_finds_what_the_file_says(sensor_and_report):
    """Gain, efficiency, dark noise, dark current, PRNU, DSNU: each within its uncertainty, all as one family."""
    sensor, _, found = sensor_and_report
    for name, z in z_scores(sensor, found).items():
        assert abs(z) < largest_z(len(WORTH) * len(NAMES)), name
        estimate = getattr(found, name)
        assert estimate.error < WORTH[name] * estimate.value, name


def test_the_sensor_is_linear_up_to_its_saturation(sensor_and_report):
    """Between 5 and 95 % of saturation, deviations are those of the levels' own noise; the full well is where it is."""
    sensor, levels, found = sensor_and_report
    assert found.linearity_error.value < largest_z(LEVELS * len(NAMES)) * found.linearity_error.error
    assert found.linearity_error.error < 2e-4
    check_saturation(sensor, levels)


def check_saturation(sensor: ImageSensor, levels: list[Level]) -> None:
    """Variance is largest where clipping begins: at most three σ of the pixels' charges below saturation, on the grid.

    The dark current of a long exposure takes its part of the well.
    """
    top, full = saturating(levels), sensor.saturation_e
    charge = top.photons * sensor.quantum_efficiency + top.exposure_s * sensor.dark_current_e_per_s
    grid = full * BEYOND_SATURATION / LEVELS
    assert full - 3 * (full + (sensor.prnu_share * full) ** 2) ** 0.5 - grid < charge <= full


def test_the_photon_transfer_law(sensor_and_report):
    """Variance = dark noise² + 1/12 + K · signal, level by level within 2 %; beyond the full well it collapses."""
    sensor, levels, _ = sensor_and_report
    gain = 1 / sensor.gain_e_per_dn
    for level in fitted(levels):
        dark_e2 = sensor.read_noise_e**2 + sensor.dark_current_e_per_s * level.exposure_s
        law = gain**2 * dark_e2 + 1 / 12 + gain * level.signal_dn
        assert level.bright.variance_dn2 == pytest.approx(law, rel=LAW)
        assert level.dark.variance_dn2 == pytest.approx(gain**2 * dark_e2 + 1 / 12, rel=LAW)
    assert levels[-1].bright.variance_dn2 < 0.05 * max(level.bright.variance_dn2 for level in levels)


def test_the_stated_uncertainties_are_the_scatter_of_repeated_measurements():
    """χ² of each figure's z-scores over small series of other bodies lies in a two-sided band: honest, not generous."""
    sensor = dataclasses.replace(named("machine-vision-global-shutter"), prnu_share=0.02)
    repeats = 24
    scores = [
        z_scores(sensor, report(sensor, 100 + seed, levels=12, resolution=(96, 64))[1]) for seed in range(repeats)
    ]
    alone = 1e-3 / len(WORTH) / 2
    highest, lowest = (scipy.stats.chi2.isf(p, repeats) for p in (alone, 1 - alone))
    for name in WORTH:
        assert lowest < sum(score[name] ** 2 for score in scores) < highest, name


@pytest.mark.parametrize("gain", [0.25, 1.5])
def test_an_explicit_gain_is_found(gain):
    """Below and above the derived 0.38 DN/e⁻; above, the converter saturates at its own end."""
    sensor = dataclasses.replace(named("machine-vision-global-shutter"), system_gain_dn_per_e=gain)
    levels, found = report(sensor, seed=9)
    assert abs(found.system_gain_dn_per_e.value - gain) < largest_z(2) * found.system_gain_dn_per_e.error
    assert sensor.saturation_e == pytest.approx(min(sensor.full_well_e, 4035 / gain))
    check_saturation(sensor, levels)


@pytest.mark.slow
def test_the_estimator_tells_sensors_apart():
    """A sensor that is off by 3 % of one figure at a time is refused: the tests above can fail."""
    sensor = named("surveillance-ptz")
    for change in (
        {"quantum_efficiency": 0.7 * 1.03},
        {"full_well_e": 11_000 / 1.03},
        {"read_noise_e": 3.5 * 1.03},
        {"dark_current_e_per_s": 10.3},
        {"prnu_share": 0.0103},
        {"dsnu_e": 2.06},
    ):
        other = dataclasses.replace(sensor, **change)
        found = report(other, seed=4)[1]
        assert max(abs(z) for z in z_scores(sensor, found).values()) > largest_z(len(WORTH)), change
        assert max(abs(z) for z in z_scores(other, found).values()) < largest_z(len(WORTH) * 6), change


def test_a_pair_leaves_the_fixed_pattern_and_a_drifting_lamp_out():
    """By hand: frames that differ by ±1 DN about a drift of 4 DN, on any pattern, have the variance 1/2 · 1."""
    pattern = np.arange(100).reshape(10, 10) * 7
    sign = np.tile([1, -1], 50).reshape(10, 10)
    found = pair((pattern + 10).astype(np.uint16), (pattern + 14 + sign).astype(np.uint16))
    assert found.variance_dn2 == pytest.approx(0.5)
    assert found.mean_dn == pytest.approx(pattern.mean() + 12)


def test_a_stack_separates_temporal_from_spatial_noise():
    """By hand: columns 10 DN apart, each frame ± 2 DN: temporal 4 · L/(L − 1), spatial what is left of the columns'."""
    columns = np.tile([100, 110], (10, 5))
    found = stack([(columns + step).astype(np.uint16) for step in (2, -2, 2, -2)])
    assert found.temporal_dn2 == pytest.approx(16 / 3)
    assert found.spatial_dn2 == pytest.approx(25 * 100 / 99 - 4 / 3)
