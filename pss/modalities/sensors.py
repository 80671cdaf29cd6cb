"""Sensors other than cameras: each adds its HᵀR⁻¹H to a point's information (Eq. 5).

The paper (section 3.1): "their contributions can be accounted for with sensor-specific measurement functions".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pss.cameras.camera import PTZCamera, as_points
from pss.cameras.views import Views
from pss.errors import GeometryError, RangeError, ShapeError
from pss.hints import Bools, Floats
from pss.inputs import number, numbers, place
from pss.surrogates import Shape, any_blocks
from pss.visibility.points import CLEARANCE_M, FieldOfView, Occlusion, SelfOcclusion, visible_in

__all__ = ["Bearing", "DepthCamera", "PositionFix", "RangeBeacon", "Sensor"]


class Sensor(Protocol):
    """A sensor that measures m numbers of a point's position or state. User-defined sensors have these members."""

    @property
    def name(self) -> str:
        """The sensor's name in tables."""
        ...

    def measure(self, points_m: Floats) -> Floats:
        """The noise-free measurements of points (N, 3), (N, m)."""
        ...

    def jacobian(self, points_m: Floats) -> Floats:
        """∂measurement/∂position at points (N, 3), (N, m, 3); or by all n numbers of the state, (N, m, n)."""
        ...

    def covariance(self, points_m: Floats) -> Floats:
        """Covariance of the measurements at points (N, 3), (N, m, m), positive definite."""
        ...

    def reaches(self, points_m: Floats, normals: Floats, occluder: Sequence[Shape]) -> Bools:
        """Whether the sensor measures each of the points (N, 3) with normals (N, 3), (N,)."""
        ...


def _positive(owner: str, **values: float) -> None:
    for name, value in values.items():
        if not 0 < number(value, f"{owner}.{name}", "above 0, finite") < math.inf:
            raise RangeError(f"{owner}.{name} = {value!r}; allowed: above 0, finite")


def _away(position_m: tuple[float, float, float], points_m: Floats, name: str) -> tuple[Floats, Floats]:
    """m, vectors (N, 3) and distances (N,) from a position to points."""
    away = as_points(points_m) - np.array(position_m)
    distance = np.linalg.norm(away, axis=-1)
    if (distance == 0).any():
        raise GeometryError(f"a point lies at {name}'s own place {tuple(position_m)}, where it has no direction")
    return away, distance


def _in_reach(
    position_m: tuple[float, float, float],
    furthest_m: float,
    blocked_by_shapes: bool,
    points_m: Floats,
    normals: Floats,
    occluder: Sequence[Shape],
) -> Bools:
    away = points_m - np.array(position_m)
    distance = np.linalg.norm(away, axis=-1)
    near = np.asarray((distance > 0) & (distance <= furthest_m))
    if not blocked_by_shapes or not occluder:
        return near
    ends = points_m + CLEARANCE_M * normals
    starts = np.broadcast_to(np.array(position_m, dtype=float), ends.shape)
    return np.asarray(near & ~any_blocks(occluder, starts, ends))


@dataclass(frozen=True)
class RangeBeacon:
    """Distance to a beacon, as measured by the acoustic tracker that the paper cites.

    Attributes:
        position_m: m, (3,).
        sigma_m: m, standard deviation of a distance.
        furthest_m: m, reach.
        blocked_by_shapes: whether shapes block it (sound bends around small objects).
    """

    position_m: tuple[float, float, float]
    sigma_m: float
    furthest_m: float = math.inf
    blocked_by_shapes: bool = True
    name: str = "range"

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", place(self.position_m, "RangeBeacon.position_m"))
        _positive("RangeBeacon", sigma_m=self.sigma_m)

    def measure(self, points_m: Floats) -> Floats:
        """m, (N, 1)."""
        return _away(self.position_m, points_m, self.name)[1][:, None]

    def jacobian(self, points_m: Floats) -> Floats:
        """The unit vectors from the beacon, (N, 1, 3)."""
        away, distance = _away(self.position_m, points_m, self.name)
        return (away / distance[:, None])[:, None, :]

    def covariance(self, points_m: Floats) -> Floats:
        """m², (N, 1, 1)."""
        return np.full((len(points_m), 1, 1), self.sigma_m**2)

    def reaches(self, points_m: Floats, normals: Floats, occluder: Sequence[Shape]) -> Bools:
        """Within reach, and not occluded if that matters, (N,)."""
        return _in_reach(self.position_m, self.furthest_m, self.blocked_by_shapes, points_m, normals, occluder)


