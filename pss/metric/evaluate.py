"""The PSS metric: from cameras and points of interest to σ∞ at each point (section 3.2), then one number (3.3)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from pss.cameras.appearance import Appearance
from pss.cameras.camera import PTZCamera, as_points
from pss.cameras.parameters import Cameras
from pss.cameras.views import Views
from pss.errors import RangeError, ShapeError
from pss.hints import Bools, Floats, Indices
from pss.inputs import members
from pss.metric.evaluation import Evaluation, Evaluations, Task
from pss.modalities.sensors import Sensor
from pss.noise import NoiseModel, noise_model
from pss.processes.process import RandomWalk
from pss.processes.steady_state import Process, as_groups, solve
from pss.riccati.covariances import largest_standard_deviation, to_six
from pss.riccati.solve import measurement_information
from pss.surrogates import Shape
from pss.visibility.detection import DetectionModel
from pss.visibility.expected import expected
from pss.visibility.points import VISIBILITY_TESTS, VisibilityTest, visible_in
from pss.visibility.targets import TARGET_VISIBILITY

__all__ = ["evaluate", "evaluate_many"]


# A unit normal read from a file with seven digits is off by less.
NORMAL_LENGTH_TOLERANCE = 1e-6
DEFAULT_PROCESS = RandomWalk()
# The attribute that identifies a camera.
CAMERA = "focal_px"
# Camera–point pairs at once: enough to hide Python's overhead, few enough for the arrays to stay in the cache.
PAIRS_AT_ONCE = 16384
# Points at once even with thousands of cameras.
SHORTEST_RUN = 128
# Largest number of values kept for the current points, of all cameras, before summing them into configurations.
MOST_NUMBERS_KEPT = 2e7


def evaluate(
    cameras: Sequence[PTZCamera],
    points_m: ArrayLike,
    normals: ArrayLike,
    *,
    noise: NoiseModel | str = "as-printed",
    process: Process | None = None,
    occluder: Sequence[Shape] = (),
    appearance: Appearance | None = None,
    sensors: Sequence[Sensor] = (),
    visibility: Sequence[VisibilityTest] = VISIBILITY_TESTS,
    detection: DetectionModel | None = None,
) -> Evaluation:
    """Evaluate the PSS metric of one configuration (Eqs. 4–10).

    Args:
        cameras: the configuration, C of them.
        points_m: m, points of interest, (N, 3).
        normals: unit outward normals of the surface at the points, (N, 3).
        noise: model of R_k, or its name.
        process: model of A and Q, or one for each point; a random walk of 1 mm a frame if None.
        occluder: shapes that block lines of sight.
        appearance: the targets' size and brightness, for a noise model that needs it ("physical").
        sensors: other modalities, whose measurements are added to those of the cameras.
        visibility: tests that a point must pass to be visible to a camera.
        detection: probability with which a camera finds a visible point (`pss.detection_model`). PSS, C and P∞ are then
            expectations over which cameras find a point (`pss.visibility.expected`), and the default of `visibility` is
            the whole target. If None, every visible point is found.

    Raises:
        ShapeError, RangeError: wrong shapes, values or normals; a noise model's R that is not positive definite.
        RiccatiError: the process model has no steady state, however precisely its position is measured.
    """
    return evaluate_many(
        [members(cameras, "cameras", CAMERA, "cameras")],
        points_m,
        normals,
        noise=noise,
        process=process,
        occluder=occluder,
        appearance=appearance,
        sensors=sensors,
        visibility=visibility,
        detection=detection,
    )[0]


def evaluate_many(
    configurations: Sequence[Sequence[PTZCamera]],
    points_m: ArrayLike,
    normals: ArrayLike,
    *,
    noise: NoiseModel | str = "as-printed",
    process: Process | None = None,
    occluder: Sequence[Shape] = (),
    appearance: Appearance | None = None,
    sensors: Sequence[Sensor] = (),
    visibility: Sequence[VisibilityTest] = VISIBILITY_TESTS,
    detection: DetectionModel | None = None,
) -> Evaluations:
    """Evaluate K configurations at the same points, each a list of cameras; shared cameras are computed once.

    Arguments and errors are those of `evaluate`.
    """
    named = list(_listed(configurations))
    points, unit_normals = as_points(points_m), as_points(normals, "normals")
    _check_points(points, unit_normals)
    if appearance is not None:
        if not isinstance(appearance, Appearance):
            raise RangeError(f"appearance is a {type(appearance).__name__}; allowed: a pss.Appearance, or None")
        appearance.check_length(len(points))
    if not isinstance(noise, str | Path) and not hasattr(noise, "of_views"):
        raise RangeError(f"noise is a {type(noise).__name__}; allowed: a noise model, or its name")
    tests = members(visibility, "visibility", "passed", "tests, as pss.visibility_tests returns them")
    if detection is not None and not hasattr(detection, "probability"):
        raise RangeError(f"detection is a {type(detection).__name__}; allowed: a pss.DetectionModel, or None")
    task = Task(
        points,
        unit_normals,
        noise_model(noise) if isinstance(noise, str | Path) else noise,
        as_groups(DEFAULT_PROCESS if process is None else process, len(points)),
        members(occluder, "occluder", "blocks", "shapes"),
        appearance,
        members(sensors, "sensors", "reaches", "sensors"),
    )
    # Cameras that differ in the name only may still have different sensors in a noise model.
    distinct = tuple({(c, c.name): c for cs in named for c in cs}.values())
    number = {(camera, camera.name): index for index, camera in enumerate(distinct)}
    chosen = tuple(np.array([number[c, c.name] for c in cs], dtype=np.intp) for cs in named)
    of_sensors = _information_of_sensors(task)
    # Only other sensors can measure more of the state than the position, and they do so for every configuration.
    state_information = of_sensors if of_sensors is not None and of_sensors.shape[-1] > 3 else None
    positions = None if of_sensors is None else to_six(of_sensors[:, :3, :3])
    if detection is not None:
        whole = TARGET_VISIBILITY if tests == VISIBILITY_TESTS else tests
        return _expected(distinct, chosen, task, whole, detection, positions, state_information)
    visible, information = _measured(distinct, chosen, task, tests)
    if positions is not None:
        information += positions
    observable, sigma, frame_sigma = solve(task.processes, information, state_information)
    return Evaluations(task, distinct, chosen, visible, observable, information, state_information, sigma, frame_sigma)


def _expected(
    cameras: tuple[PTZCamera, ...],
    configurations: tuple[Indices, ...],
    task: Task,
    tests: Sequence[VisibilityTest],
    detection: DetectionModel,
    positions: Floats | None,
    state_information: Floats | None,
) -> Evaluations:
    """Evaluations where each camera finds a visible point with a probability.

    Args:
        positions: 1/m², six entries of the other sensors' information on the position, (6, N).
        state_information: their information on the whole state, (N, n, n).
    """
    N = len(task.points_m)
    visible, found = np.zeros((len(cameras), N), dtype=np.bool_), np.zeros((len(cameras), N))
    of_cameras = np.zeros((len(cameras), 6, N))
    points_at_once = max(1, PAIRS_AT_ONCE // max(len(cameras), 1))
    for start in range(0, N, points_at_once) if cameras else ():
        part = slice(start, start + points_at_once)
        at = task.at(part)
        views = Views(Cameras(cameras), at.points_m, at.normals, at.appearance)
        visible[:, part] = visible_in(views, task.occluder, tests)
        found[:, part] = np.where(visible[:, part], detection.probability(views), 0.0)
        of_cameras[:, :, part] = task.noise.information(views, visible[:, part])
    over_sets = tuple(expected(of_cameras[chosen], found[chosen], positions) for chosen in configurations)
    information = np.array([over.information for over in over_sets]).reshape(-1, 6, N)
    observable, sigma, _ = solve(task.processes, information, state_information)
    covariance = np.array([over.covariance_m2 for over in over_sets]).reshape(-1, N, 3, 3)
    frame_sigma = np.where(observable, largest_standard_deviation(covariance), np.nan)
    return Evaluations(
        task,
        cameras,
        configurations,
        visible,
        observable,
        information,
        state_information,
        sigma,
        frame_sigma,
        found,
        over_sets,
    )


def _listed(configurations: Iterable[Iterable[PTZCamera]]) -> Iterator[tuple[PTZCamera, ...]]:
    """Each configuration's cameras, as tuples."""
    if configurations is None or not isinstance(configurations, Iterable) or isinstance(configurations, str | bytes):
        what = "None" if configurations is None else f"a {type(configurations).__name__}"
        raise RangeError(f"configurations is {what}; allowed: a list of lists of cameras")
    for number, cameras in enumerate(configurations):
        yield members(cameras, f"configurations[{number}]", CAMERA, "cameras")


