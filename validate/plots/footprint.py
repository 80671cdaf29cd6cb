"""Where a camera looks, seen from above: the part of a level plane that its image shows, cut at the room's walls."""

from __future__ import annotations

import numpy as np

from pss import PTZCamera
from pss.hints import Floats
from render.world.state import Room

__all__ = ["footprint_m", "wedge_m"]


def wedge_m(camera: PTZCamera, room: Room, height_m: float = 0.0) -> Floats:
    """Metres (x, y), corners in order of the area between the image's left and right borders, (V, 2).

    It is the part of the plane at `height_m` over the floor, in front of the camera and within the walls, that projects
    between the borders, be it above or below the image. At the camera's own height it is a triangle with its tip at the
    camera; lower down, a camera that is tilted sees a strip of some width straight below itself. With a distorting lens
    the borders are taken where they cross the image's middle. Nothing there: (0, 2).
    """
    return _cut(camera, room, height_m, _borders(camera)[:2])


def footprint_m(camera: PTZCamera, room: Room, height_m: float = 0.0) -> Floats:
    """Metres (x, y), corners in order of what the whole image shows of the same plane, (V, 2); (0, 2) for nothing."""
    return _cut(camera, room, height_m, _borders(camera))


def _borders(camera: PTZCamera) -> Floats:
    """Inward normals of the planes through the lens and the image's left, right, top and bottom border, (4, 3)."""
    (width, height), middle = camera.resolution, np.array(camera.principal_point_px)
    # Half a pixel beyond the outermost pixel centres.
    ends = [(-0.5, middle[1]), (width - 0.5, middle[1]), (middle[0], -0.5), (middle[0], height - 0.5)]
    slopes = (camera.undistorted_px(ends) - middle) / camera.focal_px
    left, right, top, bottom = slopes[0, 0], slopes[1, 0], slopes[2, 1], slopes[3, 1]
    return np.array([[1, 0, -left], [-1, 0, right], [0, 1, -top], [0, -1, bottom]]) @ camera.rotation


def _cut(camera: PTZCamera, room: Room, height_m: float, normals: Floats) -> Floats:
    """Metres, the room's outline cut by the planes through the lens with these inward normals, (V, 2)."""
    x, y = room.width_m / 2, room.length_m / 2
    corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    for normal in normals:
        # What is left of two opposite borders is in front of the lens: their planes meet in it.
        offset = normal[2] * height_m - normal @ np.array(camera.position_m)
        corners = _kept(corners, corners @ normal[:2] + offset)
    return corners


def _kept(corners: Floats, distance: Floats) -> Floats:
    """The part of a convex outline (V, 2) where a distance, linear and given at its corners, is not below 0."""
    kept: list[Floats] = []
    for here, there, a, b in zip(corners, np.roll(corners, -1, axis=0), distance, np.roll(distance, -1), strict=True):
        if a >= 0:
            kept.append(here)
        if (a >= 0) != (b >= 0):
            kept.append(here + a / (a - b) * (there - here))
    return np.array(kept).reshape(-1, 2)
