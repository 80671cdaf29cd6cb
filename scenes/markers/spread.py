"""Markers spread over a mesh by Poisson disc, where it is flat enough for their plates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pss.hints import Floats
from pss.surrogates import Mesh, Shape, farthest_point_order, on_mesh
from render.world.state import Marker
from scenes.markers.layout import PLATE_OFFSET_M, marker_at, upwards
from scenes.markers.plates import crosses, seat

__all__ = ["Spread", "spread_over"]


# Numbers of places that are tried, until all markers fit. They do not depend on the number of markers, so that the
# number in a message does fit.
TRIES = (576, 2304, 4000)


@dataclass(frozen=True)
class Spread:
    """The markers that fit, in the order in which they fill the gaps.

    `flat` is the number of the `tried` places that are flat enough for a plate.
    """

    markers: tuple[Marker, ...]
    flat: int
    tried: int


@lru_cache(maxsize=16)
def spread_over(
    mesh: Mesh,
    others: tuple[Shape, ...],
    room_m: tuple[float, float, float],
    *,
    count: int,
    module_mm: float,
    side_m: float,
    min_distance_m: float,
    flatness_m: float,
    first_id: int,
    seed: int,
) -> Spread:
    """At most `count` markers on the faces of `mesh`, numbered from `first_id`; the same for the same arguments.

    The candidates are Poisson-disc points. A candidate is dropped if its plate (of `side_m`) is not on a surface flat
    to `flatness_m`, cuts through it or one of `others`, or extends beyond the room of `room_m`. Each next marker is the
    remaining one farthest from all before it, while that is at least `min_distance_m`.
    """
    found = Spread((), 0, 0)
    for tries in TRIES:
        candidates = on_mesh(mesh, tries, "poisson-disc", rng=np.random.default_rng(seed))
        plates = [
            plate
            for point, normal in zip(candidates.points_m, candidates.normals, strict=True)
            if (plate := _plate(mesh, others, room_m, point, normal, side_m, flatness_m)) is not None
        ]
        if not plates:
            continue
        points = np.array([point for point, _ in plates])
        order = farthest_point_order(points, min(count, len(points)))
        apart = np.linalg.norm(points[order][:, None] - points[order], axis=-1)
        # Distance of each from the nearest marker so far.
        gaps = np.where(np.tri(len(order), k=-1, dtype=bool), apart, np.inf).min(axis=1)
        kept = order[: int(np.argmax([*(gaps < min_distance_m), True]))]
        markers = tuple(
            marker_at(first_id + number, mesh.name, *plates[index], upwards(plates[index][1]), module_mm)
            for number, index in enumerate(kept.tolist())
        )
        if len(markers) >= len(found.markers):
            found = Spread(markers, len(plates), tries)
        if len(markers) == count:
            break
    return found


def _plate(
    mesh: Mesh,
    others: tuple[Shape, ...],
    room_m: tuple[float, float, float],
    point_m: Floats,
    normal: Floats,
    side_m: float,
    flatness_m: float,
) -> tuple[Floats, Floats] | None:
    """Position (3,) and normal (3,) of a plate just above the surface near a point (3,); None if not allowed."""
    seated = seat(mesh, point_m, normal, side_m)
    if seated is None or seated.fall_m > flatness_m:
        return None
    fitted, upright = seated.normal, upwards(seated.normal)
    centre = seated.base_m + PLATE_OFFSET_M * fitted
    half = side_m / 2 * (np.abs(np.cross(upright, fitted)) + np.abs(upright))
    low, high = centre - half, centre + half
    width, length, height = room_m
    if (low < [-width / 2, -length / 2, 0.0]).any() or (high > [width / 2, length / 2, height]).any():
        return None
    if crosses((mesh, *others), centre, fitted, upright, side_m):
        return None
    return seated.base_m, fitted
