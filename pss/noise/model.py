"""R_k as the sum of its factors (section 4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.cameras.appearance import Appearance
from pss.cameras.camera import PTZCamera, as_points
from pss.cameras.views import Views
from pss.errors import RangeError, ShapeError
from pss.hints import Floats
from pss.inputs import members
from pss.noise.covariance import PixelCovariance
from pss.noise.factors import FactorOfParts, NoiseFactor, Weighted, covariance_of

__all__ = ["NoiseModel"]


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
        """px², R_k in each of the `views`: arrays that broadcast to (C, N)."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # of points that are not visible
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

    @property
    def switches(self) -> tuple[str, ...]:
        """Names of its factors, then of their parts, which can be switched off."""
        return _switches(self.factors)

    def without(self, *names: str) -> NoiseModel:
        """The model with the named factors, or parts of one (`FactorOfParts`), switched off.

        Raises:
            RangeError: a factor that the model does not have, or no factor remains.
        """
        factors = list(self.factors)
        for name in names:
            if name not in _switches(factors):
                raise RangeError(f"noise factor {name!r} is not in {self.name!r}; allowed: {', '.join(self.switches)}")
            factors = [left for factor in factors if (left := _without(factor, name)) is not None]
        suffix = "".join(f" without {name}" for name in names)
        return NoiseModel(self.name + suffix, tuple(factors))

    def weighted(self, weights: Mapping[str, float], name: str | None = None) -> NoiseModel:
        """The model with the covariances of the named factors multiplied by `weights`.

        Args:
            weights: 0 or more, by name of the factor.
            name: of the new model; None appends " weighted".

        Raises:
            RangeError: a factor that the model does not have, or a weight out of range.
        """
        existing = [factor.name for factor in self.factors]
        for factor in weights:
            if factor not in existing:
                raise RangeError(f"noise factor {factor!r} is not in {self.name!r}; allowed: {', '.join(existing)}")
        factors = tuple(Weighted(f, weights[f.name]) if f.name in weights else f for f in self.factors)
        return NoiseModel(self.name + " weighted" if name is None else name, factors)

    def plus(self, *factors: NoiseFactor) -> NoiseModel:
        """The model with further factors."""
        return NoiseModel(self.name + "".join(f" + {f.name}" for f in factors), self.factors + factors)


def _switches(factors: Sequence[NoiseFactor]) -> tuple[str, ...]:
    parts = (part for factor in factors if isinstance(factor, FactorOfParts) for part in factor.parts)
    return tuple(dict.fromkeys((*(factor.name for factor in factors), *parts)))


def _without(factor: NoiseFactor, name: str) -> NoiseFactor | None:
    """A factor without the factor, or its part, of that name; None if it is removed."""
    if factor.name == name:
        return None
    return factor.without(name) if isinstance(factor, FactorOfParts) and name in factor.parts else factor
