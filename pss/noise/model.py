"""R_k as the sum of its factors (section 4), and the sums that have a name."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.cameras.appearance import Appearance
from pss.cameras.camera import PTZCamera, as_points
from pss.cameras.sensor import ImageSensor
from pss.cameras.views import Views
from pss.errors import RangeError, ShapeError
from pss.hints import Floats
from pss.inputs import members, number
from pss.noise.calibrated import Calibration
from pss.noise.covariance import PixelCovariance
from pss.noise.factors import (
    DEFAULT_CCD_NOISE,
    Defocus,
    DistanceIncidence,
    IdentityNoise,
    NoiseFactor,
    Resolution,
    Weighted,
    covariance_of,
)
from pss.noise.photometric import BrightnessContrast

__all__ = ["NOISE_MODELS", "NoiseModel", "noise_model"]


# Parts of Eq. 11 that can be switched off alone.
EQUATION_11_PARTS = ("distance", "incidence")


@dataclass(frozen=True)
class NoiseModel:
    """R_k as the sum of factors: `name` for tables, `factors` in the order of the paper."""

    name: str
    factors: tuple[NoiseFactor, ...]

    def __post_init__(self) -> None:
        factors = members(self.factors, "factors", "covariance", "noise factors, with name and covariance(views)")
        for factor in factors:
            if not isinstance(getattr(factor, "name", None), str):
                raise RangeError(f"a noise factor of type {type(factor).__name__} has no name; allowed: text")
        object.__setattr__(self, "factors", factors)
        if not factors:
            raise RangeError(f"noise model {self.name!r} has no factor left; allowed: at least one")

    def of_views(self, views: Views) -> PixelCovariance:
        """px², R_k in every one of `views`: arrays that broadcast to (C, N)."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # of points that are not seen
            total = covariance_of(self.factors[0], views)
            for factor in self.factors[1:]:
                total = total + covariance_of(factor, views)
        return total

    def information(self, views: Views, visible: NDArray[np.bool_]) -> Floats:
        """1/m², HᵀR⁻¹H of each camera, entries xx, xy, xz, yy, yz, zz, (C, 6, N); zero where not `visible` (C, N)."""
        return views.information(self.of_views(views).inverse(visible), visible)

    def covariance(
        self, camera: PTZCamera, points_m: ArrayLike, normals: ArrayLike, appearance: Appearance | None = None
    ) -> Floats:
        """px², R_k (N, 2, 2) of one camera at `points_m` (N, 3) with unit `normals` (N, 3)."""
        points, directions = as_points(points_m), as_points(normals, "normals")
        if points.ndim != 2 or points.shape != directions.shape:
            raise ShapeError(f"points_m {points.shape} and normals {directions.shape}; allowed are two alike, (N, 3)")
        views = Views([camera], points, directions, appearance)
        return np.asarray(self.of_views(views).matrix(1, len(points))[0])

    def without(self, *names: str) -> NoiseModel:
        """The model with the named factors switched off; "distance" and "incidence" switch off their part of Eq. 11.

        Raises:
            RangeError: a factor that the model doesn't have, or no factor left.
        """
        factors = list(self.factors)
        for name in names:
            if name in EQUATION_11_PARTS and any(isinstance(factor, DistanceIncidence) for factor in factors):
                factors = [_without_part(factor, name) for factor in factors]
                # Eq. 11 with neither part is the same for all points: it is off.
                factors = [
                    f for f in factors if not (isinstance(f, DistanceIncidence) and not (f.distance or f.incidence))
                ]
            else:
                self._require(name)
                factors = [factor for factor in factors if factor.name != name]
        suffix = "".join(f" without {name}" for name in names)
        return NoiseModel(self.name + suffix, tuple(factors))

    def weighted(self, weights: Mapping[str, float], name: str | None = None) -> NoiseModel:
        """The model with the covariances of the named factors multiplied by `weights`, of 0 or more."""
        for factor in weights:
            self._require(factor)
        factors = tuple(Weighted(f, weights[f.name]) if f.name in weights else f for f in self.factors)
        return NoiseModel(self.name + " weighted" if name is None else name, factors)

    def plus(self, *factors: NoiseFactor) -> NoiseModel:
        """The model with further factors."""
        return NoiseModel(self.name + "".join(f" + {f.name}" for f in factors), self.factors + factors)

    def _require(self, name: str) -> None:
        have = [factor.name for factor in self.factors]
        if name not in have:
            raise RangeError(f"noise factor {name!r} is not in {self.name!r}; allowed: {', '.join(have)}")


def _without_part(factor: NoiseFactor, part: str) -> NoiseFactor:
    if not isinstance(factor, DistanceIncidence):
        return factor
    return dataclasses.replace(
        factor, distance=factor.distance and part != "distance", incidence=factor.incidence and part != "incidence"
    )


NOISE_MODELS = ("as-printed", "corrected", "physical", "identity")


def noise_model(
    name: str | Path,
    *,
    switched_off: Iterable[str] = (),
    ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE,
    px2_per_m2: float = 1.0,
    sensor: ImageSensor | Mapping[str, ImageSensor] | None = None,
) -> NoiseModel:
    """The noise model called `name`.

    "as-printed" is Eqs. 11–15, "corrected" has D²/cos α in Eq. 11, "physical" is the tag's edges against the sensor's
    noise (it needs `appearance` in `pss.evaluate`), "identity" is R = I. The path of a calibration (.toml) is the
    model that it describes.

    Args:
        switched_off: names of factors to leave out: "distance-incidence" (or "distance", "incidence"), "resolution",
            "defocus". They are the paper's; the models "physical" and "identity" have none of them.
        ccd_noise: dark noise over full well, for Eqs. 12 and 13; a number, or one for each camera by name.
        px2_per_m2: px²/m², the scale of Eq. 11.
        sensor: for "physical"; one for all cameras, or one for each by name.

    Raises:
        RangeError: an unknown name of a model or a factor, or a constant out of range.
    """
    if isinstance(switched_off, str):
        raise RangeError(f"switched_off = {switched_off!r}; allowed: a list of names")
    off = tuple(switched_off)
    of_file = str(name).endswith(".toml")
    if name not in NOISE_MODELS and not of_file:
        raise RangeError(f"noise model {name!r}; allowed: {', '.join(NOISE_MODELS)}, or a calibration's path (.toml)")
    dark = ccd_noise.values() if isinstance(ccd_noise, Mapping) else [ccd_noise]
    scales = [*(number(value, "ccd_noise") for value in dark), number(px2_per_m2, "px2_per_m2")]
    if not all(scale > 0 for scale in scales):
        raise RangeError(f"ccd_noise = {ccd_noise!r}, px2_per_m2 = {px2_per_m2!r}; allowed: above 0")
    if of_file:
        calibration = Calibration.from_file(name)
        return NoiseModel(calibration.name, calibration.factors(sensor, ccd_noise)).without(*off)
    if name == "identity":
        return NoiseModel("identity", (IdentityNoise(),)).without(*off)
    if name == "physical":
        factor = BrightnessContrast(ImageSensor() if sensor is None else sensor)
        return NoiseModel("physical", (factor,)).without(*off)
    first = DistanceIncidence(corrected=name == "corrected", px2_per_m2=px2_per_m2)
    return NoiseModel(str(name), (first, Resolution(ccd_noise), Defocus())).without(*off)
