"""Set prediction and measurement of one configuration side by side: the only place where the two meet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss import Appearance, Evaluation, PTZCamera, evaluate
from pss.hints import Floats
from pss.riccati.covariances import largest_standard_deviation, root_trace
from scenes import Scene
from validate.markers.view_measurement import ViewMeasurement
from validate.points.error_budget import propagated_errors
from validate.points.static_filter import Tracked, track_static
from validate.points.triangulate import Triangulated, triangulate
from validate.stats.measured_errors import MeasuredErrors, measured_inverse_sigma, measured_pss

__all__ = ["Assessment", "Measured", "assess", "measure_configuration", "predict", "triangulated_errors"]


@dataclass(frozen=True, eq=False)
class Measured:
    """What the images of one configuration say, whatever the noise model.

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


@dataclass(frozen=True, eq=False)
class Assessment:
    """A configuration with its prediction by each noise model and its measurement."""

    cameras: tuple[PTZCamera, ...]
    predicted: Mapping[str, Evaluation]
    measured: Measured
    view_detection_rate: Floats
    """(C, N), share of the trials in which each view detected each marker."""


def predict(scene: Scene, cameras: Sequence[PTZCamera], appearance: Appearance | None = None) -> dict[str, Evaluation]:
    """The metric of a configuration, by the name of each of the scene's noise models."""
    state = scene.state
    return {
        model.name: evaluate(
            cameras,
            state.points_m,
            state.normals,
            noise=model,
            process=scene.process,
            occluder=state.occluders,
            appearance=appearance,
            visibility=scene.visibility,
        )
        for model in scene.noise_models
    }


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


def assess(
    scene: Scene,
    cameras: Sequence[PTZCamera],
    views: Sequence[ViewMeasurement],
    rng: np.random.Generator,
    appearance: Appearance | None = None,
) -> Assessment:
    """Predict, from how the markers look in the scene's light, and measure one configuration."""
    return Assessment(
        tuple(cameras),
        predict(scene, cameras, appearance),
        measure_configuration(scene, cameras, views, rng),
        np.array([view.detected.mean(axis=0) for view in views]),
    )
