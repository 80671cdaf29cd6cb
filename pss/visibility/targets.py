"""Visibility of whole targets: conditions for detection beyond a line of sight to the centre.

The paper's points are visible if the camera sees them (section 4.1; `pss.visibility.points`). A marker is more than its
centre: its outline must be in view, no part of it may be occluded, and its modules must be large, sharp and bright
enough to be distinguished. The first two are geometry; the limits of the third depend on the detector. Those of size
and blur are fitted (`Calibration.limits`), that of contrast over noise was measured on drawn markers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pss.cameras.appearance import Appearance
from pss.cameras.sensor import ImageSensor
from pss.cameras.views import Views
from pss.errors import RangeError
from pss.hints import Bools, Floats
from pss.noise.blur import DIAMETERS_PER_SIGMA, SQUARED_LENGTHS_PER_VARIANCE, sensors_of, way_across_px, way_px
from pss.noise.photometric import module_sides, sides_e
from pss.noise.table import CALIBRATED, calibration_called
from pss.surrogates import Shape, any_blocks
from pss.visibility.points import CLEARANCE_M, VISIBILITY_TESTS, VisibilityTest

__all__ = [
    "LEAST_CONTRAST_OVER_NOISE",
    "TARGET_VISIBILITY",
    "VISIBILITIES",
    "Legible",
    "WholeTarget",
    "blur_modules",
    "contrast_over_noise",
    "narrow_side_px",
    "visibility_tests",
    "within_limits",
]


LEAST_CONTRAST_OVER_NOISE = 2.0
"""Contrast of white and black modules over σ of one capture at white, per pixel, below which sharp markers are missed.

Measured on drawn markers (benchmarks/detection_limit.py, benchmarks/README.md)."""

VISIBILITIES = ("point", "target", CALIBRATED)
# Places on a target that are tested for occlusion: corners and middles of the sides, in units of half a side.
AROUND = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))


@dataclass(frozen=True)
class WholeTarget:
    """The whole target is in view, and its outline is not occluded.

    Attributes:
        margin_modules: width of the white margin that must be in view too, since detection needs the outline. Below
            half a module hardly any marker is found, above it nearly all are.
    """

    margin_modules: float = 0.5
    name: str = "whole-target"

    def __post_init__(self) -> None:
        if not self.margin_modules >= 0:
            raise RangeError(f"WholeTarget.margin_modules = {self.margin_modules!r}; allowed: 0 or more, in modules")

    def passed(self, views: Views, candidates: Bools, occluder: Sequence[Shape]) -> Bools:
        """Where the whole target is visible, (C, N); False outside the candidates.

        Raises:
            RangeError: `views` has no appearance.
        """
        appearance = _appearance(self.name, views)
        assert views.normals is not None
        across_m, down_m = appearance.sides_m(views.normals)
        half = appearance.modules / 2
        clear = candidates.copy()
        outer = half + self.margin_modules
        for u, v in CORNERS:
            clear &= Views(views.arrays, views.points_m + outer * (u * across_m + v * down_m)).in_frustum
        if not occluder:
            return clear
        for u, v in AROUND:
            camera, point = np.nonzero(clear)
            ends = views.points_m + half * (u * across_m + v * down_m) + CLEARANCE_M * views.normals
            clear[camera, point] = ~any_blocks(occluder, views.arrays.position_m[camera], ends[point])
        return clear


@dataclass(frozen=True)
class Legible:
    """The target's modules are large, sharp and bright enough for a detector.

    Attributes:
        smallest_module_px: px, of a module's narrow side (`narrow_side_px`).
        largest_blur_modules: circle of confusion over that side, including motion blur (`blur_modules`).
        sensor: the cameras' image sensor, or one for each by the camera's name, for motion blur and noise; None ignores
            both.
        least_contrast: contrast of white and black over the noise of one capture (`contrast_over_noise`).
    """

    smallest_module_px: float
    largest_blur_modules: float
    name: str = "legible"
    sensor: ImageSensor | Mapping[str, ImageSensor] | None = None
    least_contrast: float = LEAST_CONTRAST_OVER_NOISE

    def __post_init__(self) -> None:
        if not self.least_contrast >= 0:
            raise RangeError(f"Legible.least_contrast = {self.least_contrast!r}; allowed: 0 or more")
        for name in ("smallest_module_px", "largest_blur_modules"):
            if not getattr(self, name) > 0:
                raise RangeError(f"Legible.{name} = {getattr(self, name)!r}; allowed: above 0")

    def passed(self, views: Views, candidates: Bools, occluder: Sequence[Shape]) -> Bools:
        """Where the target is legible, (C, N).

        Raises:
            RangeError: `views` has no appearance.
        """
        _appearance(self.name, views)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            large = narrow_side_px(views) >= self.smallest_module_px
            legible = candidates & large & (blur_modules(views, self.sensor) <= self.largest_blur_modules)
            if self.sensor is not None:
                legible &= contrast_over_noise(views, self.sensor) >= self.least_contrast
            return np.asarray(legible)


TARGET_VISIBILITY: tuple[VisibilityTest, ...] = (*VISIBILITY_TESTS, WholeTarget())


def visibility_tests(
    name: str | Path, sensor: ImageSensor | Mapping[str, ImageSensor] | None = None
) -> tuple[VisibilityTest, ...]:
    """The visibility tests called `name`, for `pss.evaluate(…, visibility=…)`.

    "point" is the paper's: a line of sight to the point. "target" requires the whole target. The path of a calibration
    (.toml), or "calibrated" for the shipped one, adds its detector's limits; one without limits is "target".

    Args:
        sensor: of `Legible`; for moving targets.

    Raises:
        RangeError: an unknown name, or a file that is not a calibration.
    """
    if name == "point":
        return VISIBILITY_TESTS
    if name == "target":
        return TARGET_VISIBILITY
    calibration = calibration_called(name)
    if calibration is None:
        allowed = f"{', '.join(VISIBILITIES)}, or a calibration's path (.toml)"
        raise RangeError(f"visibility {str(name)!r}; allowed: {allowed}")
    return within_limits(calibration.limits, sensor)


def within_limits(
    limits: Mapping[str, float], sensor: ImageSensor | Mapping[str, ImageSensor] | None = None
) -> tuple[VisibilityTest, ...]:
    """Whole targets that are legible by a calibration's limits, if it has any; `sensor` as in `visibility_tests`."""
    if not limits:
        return TARGET_VISIBILITY
    legible = Legible(limits["smallest_module_px"], limits["largest_blur_modules"], sensor=sensor)
    return (*TARGET_VISIBILITY, legible)


