"""σ∞ at N points from the information of their measurements, by the fastest method that each process model allows."""

from __future__ import annotations

import functools
from collections.abc import Hashable, Sequence
from typing import Any, cast

import numpy as np

from pss.errors import ShapeError
from pss.hints import Bools, Floats, Indices
from pss.inputs import members
from pss.processes.own_process import LinearProcess, PerPoint
from pss.processes.process import ProcessModel
from pss.riccati.axes import axis_blocks, position_variance
from pss.riccati.covariances import from_six, largest_standard_deviation
from pss.riccati.observability import smallest_eigenvalue_3x3
from pss.riccati.solve import steady_state_covariance_from_information

__all__ = ["Process", "as_groups", "of_state", "position_sigma", "prior_covariance", "resolvable", "solve"]

Groups = list[tuple[ProcessModel, Indices]]
Process = ProcessModel | PerPoint | Sequence[ProcessModel]


# Rays too close to parallel for double precision carry no depth: smallest eigenvalue over trace of J.
SMALLEST_INFORMATION_RATIO = 1e-13
# For fewer matrices LAPACK is faster than the NumPy calls of the closed form.
FEWEST_IN_CLOSED_FORM = 400
# 3 × 3 matrices at once: their arrays stay in the cache.
MATRICES_AT_ONCE = 16384
# n × n systems at once: bounds the memory of the general methods.
SYSTEMS_AT_ONCE = 8192
MODELS_REMEMBERED = 64


def as_groups(process: Process, points: int) -> Groups:
    """Each model with the indices of its points.

    Raises:
        ShapeError: models or matrices for another number of points.
    """
    if not hasattr(process, "states") and not isinstance(process, PerPoint):
        models: tuple[ProcessModel, ...] = members(process, "process", "states", "process models, or one")
        distinct = list({id(model): model for model in models}.values())
        number = {id(model): index for index, model in enumerate(distinct)}
        process = PerPoint(distinct, np.array([number[id(model)] for model in models], dtype=np.intp))
    if isinstance(process, PerPoint):
        if len(process.index) != points:
            raise ShapeError(f"process is given for {len(process.index)} points; allowed: {points}, the points'")
        groups = list(process.groups())
    else:
        groups = [(cast(ProcessModel, process), np.arange(points))]
    for model, indices in groups:
        for M in (model.A, model.Q):
            if M.ndim == 3 and len(M) != len(indices):
                raise ShapeError(f"a process has matrices for {len(M)} points; allowed: one, or {len(indices)}")
    return groups


def of_state(information: Floats, states: int) -> Floats:
    """Information on positions (or more), (N, k, k), embedded in that on the whole state, (N, n, n)."""
    known = information.shape[-1]
    whole = np.zeros((len(information), states, states))
    whole[:, :known, :known] = information
    return whole


def solve(groups: Groups, information: Floats, state_information: Floats | None) -> tuple[Bools, Floats, Floats]:
    """Observable points of K configurations, and their σ∞ and √λmax of C in m; (K, N) each, nan if unobservable.

    Args:
        information, state_information: as in `position_sigma`.

    Raises:
        RiccatiError: as `position_sigma`.
    """
    observable, smallest = resolvable(information)
    sigma = position_sigma(groups, information, state_information, smallest, observable)
    observable &= np.isfinite(sigma)  # a point for which Eq. 4 fails is unobservable to within rounding
    frame_sigma = np.full(smallest.shape, np.nan)
    frame_sigma[observable] = 1 / np.sqrt(smallest[observable])
    return observable, sigma, frame_sigma


def resolvable(information: Floats) -> tuple[Bools, Floats]:
    """Whether measurements determine all three coordinates in double precision, and λmin in 1/m².

    Args:
        information: 1/m², entries xx, xy, xz, yy, yz, zz, (K, 6, N).

    Returns:
        (K, N) both; λmin is 0 where nothing is measured.
    """
    trace = information[:, 0] + information[:, 3] + information[:, 5]
    smallest = _smallest_eigenvalues(information, trace > 0)
    return np.asarray(smallest > SMALLEST_INFORMATION_RATIO * trace), smallest


