"""Unknown errors of calibration: their size, how they displace detections, and the term in R for them.

The rendered camera stays the true one. The camera that triangulation assumes differs from it by errors of pan, tilt,
focal length and place. There are two kinds:

- **each frame**: every trial has another calibration of all cameras. The second moment over the trials is that over
  calibrations, each used once, which C + GΣGᵀ predicts.
- **frozen**: one draw, the same in all trials, as after a move to presets. A camera has one place and one relative
  error of the focal length at all its settings, and other errors of pan and tilt at each: the motor comes back to a
  preset only so well, while mount and lens stay as they are. Within one draw the error about the truth is a bias plus
  noise; over many draws its second moment is that of the first kind.

(What errors of this size do to the prediction itself, through visibility and H, is left out.)

Nothing is rendered for it. To first order a wrong camera displaces where its model puts a point by J δ, J the
projection's Jacobian and δ the errors; the displacement of the true points (exact, not linearised) is taken off the
detections, which are triangulated with the true cameras.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import scipy.stats

from pss import PTZCamera, RangeError
from pss.cameras.camera import MAX_ABS_TILT_DEG
from pss.cameras.views import Views
from pss.hints import Floats
from pss.noise import PixelCovariance
from render.random_streams import random_stream
from validate.bank.measured import BankData
from validate.points.triangulate import BLUNDER_INFLATION, BLUNDER_TAIL

__all__ = [
    "PTZ_SIZES",
    "CalibrationNoise",
    "CalibrationSizes",
    "disturbed",
    "error_jacobian",
    "passing_covariance",
    "shifts_px",
    "without_blunders",
]


# pan, tilt, relative focal length, x, y, z.
ERRORS = 6
OF_A_SETTING = 2


@dataclass(frozen=True)
class CalibrationSizes:
    """Standard deviations of independent normal errors of one camera.

    Attributes:
        pan_tilt_deg: degrees, of pan and of tilt, each.
        focal_share: of the focal length, relative (0.001 is 0.1 %).
        position_m: m, along each axis of the world.
    """

    pan_tilt_deg: float = 0.0
    focal_share: float = 0.0
    position_m: float = 0.0

    def __post_init__(self) -> None:
        for name, value in dataclasses.asdict(self).items():
            if not 0 <= value < math.inf:
                raise RangeError(f"{name} = {value!r}; allowed: 0 or more")

    @property
    def sigmas(self) -> Floats:
        """rad (pan, tilt), 1 (focal length) and m (x, y, z), (6,)."""
        angle = math.radians(self.pan_tilt_deg)
        return np.array([angle, angle, self.focal_share, *[self.position_m] * 3])

    @property
    def none(self) -> bool:
        """Whether there is no error at all."""
        return not self.sigmas.any()


# One kind of error at a time, then all together. Assumed of real PTZ cameras: pan and tilt come back to 0.01 to 0.1
# degrees, focal length to 0.05 to 0.5 %, places are known to 1 to 5 mm. What is below is where the ranking changes.
PTZ_SIZES = (
    CalibrationSizes(),
    *(CalibrationSizes(pan_tilt_deg=size) for size in (0.0001, 0.0003, 0.001, 0.003, 0.01, 0.05, 0.1)),
    *(CalibrationSizes(focal_share=size) for size in (1e-5, 3e-5, 1e-4, 3e-4, 0.0005, 0.002, 0.005)),
    *(CalibrationSizes(position_m=size) for size in (1e-5, 3e-5, 1e-4, 3e-4, 0.001, 0.005)),
    CalibrationSizes(0.0001, 1e-5, 1e-5),
    CalibrationSizes(0.001, 1e-4, 1e-4),
    CalibrationSizes(0.01, 0.0005, 0.001),
    CalibrationSizes(0.05, 0.002, 0.003),
    CalibrationSizes(0.1, 0.005, 0.005),
)


def disturbed(camera: PTZCamera, sizes: CalibrationSizes, rng: np.random.Generator) -> PTZCamera:
    """A camera as a calibration with errors of these sizes has it."""
    return _moved(camera, sizes.sigmas * rng.standard_normal(ERRORS))


def _moved(camera: PTZCamera, errors: Floats) -> PTZCamera:
    """The camera with `errors` (6,), in the units and the order of `CalibrationSizes.sigmas`.

    The zoom is the motor's set value; a wrong focal length is a wrong assumption of the field of view at that zoom.
    """
    pan, tilt, focal, *place = errors.tolist()
    if not any(errors):
        return camera
    half = math.atan(math.tan(math.radians(camera.horizontal_fov_deg) / 2) / (1 + focal))
    x, y, z = (a + b for a, b in zip(camera.position_m, place, strict=True))
    return dataclasses.replace(
        camera,
        pan_deg=camera.pan_deg + math.degrees(pan),
        # Beyond the vertical a camera would stand on its head: one that looks straight down is off to one side alone.
        tilt_deg=min(max(camera.tilt_deg + math.degrees(tilt), -MAX_ABS_TILT_DEG), MAX_ABS_TILT_DEG),
        widest_fov_deg=2 * math.degrees(half) * camera.zoom,
        position_m=(x, y, z),
    )


def error_jacobian(views: Views) -> Floats:
    """∂pixel/∂error, (C, N, 2, 6): px/rad for pan and tilt, px for the relative focal length, px/m for the place.

    A camera that pans by dφ sees a point x as if that had moved by dφ ẑ × (x − c); one that tilts, by a turn about its
    own x axis; one that moves, by the opposite of its way.
    """
    towards = views.points_m - views.arrays.position_m[:, None]  # (C, N, 3)
    panned = np.cross([0.0, 0.0, 1.0], towards)
    local = views.local_m  # (C, 3, N)
    tilted = np.stack([np.zeros_like(local[:, 0]), local[:, 2], -local[:, 1]], axis=-1) @ views.arrays.rotation
    jacobian = views.jacobian
    turns = jacobian @ np.stack([panned, tilted], axis=-1)
    focal = (views.pixels - views.arrays.principal_point_px[:, None])[..., None]
    return np.concatenate([turns, focal, -jacobian], axis=-1)


@dataclass(frozen=True)
class CalibrationNoise:
    """A factor of R: what unknown errors of calibration add to a detection, J Σ Jᵀ with Σ of their variances.

    It takes points one by one, as PSS does: that all points of a view share one error does not enter.
    """

    sizes: CalibrationSizes
    name: str = "calibration"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², full 2 × 2."""
        scaled = error_jacobian(views) * self.sizes.sigmas
        return PixelCovariance.from_matrix(scaled @ scaled.mT)


