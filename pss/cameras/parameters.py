"""What a camera needs to be predicted with, and the same of C cameras as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np

from pss.cameras.distortion import fold_radius
from pss.hints import Floats
from pss.riccati.covariances import COLUMNS, ROWS

__all__ = ["CameraModel", "Cameras"]


# Of each pair of entries xx, xy, …, one in the world (down) and one in the camera's frame (across), row and column.
TO_ROW, FROM_ROW = np.meshgrid(ROWS, ROWS, indexing="ij")
TO_COLUMN, FROM_COLUMN = np.meshgrid(COLUMNS, COLUMNS, indexing="ij")


class CameraModel(Protocol):
    """What a camera needs to be predicted with: its pose, pinhole, thin lens and image size; `PTZCamera` has it all."""

    @property
    def name(self) -> str:
        """Its name in files and tables."""
        ...

    @property
    def position_m(self) -> tuple[float, float, float]:
        """Of the centre of projection, in the world."""
        ...

    @property
    def rotation(self) -> Floats:
        """World to camera frame (x right, y down, z forward), (3, 3)."""
        ...

    @property
    def focal_px(self) -> float:
        """Image distance in pixels."""
        ...

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """Where the optical axis meets the sensor; the centre of the first pixel is (0, 0)."""
        ...

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height in pixels."""
        ...

    @property
    def pixel_pitch_m(self) -> float:
        """Distance of two pixels' centres."""
        ...

    @property
    def radial_distortion(self) -> tuple[float, float]:
        """k₁ and k₂ of OpenCV's model."""
        ...

    @property
    def psf_sigma_px(self) -> float:
        """Standard deviation of the lens's own blur."""
        ...

    @property
    def focus_distance_m(self) -> float:
        """Depth of the plane in focus."""
        ...

    @property
    def image_distance_m(self) -> float:
        """From the lens to the sensor."""
        ...

    @property
    def focal_length_m(self) -> float:
        """Of the thin lens."""
        ...

    @property
    def aperture_diameter_m(self) -> float:
        """Of the thin lens."""
        ...


class Cameras:
    """The parameters of C cameras as arrays with a last axis of length 1 for the points: (C, 1), or (C, 3, 3)."""

    def __init__(self, cameras: Sequence[CameraModel]) -> None:
        self.cameras = tuple(cameras)
        count = len(self.cameras)

        def column(values: list[float]) -> Floats:
            return np.array(values, dtype=float).reshape(count, 1)

        self.position_m = np.array([c.position_m for c in self.cameras]).reshape(count, 3)
        self.rotation = np.array([c.rotation for c in self.cameras]).reshape(count, 3, 3)
        self.focal_px = column([c.focal_px for c in self.cameras])
        self.focus_distance_m = column([c.focus_distance_m for c in self.cameras])
        self.pixel_pitch_m = column([c.pixel_pitch_m for c in self.cameras])
        self.width = column([c.resolution[0] for c in self.cameras])
        self.height = column([c.resolution[1] for c in self.cameras])
        self.psf_sigma_px = column([c.psf_sigma_px for c in self.cameras])
        self.k1 = column([c.radial_distortion[0] for c in self.cameras])
        self.k2 = column([c.radial_distortion[1] for c in self.cameras])
        self.distorts = bool(self.k1.any() or self.k2.any())

    @cached_property
    def focal_length_m(self) -> Floats:
        """m, (C, 1), f_k of Eq. 14."""
        return np.array([[c.focal_length_m] for c in self.cameras]).reshape(-1, 1)

    @cached_property
    def aperture_diameter_m(self) -> Floats:
        """m, (C, 1), a_k of Eq. 14."""
        return np.array([[c.aperture_diameter_m] for c in self.cameras]).reshape(-1, 1)

    @cached_property
    def principal_point_px(self) -> Floats:
        """px, (C, 2)."""
        return np.array([c.principal_point_px for c in self.cameras]).reshape(-1, 2)

    @cached_property
    def fold(self) -> Floats:
        """Largest slope off the axis that the lens images, (C, 1); ∞ without distortion."""
        radii = [fold_radius(*c.radial_distortion) if any(c.radial_distortion) else np.inf for c in self.cameras]
        return np.array(radii).reshape(-1, 1)

    @cached_property
    def turn_symmetric(self) -> Floats:
        """(C, 6, 6): maps the six entries of a symmetric matrix from the camera's frame to the world's."""
        R = self.rotation
        both = R[:, FROM_ROW, TO_ROW] * R[:, FROM_COLUMN, TO_COLUMN]
        swapped = R[:, FROM_COLUMN, TO_ROW] * R[:, FROM_ROW, TO_COLUMN]
        return np.asarray(both + np.where(FROM_ROW != FROM_COLUMN, swapped, 0.0))
