"""The image sensor: the electrons that a radiance yields, and their noise.

Rendering and prediction use the same sensor: the first draws its noise from it, the second takes the variance of the
brightness and contrast factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pss.cameras.parameters import CameraModel
from pss.errors import RangeError
from pss.hints import AnyFloats

__all__ = ["ImageSensor", "electrons_per_radiance"]

PLANCK_TIMES_LIGHT_SPEED_J_M = 6.62607015e-34 * 299_792_458.0

# Above it, a Gaussian spread of the pixels' response would extend to negative responses.
LARGEST_PRNU_SHARE = 0.2


@dataclass(frozen=True)
class ImageSensor:
    """A monochrome image sensor with its exposure. The defaults are those of an indoor PTZ camera in dim light.

    The quantities are those of EMVA 1288; `render.sensor` has the stages from photons to digital numbers.

    Attributes:
        wavelength_nm: nm, mean wavelength of the band; it sets the photon's energy.
        quantum_efficiency: electrons per photon, 0 to 1.
        exposure_ms: ms.
        full_well_e: electrons at which a pixel saturates.
        read_noise_e: electrons (σ) of dark noise at each read-out.
        bits: resolution of the analogue-to-digital converter.
        black_level_dn: digital numbers without light, so that noise in the dark is not clipped.
        dark_current_e_per_s: electrons per second, the mean that a pixel collects without light (μ_I).
        prnu_share: σ of the pixels' photo response over its mean (PRNU), no unit: 0.01 is 1 %.
        dsnu_e: electrons (σ), spread of the pixels' dark offsets (DSNU).
        system_gain_dn_per_e: digital numbers per electron (K). None: the full well fills the converter's range above
            the black level, as at a camera's gain of 0 dB. With a larger gain the converter saturates first.
    """

    wavelength_nm: float = 550.0
    quantum_efficiency: float = 0.5
    exposure_ms: float = 4.0
    full_well_e: float = 10_000.0
    read_noise_e: float = 6.0
    bits: int = 12
    black_level_dn: int = 64
    dark_current_e_per_s: float = 0.0
    prnu_share: float = 0.0
    dsnu_e: float = 0.0
    system_gain_dn_per_e: float | None = None

    def __post_init__(self) -> None:
        for name in ("wavelength_nm", "exposure_ms", "full_well_e"):
            self._require(name, 0 < getattr(self, name) < math.inf, "above 0")
        self._require("quantum_efficiency", 0 < self.quantum_efficiency <= 1, "above 0, at most 1")
        for name in ("read_noise_e", "dark_current_e_per_s", "dsnu_e"):
            self._require(name, 0 <= getattr(self, name) < math.inf, "0 or more")
        self._require("prnu_share", 0 <= self.prnu_share <= LARGEST_PRNU_SHARE, f"0 to {LARGEST_PRNU_SHARE}")
        self._require("bits", 8 <= self.bits <= 16, "8 to 16")
        self._require("black_level_dn", 0 <= self.black_level_dn < self.largest_dn, f"0 to {self.largest_dn - 1}")
        gain = self.system_gain_dn_per_e
        self._require("system_gain_dn_per_e", gain is None or 0 < gain < math.inf, "above 0, or None")

    def _require(self, name: str, allowed: bool, what: str) -> None:
        if not allowed:
            raise RangeError(f"ImageSensor.{name} = {getattr(self, name)!r}; allowed: {what}")

    @property
    def largest_dn(self) -> int:
        """The converter's largest number."""
        return int(2**self.bits) - 1

    @property
    def gain_e_per_dn(self) -> float:
        """Electrons per digital number, 1/K."""
        if self.system_gain_dn_per_e is not None:
            return 1 / self.system_gain_dn_per_e
        return self.full_well_e / (self.largest_dn - self.black_level_dn)

    @property
    def saturation_e(self) -> float:
        """Electrons, signal plus dark current, at which a pixel saturates: the full well or the converter's end."""
        if self.system_gain_dn_per_e is None:
            return self.full_well_e
        return min(self.full_well_e, (self.largest_dn - self.black_level_dn) * self.gain_e_per_dn)

    @property
    def dark_signal_e(self) -> float:
        """Electrons, the mean dark signal of one exposure."""
        return self.dark_current_e_per_s * self.exposure_ms * 1e-3

    @property
    def dark_noise_e(self) -> float:
        """Electrons (σ), temporal noise of one exposure in the dark (σ_d): read noise and dark current's shot noise."""
        return math.sqrt(self.read_noise_e**2 + self.dark_signal_e)

    @property
    def ccd_noise(self) -> float:
        """Dark noise over full well, no unit: CCDnoise of Eqs. 12 and 13."""
        return self.dark_noise_e / self.full_well_e

    def noise_electrons(self, electrons: AnyFloats) -> AnyFloats:
        """Electrons (σ), temporal noise of one capture at a mean of `electrons` photoelectrons (any shape).

        Shot noise of signal and dark current, read noise and quantisation; saturation is not taken into account.
        """
        quantisation = self.gain_e_per_dn**2 / 12
        collected = np.maximum(electrons, 0) + self.dark_signal_e
        return np.asarray(np.sqrt(collected + self.read_noise_e**2 + quantisation))


def electrons_per_radiance(camera: CameraModel, sensor: ImageSensor) -> float:
    """Electrons per W/(m² sr) that a pixel in the middle of the image collects.

    The irradiance behind the lens is L (π/4) (a/v)², exact in the aperture and the image distance: focusing near
    (a longer v) darkens the image, as in a real camera. Off the axis, multiply by cos⁴ θ.
    """
    steradians = math.pi / 4 * (camera.aperture_diameter_m / camera.image_distance_m) ** 2
    joules = steradians * camera.pixel_pitch_m**2 * sensor.exposure_ms * 1e-3
    photon_j = PLANCK_TIMES_LIGHT_SPEED_J_M / (sensor.wavelength_nm * 1e-9)
    return joules / photon_j * sensor.quantum_efficiency
