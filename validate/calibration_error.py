"""What errors of calibration do to the ranking by PSS, and whether a term in R for them repairs it.

The rendered camera stays the true one. The camera that triangulation assumes differs from it by errors of pan, tilt,
focal length and place of which it does not know, drawn anew for each trial of each view, as of a PTZ camera that
re-aims for every frame. So a bias that stays in use, one draw for all frames, shows here as a spread: over the trials
the second moment is that of many calibrations, each used once. All points of a trial in a view share its draw. (What
errors of this size do to the prediction itself, through visibility and H, is left out.)

Nothing is rendered for it. To first order a wrong camera displaces where its model puts a point by J δ, J the
projection's Jacobian and δ the errors; the study takes the displacement of the true points (exact, not linearised) off
the detections and triangulates them with the true cameras, all trials at once.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from pss import NoiseModel, PTZCamera, RangeError
from pss.camera import MAX_ABS_TILT_DEG
from pss.noise import PixelCovariance
from pss.views import Views
from render.view import random_stream
from validate.bank.measured import BankData, measure_all
from validate.bank.ranking import Resamples, judge_against
from validate.triangulate import BLUNDER_INFLATION, BLUNDER_TAIL

__all__ = [
    "PTZ_SIZES",
    "CalibrationNoise",
    "CalibrationSizes",
    "calibration_noise",
    "displaced",
    "disturbed",
    "error_jacobian",
    "study",
]

Floats = NDArray[np.float64]
Row = dict[str, object]

# pan, tilt, relative focal length, x, y, z.
ERRORS = 6


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

    The zoom is what the motor is told; a wrong focal length is a wrong belief of the field of view that goes with it.
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


def calibration_noise(sizes: CalibrationSizes) -> CalibrationNoise:
    """The noise factor for errors of these sizes: `model.plus(calibration_noise(sizes))`."""
    return CalibrationNoise(sizes)


def displaced(data: BankData, sizes: CalibrationSizes) -> BankData:
    """The detections as if their cameras were wrong by a draw for each view and trial; `data` itself without errors.

    Draws of different sizes are the same but for their scale. Triangulation's test for blunders is for detections off
    by their own noise: the covariances are multiplied, all by one number, until errors of these sizes pass it, which
    leaves the estimates as they are. What is a blunder without errors (by that test, against the truth) is left out.
    """
    if sizes.none:
        return data
    pixels = data.pixels.copy()
    views, trials = pixels.shape[:2]
    residuals = np.nan_to_num(data.residuals())[..., None]
    weight = np.linalg.inv(np.where(data.detected[..., None, None], data.covariance, np.eye(2)))
    chi2 = (residuals.mT @ weight @ residuals)[..., 0, 0]
    pixels[chi2 > BLUNDER_INFLATION * scipy.stats.chi2.isf(BLUNDER_TAIL, 2)] = np.nan
    ratio = 0.0
    for view in range(views):
        camera = data.cameras[view]
        seen = np.flatnonzero(data.detected[view].any(axis=0))
        if not seen.size:
            continue
        points = data.points_m[seen]
        right = camera.project(points)[0]
        for trial in range(trials):
            rng = random_stream(data.seed, f"view {view}", "calibration error", trial)
            pixels[view, trial, seen] -= disturbed(camera, sizes, rng).project(points)[0] - right
        added = CalibrationNoise(sizes).covariance(Views([camera], points)).matrix(1, len(seen))[0]
        own = data.covariance[view][:, seen]
        with np.errstate(invalid="ignore", divide="ignore"):
            of_view = np.trace(added, axis1=-2, axis2=-1) / np.trace(own, axis1=-2, axis2=-1)
        ratio = max(ratio, float(np.nanmax(of_view)))
    return dataclasses.replace(data, pixels=pixels, covariance=data.covariance * (1 + ratio))


def study(
    data: BankData,
    configurations: NDArray[np.int64],
    model: NoiseModel,
    predict: Callable[[NoiseModel], Floats],
    sizes: Sequence[CalibrationSizes] = PTZ_SIZES,
    processes: int | None = None,
) -> list[Row]:
    """A row for each size of error: how PSS, without and with a term for it, ranks what is then measured.

    Args:
        configurations: views of each, (K, c).
        model: of R, without the errors.
        predict: 1/m, terms of the single-frame PSS under a noise model, (K, N), 0 where not observable.

    Returns:
        Sizes; medians over the configurations of the measured PSS (1/m) and of the pooled RMS (m); Spearman's ρ of the
        measured PSS with the prediction by `model` ("plain") and by `model` plus the term ("with_term"), and what the
        term gains, each with a 95 % interval over views and points, all on the same resamples.
    """
    chosen = np.asarray(configurations)
    plain = predict(model)
    chance = Resamples.of_configurations(chosen, len(data.points_m), [camera.name for camera in data.cameras])
    rows: list[Row] = []
    for size in sizes:
        measured = [found.errors for found in measure_all(displaced(data, size), chosen.tolist(), processes=processes)]
        terms = np.array([errors.inverse_sigma for errors in measured])
        # Without errors the term is zero, and predictions are the same to the last bit.
        with_term = plain if size.none else predict(model.plus(CalibrationNoise(size)))
        before, after = (judge_against(prediction, terms, chance) for prediction in (plain, with_term))
        row: Row = dataclasses.asdict(size) | {
            "n": len(chosen),
            "median_pss": float(np.median(terms.mean(axis=1))),
            "median_rms_m": float(np.nanmedian([errors.pooled_rms_m for errors in measured])),
        }
        for name, judged in (("plain", before), ("with_term", after), ("gain", after.minus(before))):
            low, high = judged.interval
            row |= {f"spearman_{name}": judged.estimate, f"spearman_{name}_low": low, f"spearman_{name}_high": high}
        rows.append(row)
    return rows
