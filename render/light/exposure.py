"""The exposure for a scene's light, from the markers' appearance and never from an image of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss import Appearance, ImageSensor, PTZCamera, RangeError
from pss.cameras.sensor import electrons_per_radiance
from pss.hints import Floats

__all__ = ["AutoExposure", "ExposureChoice", "choose_exposure"]


# Significant digits to which an exposure is rounded down.
DIGITS = 2
# Quotients such as 0.0034 / 1e-4 are off by less than this (relative).
ROUNDING = 1e-9


@dataclass(frozen=True)
class AutoExposure:
    """Target of the automatic exposure.

    Attributes:
        share: share of the saturation (0 to 1) that the white of the brightest marker is to reach. The rest is a margin
            for shot noise, PRNU, and plates that are brighter at the edge than in the middle.
        longest_ms: ms, upper limit: 20 is 1/50 s, half a frame's time at 25 frames per second.
    """

    share: float = 0.7
    longest_ms: float = 20.0

    def __post_init__(self) -> None:
        if not 0 < self.share <= 1:
            raise RangeError(f"AutoExposure.share = {self.share!r}; allowed: above 0, at most 1")
        if not 0 < self.longest_ms < math.inf:
            raise RangeError(f"AutoExposure.longest_ms = {self.longest_ms!r}; allowed: above 0, in milliseconds")


@dataclass(frozen=True)
class ExposureChoice:
    """A chosen exposure and its basis.

    Attributes:
        exposure_ms: ms.
        share: share of the saturation (0 to 1) of the brightest marker; 0 if none is in view.
        point: number of that marker's point; −1 if there is none.
        camera: the camera in which it is that bright; None if there is none.
        longest: whether the upper limit applied.
    """

    exposure_ms: float
    share: float
    point: int
    camera: PTZCamera | None
    longest: bool


def choose_exposure(
    appearance: Appearance,
    points_m: ArrayLike,
    normals: ArrayLike,
    cameras: Iterable[PTZCamera],
    sensor: ImageSensor,
    target: AutoExposure,
) -> ExposureChoice:
    """One exposure for all `cameras`: no white of a marker in view exceeds the requested share of saturation.

    A marker is in view if its point is in a camera's frustum and it faces the camera. Occlusion is ignored, so that a
    hidden marker can only shorten the exposure. Dark current counts with the light. The light is that on the axis; off
    it, it is lower by cos⁴ θ.

    Args:
        appearance: the markers' radiances, of N points.
        points_m: m, (N, 3).
        normals: unit, (N, 3).
        sensor: its own exposure has no effect.
        target: share of the saturation and longest exposure.
    """
    points, directions = np.asarray(points_m, dtype=float), np.asarray(normals, dtype=float)
    second = dataclasses.replace(sensor, exposure_ms=1000.0)
    brightest, point, seen_by = 0.0, -1, None
    for camera in dict.fromkeys(cameras):
        rates = electrons_per_radiance(camera, second) * _radiance(appearance, points, directions, camera)
        if rates.size and rates.max() > brightest:
            brightest, point, seen_by = float(rates.max()), int(rates.argmax()), camera
    if seen_by is None:
        return ExposureChoice(target.longest_ms, 0.0, -1, None, True)
    rate_e_per_ms = (brightest + sensor.dark_current_e_per_s) * 1e-3
    unlimited_ms = target.share * sensor.saturation_e / rate_e_per_ms
    longest = unlimited_ms >= target.longest_ms
    exposure_ms = target.longest_ms if longest else _rounded_down(unlimited_ms)
    return ExposureChoice(exposure_ms, exposure_ms * rate_e_per_ms / sensor.saturation_e, point, seen_by, longest)


def _radiance(appearance: Appearance, points_m: Floats, normals: Floats, camera: PTZCamera) -> Floats:
    """W/(m² sr), the white of each marker as `camera` sees it, (N,); 0 for those not in view."""
    white = np.broadcast_to(np.asarray(appearance.white_w_per_m2_sr, dtype=float), len(points_m))
    radiance = np.zeros(len(points_m))
    rows = np.flatnonzero(camera.in_frustum(points_m))
    cosine = camera.cos_incidence(points_m[rows], normals[rows])
    rows, cosine = rows[cosine > 0], cosine[cosine > 0]
    radiance[rows] = white[rows]
    if appearance.ring_light:
        radiance[rows] *= cosine / camera.range_m(points_m[rows]) ** 2
    return radiance


def _rounded_down(value: float) -> float:
    step = 10.0 ** (math.floor(math.log10(value)) - DIGITS + 1)
    # Through text, so that the result equals the number 3.4 read from a file.
    return float(f"{math.floor(value / step * (1 + ROUNDING)) * step:.{DIGITS}g}")
