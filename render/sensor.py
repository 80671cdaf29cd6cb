"""The sensor: from the radiance at the lens to digital numbers, in named stages with units.

radiance → photons → electrons (quantum efficiency, each pixel's response) → dark current → shot noise of both → full
well → read-out (each pixel's offset, read noise) → gain → converter. One render yields many noisy captures: `capture`
is called once per trial with its own generator, and with the camera's `fixed_pattern`.

A stage may modify its input array and return it; `capture` never modifies its caller's.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor, PTZCamera
from pss.cameras.distortion import stretch, undistorted
from pss.cameras.sensor import electrons_per_radiance
from pss.hints import AnyFloats, Images

__all__ = [
    "FixedPattern",
    "amplify",
    "capture",
    "digitise",
    "expected_electrons",
    "fill_well",
    "fixed_pattern",
    "mean_charge",
    "read_out",
    "relative_illumination",
    "saturated_share",
    "shot_noise",
    "surely_saturated",
]


# Above this value the distribution function of the expansion is within 0.0009 of Poisson's.
EXACT_BELOW_E = 12.0
# One draw in a billion is below.
SURELY_SIGMA = 6.0


@dataclass(frozen=True, eq=False)
class FixedPattern:
    """Differences between the pixels of one camera, the same in all its frames. Arrays are (height, width).

    Attributes:
        prnu: each pixel's photo response over the mean, minus 1 (no unit).
        dsnu_e: electrons, each pixel's dark offset from the mean.
    """

    prnu: Images
    dsnu_e: Images


# ---- light to electrons ----------------------------------------------------------------------------------------------


def relative_illumination(camera: PTZCamera) -> AnyFloats:
    """cos⁴ θ of every pixel, (height, width): the vignetting of a thin lens.

    Where distortion compresses the image, a pixel collects from a larger solid angle.
    """
    width, height = camera.resolution
    cx, cy = camera.principal_point_px
    x = (np.arange(width) - cx) / camera.focal_px
    y = (np.arange(height) - cy) / camera.focal_px
    if not any(camera.radial_distortion):
        return 1 / (1 + x**2 + y[:, None] ** 2) ** 2
    bent = np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1)
    squared = (undistorted(bent, *camera.radial_distortion) ** 2).sum(axis=-1)
    factor, derivative = stretch(squared, *camera.radial_distortion)
    return 1 / (1 + squared) ** 2 / (factor * (factor + 2 * squared * derivative))


def expected_electrons(radiance_w_per_m2_sr: AnyFloats, camera: PTZCamera, sensor: ImageSensor) -> AnyFloats:
    """Mean photoelectrons of every pixel, (height, width), for a radiance image (height, width).

    The irradiance behind the lens is L (π/4) (a/v)² cos⁴ θ; photons and quantum efficiency are included in one factor
    (`pss.cameras.sensor.electrons_per_radiance`).
    """
    return radiance_w_per_m2_sr * (electrons_per_radiance(camera, sensor) * relative_illumination(camera))


# ---- the camera's own pattern ----------------------------------------------------------------------------------------


def fixed_pattern(camera: PTZCamera, sensor: ImageSensor) -> FixedPattern:
    """The pattern of the camera at this position with this resolution: Gaussian, the same in every frame and every run.

    Pan, tilt and other settings have no effect: a camera that pans keeps its sensor. Of `sensor` only the two σ count,
    as scales of one pattern.
    """
    width, height = camera.resolution

    def spread(what: str, sigma: float, lowest: float) -> Images:
        if sigma == 0:
            # No memory and no time for a sensor without it.
            return np.broadcast_to(np.float32(0), (height, width))
        pattern = _body_stream(camera, what).standard_normal((height, width), dtype=np.float32)
        pattern *= np.float32(sigma)
        return np.maximum(pattern, np.float32(lowest), out=pattern)

    # A pixel's response cannot be negative, which is 5 σ away at the largest PRNU allowed.
    return FixedPattern(spread("prnu", sensor.prnu_share, -1), spread("dsnu", sensor.dsnu_e, -np.inf))


def _body_stream(camera: PTZCamera, what: str) -> np.random.Generator:
    # Adding 0.0 turns −0.0, which is the same place, into 0.0.
    place = [value + 0.0 for value in camera.position_m]
    words = hashlib.sha256(f"{place}/{camera.resolution}/{what}".encode()).digest()
    return np.random.default_rng(np.random.SeedSequence(np.frombuffer(words, dtype="<u4").tolist()))


# ---- electrons to digital numbers, one exposure ----------------------------------------------------------------------


def mean_charge(electrons: Images, sensor: ImageSensor, pattern: FixedPattern | None = None) -> Images:
    """Mean electrons that each pixel collects in an exposure, from mean photoelectrons without a pattern.

    PRNU scales the photoelectrons; the dark current is added.
    """
    if pattern is not None and sensor.prnu_share > 0:
        electrons = electrons * (pattern.prnu + np.float32(1))
    return electrons + np.float32(sensor.dark_signal_e) if sensor.dark_signal_e > 0 else electrons


def shot_noise(electrons: Images, rng: np.random.Generator) -> Images:
    """Whole electrons of one exposure with mean `electrons` (any shape): Poisson.

    A sum of Poisson variables is Poisson, so that light and dark current are drawn together. Exact below
    `EXACT_BELOW_E`; above it by the rounded Cornish–Fisher expansion of a Poisson variable, which has its mean,
    variance and skewness and takes a quarter of the time.
    """
    z = rng.standard_normal(electrons.shape, dtype=np.float32)
    # rint(electrons + z √(electrons − …) + (z² − 1)/6), in two arrays. Rounding adds 1/12 to the variance, the
    # quadratic term 1/18.
    collected = electrons - np.float32(1 / 12 + 1 / 18)
    np.sqrt(np.maximum(collected, 0, out=collected), out=collected)
    collected *= z
    collected += electrons
    z *= z
    z -= 1
    z /= np.float32(6)
    collected += z
    np.rint(collected, out=collected)
    dim = electrons < EXACT_BELOW_E
    collected[dim] = rng.poisson(electrons[dim])
    return collected


def fill_well(electrons: Images, sensor: ImageSensor) -> Images:
    """Electrons in the pixels' wells: those above the full well are lost. Works in place."""
    return np.minimum(electrons, np.float32(sensor.full_well_e), out=electrons)


