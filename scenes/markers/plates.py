"""The surface under a marker's plate, and whether the plate may be glued to it.

A flat marker on a curved surface may stand off by its sagitta plus 2 mm. A plate that cuts through a surface, extends
over an edge, or stands off further is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pss import Box, Rectangle, Sphere
from pss.hints import Bools, Floats
from pss.surrogates import Mesh, Shape, any_blocks
from render.world.meshes import skin
from render.world.state import Marker
from scenes.markers.layout import upwards
from scenes.mesh_file import contains

__all__ = ["Seat", "Solid", "Under", "crosses", "places", "seat", "stand_off_problem", "surface_under"]

Solid = Rectangle | Sphere | Box | Mesh

# A plate is tested at this many places along each side, including its rim.
PLACES = 9
# Largest stand-off of a plate, whatever its surface.
FLOAT_M = 2e-3
# A surface counts as under a plate down to this share of the plate's side …
DEEPEST_SHARE = 0.5
# … and as in its way up to this share.
HIGHEST_SHARE = 0.125
# No more curved than a ball whose radius is the plate's side: its sagitta is 1 − √½ of that.
MOST_SAGITTA_SHARE = 0.3
# Edges shared by faces belong to both, within this share of a plate's side.
ON_EDGE = 1e-9
# Rounding of places in a room.
ROUNDING_M = 1e-7


@dataclass(frozen=True, eq=False)
class Under:
    """The surface under a plate, as heights over the plate's plane in metres.

    Attributes:
        heights_m: at `PLACES` × `PLACES` places, row by row (PLACES²,); nan for nothing or an inside.
        highest_m: maximum within the plate's outline, also between its places.
    """

    heights_m: Floats
    highest_m: float


@dataclass(frozen=True, eq=False)
class Seat:
    """The position in which a plate just touches the surface under it, in metres.

    Attributes:
        base_m: m, (3,), the middle of the plate.
        normal: unit, (3,), of the plane that fits the surface best.
        fall_m: largest distance of the surface below the plate.
    """

    base_m: Floats
    normal: Floats
    fall_m: float


def places(side_m: float) -> Floats:
    """Metres along right and up, the test places of a plate, (PLACES², 2)."""
    line = np.linspace(-side_m / 2, side_m / 2, PLACES)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def surface_under(shape: Solid, centre_m: Floats, normal: Floats, up: Floats, side_m: float) -> Under:
    """The part of `shape` under the square of `side_m` about `centre_m` (3,) with normal `normal` (3,)."""
    frame = np.array([np.cross(up, normal), up, normal])
    if isinstance(shape, Sphere):
        return _ball_under(frame @ (np.array(shape.centre_m) - centre_m), shape.radius_m, side_m)
    return _faces_under(_as_mesh(shape), frame, centre_m, side_m)


def seat(shape: Solid, point_m: Floats, normal: Floats, side_m: float) -> Seat | None:
    """Seat of an upright plate on `shape` near a point (3,) of unit `normal` (3,); None if it is over an edge."""
    upright = upwards(normal)
    under = surface_under(shape, point_m, normal, upright, side_m)
    if np.isnan(under.heights_m).any():
        return None
    # The plane that fits the surface best.
    plane = np.column_stack([places(side_m), np.ones(len(under.heights_m))])
    right, up, _ = np.linalg.lstsq(plane, under.heights_m, rcond=None)[0]
    fitted = normal - right * np.cross(upright, normal) - up * upright
    fitted /= np.linalg.norm(fitted)
    under = surface_under(shape, point_m, fitted, upwards(fitted), side_m)
    if np.isnan(under.heights_m).any():
        return None
    return Seat(point_m + under.highest_m * fitted, fitted, float(under.highest_m - under.heights_m.min()))


def _ball_under(centre: Floats, radius: float, side_m: float) -> Under:
    apart = np.linalg.norm(places(side_m) - centre[:2], axis=1)
    with np.errstate(invalid="ignore"):
        heights = centre[2] + np.sqrt(radius**2 - apart**2)
    nearest = np.linalg.norm(np.clip(centre[:2], -side_m / 2, side_m / 2) - centre[:2])
    highest = centre[2] + np.sqrt(max(radius**2 - nearest**2, 0.0))
    return Under(np.where(heights < -DEEPEST_SHARE * side_m, np.nan, heights), float(highest))


@lru_cache(maxsize=64)
def _as_mesh(shape: Rectangle | Box | Mesh) -> Mesh:
    match shape:
        case Rectangle():
            right, up = shape.right * shape.width_m / 2, shape.up * shape.height_m / 2
            corners = np.array(shape.centre_m) + [-right - up, right - up, right + up, up - right]
            return Mesh(shape.name, corners, np.array([(0, 1, 2), (0, 2, 3)]))
        case Box():
            ends = np.array([shape.lowest_m, shape.highest_m])
            corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
            quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
            return Mesh(shape.name, corners, np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]))
    return shape


@lru_cache(maxsize=64)
def _bounds(mesh: Mesh) -> tuple[Floats, Floats]:
    corners = skin(mesh).corners_m
    return corners.min(axis=1), corners.max(axis=1)


def _faces_under(mesh: Mesh, frame: Floats, centre_m: Floats, side_m: float) -> Under:
    sides, (low, high) = skin(mesh), _bounds(mesh)
    # The plate's outline, with the depth and height that count, is within this distance.
    near = ((low < centre_m + side_m) & (high > centre_m - side_m)).all(axis=1)
    corners = (sides.corners_m[near] - centre_m) @ frame.T
    reach = np.array([side_m / 2, side_m / 2])
    touching = ((corners[..., :2].min(axis=1) <= reach) & (corners[..., :2].max(axis=1) >= -reach)).all(axis=1)
    corners, sheet = corners[touching], sides.open_faces[near][touching]
    deepest, top = -DEEPEST_SHARE * side_m, HIGHEST_SHARE * side_m
    heights = _heights(corners, sheet, places(side_m), top, side_m)
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    ends = _clipped(edges, np.array([-side_m / 2, -side_m / 2, deepest]), np.array([side_m / 2, side_m / 2, top]))
    within = heights[np.isfinite(heights)]
    highest = max([*ends, *within.tolist()], default=-np.inf)
    return Under(np.where(heights < deepest, np.nan, heights), float(highest))


def _heights(corners: Floats, sheet: Bools, at: Floats, top: float, side_m: float) -> Floats:
    """Height of the first face (F, 3, 3) below `top` at places (N, 2); nan for none or a back, (N,)."""
    found = np.full(len(at), -np.inf)
    faces_up = np.ones(len(at), dtype=bool)
    for (a, b, c), both in zip(corners, sheet.tolist(), strict=True):
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < (ON_EDGE * side_m) ** 2:
            continue
        v = ((at[:, 0] - a[0]) * (c[1] - a[1]) - (at[:, 1] - a[1]) * (c[0] - a[0])) / area
        w = ((b[0] - a[0]) * (at[:, 1] - a[1]) - (b[1] - a[1]) * (at[:, 0] - a[0])) / area
        inside = np.minimum(np.minimum(v, w), 1 - v - w) >= -ON_EDGE
        height = a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2])
        higher = inside & (height <= top) & (height > found)
        found[higher] = height[higher]
        faces_up[higher] = both or area > 0
    return np.where(np.isfinite(found) & faces_up, found, np.nan)


def _clipped(edges: Floats, low: Floats, high: Floats) -> list[float]:
    """Heights of both ends of `edges` (E, 2, 3) clipped to the box from `low` to `high` (Liang and Barsky)."""
    start, way = edges[:, 0], edges[:, 1] - edges[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - start) / way, (high - start) / way
    flat = way == 0
    outside = flat & ((start < low) | (start > high))
    enter = np.where(flat, 0.0, np.minimum(one, other)).max(axis=1).clip(0.0)
    leave = np.where(flat, 1.0, np.maximum(one, other)).min(axis=1).clip(max=1.0)
    kept = (enter <= leave) & ~outside.any(axis=1)
    return [*(start + enter[:, None] * way)[kept, 2].tolist(), *(start + leave[:, None] * way)[kept, 2].tolist()]


def crosses(shapes: Sequence[Shape], centre_m: Floats, normal: Floats, up: Floats, side_m: float) -> bool:
    """Whether any of `shapes` cuts through a plate, along the rows and columns of its places, or contains it."""
    right = np.cross(up, normal)
    line = np.linspace(-side_m / 2, side_m / 2, PLACES)[:, None]
    rows = [centre_m + line * one + end * other for one, other in ((up, right), (right, up)) for end in (-side_m / 2,)]
    ends = [row + side_m * other for row, other in zip(rows, (right, up), strict=True)]
    if any_blocks(shapes, np.concatenate(rows), np.concatenate(ends)).any():
        return True
    return any(isinstance(shape, Mesh) and contains(shape, centre_m) for shape in shapes)


def stand_off_problem(marker: Marker, side_m: float, owner: Solid, others: Sequence[Shape]) -> str | None:
    """What is allowed for the plate of `marker`, and the violation; None if it may be glued to its `owner`."""
    centre, normal, up = (np.array(vector) for vector in (marker.centre_m, marker.normal, marker.up))
    under = surface_under(owner, centre, normal, up, side_m)
    plate = f'its plate of {side_m * 1e3:.4g} mm clear of every surface and on that of "{owner.name}"'
    if under.highest_m > ROUNDING_M:
        return f"{plate}; it sticks {under.highest_m * 1e3:.3g} mm through it"
    for other in (owner, *others):
        if crosses([other], centre, normal, up, side_m):
            return f'{plate}; it sticks through "{other.name}"'
    if np.isnan(under.heights_m).any():
        share = np.isnan(under.heights_m).mean()
        return f"{plate}; {'all' if share == 1 else f'{share:.0%}'} of it has no surface beneath"
    sagitta = min(_sagitta(under.heights_m, side_m), MOST_SAGITTA_SHARE * side_m)
    if -under.heights_m.min() > sagitta + FLOAT_M + ROUNDING_M:
        far, allowed = -under.heights_m.min() * 1e3, sagitta * 1e3
        return f"{plate}; it stands off by {far:.3g} mm, and may by its sagitta of {allowed:.2g} mm and 2 mm"
    return None


def _sagitta(heights_m: Floats, side_m: float) -> float:
    """Metres, sagitta of the surface under a plate: that of the best paraboloid, without its slope."""
    x, y = (places(side_m) / side_m).T
    curved = np.column_stack([x * x, x * y, y * y])
    terms = np.column_stack([np.ones_like(x), x, y, curved])
    coefficients = np.linalg.lstsq(terms, heights_m, rcond=None)[0]
    return float(np.ptp(curved @ coefficients[3:]))
