"""The paper's quality factors of section 4.1, Eqs. 11–15, each with the covariance it adds to R_k.

Eq. 11 adds m² to px²; it is kept as printed, with an explicit scale between them (`px2_per_m2`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from pss.cameras.views import Views
from pss.errors import PSSError, RangeError, ShapeError
from pss.inputs import number, numbers
from pss.noise.covariance import PixelCovariance

__all__ = [
    "DEFAULT_CCD_NOISE",
    "SMALLEST_COS_INCIDENCE",
    "Defocus",
    "DistanceIncidence",
    "FactorOfParts",
    "IdentityNoise",
    "NoiseFactor",
    "Resolution",
    "Weighted",
    "covariance_of",
]

T = TypeVar("T")

# Dark noise over full well (6 e⁻ over 10 000 e⁻), the default without a sensor; scenes use their own.
DEFAULT_CCD_NOISE = 6e-4
# D²/cos α is unbounded at grazing incidence; beyond 89.4° no target can be measured anyway.
SMALLEST_COS_INCIDENCE = 0.01
# A matrix less symmetric than this (relative to its largest entry) is an error, not rounding.
SYMMETRY_TOLERANCE = 1e-9


class NoiseFactor(Protocol):
    """One quality factor. A user-defined factor is any object with these two members.

    Its `covariance` may also return an array (C, N, 2, 2) of matrices, or one that broadcasts to it: see
    `covariance_of`.
    """

    @property
    def name(self) -> str:
        """The factor's name in switches, weights and lists."""
        ...

    def covariance(self, views: Views) -> PixelCovariance:
        """px², the factor's contribution to R in each of the `views`: arrays that broadcast to (C, N)."""
        ...


@runtime_checkable
class FactorOfParts(NoiseFactor, Protocol):
    """A factor whose parts can be switched off individually, by their own names."""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of all its parts; switching off one that is off already has no effect."""
        ...

    def without(self, part: str) -> NoiseFactor | None:
        """The factor with the part switched off; None if no part remains."""
        ...


EQUATION_11_PARTS = ("distance", "incidence")


@dataclass(frozen=True)
class DistanceIncidence:
    """Object distance and incidence angle, Eq. 11.

    Attributes:
        corrected: False for D² cos α as printed; True for D² / cos α, in agreement with the sentence before Eq. 11
            (accuracy increases with cos α, so that the noise must decrease with it).
        px2_per_m2: px²/m², the scale that Eq. 11 does not define.
        distance: False for D = 1 m everywhere.
        incidence: False for cos α = 1 everywhere.

    Its parts are "distance" and "incidence".
    """

    corrected: bool = False
    px2_per_m2: float = 1.0
    distance: bool = True
    incidence: bool = True
    name: str = "distance-incidence"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², isotropic."""
        variance = views.range_m**2 if self.distance else np.ones_like(views.range_m)
        if self.incidence and self.corrected:
            variance = variance / np.maximum(views.cos_incidence, SMALLEST_COS_INCIDENCE)
        elif self.incidence:
            variance = variance * np.maximum(views.cos_incidence, 0.0)  # Eq. 11
        return PixelCovariance.isotropic(self.px2_per_m2 * variance)

    @property
    def parts(self) -> tuple[str, ...]:
        """Both, whether they are on or off."""
        return EQUATION_11_PARTS

    def without(self, part: str) -> DistanceIncidence | None:
        """Eq. 11 without one of its parts; None without both, since it is then the same for all points."""
        distance, incidence = self.distance and part != "distance", self.incidence and part != "incidence"
        return replace(self, distance=distance, incidence=incidence) if distance or incidence else None


@dataclass(frozen=True)
class Resolution:
    """Image resolution, Eqs. 12 and 13: black-level noise times the sensor's size in pixels times cos θ.

    Attributes:
        ccd_noise: CCDnoise_k, dark noise over full well (the paper: "measured sensor black-level noise"); no unit. A
            number for all cameras, or one for each by the camera's name.
    """

    ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE
    name: str = "resolution"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², diagonal."""
        if isinstance(self.ccd_noise, Mapping):
            noise = np.array([of_camera(self.ccd_noise, camera.name, "ccd_noise") for camera in views.cameras])[:, None]
        else:
            noise = np.array([[self.ccd_noise]])
        scaled = noise * views.cos_off_axis
        # Eqs. 12 and 13.
        return PixelCovariance.diagonal((scaled * views.arrays.width) ** 2, (scaled * views.arrays.height) ** 2)


@dataclass(frozen=True)
class Defocus:
    """Focus distance and depth of field, Eqs. 14 and 15: the squared diameter of the circle of confusion."""

    name: str = "defocus"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², isotropic."""
        return PixelCovariance.isotropic(views.circle_of_confusion_px**2)  # Eq. 15


