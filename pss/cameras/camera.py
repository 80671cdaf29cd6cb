"""The pan-tilt-zoom camera: projection, its Jacobian, and the thin lens. The only camera model of the project.

Conventions (docs/conventions.md; each has a test in tests/project/test_conventions.py):

- World: right-handed, metres, z up. Camera frame: x right, y down, z forward; roll 0.
- Pan turns about world z: 0° points along +y, positive towards +x. Tilt is positive upwards.
- Zoom is the paper's multiplier: horizontal field of view = widest field of view / zoom, at the current focus.
- Pixels are OpenCV's: the centre of the top left pixel is (0, 0).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.cameras.distortion import undistorted
from pss.cameras.views import Views
from pss.errors import GeometryError, RangeError, ShapeError
from pss.hints import Floats
from pss.inputs import number, numbers, place, row

__all__ = ["PTZCamera", "as_points"]


# Straight up or down, the pan still defines where the image's top points: the limit of ever steeper tilts.
MAX_ABS_TILT_DEG = 90.0
# A direction closer to the vertical than this share of the distance differs from it by rounding only: its pan is 0.
VERTICAL = 1e-12
# With more blades an aperture is practically round.
MOST_BLADES = 32
NUMBERS = (
    *("pan_deg", "tilt_deg", "zoom", "focus_distance_m"),
    *("f_number", "pixel_pitch_m", "max_zoom", "widest_fov_deg", "psf_sigma_um"),
)


def as_points(points_m: ArrayLike, name: str = "points_m") -> Floats:
    """Return `points_m` as a new float array of shape (..., 3).

    Raises:
        ShapeError: the last axis does not have length 3.
        RangeError: not numbers, or not finite.
    """
    points = numbers(points_m, name, "(..., 3)")
    if points.ndim < 1 or points.shape[-1] != 3:
        raise ShapeError(f"{name} has shape {points.shape}; allowed is (..., 3)")
    if not np.isfinite(points).all():
        raise RangeError(f"{name} holds {points[~np.isfinite(points)][0]}; allowed are finite values in metres")
    return points


def _require(condition: bool, name: str, value: object, allowed: str) -> None:
    if not condition:
        raise RangeError(f"{name} = {value!r}; allowed: {allowed}")


@dataclass(frozen=True)
class PTZCamera:
    """A pan-tilt-zoom camera: position, pan, tilt, zoom and focus, with a thin lens.

    Attributes:
        position_m: m, the lens centre in the world, (3,).
        pan_deg: degrees about world z; 0 points along +y, positive towards +x.
        tilt_deg: degrees above the horizon, −90 to 90; straight down, the image's top points along the pan.
        zoom: the paper's multiplier, 1 to `max_zoom`; horizontal field of view = `widest_fov_deg` / zoom.
        focus_distance_m: m, depth of the plane in focus along the optical axis (d_k of Eq. 14).
        f_number: focal length over aperture diameter.
        resolution: pixels (width, height).
        pixel_pitch_m: m, side of the square pixel (ps_k of Eq. 14).
        radial_distortion: k₁ and k₂ of OpenCV's radial distortion (slope times 1 + k₁r² + k₂r⁴), no unit; the field of
            view and the focal length are those of the lens without it.
        psf_sigma_um: µm on the sensor (σ), Gaussian blur of the lens in focus, by diffraction and aberration.
        aperture_blades: straight blades of the aperture, 3 or more; 0 for a round one. Both have the same area.
        max_zoom: upper limit of `zoom`.
        widest_fov_deg: degrees, horizontal field of view at zoom 1 (the paper: 90).
        name: the camera's name in tables and figures.

    Raises:
        RangeError: a value out of range; the message has the value and what is allowed.
        ShapeError: `position_m` or `resolution` of the wrong length.
    """

    position_m: tuple[float, float, float]
    pan_deg: float
    tilt_deg: float
    zoom: float = 1.0
    focus_distance_m: float = 4.0
    f_number: float = 1.8
    resolution: tuple[int, int] = (1280, 960)
    pixel_pitch_m: float = 4.65e-6
    max_zoom: float = 8.0
    widest_fov_deg: float = 90.0
    radial_distortion: tuple[float, float] = (0.0, 0.0)
    psf_sigma_um: float = 0.0
    aperture_blades: int = 0
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", place(self.position_m, "position_m"))
        resolution = row(self.resolution, 2, "resolution", "2 (width, height in pixels)")
        if all(map(math.isfinite, resolution)):
            resolution = tuple(int(n) for n in resolution)
        distortion = row(self.radial_distortion, 2, "radial_distortion", "2 (k1, k2)")
        object.__setattr__(self, "radial_distortion", distortion)
        _require(all(map(math.isfinite, distortion)), "radial_distortion", distortion, "finite numbers")
        # An integer and the equal float are the same setting: they must have the same text in files and the same hash.
        for name in NUMBERS:
            object.__setattr__(self, name, number(getattr(self, name), name))
        _require(all(map(math.isfinite, resolution)), "resolution", resolution, "at least 1 × 1 pixel")
        object.__setattr__(self, "resolution", resolution)
        _require(math.isfinite(self.pan_deg), "pan_deg", self.pan_deg, "finite degrees")
        _require(abs(self.tilt_deg) <= MAX_ABS_TILT_DEG, "tilt_deg", self.tilt_deg, f"within ±{MAX_ABS_TILT_DEG:g}°")
        _require(0 < self.widest_fov_deg < 180, "widest_fov_deg", self.widest_fov_deg, "between 0 and 180 degrees")
        _require(1 <= self.zoom <= self.max_zoom, "zoom", self.zoom, f"1 to {self.max_zoom:g}")
        _require(min(self.resolution) >= 1, "resolution", resolution, "at least 1 × 1 pixel")
        _require(0 < self.pixel_pitch_m < 1e-3, "pixel_pitch_m", self.pixel_pitch_m, "above 0 and below 1e-3 metres")
        _require(0 < self.f_number < math.inf, "f_number", self.f_number, "above 0")
        _require(0 <= self.psf_sigma_um < math.inf, "psf_sigma_um", self.psf_sigma_um, "0 or more, in micrometres")
        object.__setattr__(self, "aperture_blades", int(self.aperture_blades))
        _require(
            self.aperture_blades == 0 or 3 <= self.aperture_blades <= MOST_BLADES,
            "aperture_blades",
            self.aperture_blades,
            f"0 for a round aperture, or 3 to {MOST_BLADES}",
        )
        # 1/f = 1/v + 1/d has a solution for every d > 0, but d <= v would be a magnifying close-up, not a camera.
        _require(
            self.image_distance_m < self.focus_distance_m < math.inf,
            "focus_distance_m",
            self.focus_distance_m,
            f"beyond the image distance of {self.image_distance_m:.4g} m (so beyond the focal length)",
        )

    # ---- intrinsic and extrinsic parameters ------------------------------------------------------------------------

    @property
    def horizontal_fov_deg(self) -> float:
        """Degrees; `widest_fov_deg` / zoom (the paper, section 4.1, field of view)."""
        return self.widest_fov_deg / self.zoom

    @property
    def focal_px(self) -> float:
        """Pixels, the focal length of the equivalent pinhole: image distance over pixel pitch."""
        return 0.5 * self.resolution[0] / math.tan(math.radians(self.horizontal_fov_deg) / 2)

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """Pixels (x, y), the middle of the sensor, where the centre of the top left pixel is (0, 0)."""
        return (self.resolution[0] - 1) / 2, (self.resolution[1] - 1) / 2

    @property
    def intrinsic_matrix(self) -> Floats:
        """Pixels, OpenCV's K, (3, 3)."""
        cx, cy = self.principal_point_px
        return np.array([[self.focal_px, 0.0, cx], [0.0, self.focal_px, cy], [0.0, 0.0, 1.0]])

    @property
    def rotation(self) -> Floats:
        """World to camera, (3, 3): its rows are the camera's right, down and forward in the world."""
        pan, tilt = math.radians(self.pan_deg), math.radians(self.tilt_deg)
        sp, cp, st, ct = math.sin(pan), math.cos(pan), math.sin(tilt), math.cos(tilt)
        return np.array([[cp, -sp, 0.0], [sp * st, cp * st, -ct], [sp * ct, cp * ct, st]])

    @property
    def translation_m(self) -> Floats:
        """Metres, OpenCV's t: a point is at `rotation @ x + translation_m` in the camera frame, (3,)."""
        return np.asarray(-self.rotation @ np.array(self.position_m))

    @property
    def projection_matrix(self) -> Floats:
        """OpenCV's P = K [R | t], (3, 4)."""
        return self.intrinsic_matrix @ np.column_stack([self.rotation, self.translation_m])

    # ---- thin lens -------------------------------------------------------------------------------------------------

    @property
    def image_distance_m(self) -> float:
        """Metres from lens to sensor, v; it follows from the field of view, which is defined at the current focus."""
        return self.focal_px * self.pixel_pitch_m

    @property
    def focal_length_m(self) -> float:
        """Metres, f_k of Eq. 14, from 1/f = 1/v + 1/d."""
        return 1 / (1 / self.image_distance_m + 1 / self.focus_distance_m)

    @property
    def aperture_diameter_m(self) -> float:
        """Metres, a_k of Eq. 14: focal length over f-number."""
        return self.focal_length_m / self.f_number

    @property
    def psf_sigma_px(self) -> float:
        """Pixels (σ), the blur of the lens in focus."""
        return self.psf_sigma_um * 1e-6 / self.pixel_pitch_m

    def circle_of_confusion_px(self, points_m: ArrayLike) -> Floats:
        """Pixels, the diameter of the circle of confusion, Eq. 14, of `points_m` (..., 3); shape (...).

        Eq. 14's D is read as depth along the axis, since the surface in focus of a thin lens is a plane. With
        v = f d / (d − f), Eq. 14 equals a·f_px/d·|z − d|/z.
        """
        views, shape = self._views(points_m)
        self._refuse_centre(views.depth_m)
        return np.asarray(views.circle_of_confusion_px[0].reshape(shape))

    # ---- projection ------------------------------------------------------------------------------------------------

    def to_camera_frame(self, points_m: ArrayLike) -> Floats:
        """Metres in the camera frame (x right, y down, z forward) of `points_m` (..., 3); shape (..., 3)."""
        views, shape = self._views(points_m)
        return np.asarray(views.local_m[0].T.reshape(*shape, 3))

    def project(self, points_m: ArrayLike) -> tuple[Floats, Floats]:
        """Pixels (..., 2) and depth in metres (...) of `points_m` (..., 3).

        A point behind the camera has a negative depth and the pixel of its mirror image; see `in_frustum`.

        Raises:
            GeometryError: a point is in the plane through the lens (depth 0), where no pixel exists.
        """
        views, shape = self._views(points_m)
        self._refuse_centre(views.depth_m)
        return np.asarray(views.pixels[0].reshape(*shape, 2)), np.asarray(views.depth_m[0].reshape(shape))

    def jacobian(self, points_m: ArrayLike) -> Floats:
        """Pixels per metre, ∂pixel/∂point, H_k of Eq. 5, at `points_m` (..., 3); shape (..., 2, 3)."""
        views, shape = self._views(points_m)
        self._refuse_centre(views.depth_m)
        return np.asarray(views.jacobian[0].reshape(*shape, 2, 3))

    def undistorted_px(self, pixels: ArrayLike) -> Floats:
        """Pixels (..., 2) of an undistorted lens for the points that this lens images at `pixels` (..., 2).

        Raises:
            ShapeError: `pixels` does not end in 2.
            RangeError: a pixel beyond the radius up to which this lens forms an image.
        """
        distorted = numbers(pixels, "pixels", "(..., 2)")
        if distorted.ndim < 1 or distorted.shape[-1] != 2:
            raise ShapeError(f"pixels has shape {distorted.shape}; allowed is (..., 2)")
        if not any(self.radial_distortion):
            return distorted
        middle = np.array(self.principal_point_px)
        slopes = undistorted((distorted - middle) / self.focal_px, *self.radial_distortion)
        return np.asarray(slopes * self.focal_px + middle)

    def in_frustum(self, points_m: ArrayLike) -> NDArray[np.bool_]:
        """Whether `points_m` (..., 3) project in front of the camera and onto the sensor's area; shape (...)."""
        views, shape = self._views(points_m)
        return np.asarray(views.in_frustum[0].reshape(shape))

    def range_m(self, points_m: ArrayLike) -> Floats:
        """Metres from the lens centre to `points_m` (..., 3), D of Eq. 11; shape (...)."""
        views, shape = self._views(points_m)
        return np.asarray(views.range_m[0].reshape(shape))

    def cos_off_axis(self, points_m: ArrayLike) -> Floats:
        """Cosine of the off-axis angle θ of Eqs. 12 and 13 at `points_m` (..., 3); shape (...)."""
        views, shape = self._views(points_m)
        self._refuse_centre(views.range_m)
        return np.asarray(views.cos_off_axis[0].reshape(shape))

    def cos_incidence(self, points_m: ArrayLike, normals: ArrayLike) -> Floats:
        """Cosine of the incidence angle α of Eq. 11 between the ray to the camera and the unit normal; shape (...)."""
        points, directions = np.broadcast_arrays(as_points(points_m), as_points(normals, "normals"))
        views = Views([self], points.reshape(-1, 3), directions.reshape(-1, 3))
        self._refuse_centre(views.range_m)
        return np.asarray(views.cos_incidence[0].reshape(points.shape[:-1]))

    def _views(self, points_m: ArrayLike) -> tuple[Views, tuple[int, ...]]:
        """Views of the flattened points in this camera, and the points' shape without the last axis."""
        points = as_points(points_m)
        return Views([self], points.reshape(-1, 3)), points.shape[:-1]

    # ---- settings --------------------------------------------------------------------------------------------------

    def direction_to(self, target_m: Sequence[float] | Floats) -> tuple[float, float]:
        """Degrees, the pan and tilt of the line of sight to `target_m` (3,); straight up or down has pan 0.

        Raises:
            GeometryError: the target is at the lens centre.
        """
        x, y, z = as_points(target_m, "target_m") - np.array(self.position_m)
        if math.hypot(x, y, z) == 0:
            raise GeometryError(f"target_m = {tuple(target_m)} is the camera's own position; there is no direction")
        if math.hypot(x, y) < VERTICAL * abs(z):
            return 0.0, math.copysign(MAX_ABS_TILT_DEG, z)
        return math.degrees(math.atan2(x, y)), math.degrees(math.atan2(z, math.hypot(x, y)))

    def aimed_at(self, target_m: Sequence[float] | Floats) -> PTZCamera:
        """The same camera with pan and tilt such that `target_m` (3,) is in the middle of the image."""
        pan_deg, tilt_deg = self.direction_to(target_m)
        return dataclasses.replace(self, pan_deg=pan_deg, tilt_deg=tilt_deg)

    def _refuse_centre(self, depth: Floats) -> None:
        if (depth == 0).any():
            raise GeometryError(f"a point has depth 0 in the camera at {self.position_m}; it has no projection")