def shifts_px(data: BankData, sizes: CalibrationSizes, draw: int | None = None) -> Floats:
    """How far errors of calibration move the projections, px: (V, T, N, 2), or (V, 1, N, 2) of a frozen draw.

    Draws of different sizes are the same but for their scale. Where a view never detected a point it is 0.

    Args:
        draw: number of the frozen draw; None for another calibration in each trial.
    """
    views, trials = data.pixels.shape[:2]
    shifts = np.zeros((views, trials if draw is None else 1, *data.pixels.shape[2:]))
    places = [camera.position_m for camera in data.cameras]
    for view, camera in enumerate(data.cameras):
        seen = np.flatnonzero(data.detected[view].any(axis=0))
        if not seen.size:
            continue
        if draw is None:
            streams = (random_stream(data.seed, f"view {view}", "calibration error", trial) for trial in range(trials))
            wrong = [disturbed(camera, sizes, rng) for rng in streams]
        else:
            # Views from one place are settings of one camera.
            of_setting = random_stream(data.seed, f"view {view}", "frozen calibration error", draw)
            of_camera = random_stream(
                data.seed, f"camera of view {places.index(camera.position_m)}", "frozen calibration error", draw
            )
            errors = [*of_setting.standard_normal(OF_A_SETTING), *of_camera.standard_normal(ERRORS - OF_A_SETTING)]
            wrong = [_moved(camera, sizes.sigmas * np.array(errors))]
        projected = Views([camera, *wrong], data.points_m[seen]).pixels
        shifts[view][:, seen] = projected[1:] - projected[0]
    return shifts


def without_blunders(data: BankData) -> BankData:
    """The detections less those that are blunders by triangulation's own test, held against the truth."""
    residuals = np.nan_to_num(data.residuals())[..., None]
    weight = np.linalg.inv(np.where(data.detected[..., None, None], data.covariance, np.eye(2)))
    chi2 = (residuals.mT @ weight @ residuals)[..., 0, 0]
    blunder = chi2 > BLUNDER_INFLATION * scipy.stats.chi2.isf(BLUNDER_TAIL, 2)
    return dataclasses.replace(data, pixels=np.where(blunder[..., None], np.nan, data.pixels))


def passing_covariance(data: BankData, sizes: CalibrationSizes, term_in_weights: bool) -> Floats:
    """Covariances with which detections that are off by errors of these sizes are no blunders, px², (V, T, N, 2, 2).

    Triangulation's test for blunders is for detections off by their own noise. With the term in the weights J Σ Jᵀ is
    added to each detection's own covariance (J at the true points; at the estimated ones it differs by the error over
    the distance). Without it all are multiplied by one number, which does not change the estimates.
    """
    added = np.zeros((len(data.cameras), len(data.points_m), 2, 2))
    for view, camera in enumerate(data.cameras):
        seen = np.flatnonzero(data.detected[view].any(axis=0))
        if seen.size:
            of_view = CalibrationNoise(sizes).covariance(Views([camera], data.points_m[seen]))
            added[view, seen] = of_view.matrix(1, len(seen))[0]
    added = added[:, None]  # the same in all trials
    if term_in_weights:
        return np.asarray(data.covariance + added)
    own = np.where(data.detected, np.trace(data.covariance, axis1=-2, axis2=-1), np.inf)
    return np.asarray(data.covariance * (1 + float((np.trace(added, axis1=-2, axis2=-1) / own).max())))
