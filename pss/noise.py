"""The measurement noise R_k of a camera: the paper's factors of section 4.1, each a small unit, and their named sums.

Every factor gives a 2 × 2 covariance in px² for each point; a model is the sum of its factors (section 4). Eq. 11 adds
m² to px²; it is kept as printed, and the scale between them is explicit (`px2_per_m2`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pss.camera import PTZCamera
from pss.errors import RangeError

__all__ = [
    "DEFAULT_CCD_NOISE",
    "NOISE_MODELS",
    "Defocus",
    "DistanceIncidence",
    "IdentityNoise",
    "NoiseFactor",
    "NoiseModel",
    "Resolution",
    "noise_model",
]

Floats = NDArray[np.float64]

# Dark noise over full well (6 e⁻ over 10 000 e⁻), for callers without a sensor at hand; a scene gives its own.
DEFAULT_CCD_NOISE = 6e-4
# D²/cos α has no bound at grazing incidence; beyond 89.4° nothing can be measured anyway.
SMALLEST_COS_INCIDENCE = 0.01


class NoiseFactor(Protocol):
    """One quality factor. A user's own factor is any object with these two members."""

    @property
    def name(self) -> str:
        """How the factor is switched and listed."""
        ...

    def covariance(self, camera: PTZCamera, points_m: Floats, normals: Floats) -> Floats:
        """px², covariances (N, 2, 2) that the factor adds at `points_m` (N, 3) with unit `normals` (N, 3)."""
        ...


def _isotropic(variance: Floats) -> Floats:
    """px², (N,) variances as (N, 2, 2) covariances."""
    return np.asarray(variance[:, None, None] * np.eye(2))


@dataclass(frozen=True)
class DistanceIncidence:
    """Object distance and incidence angle, Eq. 11.

    Attributes:
        corrected: False for D² cos α as printed; True for D² / cos α, which is what the sentence before Eq. 11 says
            (accuracy grows with cos α, so the noise must fall with it).
        px2_per_m2: px²/m², the scale that Eq. 11 leaves open.
    """

    corrected: bool = False
    px2_per_m2: float = 1.0
    name: str = "distance-incidence"

    def covariance(self, camera: PTZCamera, points_m: Floats, normals: Floats) -> Floats:
        """px², (N, 2, 2)."""
        cos_alpha = camera.cos_incidence(points_m, normals)
        squared_distance = camera.range_m(points_m) ** 2
        if self.corrected:
            variance = squared_distance / np.maximum(cos_alpha, SMALLEST_COS_INCIDENCE)
        else:
            variance = squared_distance * np.maximum(cos_alpha, 0.0)  # Eq. 11
        return _isotropic(self.px2_per_m2 * variance)


@dataclass(frozen=True)
class Resolution:
    """Image resolution, Eqs. 12 and 13: black-level noise times the sensor's size in pixels times cos θ.

    Attributes:
        ccd_noise: dark noise over full well (the paper: "measured sensor black-level noise"); no unit.
    """

    ccd_noise: float = DEFAULT_CCD_NOISE
    name: str = "resolution"

    def covariance(self, camera: PTZCamera, points_m: Floats, normals: Floats) -> Floats:
        """px², (N, 2, 2)."""
        width, height = camera.resolution
        cos_theta = camera.cos_off_axis(points_m)
        covariance = np.zeros((len(points_m), 2, 2))
        covariance[:, 0, 0] = (self.ccd_noise * width * cos_theta) ** 2  # Eq. 12
        covariance[:, 1, 1] = (self.ccd_noise * height * cos_theta) ** 2  # Eq. 13
        return covariance


@dataclass(frozen=True)
class Defocus:
    """Focus distance and depth of field, Eqs. 14 and 15: the squared diameter of the circle of confusion."""

    name: str = "defocus"

    def covariance(self, camera: PTZCamera, points_m: Floats, normals: Floats) -> Floats:
        """px², (N, 2, 2)."""
        return _isotropic(camera.circle_of_confusion_px(points_m) ** 2)  # Eq. 15


@dataclass(frozen=True)
class IdentityNoise:
    """R = I: the same noise everywhere. No factor of the paper, but the ablation that tells what R is worth."""

    variance_px2: float = 1.0
    name: str = "identity"

    def covariance(self, camera: PTZCamera, points_m: Floats, normals: Floats) -> Floats:
        """px², (N, 2, 2)."""
        return _isotropic(np.full(len(points_m), self.variance_px2))


@dataclass(frozen=True)
class NoiseModel:
    """R_k as the sum of factors: `name` for tables, `factors` in the order of the paper."""

    name: str
    factors: tuple[NoiseFactor, ...]

    def __post_init__(self) -> None:
        if not self.factors:
            raise RangeError(f"noise model {self.name!r} has no factor left; allowed: at least one")

    def covariance(self, camera: PTZCamera, points_m: Floats, normals: Floats) -> Floats:
        """px², R_k (N, 2, 2) at `points_m` (N, 3) with unit `normals` (N, 3)."""
        total = self.factors[0].covariance(camera, points_m, normals)
        for factor in self.factors[1:]:
            total = total + factor.covariance(camera, points_m, normals)
        return total

    def without(self, *factor_names: str) -> NoiseModel:
        """The model with the named factors switched off."""
        have = [factor.name for factor in self.factors]
        for name in factor_names:
            if name not in have:
                raise RangeError(f"noise factor {name!r} is not in {self.name!r}; allowed: {', '.join(have)}")
        kept = tuple(factor for factor in self.factors if factor.name not in factor_names)
        suffix = "".join(f" without {name}" for name in factor_names)
        return dataclasses.replace(self, name=self.name + suffix, factors=kept)


NOISE_MODELS = ("as-printed", "corrected", "identity")


def noise_model(
    name: str,
    *,
    switched_off: Iterable[str] = (),
    ccd_noise: float = DEFAULT_CCD_NOISE,
    px2_per_m2: float = 1.0,
) -> NoiseModel:
    """The noise model called `name`: "as-printed" (Eqs. 11–15), "corrected" (D²/cos α in Eq. 11) or "identity" (R = I).

    Args:
        switched_off: names of factors to leave out: "distance-incidence", "resolution", "defocus".
        ccd_noise: dark noise over full well, for Eqs. 12 and 13.
        px2_per_m2: px²/m², the scale of Eq. 11.

    Raises:
        RangeError: an unknown name of a model or a factor, or a constant out of range.
    """
    if name not in NOISE_MODELS:
        raise RangeError(f"noise model {name!r}; allowed: {', '.join(NOISE_MODELS)}")
    if not ccd_noise > 0 or not px2_per_m2 > 0:
        raise RangeError(f"ccd_noise = {ccd_noise!r}, px2_per_m2 = {px2_per_m2!r}; allowed: above 0")
    if name == "identity":
        return NoiseModel(name, (IdentityNoise(),))
    first = DistanceIncidence(corrected=name == "corrected", px2_per_m2=px2_per_m2)
    return NoiseModel(name, (first, Resolution(ccd_noise), Defocus())).without(*switched_off)
