"""The sensor: from the radiance that reaches the lens to digital numbers, in named stages with units.

radiance → photons → electrons (shot noise) → full well → read noise → gain → quantisation. Many noisy captures come
from one render: `capture` is called once a trial with a generator of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera, RangeError

__all__ = ["Sensor", "capture", "expected_electrons", "noise_electrons", "relative_illumination", "shot_noise"]

Floats = NDArray[np.floating]

# From here on the distribution function of the expansion is within 0.0009 of Poisson's.
EXACT_BELOW_E = 12.0
PLANCK_TIMES_LIGHT_SPEED_J_M = 6.62607015e-34 * 299_792_458.0


@dataclass(frozen=True)
class Sensor:
    """A monochrome sensor with its exposure.

    Attributes:
        wavelength_nm: nm, mean wavelength of the band; it sets the photon's energy.
        quantum_efficiency: electrons per photon, 0 to 1.
        exposure_ms: ms.
        full_well_e: electrons at which a pixel saturates.
        read_noise_e: electrons (σ) of dark noise at each read-out.
        bits: of the converter; the full well fills its range above the black level.
        black_level_dn: digital numbers at no light, so that the noise in the dark is not cut off.
    """

    wavelength_nm: float
    quantum_efficiency: float
    exposure_ms: float
    full_well_e: float
    read_noise_e: float
    bits: int
    black_level_dn: int

    def __post_init__(self) -> None:
        for name in ("wavelength_nm", "exposure_ms", "full_well_e"):
            if not 0 < getattr(self, name) < math.inf:
                raise RangeError(f"Sensor.{name} = {getattr(self, name)!r}; allowed: above 0")
        if not 0 < self.quantum_efficiency <= 1:
            raise RangeError(f"Sensor.quantum_efficiency = {self.quantum_efficiency!r}; allowed: above 0, at most 1")
        if not self.read_noise_e >= 0:
            raise RangeError(f"Sensor.read_noise_e = {self.read_noise_e!r}; allowed: 0 or more")
        if not 8 <= self.bits <= 16:
            raise RangeError(f"Sensor.bits = {self.bits!r}; allowed: 8 to 16")
        if not 0 <= self.black_level_dn < self.largest_dn:
            raise RangeError(f"Sensor.black_level_dn = {self.black_level_dn!r}; allowed: 0 to {self.largest_dn - 1}")

    @property
    def largest_dn(self) -> int:
        """The converter's largest number."""
        return 2**self.bits - 1

    @property
    def gain_e_per_dn(self) -> float:
        """Electrons per digital number."""
        return self.full_well_e / (self.largest_dn - self.black_level_dn)

    @property
    def ccd_noise(self) -> float:
        """Dark noise over full well, no unit: CCDnoise of Eqs. 12 and 13."""
        return self.read_noise_e / self.full_well_e


def relative_illumination(camera: PTZCamera) -> Floats:
    """cos⁴ θ of every pixel, (height, width): how a thin lens darkens towards the image's corners."""
    width, height = camera.resolution
    cx, cy = camera.principal_point_px
    x = (np.arange(width) - cx) / camera.focal_px
    y = (np.arange(height) - cy) / camera.focal_px
    return 1 / (1 + x**2 + y[:, None] ** 2) ** 2


def expected_electrons(radiance_w_per_m2_sr: Floats, camera: PTZCamera, sensor: Sensor) -> Floats:
    """Mean photoelectrons of every pixel, (height, width), for a radiance image (height, width).

    The irradiance behind the lens is L (π/4) (a/v)² cos⁴ θ: exact in the aperture and the image distance, so that
    focusing near (a longer v) darkens the image as it does in a camera.
    """
    steradians = math.pi / 4 * (camera.aperture_diameter_m / camera.image_distance_m) ** 2
    joules_per_radiance = steradians * camera.pixel_pitch_m**2 * sensor.exposure_ms * 1e-3
    photon_j = PLANCK_TIMES_LIGHT_SPEED_J_M / (sensor.wavelength_nm * 1e-9)
    electrons_per_radiance = joules_per_radiance / photon_j * sensor.quantum_efficiency
    return radiance_w_per_m2_sr * (electrons_per_radiance * relative_illumination(camera))


def noise_electrons(electrons: Floats, sensor: Sensor) -> Floats:
    """Electrons (σ) of the noise of one capture at a mean of `electrons`: shot, read-out and quantisation."""
    quantisation = sensor.gain_e_per_dn**2 / 12
    return np.sqrt(np.maximum(electrons, 0) + sensor.read_noise_e**2 + quantisation)


def shot_noise(electrons: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Whole electrons of one exposure of mean `electrons` (any shape): Poisson.

    Drawn exactly below `EXACT_BELOW_E`; above it by the Cornish–Fisher expansion of a Poisson variable, rounded, which
    has its mean, variance and skewness and takes a quarter of the time.
    """
    z = rng.standard_normal(electrons.shape, dtype=np.float32)
    # Rounding adds 1/12 to the variance, the quadratic term 1/18.
    spread = np.sqrt(np.maximum(electrons - np.float32(1 / 12 + 1 / 18), 0))
    collected = np.rint(electrons + z * spread + (z * z - 1) / np.float32(6))
    dim = electrons < EXACT_BELOW_E
    collected[dim] = rng.poisson(electrons[dim])
    return np.asarray(collected, dtype=np.float32)


def capture(electrons: Floats, sensor: Sensor, rng: np.random.Generator) -> NDArray[np.uint16]:
    """One noisy exposure in digital numbers, (height, width), of mean `electrons` (height, width)."""
    collected = shot_noise(np.asarray(electrons, dtype=np.float32), rng)
    np.minimum(collected, np.float32(sensor.full_well_e), out=collected)
    collected += np.float32(sensor.read_noise_e) * rng.standard_normal(collected.shape, dtype=np.float32)
    numbers = np.rint(collected / np.float32(sensor.gain_e_per_dn) + np.float32(sensor.black_level_dn))
    return np.clip(numbers, 0, sensor.largest_dn).astype(np.uint16)
