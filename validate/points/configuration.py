"""What the images of one configuration of cameras measure: triangulated and tracked points, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pss import PTZCamera
from pss.hints import Floats
from pss.riccati.covariances import largest_standard_deviation, root_trace
from scenes import Scene
from validate.markers.view_measurement import ViewMeasurement
from validate.points.error_budget import propagated_errors
from validate.points.static_filter import Tracked, track_static
from validate.points.triangulate import Triangulated, triangulate
from validate.stats.measured_errors import MeasuredErrors, measured_inverse_sigma, measured_pss

__all__ = ["Measured", "measure_configuration", "triangulated_errors"]


@dataclass(frozen=True, eq=False)
class Measured:
    """Measurements from the images of one configuration, independent of the noise model.

    Attributes:
        errors: of the maximum likelihood estimate over all views.
        linear: of `cv2.triangulatePoints` over the widest pair.
        triangulated: the estimates themselves.
        propagated: of the same detections, carried to the points by linear geometry.
        tracked: second moments of the static filter's errors.
    """

    errors: MeasuredErrors
    linear: MeasuredErrors
    triangulated: Triangulated
    propagated: MeasuredErrors
    tracked: Tracked

    @property
    def filter_sigma_m(self) -> Floats:
        """m, (N,), √λmax of the filter's predicted error: what σ∞ is compared with."""
        return largest_standard_deviation(self.tracked.prior_moment_m2)

    @property
    def prior_rms_m(self) -> Floats:
        """m, (N,), √tr of the filter's predicted error."""
        return root_trace(self.tracked.prior_moment_m2)

    @property
    def posterior_rms_m(self) -> Floats:
        """m, (N,), √tr of the filter's updated error."""
        return root_trace(self.tracked.posterior_moment_m2)

    @property
    def inverse_filter_sigma(self) -> Floats:
        """1/m, (N,), what each point adds to `pss_filter`."""
        return measured_inverse_sigma(self.filter_sigma_m, self.errors.detection_rate)

    @property
    def own_nees(self) -> Floats:
        """(N,), mean eᵀC⁻¹e with the covariance that the detections claim for themselves; 3 where they are right."""
        errors, covariance = self.errors.errors_m, self.triangulated.covariance_m2
        known = self.errors.detected
        values = np.full(known.shape, np.nan)
        weighted = np.linalg.solve(covariance[known], errors[known][..., None])[..., 0]
        values[known] = (errors[known] * weighted).sum(axis=-1)
        counts = known.sum(axis=0)
        return np.where(counts > 0, np.nansum(values, axis=0) / np.maximum(counts, 1), np.nan)

    @property
    def pss_filter(self) -> float:
        """1/m, measured PSS of the filter kind (beside the paper's PSS)."""
        return measured_pss(self.filter_sigma_m, self.errors.detection_rate)


def triangulated_errors(
    scene: Scene, cameras: Sequence[PTZCamera], views: Sequence[ViewMeasurement]
) -> tuple[Triangulated, MeasuredErrors]:
    """Triangulate the points of interest in every trial, and their errors."""
    pixels = np.array([view.pixels for view in views])
    covariance = np.array([view.covariance for view in views])
    triangulated = triangulate(cameras, pixels, covariance)
    return triangulated, MeasuredErrors(triangulated.points_m - scene.state.points_m)


def measure_configuration(
    scene: Scene, cameras: Sequence[PTZCamera], views: Sequence[ViewMeasurement], rng: np.random.Generator
) -> Measured:
    """Triangulate and track the points of interest from the detections of a configuration's views."""
    truth = scene.state.points_m
    triangulated, errors = triangulated_errors(scene, cameras, views)
    usable = np.isfinite(triangulated.points_m[..., 0])
    kept = np.where(triangulated.used[..., None], [view.pixels for view in views], np.nan)
    covariance = np.array([view.covariance for view in views])
    return Measured(
        errors,
        MeasuredErrors(triangulated.linear_m - truth),
        triangulated,
        propagated_errors(cameras, truth, kept, covariance, triangulated.used),
        track_static(cameras, truth, kept, covariance, usable, scene.process, rng),
    )
