"""Results of the metric for one configuration or many: the arrays behind Eq. 10, and what derives from them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pss.cameras.appearance import Appearance
from pss.cameras.camera import PTZCamera
from pss.cameras.views import Views
from pss.hints import Bools, Floats, Indices
from pss.modalities.sensors import Sensor
from pss.noise import NoiseModel
from pss.processes.process import ProcessModel
from pss.processes.steady_state import of_state, prior_covariance
from pss.riccati.covariances import from_six, largest_standard_deviation, mean_inverse_sigma, root_trace
from pss.riccati.solve import posterior_covariance
from pss.surrogates import Shape
from pss.visibility.expected import Expected

__all__ = ["Evaluation", "Evaluations", "Task"]


@dataclass(frozen=True, eq=False)
class Task:
    """What all configurations of an evaluation share: N points, and the models of noise and process.

    Attributes:
        points_m: m, (N, 3).
        normals: unit outward normals, (N, 3).
        noise: model of R_k.
        processes: each process model with the indices of its points.
        occluder: shapes that block lines of sight.
        appearance: size, brightness and motion of the targets; None if no factor or test needs it.
        sensors: other modalities.
    """

    points_m: Floats
    normals: Floats
    noise: NoiseModel
    processes: list[tuple[ProcessModel, Indices]]
    occluder: tuple[Shape, ...] = ()
    appearance: Appearance | None = None
    sensors: tuple[Sensor, ...] = ()

    def at(self, part: slice) -> Task:
        """The task at a slice of the points, for the cameras' views of them; `processes` stay those of all points."""
        appearance = None if self.appearance is None else self.appearance.at(part)
        return dataclasses.replace(
            self, points_m=self.points_m[part], normals=self.normals[part], appearance=appearance
        )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Results for one configuration of C cameras at N points, with a state of up to n numbers.

    Unobservable points have nan in every array but `visible`, `observable` and `information`. Where points have process
    models of different size, n is the largest, and the missing entries of a smaller one are nan.

    Attributes:
        task: the points and models.
        cameras: C of them.
        visible: (C, N), whether the camera sees the point.
        observable: (N,), whether the measurements determine all three coordinates, within double precision, and Eq. 4
            has a solution. With cameras alone it takes two that are not collinear with the point.
        information: ĤᵀR̂⁻¹Ĥ of Eq. 5's batch, (N, 3, 3) in 1/m²; (N, n, n) if a sensor measures more than positions.
        sigma_m: m, σ∞ of Eq. 9, of the position block, (N,).
        single_frame_sigma_m: m, √λmax of C = (Σ HᵀR⁻¹H)⁻¹, the triangulation of one frame, (N,).
        detection: probability that each camera finds each point, (C, N); 0 where the point is not visible. None without
            `evaluate(…, detection=…)`: every visible point is found.
        expected: with `detection`, expectations over which cameras find each point. `information` and C are then
            conditional on the point being found, and σ∞ is that of a filter with this information in each frame.
    """

    task: Task
    cameras: tuple[PTZCamera, ...]
    visible: Bools
    observable: Bools
    information: Floats
    sigma_m: Floats
    single_frame_sigma_m: Floats
    detection: Floats | None = None
    expected: Expected | None = None

    @property
    def points_m(self) -> Floats:
        """Metres, the points of interest, (N, 3)."""
        return self.task.points_m

    @property
    def normals(self) -> Floats:
        """Unit outward normals, (N, 3)."""
        return self.task.normals

    @cached_property
    def covariance(self) -> Floats:
        """A-priori P∞, Eq. 4, (N, n, n); the position block is in m²."""
        return prior_covariance(self.task.processes, self.information, self.observable)

    @cached_property
    def posterior(self) -> Floats:
        """A-posteriori P⁺∞, (N, n, n): P∞ after its update with one frame."""
        filled = np.full_like(self.covariance, np.nan)
        for model, indices in self.task.processes:
            rows, n = indices[self.observable[indices]], model.states
            prior = self.covariance[rows, :n, :n]
            filled[rows, :n, :n] = posterior_covariance(prior, of_state(self.information[rows], n))
        return filled

    @cached_property
    def single_frame_covariance(self) -> Floats:
        """m², (N, 3, 3), C = (Σ HᵀR⁻¹H)⁻¹ of one frame's triangulation; with `detection`, E[C | found]."""
        if self.expected is not None:
            return self.expected.covariance_m2
        filled = np.full((len(self.observable), 3, 3), np.nan)
        filled[self.observable] = np.linalg.inv(self.information[self.observable, :3, :3])
        return filled

    @property
    def rms_m(self) -> Floats:
        """Metres, √tr of the position block of P∞, (N,)."""
        return root_trace(self.covariance[:, :3, :3])

    @property
    def posterior_sigma_m(self) -> Floats:
        """Metres, √λmax of the position block of P⁺∞, (N,)."""
        return largest_standard_deviation(self.posterior[:, :3, :3])

    @property
    def posterior_rms_m(self) -> Floats:
        """Metres, √tr of the position block of P⁺∞, (N,)."""
        return root_trace(self.posterior[:, :3, :3])

    @property
    def single_frame_rms_m(self) -> Floats:
        """Metres, √tr of C, (N,); its measured counterpart is the RMS error of triangulated points."""
        return root_trace(self.single_frame_covariance)

    @property
    def whole_state_sigma(self) -> Floats:
        """√λmax of all of P∞, Eq. 9 to the letter, (N,): for states with velocity it mixes m with m/s."""
        sigma = np.full(len(self.observable), np.nan)
        for model, indices in self.task.processes:
            sigma[indices] = largest_standard_deviation(self.covariance[indices, : model.states, : model.states])
        return sigma

    @property
    def found(self) -> Floats:
        """Probability, (N,), that a point is found by enough cameras to determine it; 1 or 0 without `detection`."""
        return self.observable.astype(float) if self.expected is None else self.expected.found

    @property
    def inverse_sigma(self) -> Floats:
        """1/m, (N,), each point's contribution to the mean of Eq. 10; 0 where it is not observable.

        With `detection`, 1/σ∞ times the probability that the point is found.
        """
        return np.nan_to_num((1 if self.expected is None else self.expected.found) / self.sigma_m)

    @property
    def single_frame_inverse_sigma(self) -> Floats:
        """1/m, (N,), as `inverse_sigma` with √λmax of C in place of σ∞; with `detection`, E[1/√λmax C]."""
        if self.expected is not None:
            return self.expected.inverse_sigma
        return np.nan_to_num(1 / self.single_frame_sigma_m)

    @property
    def pss(self) -> float:
        """1/m, Eq. 10; with `detection`, each point is weighted by the probability that it is found."""
        if self.expected is not None:
            return float(self.inverse_sigma.mean())
        return mean_inverse_sigma(self.sigma_m)

    @property
    def pss_single_frame(self) -> float:
        """1/m, Eq. 10 with √λmax of C in place of σ∞; with `detection`, the mean of E[1/√λmax C]."""
        if self.expected is not None:
            return float(self.expected.inverse_sigma.mean())
        return mean_inverse_sigma(self.single_frame_sigma_m)

    @cached_property
    def views(self) -> Views:
        """Distances, angles, pixels and Jacobians of all points in all cameras, visible or not."""
        return Views(self.cameras, self.points_m, self.normals, self.task.appearance)

    @cached_property
    def jacobian(self) -> Floats:
        """px/m, H_k, (C, N, 2, 3), of all points, visible or not."""
        return self.views.jacobian

    @cached_property
    def noise_px2(self) -> Floats:
        """px², R_k, (C, N, 2, 2), of all points, visible or not."""
        return self.task.noise.of_views(self.views).matrix(*self.visible.shape)

    @cached_property
    def camera_information(self) -> Floats:
        """1/m², HᵀR⁻¹H of each camera, (C, N, 3, 3); zero where the point is not visible."""
        six = self.task.noise.information(self.views, self.visible)
        return from_six(six.swapaxes(0, 1).reshape(6, -1)).reshape(*self.visible.shape, 3, 3)