@dataclass(frozen=True)
class IdentityNoise:
    """R = I: the same noise everywhere. It is not a factor of the paper, but an ablation that shows the effect of R."""

    variance_px2: float = 1.0
    name: str = "identity"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², isotropic."""
        return PixelCovariance.isotropic(self.variance_px2)


@dataclass(frozen=True)
class Weighted:
    """A factor times a weight of 0 or more."""

    factor: NoiseFactor
    weight: float

    def __post_init__(self) -> None:
        if not 0 <= number(self.weight, f"weight of {self.factor.name!r}", "0 or more, finite") < math.inf:
            raise RangeError(f"weight of {self.factor.name!r} = {self.weight!r}; allowed: 0 or more, finite")

    @property
    def name(self) -> str:
        """The factor's name."""
        return self.factor.name

    @property
    def parts(self) -> tuple[str, ...]:
        """The factor's parts; empty for a factor without parts."""
        return self.factor.parts if isinstance(self.factor, FactorOfParts) else ()

    def without(self, part: str) -> Weighted | None:
        """The factor without the part, with the same weight."""
        assert isinstance(self.factor, FactorOfParts)  # it has the part
        left = self.factor.without(part)
        return None if left is None else Weighted(left, self.weight)

    def covariance(self, views: Views) -> PixelCovariance:
        """px², the factor's covariance times the weight."""
        return covariance_of(self.factor, views) * self.weight


def covariance_of(factor: NoiseFactor, views: Views) -> PixelCovariance:
    """px², the contribution of `factor` to R in each of the `views`, from a `PixelCovariance` or from matrices.

    Matrices are an array (..., 2, 2) that broadcasts to (C, N, 2, 2), with nan or infinity for points not visible.

    Raises:
        ShapeError: the factor returns another shape.
        RangeError: it raises, returns neither, or matrices that are not symmetric positive semidefinite.
    """
    owner = f"noise factor {factor.name!r}"
    try:
        returned: object = factor.covariance(views)
    except (PSSError, MemoryError):
        raise
    except Exception as error:  # third-party code: the message needs the factor's name
        raise RangeError(f"{owner} raised {type(error).__name__}: {error}; allowed: a factor that returns R") from error
    count = (len(views.cameras), len(views.points_m))
    matrices = f"an array of matrices in px² that broadcasts to {(*count, 2, 2)}"
    allowed = f"a PixelCovariance, such as PixelCovariance.isotropic(variance_px2), or {matrices}"
    if isinstance(returned, PixelCovariance):
        shapes = [np.shape(entry) for entry in (returned.uu, returned.vv, returned.uv)]
        if not all(_broadcasts(shape, count) for shape in shapes):
            raise ShapeError(f"{owner} returns entries of shapes {shapes}; allowed: those that broadcast to {count}")
        return returned
    array = numbers(returned, f"what {owner} returns", allowed)
    if array.shape[-2:] != (2, 2) or not _broadcasts(array.shape[:-2], count):
        raise ShapeError(f"{owner} returns an array of shape {array.shape}; allowed: {allowed}")
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.abs(array).max(axis=(-1, -2))
        skew = np.abs(array[..., 0, 1] - array[..., 1, 0])
        uu, vv, uv = array[..., 0, 0], array[..., 1, 1], array[..., 0, 1]
        wrong = (skew > SYMMETRY_TOLERANCE * largest) | (uu < 0) | (vv < 0)
        # The roots keep the product of two small or large variances finite.
        wrong |= np.abs(uv) > (1 + SYMMETRY_TOLERANCE) * np.sqrt(np.abs(uu)) * np.sqrt(np.abs(vv))
    if wrong.any():
        worst = array[tuple(np.argwhere(wrong)[0])].tolist()
        raise RangeError(f"{owner} returns the matrix {worst}; allowed: symmetric positive semidefinite, in px²")
    return PixelCovariance.from_matrix(array)


def _broadcasts(shape: tuple[int, ...], to: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(shape, to) == to
    except ValueError:
        return False


def of_camera(values: Mapping[str, T], name: str, what: str) -> T:
    """The value of the camera called `name`."""
    if name not in values:
        raise RangeError(f"{what} has no value for the camera {name!r}; allowed: {', '.join(values)}")
    return values[name]
