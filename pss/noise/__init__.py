"""The measurement noise R_k of a camera: quality factors, each a small unit, and their named sums (section 4)."""

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
    IdentityNoise,
    NoiseFactor,
    Resolution,
    Weighted,
)
from pss.noise.model import NOISE_MODELS, NoiseModel, noise_model
from pss.noise.photometric import BrightnessContrast
from pss.noise.relative import ModuleSize, RelativeDefocus

__all__ = [
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
    "IdentityNoise",
    "ModuleSize",
    "NoiseFactor",
    "NoiseModel",
    "PixelCovariance",
    "RelativeDefocus",
    "Resolution",
    "Weighted",
    "calibration_factor",
    "noise_model",
]