@dataclass(frozen=True, eq=False)
class Evaluations(Sequence[Evaluation]):
    """Results for K configurations at N points. Item k is the `Evaluation` of one configuration.

    Attributes:
        task: the points and models that all configurations share.
        cameras: the distinct cameras of all configurations, U of them.
        configurations: indices into `cameras` of each configuration's cameras.
        visible: (U, N).
        observable: (K, N).
        information: 1/m², entries xx, xy, xz, yy, yz, zz of the position block, (K, 6, N).
        state_information: information of other sensors on the whole state, (N, n, n); None if they measure positions
            only.
        sigma_m: m, σ∞, (K, N).
        single_frame_sigma_m: m, (K, N).
        detection: (U, N), as in `Evaluation`; None without `evaluate_many(…, detection=…)`.
        expected: one for each configuration, as in `Evaluation`; None without `detection`.
    """

    task: Task
    cameras: tuple[PTZCamera, ...]
    configurations: tuple[Indices, ...]
    visible: Bools
    observable: Bools
    information: Floats
    state_information: Floats | None
    sigma_m: Floats
    single_frame_sigma_m: Floats
    detection: Floats | None = None
    expected: tuple[Expected, ...] | None = None

    def __len__(self) -> int:
        return len(self.configurations)

    def __iter__(self) -> Iterator[Evaluation]:
        return (self[k] for k in range(len(self)))

    def __getitem__(self, k: int) -> Evaluation:  # type: ignore[override]  # no slices: a batch is indexed by number
        chosen = self.configurations[k]
        information = from_six(self.information[k])
        if self.state_information is not None:
            information, positions = self.state_information.copy(), information
            information[:, :3, :3] = positions
        return Evaluation(
            self.task,
            tuple(self.cameras[i] for i in chosen),
            self.visible[chosen],
            self.observable[k],
            information,
            self.sigma_m[k],
            self.single_frame_sigma_m[k],
            None if self.detection is None else self.detection[chosen],
            None if self.expected is None else self.expected[k],
        )

    @property
    def pss(self) -> Floats:
        """1/m, Eq. 10 of each configuration, (K,)."""
        if self.expected is not None:
            return np.array([evaluation.pss for evaluation in self])
        return np.asarray(np.nansum(1 / self.sigma_m, axis=1) / self.sigma_m.shape[1])

    @property
    def pss_single_frame(self) -> Floats:
        """1/m, Eq. 10 with √λmax of C, (K,)."""
        if self.expected is not None:
            return np.array([evaluation.pss_single_frame for evaluation in self])
        return np.asarray(np.nansum(1 / self.single_frame_sigma_m, axis=1) / self.sigma_m.shape[1])