def read_out(
    electrons: Images, sensor: ImageSensor, rng: np.random.Generator, pattern: FixedPattern | None = None
) -> Images:
    """Electrons at the amplifier: with read noise, and DSNU as an offset of each pixel. Works in place."""
    electrons += np.float32(sensor.read_noise_e) * rng.standard_normal(electrons.shape, dtype=np.float32)
    if pattern is not None and sensor.dsnu_e > 0:
        electrons += pattern.dsnu_e
    return electrons


def amplify(electrons: Images, sensor: ImageSensor) -> Images:
    """Digital numbers before the converter, not yet integers: gain and black level. Works in place."""
    electrons /= np.float32(sensor.gain_e_per_dn)
    electrons += np.float32(sensor.black_level_dn)
    return electrons


def digitise(numbers: Images, sensor: ImageSensor) -> NDArray[np.uint16]:
    """Integer digital numbers from 0 to the converter's largest. Works in place."""
    np.rint(numbers, out=numbers)
    return np.clip(numbers, 0, sensor.largest_dn, out=numbers).astype(np.uint16)


def capture(
    electrons: AnyFloats, sensor: ImageSensor, rng: np.random.Generator, pattern: FixedPattern | None = None
) -> NDArray[np.uint16]:
    """One noisy exposure in digital numbers, (height, width), of mean photoelectrons `electrons` (height, width).

    Args:
        pattern: the camera's, from `fixed_pattern`; without it all pixels are equal, whatever `sensor` states.
    """
    charge = mean_charge(np.asarray(electrons, dtype=np.float32), sensor, pattern)
    collected = fill_well(shot_noise(charge, rng), sensor)
    return digitise(amplify(read_out(collected, sensor, rng, pattern), sensor), sensor)


def surely_saturated(electrons: AnyFloats, sensor: ImageSensor) -> NDArray[np.bool_]:
    """Where mean photoelectrons (any shape) certainly saturate, even if the mean is twice what it should be.

    PRNU and noise are taken into account with `SURELY_SIGMA` of their σ.
    """
    least = np.asarray(electrons) * max(0.0, 1 - SURELY_SIGMA * sensor.prnu_share)
    return np.asarray(least / 2 - SURELY_SIGMA * sensor.noise_electrons(least / 2) > sensor.saturation_e)


def saturated_share(electrons: AnyFloats, sensor: ImageSensor) -> float:
    """Share (0 to 1) of the pixels whose mean charge, for mean photoelectrons of any shape, reaches saturation.

    Because of shot noise some pixels below it saturate, and some above do not.
    """
    charge = np.asarray(electrons) + sensor.dark_signal_e
    return float(np.mean(charge >= sensor.saturation_e)) if charge.size else 0.0