def narrow_side_px(views: Views) -> Floats:
    """px, (C, N), distance of a module's two longer sides in the image."""
    across, down = module_sides(_appearance("legible", views), views)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        area = np.abs(across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0])
        longer = np.maximum(np.hypot(across[:, 0], across[:, 1]), np.hypot(down[:, 0], down[:, 1]))
        return np.asarray(area / longer)


def blur_modules(views: Views, sensor: ImageSensor | Mapping[str, ImageSensor] | None = None) -> Floats:
    """Circle of confusion over a module's narrow side, (C, N).

    A moving target has the circle of confusion of a disc with equal blur across the edges (equal second moment), over
    the module's width there, for the worse of its two sides.

    Args:
        sensor: its exposure determines motion blur, as in `Legible`; None ignores motion.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        way = None if sensor is None else way_px(views, sensor)
        if way is None:
            return np.asarray(views.circle_of_confusion_px / narrow_side_px(views))
        across, down = module_sides(_appearance("legible", views), views)
        area = np.abs(across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0])
        found = []
        for side in (across, down):
            of_motion = (DIAMETERS_PER_SIGMA * way_across_px(side, way)) ** 2 / SQUARED_LENGTHS_PER_VARIANCE
            diameter = np.sqrt(views.circle_of_confusion_px**2 + of_motion)
            found.append(diameter * np.hypot(side[:, 0], side[:, 1]) / area)
        return np.asarray(np.maximum(*found))


def contrast_over_noise(views: Views, sensor: ImageSensor | Mapping[str, ImageSensor]) -> Floats:
    """(C, N), white minus black over σ of one capture at white, in one pixel, without blur; 0 where both saturate."""
    white, black = sides_e(views, _appearance("legible", views), sensor)
    noise = np.array([each.noise_electrons(row) for each, row in zip(sensors_of(sensor, views), white, strict=True)])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(white > black, (white - black) / noise, 0.0))


def _appearance(name: str, views: Views) -> Appearance:
    if views.appearance is None:
        raise RangeError(f"visibility test {name!r} has no appearance; allowed: evaluate(…, appearance=…)")
    return views.appearance
