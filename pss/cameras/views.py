"""Views of N points in C cameras: pinhole, thin lens and angles, as arrays over cameras and points.

The project's only projection: the methods of `PTZCamera` use views of one camera. Everything is computed on first use
and over all cameras at once, since a Python loop over cameras would be too slow for a control loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from pss.cameras.appearance import Appearance
from pss.cameras.distortion import stretch
from pss.cameras.parameters import CameraModel, Cameras
from pss.hints import Bools, Floats

__all__ = ["Views"]


class Views:
    """N points as C cameras see them. Arrays are (C, N) unless stated; points behind a camera are mirrored.

    Attributes:
        cameras: C cameras, or their `Cameras`.
        points_m: m, (N, 3).
        normals: unit normals of the surface at the points, (N, 3); None unless a noise factor or a test needs them.
        appearance: size, brightness and motion of the targets; None unless a noise factor or a test needs it.
    """

    def __init__(
        self,
        cameras: Sequence[CameraModel] | Cameras,
        points_m: Floats,
        normals: Floats | None = None,
        appearance: Appearance | None = None,
    ) -> None:
        self.arrays = cameras if isinstance(cameras, Cameras) else Cameras(cameras)
        self.points_m = points_m
        self.normals = normals
        self.appearance = appearance

    @property
    def cameras(self) -> tuple[CameraModel, ...]:
        """The C cameras."""
        return self.arrays.cameras

    # ---- pinhole ---------------------------------------------------------------------------------------------------

    @cached_property
    def local_m(self) -> Floats:
        """m in each camera's frame (x right, y down, z forward), (C, 3, N)."""
        R = self.arrays.rotation
        centred = self.points_m.T - self.arrays.position_m[:, :, None]
        return np.asarray(R @ centred)

    @property
    def depth_m(self) -> Floats:
        """m along the optical axis; negative behind the camera."""
        return np.asarray(self.local_m[:, 2])

    @cached_property
    def range_m(self) -> Floats:
        """m from lens centre to point, D of Eq. 11."""
        return np.asarray(np.sqrt(np.einsum("cin,cin->cn", self.local_m, self.local_m)))

    @cached_property
    def slopes(self) -> Floats:
        """x/z and y/z of the undistorted ray, (C, 2, N); not finite in the plane of the lens."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.local_m[:, :2] / self.local_m[:, 2:])

    @cached_property
    def _distortion(self) -> tuple[Floats, Floats]:
        squared = self.slopes[:, 0] ** 2 + self.slopes[:, 1] ** 2
        return stretch(squared, self.arrays.k1, self.arrays.k2)

    @property
    def pixels(self) -> Floats:
        """px, (C, N, 2)."""
        arrays, slopes = self.arrays, self.slopes
        if arrays.distorts:
            slopes = slopes * self._distortion[0][:, None]
        return np.swapaxes(arrays.focal_px[:, None] * slopes + arrays.principal_point_px[:, :, None], 1, 2)

    @cached_property
    def in_frustum(self) -> Bools:
        """Whether the point is in front of the camera and on the sensor's area."""
        arrays, depth = self.arrays, self.depth_m
        # Half a pixel beyond the outermost pixel centres is the sensor's edge.
        across, down = arrays.width / 2 / arrays.focal_px, arrays.height / 2 / arrays.focal_px
        if not arrays.distorts:
            x, y = np.abs(self.local_m[:, 0]), np.abs(self.local_m[:, 1])
            return np.asarray((depth > 0) & (x <= across * depth) & (y <= down * depth))
        with np.errstate(invalid="ignore", over="ignore"):
            squared = (self.slopes**2).sum(axis=1)
            bent = np.abs(self.slopes * self._distortion[0][:, None])
            inside = (bent[:, 0] <= across) & (bent[:, 1] <= down) & (squared <= arrays.fold**2)
        return np.asarray((depth > 0) & inside)

    @cached_property
    def distortion_jacobian(self) -> tuple[Floats, Floats, Floats]:
        """∂(distorted slope)/∂(slope), symmetric: its entries xx, xy, yy, each (C, N)."""
        factor, derivative = self._distortion
        u, v = self.slopes[:, 0], self.slopes[:, 1]
        return factor + 2 * derivative * u**2, 2 * derivative * u * v, factor + 2 * derivative * v**2

    @property
    def jacobian(self) -> Floats:
        """px/m, ∂pixel/∂point, H_k of Eq. 5, (C, N, 2, 3)."""
        arrays = self.arrays
        u, v = self.slopes[:, 0], self.slopes[:, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = arrays.focal_px / self.depth_m
            rows = np.zeros((*u.shape, 2, 3))
            rows[..., 0, 0] = rows[..., 1, 1] = scale
            rows[..., 0, 2], rows[..., 1, 2] = -scale * u, -scale * v
            if arrays.distorts:
                bend = np.empty((*u.shape, 2, 2))
                bend[..., 0, 0], bend[..., 0, 1], bend[..., 1, 1] = self.distortion_jacobian
                bend[..., 1, 0] = bend[..., 0, 1]
                rows = bend @ rows
            return np.asarray(rows @ arrays.rotation[:, None])

    def image_of(self, steps_m: Floats) -> Floats:
        """px, motion in the image of small steps (m, (N, 3)) of the points, (C, 2, N): H_k times the step."""
        arrays = self.arrays
        local = arrays.rotation @ steps_m.T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            moved = (local[:, :2] - self.slopes * local[:, 2:]) * (arrays.focal_px / self.depth_m)[:, None]
            if arrays.distorts:
                a, b, d = self.distortion_jacobian
                moved = np.stack([a * moved[:, 0] + b * moved[:, 1], b * moved[:, 0] + d * moved[:, 1]], axis=1)
        return np.asarray(moved)

    def information(self, weight: tuple[Floats, Floats, Floats], counted: Bools) -> Floats:
        """1/m², HᵀWH, its six entries xx, xy, xz, yy, yz, zz on the second axis: (C, 6, N).

        Args:
            weight: 1/px², entries uu, uv, vv of W = R⁻¹, each (C, N) or broadcast to it.
            counted: the pairs that count, (C, N); the others are zero.
        """
        arrays = self.arrays
        uu, uv, vv = weight
        u, v = self.slopes[:, 0], self.slopes[:, 1]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if arrays.distorts:
                a, b, d = self.distortion_jacobian
                uu, uv, vv = (
                    a * a * uu + 2 * a * b * uv + b * b * vv,
                    a * b * uu + (a * d + b * b) * uv + b * d * vv,
                    b * b * uu + 2 * b * d * uv + d * d * vv,
                )
            scale = (arrays.focal_px / self.depth_m) ** 2
            uu, uv, vv = scale * uu, scale * uv, scale * vv
            along_u, along_v = uu * u + uv * v, uv * u + vv * v
            entries = np.stack([uu, uv, -along_u, vv, -along_v, along_u * u + along_v * v], axis=1)
        entries = np.where(counted[:, None], entries, 0.0)
        return np.asarray(arrays.turn_symmetric @ entries)

    # ---- angles and the thin lens ----------------------------------------------------------------------------------

    @cached_property
    def cos_off_axis(self) -> Floats:
        """Cosine of the off-axis angle θ of Eqs. 12 and 13; nan at the lens centre."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.depth_m / self.range_m)

    @cached_property
    def cos_incidence(self) -> Floats:
        """Cosine of the incidence angle α of Eq. 11, between the ray to the camera and the normal."""
        assert self.normals is not None
        to_camera = self.arrays.position_m @ self.normals.T - np.einsum("ni,ni->n", self.points_m, self.normals)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(to_camera / self.range_m)

    @cached_property
    def circle_of_confusion_px(self) -> Floats:
        """px, diameter of the circle of confusion, Eq. 14, with D read as depth along the axis."""
        arrays = self.arrays
        a, f, d = arrays.aperture_diameter_m, arrays.focal_length_m, arrays.focus_distance_m
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.abs(self.depth_m - d) / np.abs(self.depth_m)
        return np.asarray(a / arrays.pixel_pitch_m * f / (d - f) * away)  # Eq. 14
