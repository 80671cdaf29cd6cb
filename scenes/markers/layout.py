"""Layout of markers on an object: plates, their corners, and overlaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from pss import Rectangle, Sphere
from pss.hints import Floats
from render.world.state import Marker
from scenes.schema.dictionaries import Dictionary
from scenes.schema.object_tables import GridSpec, PlacedSpec, SpiralSpec

__all__ = [
    "largest_spiral_module_m",
    "marker_at",
    "markers_on",
    "overlapping",
    "placed_marker",
    "plate_corners_m",
    "plate_side_m",
]


# Only half of the rays would hit a plate coplanar with its surface; 0.5 mm is strong paper.
PLATE_OFFSET_M = 0.5e-3
# At the pole of a ball no tangent is nearer to "up" than another.
POLE_SINE = 1e-6
# Plates that share an edge, as in a full grid, do not overlap.
TOUCHING = 1e-9
# Plates on flat faces count as neighbours if they are coplanar within this distance.
SAME_PLANE_M = 0.01
# The largest module in a message is rounded down to this.
MODULE_STEP_M = 1e-6
MODULE_STEP_SHARE = 1e-9


def plate_side_m(module_m: float, dictionary: Dictionary, quiet_zone_modules: float) -> float:
    """Metres, side of the plate of a marker with its white margin."""
    return module_m * (dictionary.modules + 2 * quiet_zone_modules)


def upwards(normal: ArrayLike) -> Floats:
    """The unit tangent nearest to world up at a surface of unit `normal` (3,); at a pole the one nearest to +y."""
    n = np.asarray(normal, dtype=float)
    for axis in (np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])):
        tangent = axis - (axis @ n) * n
        if np.linalg.norm(tangent) > POLE_SINE:
            break
    return tangent / np.linalg.norm(tangent)


def markers_on(shape: Rectangle | Sphere, spec: GridSpec | SpiralSpec) -> list[Marker]:
    """The markers of `spec` on `shape`, numbered from its first id."""
    if isinstance(shape, Rectangle):
        points, normals = shape.grid(spec.columns, spec.rows)
        ups = np.broadcast_to(shape.up, points.shape)
    else:
        points, normals = shape.spiral(spec.count)
        ups = np.array([upwards(normal) for normal in normals])
    return [
        marker_at(spec.first_id + number, shape.name, point, normal, up, spec.module_mm)
        for number, (point, normal, up) in enumerate(zip(points, normals, ups, strict=True))
    ]


def placed_marker(spec: PlacedSpec) -> Marker | None:
    """The marker of `spec`; None if its normal and up are not independent directions."""
    normal, up = np.array(spec.normal), None if spec.up is None else np.array(spec.up)
    if not np.linalg.norm(normal) > 0:
        return None
    normal = normal / np.linalg.norm(normal)
    if up is None:
        up = upwards(normal)
    else:
        length = np.linalg.norm(up)
        up = up - (up @ normal) * normal
        if not np.linalg.norm(up) > POLE_SINE * length:
            return None
        up = up / np.linalg.norm(up)
    return marker_at(spec.id, spec.object, np.array(spec.centre_m), normal, up, spec.module_mm)


def marker_at(number: int, owner: str, on_surface_m: Floats, normal: Floats, up: Floats, module_mm: float) -> Marker:
    """The marker whose plate is `PLATE_OFFSET_M` above a point (3,) of a surface of unit `normal` (3,)."""
    centre_m = on_surface_m + PLATE_OFFSET_M * normal
    return Marker(number, owner, _triple(centre_m), _triple(normal), _triple(up), module_mm * 1e-3)


def _triple(vector: Floats) -> tuple[float, float, float]:
    x, y, z = (float(component) for component in vector)
    return x, y, z


def plate_corners_m(marker: Marker, side_m: float) -> Floats:
    """Metres, corners of a marker's plate, in order around it, (4, 3)."""
    right, up = side_m / 2 * marker.right, side_m / 2 * np.array(marker.up)
    return np.array(marker.centre_m) + np.array([up - right, up + right, right - up, -right - up])


def overlapping(markers: list[Marker], sides_m: list[float], shape: object) -> Iterator[tuple[int, int]]:
    """The pairs of `markers`, all on `shape`, whose plates overlap.

    Projected from a point behind the surface (the centre of a ball), plates are convex polygons on a sphere. They are
    disjoint if and only if the plane through the point and a side of one separates them.
    """
    corners = np.array([plate_corners_m(marker, side) for marker, side in zip(markers, sides_m, strict=True)])
    centres = np.array([marker.centre_m for marker in markers])
    normals = np.array([marker.normal for marker in markers])
    if isinstance(shape, Sphere):
        apexes = np.broadcast_to(np.array(shape.centre_m), centres.shape)
        # The angle between two plates on the sphere against the sum of their half diagonals.
        arms = np.linalg.norm(centres - apexes, axis=1)
        reach = np.arctan2(np.sqrt(0.5) * np.array(sides_m), arms)
        sky = (centres - apexes) / arms[:, None]
        near = np.arccos(np.clip(sky @ sky.T, -1, 1)) <= reach[:, None] + reach
    else:
        apexes = centres - normals
        reach = np.sqrt(0.5) * np.array(sides_m)
        apart = np.abs(((centres - centres[:, None]) * normals[:, None]).sum(axis=-1))
        near = (normals @ normals.T > 0) & (apart <= SAME_PLANE_M)
        near &= np.linalg.norm(centres - centres[:, None], axis=-1) <= reach[:, None] + reach
    for first, second in np.argwhere(np.triu(near, 1)):
        a, b = corners[first] - apexes[first], corners[second] - apexes[first]
        if not (_a_side_parts(a, b) or _a_side_parts(b, a)):
            yield int(first), int(second)


def _a_side_parts(cone: Floats, other: Floats) -> bool:
    sides = np.cross(cone, np.roll(cone, -1, axis=0))
    sides *= np.sign((sides * cone.mean(axis=0)).sum(axis=1))[:, None]  # inwards
    return bool((sides @ other.T <= TOUCHING).all(axis=1).any())


def largest_spiral_module_m(shape: Sphere, spec: SpiralSpec, side_modules: float) -> float:
    """Metres, the requested module if its plates fit the ball and stay apart, else the largest that does.

    Plates, `side_modules` wide, fit a ball if they are no larger than the square within its outline, whose corners
    stand off by at most 0.41 radii.
    """
    fits = 2**0.5 * shape.radius_m / side_modules
    markers = markers_on(shape, spec)

    def apart(module_m: float) -> bool:
        sides = [module_m * side_modules] * len(markers)
        return next(overlapping(markers, sides, shape), None) is None

    low, high = 0.0, min(fits, spec.module_mm * 1e-3)
    if apart(high):
        return high
    # For a ball of millions of kilometres the step is below double precision.
    while high - low > max(MODULE_STEP_M, MODULE_STEP_SHARE * high):
        middle = (low + high) / 2
        low, high = (middle, high) if apart(middle) else (low, middle)
    return low