def _smallest_eigenvalues(information: Floats, measured: Bools) -> Floats:
    """1/m², of the matrices whose six entries are on the middle axis, (K, 6, N), zero if not `measured`; (K, N)."""
    K, _, N = information.shape
    smallest = np.zeros((K, N))
    k_at_once = max(1, MATRICES_AT_ONCE // max(N, 1))
    for k in range(0, K, k_at_once):
        for n in range(0, N, MATRICES_AT_ONCE):
            rows, columns = slice(k, k + k_at_once), slice(n, n + MATRICES_AT_ONCE)
            chosen = measured[rows, columns]
            entries = [information[rows, entry, columns][chosen] for entry in range(6)]
            few = len(entries[0]) < FEWEST_IN_CLOSED_FORM
            found = np.linalg.eigvalsh(from_six(np.array(entries)))[:, 0] if few else smallest_eigenvalue_3x3(*entries)
            smallest[rows, columns][chosen] = found
    return smallest


def position_sigma(
    groups: Groups, information: Floats, state_information: Floats | None, smallest: Floats, selected: Bools
) -> Floats:
    """m, σ∞ of the position block (Eq. 9) of K configurations at N points, (K, N); nan if not selected or not solvable.

    Args:
        information: 1/m², six entries of the position block, (K, 6, N).
        state_information: information on the whole state, (N, n, n), whose position block is in `information`; or None.
        smallest: 1/m², smallest eigenvalue of the position block, (K, N).
        selected: the points to solve for, (K, N).

    Raises:
        RiccatiError: a process has no steady state even if all directions are measured equally well.
    """
    sigma = np.full(selected.shape, np.nan)
    for model, points in groups:
        blocks = _axis_blocks(model) if state_information is None else None
        configuration, place = np.nonzero(selected[:, points])
        if len(place) == 0:
            continue
        if blocks is not None:
            # The eigenvalues of the position block decrease with those of J: the largest belongs to the smallest.
            variance = position_variance(*blocks, smallest[configuration, points[place]], unsolvable="nan")
            if not np.isfinite(variance).all():
                _blame_the_process(model, from_six(information[configuration, :, points[place]].T))
            sigma[configuration, points[place]] = np.sqrt(variance)
            continue
        for start in range(0, len(place), SYSTEMS_AT_ONCE):
            of_k, of_n = configuration[start : start + SYSTEMS_AT_ONCE], place[start : start + SYSTEMS_AT_ONCE]
            known = from_six(information[of_k, :, points[of_n]].T)
            if state_information is not None:
                known, positions = state_information[points[of_n]].copy(), known
                known[:, :3, :3] = positions
            prior = _covariance(_chosen(model, of_n), known)
            sigma[of_k, points[of_n]] = largest_standard_deviation(prior[:, :3, :3])
    return sigma


def _axis_blocks(model: ProcessModel) -> tuple[Floats, Floats] | None:
    """A₀ and Q₀ of a model with equal axes (`pss.riccati.axes`), cached."""
    try:
        return _found_axis_blocks(cast(Hashable, model))
    except TypeError:  # a user-defined model that cannot be hashed
        return _found_axis_blocks.__wrapped__(model)


@functools.lru_cache(maxsize=MODELS_REMEMBERED)
def _found_axis_blocks(model: Any) -> tuple[Floats, Floats] | None:
    return axis_blocks(model.A, model.Q, np.zeros((model.states, model.states)))


def prior_covariance(groups: Groups, information: Floats, selected: Bools) -> Floats:
    """P∞, (N, n, n) with the largest n of the models; nan where not selected, undefined or not solvable.

    Args:
        information: of the position (N, 3, 3) in 1/m², or of the state, (N, n, n).
        selected: the points to solve for, (N,).
    """
    states = max(model.states for model, _ in groups)
    filled = np.full((len(selected), states, states), np.nan)
    for model, points in groups:
        place = np.flatnonzero(selected[points])
        if len(place):
            rows = points[place]
            filled[rows, : model.states, : model.states] = _covariance(_chosen(model, place), information[rows])
    return filled


def _chosen(model: ProcessModel, places: Indices) -> ProcessModel:
    """The model restricted to some of its points, where it has matrices for each."""
    return model.at(places) if isinstance(model, LinearProcess) else model


def _covariance(model: ProcessModel, information: Floats) -> Floats:
    """P∞ of points with one model, (V, n, n); nan where Eq. 4 has no numerical solution."""
    prior = steady_state_covariance_from_information(
        model.A, model.Q, of_state(information, model.states), unsolvable="nan"
    )
    if not np.isfinite(prior).all():
        _blame_the_process(model, information)
    return prior


def _blame_the_process(model: ProcessModel, information: Floats) -> None:
    """Raise `RiccatiError` if the process has no steady state even when all directions are measured equally well."""
    alike = np.trace(information[:, :3, :3], axis1=-2, axis2=-1)[:, None, None] / 3 * np.eye(3)
    steady_state_covariance_from_information(model.A, model.Q, of_state(alike, model.states))