def _measured(
    cameras: tuple[PTZCamera, ...],
    configurations: tuple[Indices, ...],
    task: Task,
    tests: Sequence[VisibilityTest],
) -> tuple[Bools, Floats]:
    """Visibility, (U, N), and the cameras' information in each configuration, (K, 6, N), in 1/m²."""
    U, K, N = len(cameras), len(configurations), len(task.points_m)
    visible, information = np.zeros((U, N), dtype=np.bool_), np.zeros((K, 6, N))
    points_at_once = min(max(PAIRS_AT_ONCE // max(U, 1), SHORTEST_RUN), int(MOST_NUMBERS_KEPT / (6 * max(U, 1))))
    points_at_once = max(1, min(N, points_at_once))
    cameras_at_once = max(1, PAIRS_AT_ONCE // points_at_once)
    parts = [slice(start, start + cameras_at_once) for start in range(0, U, cameras_at_once)]
    blocks = [(rows, Cameras(cameras[rows])) for rows in parts]
    everything = K == 1 and len(blocks) == 1
    for start in range(0, N, points_at_once):
        part = slice(start, start + points_at_once)
        of_points = task.at(part)
        kept = []
        for rows, block in blocks:
            visible[rows, part], six = _information(block, of_points, tests)
            kept.append(six)
        if everything:  # the one configuration has all cameras
            information[0, :, part] = kept[0][configurations[0]].sum(axis=0)
        elif U:
            of_cameras = np.concatenate(kept)
            for k, chosen in enumerate(configurations):
                information[k, :, part] = of_cameras[chosen].sum(axis=0)
    return visible, information


def _information(cameras: Cameras, task: Task, tests: Sequence[VisibilityTest]) -> tuple[Bools, Floats]:
    """Visibility, (C, n), and HᵀR⁻¹H of each camera, (C, 6, n); with Eq. 5's batch, ĤᵀR̂⁻¹Ĥ is their sum."""
    views = Views(cameras, task.points_m, task.normals, task.appearance)
    visible = visible_in(views, task.occluder, tests)
    return visible, task.noise.information(views, visible)


def _information_of_sensors(task: Task) -> Floats | None:
    """HᵀR⁻¹H of the other modalities, (N, 3, 3) or of the whole state (N, n, n); None without any."""
    if not task.sensors:
        return None
    N, states = len(task.points_m), max(model.states for model, _ in task.processes)
    total = np.zeros((N, states, states))
    state_information = False
    for sensor in task.sensors:
        rows = np.flatnonzero(sensor.reaches(task.points_m, task.normals, task.occluder))
        if len(rows) == 0:
            continue
        jacobian = np.asarray(sensor.jacobian(task.points_m[rows]), dtype=float)
        known = jacobian.shape[-1]
        if jacobian.ndim != 3 or len(jacobian) != len(rows) or known not in (3, states):
            raise ShapeError(
                f"sensor {sensor.name!r} has a Jacobian of shape {jacobian.shape}; "
                f"allowed: ({len(rows)}, m, 3) or ({len(rows)}, m, {states})"
            )
        if known > 3 and len(task.processes) > 1:
            raise ShapeError(f"sensor {sensor.name!r} measures the whole state; allowed: one process for all points")
        state_information |= known > 3
        total[rows, :known, :known] += measurement_information(jacobian, sensor.covariance(task.points_m[rows]))
    return total if state_information else total[:, :3, :3]


def _check_points(points: Floats, normals: Floats) -> None:
    if points.ndim != 2 or points.shape != normals.shape:
        raise ShapeError(f"points_m {points.shape} and normals {normals.shape}; allowed are two alike, (N, 3)")
    if len(points) == 0:
        raise ShapeError(f"points_m has shape {points.shape}; allowed is (N, 3) with at least one point")
    lengths = np.sqrt(np.einsum("ni,ni->n", normals, normals))
    if (np.abs(lengths - 1) > NORMAL_LENGTH_TOLERANCE).any():
        worst = float(lengths[np.abs(lengths - 1).argmax()])
        raise RangeError(f"a normal has length {worst:.6g}; allowed is 1 ± {NORMAL_LENGTH_TOLERANCE:g}")