@dataclass(frozen=True)
class Bearing:
    """Direction to a point, in radians: azimuth about world z (0 along +y, positive to +x) and elevation.

    Attributes:
        position_m: m, (3,).
        sigma_rad: rad, standard deviation of a direction across the line of sight, the same on both axes.
        furthest_m: m, reach.
        blocked_by_shapes: whether shapes block it.
    """

    position_m: tuple[float, float, float]
    sigma_rad: float
    furthest_m: float = math.inf
    blocked_by_shapes: bool = True
    name: str = "bearing"

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", place(self.position_m, "Bearing.position_m"))
        _positive("Bearing", sigma_rad=self.sigma_rad)

    def measure(self, points_m: Floats) -> Floats:
        """rad, azimuth and elevation, (N, 2)."""
        away, _ = self._off_the_pole(points_m)
        return np.column_stack(
            [np.arctan2(away[:, 0], away[:, 1]), np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1]))]
        )

    def jacobian(self, points_m: Floats) -> Floats:
        """rad/m, (N, 2, 3)."""
        away, distance = self._off_the_pole(points_m)
        x, y, z = away.T
        level = np.hypot(x, y)
        rows = np.zeros((len(away), 2, 3))
        rows[:, 0, 0], rows[:, 0, 1] = y / level**2, -x / level**2
        rows[:, 1, 0], rows[:, 1, 1] = -x * z / (level * distance**2), -y * z / (level * distance**2)
        rows[:, 1, 2] = level / distance**2
        return rows

    def covariance(self, points_m: Floats) -> Floats:
        """rad², (N, 2, 2): the azimuth's σ grows as 1/cos(elevation)."""
        away, distance = self._off_the_pole(points_m)
        cos_elevation = np.hypot(away[:, 0], away[:, 1]) / distance
        covariance = np.zeros((len(away), 2, 2))
        covariance[:, 0, 0] = (self.sigma_rad / cos_elevation) ** 2
        covariance[:, 1, 1] = self.sigma_rad**2
        return covariance

    def reaches(self, points_m: Floats, normals: Floats, occluder: Sequence[Shape]) -> Bools:
        """Within reach, not straight above or below, and not occluded if that matters, (N,)."""
        near = _in_reach(self.position_m, self.furthest_m, self.blocked_by_shapes, points_m, normals, occluder)
        return np.asarray(near & (np.linalg.norm(points_m[:, :2] - np.array(self.position_m[:2]), axis=1) > 0))

    def _off_the_pole(self, points_m: Floats) -> tuple[Floats, Floats]:
        away, distance = _away(self.position_m, points_m, self.name)
        if (np.hypot(away[:, 0], away[:, 1]) == 0).any():
            raise GeometryError(f"a point lies straight above or below {self.name}, where it has no azimuth")
        return away, distance


@dataclass(frozen=True)
class DepthCamera:
    """A camera that also measures the depth along its axis: (u, v, depth).

    Attributes:
        camera: the camera.
        sigma_px: px, standard deviation of each image coordinate.
        sigma_depth_m: m, of the depth at a depth of 1 m.
        depth_power: exponent with which the depth's σ grows with depth (stereo: 2; time of flight: about 1).
        furthest_m: m, largest depth.
    """

    camera: PTZCamera
    sigma_px: float
    sigma_depth_m: float
    depth_power: float = 2.0
    furthest_m: float = math.inf
    name: str = "depth-camera"

    def __post_init__(self) -> None:
        _positive("DepthCamera", sigma_px=self.sigma_px, sigma_depth_m=self.sigma_depth_m)

    def measure(self, points_m: Floats) -> Floats:
        """px, px and m, (N, 3)."""
        pixels, depth = self.camera.project(points_m)
        return np.column_stack([pixels, depth])

    def jacobian(self, points_m: Floats) -> Floats:
        """px/m, px/m and 1, (N, 3, 3)."""
        of_depth = np.broadcast_to(self.camera.rotation[2], (len(points_m), 1, 3))
        return np.concatenate([self.camera.jacobian(points_m), of_depth], axis=1)

    def covariance(self, points_m: Floats) -> Floats:
        """px², px² and m², (N, 3, 3)."""
        depth = np.abs(self.camera.project(points_m)[1])
        covariance = np.zeros((len(points_m), 3, 3))
        covariance[:, 0, 0] = covariance[:, 1, 1] = self.sigma_px**2
        covariance[:, 2, 2] = (self.sigma_depth_m * depth**self.depth_power) ** 2
        return covariance

    def reaches(self, points_m: Floats, normals: Floats, occluder: Sequence[Shape]) -> Bools:
        """Whether the camera sees the point, up to its largest depth, (N,)."""
        views = Views([self.camera], points_m, normals)
        seen = visible_in(views, occluder, (FieldOfView(), SelfOcclusion(), Occlusion()))
        return np.asarray(seen[0] & (views.depth_m[0] <= self.furthest_m))


@dataclass(frozen=True)
class PositionFix:
    """The position itself, everywhere: satellite navigation, a floor sensor, a prior.

    Attributes:
        sigma_m: m, standard deviation along each axis, or along x, y and z.
    """

    sigma_m: float | tuple[float, float, float]
    name: str = "position-fix"

    def __post_init__(self) -> None:
        sigma = numbers(self.sigma_m, "PositionFix.sigma_m", "a number, or (3,)")
        if sigma.shape not in ((), (3,)):
            raise ShapeError(f"PositionFix.sigma_m has shape {sigma.shape}; allowed: a number, or (3,)")
        for value in np.atleast_1d(sigma):
            _positive("PositionFix", sigma_m=float(value))
        object.__setattr__(self, "sigma_m", tuple(sigma.tolist()) if sigma.ndim else float(sigma))

    def measure(self, points_m: Floats) -> Floats:
        """m, (N, 3)."""
        return as_points(points_m).copy()

    def jacobian(self, points_m: Floats) -> Floats:
        """The identity, (N, 3, 3)."""
        return np.broadcast_to(np.eye(3), (len(points_m), 3, 3))

    def covariance(self, points_m: Floats) -> Floats:
        """m², (N, 3, 3)."""
        return np.broadcast_to(np.diag(np.broadcast_to(self.sigma_m, 3) ** 2), (len(points_m), 3, 3))

    def reaches(self, points_m: Floats, normals: Floats, occluder: Sequence[Shape]) -> Bools:
        """Everywhere, (N,)."""
        return np.ones(len(points_m), dtype=np.bool_)
