"""The measurement noise R_k of a camera: quality factors, and their named sums (section 4)."""

from pss.noise.calibrated import (
    CALIBRATION_FACTORS,
    CALIBRATION_LIMITS,
    DETECTION_COEFFICIENTS,
    SCALED_MODELS,
    Calibration,
    calibration_factor,
)
from pss.noise.covariance import PixelCovariance
from pss.noise.factors import (
    DEFAULT_CCD_NOISE,
    SMALLEST_COS_INCIDENCE,
    Defocus,
    DistanceIncidence,
    FactorOfParts,
    IdentityNoise,
    NoiseFactor,
    Resolution,
    Weighted,
)
from pss.noise.model import NoiseModel
from pss.noise.photometric import BrightnessContrast
from pss.noise.relative import ModuleSize, RelativeDefocus
from pss.noise.table import (
    CALIBRATED,
    NOISE_MODELS,
    NoiseSettings,
    NoiseTable,
    calibration_called,
    noise_model,
    shipped_calibration,
)

__all__ = [
    "CALIBRATED",
    "CALIBRATION_FACTORS",
    "CALIBRATION_LIMITS",
    "DEFAULT_CCD_NOISE",
    "DETECTION_COEFFICIENTS",
    "NOISE_MODELS",
    "SCALED_MODELS",
    "SMALLEST_COS_INCIDENCE",
    "BrightnessContrast",
    "Calibration",
    "Defocus",
    "DistanceIncidence",
    "FactorOfParts",
    "IdentityNoise",
    "ModuleSize",
    "NoiseFactor",
    "NoiseModel",
    "NoiseSettings",
    "NoiseTable",
    "PixelCovariance",
    "RelativeDefocus",
    "Resolution",
    "Weighted",
    "calibration_called",
    "calibration_factor",
    "noise_model",
    "shipped_calibration",
]
