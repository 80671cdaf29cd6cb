"""Illuminance in lux of monochromatic light, from its irradiance.

Source: CIE spectral luminous efficiency for photopic vision V(λ), 1924 (CIE 018:2019, ISO/CIE 23539), 380 to 780 nm in
steps of 10 nm, with its peak at 555 nm; 683 lm/W there by the SI's definition of the candela.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pss.hints import Floats

__all__ = ["LUMENS_PER_WATT", "illuminance_lux", "luminous_efficiency"]


LUMENS_PER_WATT = 683.002
"""lm/W at 555 nm."""

_WAVELENGTHS_NM = np.array([*range(380, 560, 10), 555, *range(560, 790, 10)], dtype=float)
_EFFICIENCY = np.array(
    [
        *(3.9e-5, 1.2e-4, 3.96e-4, 1.21e-3, 4.0e-3, 1.16e-2, 2.3e-2, 3.8e-2, 6.0e-2, 9.098e-2),  # 380 to 470
        *(0.13902, 0.20802, 0.323, 0.503, 0.710, 0.862, 0.954, 0.99495),  # 480 to 550
        *(1.0, 0.995, 0.952, 0.870, 0.757, 0.631, 0.503, 0.381, 0.265, 0.175, 0.107),  # 555 to 650
        *(6.1e-2, 3.2e-2, 1.7e-2, 8.21e-3, 4.102e-3, 2.091e-3, 1.047e-3, 5.2e-4, 2.492e-4),  # 660 to 740
        *(1.2e-4, 6.0e-5, 3.0e-5, 1.499e-5),  # 750 to 780
    ]
)


def luminous_efficiency(wavelength_nm: ArrayLike) -> Floats:
    """V(λ), no unit, 0 to 1 (any shape): log-linear between the table's values, 0 outside 380 to 780 nm."""
    wavelength = np.asarray(wavelength_nm, dtype=np.float64)
    seen = (wavelength >= _WAVELENGTHS_NM[0]) & (wavelength <= _WAVELENGTHS_NM[-1])
    return np.where(seen, np.exp(np.interp(wavelength, _WAVELENGTHS_NM, np.log(_EFFICIENCY))), 0.0)


def illuminance_lux(irradiance_w_per_m2: ArrayLike, wavelength_nm: float) -> Floats:
    """Illuminance in lux (any shape) of an irradiance in W/m² at one wavelength in nm.

    A band has less than its mean wavelength alone: equal power from 400 to 700 nm has 0.355 of that at 550 nm.
    """
    return LUMENS_PER_WATT * luminous_efficiency(wavelength_nm) * np.asarray(irradiance_w_per_m2, dtype=np.float64)
