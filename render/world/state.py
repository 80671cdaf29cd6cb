"""The scene state: everything that determines a view, except the camera. Plain data, without a renderer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pss import Box, RangeError, Rectangle, Sphere
from pss.hints import Floats
from pss.surrogates import Mesh

__all__ = ["Light", "Marker", "MarkerPrint", "Motion", "Panel", "Room", "SceneObject", "SceneState"]


@dataclass(frozen=True)
class Room:
    """A box of walls, centred on x = y = 0 with its floor at z = 0; sizes in metres, albedos between 0 and 1."""

    width_m: float
    length_m: float
    height_m: float
    wall_albedo: float
    floor_albedo: float
    ceiling_albedo: float


@dataclass(frozen=True)
class Panel:
    """A lamp in the ceiling that shines downwards: centre (x, y) and size along x and y, in metres."""

    centre_m: tuple[float, float]
    size_m: tuple[float, float]


@dataclass(frozen=True)
class Light:
    """Lamps in the ceiling, or a ring light at each camera, strobed so that each camera has its own light only.

    Attributes:
        radiance_w_per_m2_sr: W/(m² sr) within the sensor's band, of all panels.
        panels: the lamps; none with ring lights.
        ring_w_per_sr: W/sr, intensity of a camera's ring light, the same in all directions; 0 for lamps. Its
            reflections from other surfaces are neglected: a strobe's first bounce is at most a hundredth of it.
    """

    radiance_w_per_m2_sr: float
    panels: tuple[Panel, ...]
    ring_w_per_sr: float = 0.0

    def __post_init__(self) -> None:
        if self.ring_w_per_sr > 0 and self.panels:
            raise RangeError(f"Light has {len(self.panels)} panels and a ring light; allowed: one of the two")


@dataclass(frozen=True)
class MarkerPrint:
    """Print of the markers.

    Attributes:
        dictionary: name of the OpenCV dictionary, such as "DICT_4X4_100".
        quiet_zone_modules: width of the white margin around the black border, in modules.
        white_albedo, black_albedo: diffuse reflectance of paper and ink, 0 to 1.
    """

    dictionary: str
    quiet_zone_modules: float
    white_albedo: float
    black_albedo: float


@dataclass(frozen=True)
class Marker:
    """A flat square marker: its centre is a point of interest.

    Attributes:
        id: its number in the dictionary.
        object_name: name of the object that bears it.
        centre_m: m, (3,).
        normal: unit outward normal of its face, (3,).
        up: unit vector from its centre to the top of its print, (3,).
        module_m: m, side of one black or white module.
    """

    id: int
    object_name: str
    centre_m: tuple[float, float, float]
    normal: tuple[float, float, float]
    up: tuple[float, float, float]
    module_m: float

    @property
    def right(self) -> Floats:
        """Unit vector to the right as seen from the front, (3,)."""
        return np.cross(self.up, self.normal)


@dataclass(frozen=True)
class Motion:
    """Motion of a rigid object during the exposure; its shape states its position at the middle of the exposure.

    Attributes:
        velocity_m_per_s: m/s in the world, (3,).
        turn_rate_deg_per_s: °/s about the world's axes, (3,): its direction is the axis, by the right-hand rule.
        about_m: m, a point on the axis, (3,).
    """

    velocity_m_per_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_rate_deg_per_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    about_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SceneObject:
    """A shape with its diffuse reflectance (0 to 1), and its motion during an exposure (None: at rest)."""

    shape: Rectangle | Sphere | Box | Mesh
    albedo: float
    motion: Motion | None = None


@dataclass(frozen=True)
class SceneState:
    """Room, light, objects and markers: what determines a view besides the camera and its sensor."""

    room: Room
    light: Light
    objects: tuple[SceneObject, ...]
    markers: tuple[Marker, ...]
    print: MarkerPrint

    @property
    def points_m(self) -> Floats:
        """Metres, the points of interest: the markers' centres, (N, 3)."""
        return np.array([marker.centre_m for marker in self.markers], dtype=float).reshape(-1, 3)

    @property
    def normals(self) -> Floats:
        """Unit normals at the points of interest, (N, 3)."""
        return np.array([marker.normal for marker in self.markers], dtype=float).reshape(-1, 3)

    @property
    def occluders(self) -> tuple[Rectangle | Sphere | Box | Mesh, ...]:
        """The shapes that block lines of sight."""
        return tuple(item.shape for item in self.objects)
