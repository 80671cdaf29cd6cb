"""User-defined process models (Eq. 2): any A and Q, a non-linear motion by its Jacobian, or a model for each point."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import RangeError, ShapeError
from pss.hints import Floats, Indices
from pss.inputs import members, numbers, plain
from pss.processes.process import AXES, ProcessModel, require_positive
from pss.riccati.solve import require_semidefinite

__all__ = ["LinearProcess", "NonlinearProcess", "PerPoint"]


# Step of the five-point difference, relative to a state or to one unit of it, whichever is larger. Its truncation error
# is of fourth order, its rounding error eps over the step: together about eps^(4/5) = 3e-13 for a smooth transition.
DIFFERENCE_STEP = float(np.finfo(np.float64).eps) ** 0.2


@dataclass(frozen=True, eq=False)
class LinearProcess:
    """Any linear motion, equal for all points or with matrices for each; position is the first three states.

    Attributes:
        A: transition over one time step, (n, n) or (N, n, n), n ≥ 3
        Q: covariance of the noise of one time step, (n, n) or (N, n, n), symmetric positive semidefinite
        time_step_s: s between two frames, > 0

    Raises:
        ShapeError: a matrix is not square, n < 3, or the shapes of A and Q do not match
        RangeError: a value is not finite, Q not symmetric positive semidefinite, time_step_s not positive
    """

    A: Floats
    Q: Floats
    time_step_s: float = 1 / 30

    def __post_init__(self) -> None:
        require_positive("time_step_s", self.time_step_s, "s")
        for name in ("A", "Q"):
            object.__setattr__(self, name, _read_only(name, getattr(self, name)))
        n = self.A.shape[-1]
        if self.Q.shape[-1] != n or (self.A.ndim == self.Q.ndim == 3 and len(self.A) != len(self.Q)):
            raise ShapeError(f"Q has shape {self.Q.shape}; allowed beside A {self.A.shape}: ({n}, {n}) or alike")
        require_semidefinite("Q", self.Q)

    @property
    def states(self) -> int:
        """Number of states n."""
        return int(self.A.shape[-1])

    @property
    def points(self) -> int | None:
        """Number of points N with their own matrices; None if all points share one."""
        return next((len(M) for M in (self.A, self.Q) if M.ndim == 3), None)

    def at(self, indices: ArrayLike) -> LinearProcess:
        """The process of some of the points, by indices or booleans; the process itself if all points share one."""
        if self.points is None:
            return self
        chosen = np.asarray(indices)
        A, Q = (M[chosen] if M.ndim == 3 else M for M in (self.A, self.Q))
        return LinearProcess(A, Q, self.time_step_s)


@dataclass(frozen=True, eq=False)
class NonlinearProcess:
    """Any motion x' = f(x) + noise; Eq. 4 uses its Jacobian A = ∂f/∂x: see `linearised`.

    Attributes:
        transition: f over one time step, from states (N, n) to states (N, n), row by row
        Q: covariance of the noise, as in `LinearProcess`
        jacobian: ∂f/∂x from states (N, n) to (N, n, n); None for five-point differences, exact to about 1e-12 of the
            largest entry if f is smooth over steps of `DIFFERENCE_STEP` (0.7 mm, 0.7 mm/s, ...)
        time_step_s: s between two frames, > 0

    Raises:
        ShapeError, RangeError: Q or time_step_s, as in `LinearProcess`
    """

    transition: Callable[[Floats], Floats]
    Q: Floats
    jacobian: Callable[[Floats], Floats] | None = None
    time_step_s: float = 1 / 30

    def __post_init__(self) -> None:
        require_positive("time_step_s", self.time_step_s, "s")
        object.__setattr__(self, "Q", _read_only("Q", self.Q))
        require_semidefinite("Q", self.Q)

    def linearised(self, states: ArrayLike) -> LinearProcess:
        """The motion of small errors about `states`, (N, n), with a Jacobian A for each of them, (N, n, n).

        Raises:
            ShapeError: states, or the results of `transition` or `jacobian`, have another shape
            RangeError: a value is not finite
        """
        n = self.Q.shape[-1]
        given = numbers(states, "states", f"(N, {n})")
        x = _shaped("states", given, (len(given) if given.ndim else 0, n))
        if self.jacobian is not None:
            return LinearProcess(_shaped("jacobian(states)", self.jacobian(x), (*x.shape, n)), self.Q, self.time_step_s)
        A = np.empty((*x.shape, n))
        for k in range(n):
            reach = DIFFERENCE_STEP * np.maximum(1.0, np.abs(x[:, k]))
            values = []
            for steps in (-2, -1, 1, 2):
                moved = x.copy()
                moved[:, k] += steps * reach
                values.append(_shaped("transition(states)", self.transition(moved), x.shape))
            A[..., k] = (values[0] - values[3] + 8 * (values[2] - values[1])) / (12 * reach[:, None])
        return LinearProcess(A, self.Q, self.time_step_s)


@dataclass(frozen=True, eq=False)
class PerPoint:
    """Points of one evaluation that move by different models, such as a walking person in front of a wall.

    Attributes:
        models: the models; one with matrices for each point has them for all N points
        index: index of each point's model, integers (N,)

    Raises:
        ShapeError: no models, index is not (N,), or a model has matrices for another number of points
        RangeError: an index is not an integer, or out of range
    """

    models: Sequence[ProcessModel]
    index: Indices

    def __post_init__(self) -> None:
        index = plain(self.index, "index", "integers (N,)")
        models = members(self.models, "models", "states", "process models")
        if not models or index.ndim != 1:
            raise ShapeError(f"{len(models)} models and index {index.shape}; allowed: one or more, and (N,)")
        if index.size and index.dtype.kind not in "iu":
            raise RangeError(f"index has the type {index.dtype}; allowed: integers")
        wrong = index[(index < 0) | (index >= len(models))]
        if wrong.size:
            raise RangeError(f"index has the value {wrong[0]}; allowed: 0 to {len(models) - 1}, the models'")
        for number, model in enumerate(models):
            if any(M.ndim == 3 and len(M) != len(index) for M in (model.A, model.Q)):
                raise ShapeError(f"models[{number}]: A {model.A.shape}, Q {model.Q.shape}; allowed: N = {len(index)}")
        index = index.astype(np.intp)
        index.flags.writeable = False
        object.__setattr__(self, "models", models)
        object.__setattr__(self, "index", index)

    def groups(self) -> Iterator[tuple[ProcessModel, Indices]]:
        """Each model that a point uses, restricted to its points, with their indices, ascending, (M,)."""
        for number, model in enumerate(self.models):
            indices = np.flatnonzero(self.index == number)
            if indices.size:
                yield (model.at(indices) if isinstance(model, LinearProcess) else model), indices


def _read_only(name: str, value: ArrayLike) -> Floats:
    """A read-only copy of a matrix over three states or more, or of one for each point."""
    M = numbers(value, name, f"(n, n) or (N, n, n) with n ≥ {AXES}")
    if M.ndim not in (2, 3) or M.shape[-1] != M.shape[-2] or M.shape[-1] < AXES:
        raise ShapeError(f"{name} has shape {M.shape}; allowed: (n, n) or (N, n, n) with n ≥ {AXES}")
    M = _shaped(name, M, M.shape)
    M.flags.writeable = False
    return M


def _shaped(name: str, given: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """`given` as an array, checked to have the shape and to be finite."""
    value = numbers(given, name, f"{shape}")
    if value.shape != shape:
        raise ShapeError(f"{name} has shape {value.shape}; allowed: {shape}")
    if not np.isfinite(value).all():
        raise RangeError(f"{name} has the value {value[~np.isfinite(value)][0]}; allowed: finite values")
    return value
