"""The steady-state covariance P∞ of a Kalman filter (Eqs. 4–8), for many points at once.

Eq. 4 depends on the measurements only through their information J = HᵀR⁻¹H, which adds up over cameras. In terms of J
it reads P = A P⁺ Aᵀ + Q with P⁺ = (P⁻¹ + J)⁻¹. All arrays have leading batch axes that broadcast against each other.

This module is the entry point: it checks the arguments, chooses the method and judges the result. The methods are in
`pss.riccati.methods`, and in `pss.riccati.axes` for equal axes.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import RangeError, RiccatiError, ShapeError
from pss.inputs import numbers
from pss.riccati import axes as riccati_axes
from pss.riccati import methods
from pss.riccati.methods import RANK_TOLERANCE, REFUSE_ABOVE, Failures, Floats, transpose
from pss.riccati.observability import eigen_3x3

__all__ = [
    "measurement_information",
    "posterior_covariance",
    "riccati_residual",
    "steady_state_covariance",
    "steady_state_covariance_from_information",
]

Method = Literal["auto", "axes", "eigenstructure", "doubling", "scipy"]
Unsolvable = Literal["raise", "nan"]

# A matrix less symmetric than this (relative to its largest entry) is an error, not rounding.
SYMMETRY_TOLERANCE = 1e-9


def steady_state_covariance(
    A: ArrayLike,
    Q: ArrayLike,
    H: ArrayLike,
    R: ArrayLike,
    method: Method = "auto",
    *,
    unsolvable: Unsolvable = "raise",
) -> Floats:
    """A-priori covariance P∞ of the filter's error in the steady state: the stabilising solution of Eq. 4.

    Args:
        A: state transition matrix, (..., n, n)
        Q: process noise covariance of one time step, (..., n, n), positive semidefinite
        H: measurement Jacobian, stacked over the cameras (Eq. 5), (..., m, n)
        R: measurement noise covariance, block-diagonal over the cameras (Eq. 5), (..., m, m), positive definite
        method: ``eigenstructure`` (MacFarlane–Potter–Fath, Eqs. 6–8; A must be invertible), ``doubling``
            (structure-preserving doubling; (A, Q) must be stabilisable), ``scipy`` (a loop over
            ``solve_discrete_are``), ``axes`` (A = A₀ ⊗ I₃ and Q = Q₀ ⊗ I₃ without batch axes, position measurements
            only: `pss.riccati.axes`) or ``auto``: the fastest safe one, which is ``axes`` or another closed form where
            A = I and Q = qI, else ``axes`` where it applies, else ``doubling``. All but ``eigenstructure`` accept a
            singular A
        unsolvable: ``raise``, or ``nan`` to fill the systems without a solution with nan

    Returns:
        P∞ in the state's units squared (m² for positions), (..., n, n), symmetric

    Raises:
        ShapeError: the shapes of the arrays do not match
        RangeError: a value is not finite, Q is not positive semidefinite, R not positive definite, method unknown
        RiccatiError: a system has no stabilising solution (a mode that doesn't decay is not measured, or not excited),
            or none that double precision can reach; the message names the first batch indices and the reason
    """
    jacobian = _array("H", H)
    noise = _array("R", R)
    information = measurement_information(jacobian, noise)
    measurement = (jacobian, noise) if method == "scipy" else None
    return _solve(_array("A", A), _array("Q", Q), information, method, unsolvable, measurement)


def steady_state_covariance_from_information(
    A: ArrayLike, Q: ArrayLike, J: ArrayLike, method: Method = "auto", *, unsolvable: Unsolvable = "raise"
) -> Floats:
    """As `steady_state_covariance`, from the information J = HᵀR⁻¹H, (..., n, n), in place of H and R.

    J is relative to the state: per m² for positions. Precision: an eigenvalue of J that is r times the largest has a
    relative error of eps/r, and so has the part of P∞ that depends on it; below `RANK_TOLERANCE` it counts as zero.

    Raises:
        ShapeError, RangeError, RiccatiError: as in `steady_state_covariance`; J must be symmetric positive semidefinite
    """
    return _solve(_array("A", A), _array("Q", Q), _array("J", J), method, unsolvable, None)


def measurement_information(H: ArrayLike, R: ArrayLike) -> Floats:
    """Information J = HᵀR⁻¹H of one frame's measurements, (..., n, n), per unit of state squared.

    Args:
        H: measurement Jacobian, (..., m, n)
        R: measurement noise covariance, (..., m, m), positive definite

    Raises:
        ShapeError: the shape of R does not match H
        RangeError: a value is not finite, or R is not symmetric positive definite
    """
    jacobian = _array("H", H)
    noise = _square("R", _array("R", R), jacobian.shape[-2])
    _require_symmetric("R", noise)
    try:
        factor = np.linalg.cholesky(noise)
    except np.linalg.LinAlgError:
        smallest = np.linalg.eigvalsh(noise)[..., 0].min()
        raise RangeError(f"R has the eigenvalue {smallest:.3g}; allowed: positive definite") from None
    _batch_shape(H=jacobian, R=noise)
    whitened = np.linalg.solve(factor, jacobian)
    return transpose(whitened) @ whitened


def posterior_covariance(P: ArrayLike, J: ArrayLike) -> Floats:
    """Covariance P⁺ = (P⁻¹ + J)⁻¹ after a measurement update, (..., n, n), without inverting P or J.

    Args:
        P: a-priori covariance, (..., n, n), positive semidefinite (may be singular)
        J: information of the measurements, (..., n, n), positive semidefinite

    Raises:
        ShapeError: the shapes of the arrays do not match
        RangeError: a value is not finite, or a matrix is not symmetric positive semidefinite
    """
    prior = _square("P", _array("P", P))
    information = _square("J", _array("J", J), prior.shape[-1])
    _batch_shape(P=prior, J=information)
    require_semidefinite("P", prior)
    require_semidefinite("J", information)
    return methods.posterior(prior, information)


def riccati_residual(A: ArrayLike, Q: ArrayLike, J: ArrayLike, P: ArrayLike) -> Floats:
    """Relative residual of Eq. 4, (...,): the Frobenius norm of right minus left side over that of P.

    Both are in units of P's standard deviations, so that metres and metres per second have equal weight.

    Raises:
        ShapeError, RangeError: as in `steady_state_covariance_from_information`; P must be positive semidefinite
    """
    prior = _square("P", _array("P", P))
    states = prior.shape[-1]
    transition, noise, information = (
        _square(name, _array(name, value), states) for name, value in (("A", A), ("Q", Q), ("J", J))
    )
    _batch_shape(A=transition, Q=noise, J=information, P=prior)
    require_semidefinite("P", prior)
    require_semidefinite("J", information)
    return methods.residuals(transition, noise, information, prior)[0]


def _solve(
    A: Floats,
    Q: Floats,
    J: Floats,
    method: Method,
    unsolvable: Unsolvable,
    measurement: tuple[Floats, Floats] | None,
) -> Floats:
    for name, value, allowed in (("method", method, Method), ("unsolvable", unsolvable, Unsolvable)):
        if value not in get_args(allowed):
            raise RangeError(f"{name} = {value!r}; allowed: {', '.join(get_args(allowed))}")
    states = _square("A", A).shape[-1]
    _square("Q", Q, states)
    _square("J", J, states)
    batch = _batch_shape(A=A, Q=Q, J=J)
    require_semidefinite("Q", Q)

    blocks = riccati_axes.axis_blocks(A, Q, J) if method in ("auto", "axes") else None
    if method == "axes" and blocks is None:
        raise RangeError(
            f"method = 'axes' with A {A.shape}, Q {Q.shape}, J {J.shape}; allowed: A = A₀ ⊗ I₃ and Q = Q₀ ⊗ I₃ without "
            "batch axes, with one to three states an axis, and J of positions alone"
        )
    if blocks is not None:
        P, failures, error = _by_axis(*blocks, J)
    elif method == "auto" and _walks(A, Q):
        P, failures, error = _by_closed_form(Q[..., 0, 0], J)
    else:
        P, failures, error = _by_matrix(A, Q, J, method, measurement)
    P = np.broadcast_to(P, batch + (states, states))
    P = P if P.flags.writeable else P.copy()
    failed = np.broadcast_to(np.logical_or.reduce(np.broadcast_arrays(*failures.values())), batch)
    if failed.any():
        if unsolvable == "raise":
            raise RiccatiError(methods.failure_message(failed, failures, error))
        P[failed] = np.nan
    return P


def _walks(A: Floats, Q: Floats) -> bool:
    """Whether A = I and Q = qI for all systems."""
    identity = np.eye(A.shape[-1])
    return not np.any(A - identity) and not np.any(Q - Q[..., :1, :1] * identity)


def _by_axis(A0: Floats, Q0: Floats, J: Floats) -> tuple[Floats, Failures, Floats]:
    """P, failures and the error of P, for J (..., n, n) of positions only."""
    batch, states = J.shape[:-2], J.shape[-1]
    positions = J[..., :3, :3].reshape(-1, 3, 3)
    _require_symmetric("J", positions)
    information, axes = eigen_3x3(*(positions[:, i, k] for i in range(3) for k in range(i, 3)))
    _refuse_negative("J", np.stack([information.min(axis=0), information.max(axis=0)], axis=-1))
    P, failures, error = riccati_axes.three_axes(A0, Q0, information, axes)
    failures = {reason: mask.reshape(batch) for reason, mask in failures.items()}
    return P.reshape(*batch, states, states), failures, error.reshape(batch)


def _by_closed_form(step_variance: Floats, J: Floats) -> tuple[Floats, Failures, Floats]:
    """The same for A = I and Q = qI of any size."""
    _require_symmetric("J", J)
    information, axes = np.linalg.eigh(J)
    _refuse_negative("J", information)
    return *methods.random_walk(step_variance, information, axes), np.zeros(())


def _by_matrix(
    A: Floats, Q: Floats, J: Floats, method: Method, measurement: tuple[Floats, Floats] | None
) -> tuple[Floats, Failures, Floats]:
    """The same by one of the methods for whole matrices."""
    require_semidefinite("J", J)
    batch, states = _batch_shape(A=A, Q=Q, J=J), A.shape[-1]
    undetectable = methods.undetectable(A, J)
    flat_A, flat_Q, flat_J = (np.broadcast_to(x, batch + x.shape[-2:]).reshape(-1, states, states) for x in (A, Q, J))
    if method == "scipy":
        if measurement is None:
            # whitened measurements with J as their information
            measurement = methods.symmetric_root(J), np.eye(states)
        H, R = (np.broadcast_to(x, batch + x.shape[-2:]).reshape(-1, *x.shape[-2:]) for x in measurement)
        P, failures = methods.scipy_loop(flat_A, flat_Q, H, R)
    else:
        solver = methods.eigenstructure if method == "eigenstructure" else methods.doubling
        P, failures = solver(flat_A, flat_Q, flat_J)
    if method in ("eigenstructure", "scipy"):
        P, error = methods.refined(flat_A, flat_Q, flat_J, P)
    else:
        error = methods.residuals(A, Q, J, P.reshape(batch + (states, states)))[1]
    P, error = P.reshape(batch + (states, states)), error.reshape(batch)
    failures = {"not detectable": undetectable} | {reason: mask.reshape(batch) for reason, mask in failures.items()}
    # Written so that nan counts as a refusal.
    return P, failures | {methods.REFUSED: ~(error <= REFUSE_ABOVE)}, error


def _array(name: str, value: ArrayLike) -> Floats:
    array = numbers(value, name, "matrices with leading batch axes")
    if array.ndim < 2:
        raise ShapeError(f"{name} has shape {array.shape}; allowed: matrices with leading batch axes")
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise RangeError(f"{name}{list(where)} = {array[where]}; allowed: finite values")
    return array


def _square(name: str, array: Floats, size: int | None = None) -> Floats:
    size = array.shape[-1] if size is None else size
    if array.shape[-2:] != (size, size) or size == 0:
        raise ShapeError(f"{name} has shape {array.shape}; allowed: (..., {size or 'n'}, {size or 'n'})")
    return array


def _batch_shape(**arrays: Floats) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(*(array.shape[:-2] for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ShapeError(f"shapes are {shapes}; allowed: leading axes that broadcast") from None


def _require_symmetric(name: str, M: Floats) -> None:
    asymmetry = np.abs(M - transpose(M)).max(initial=0.0, axis=(-2, -1))
    if np.any(asymmetry > SYMMETRY_TOLERANCE * np.abs(M).max(initial=0.0, axis=(-2, -1))):
        raise RangeError(f"{name} differs from its transpose by {asymmetry.max():.3g}; allowed: symmetric matrices")


def require_semidefinite(name: str, M: Floats) -> None:
    """Raise unless matrices (..., n, n) are symmetric positive semidefinite up to rounding.

    Raises:
        RangeError: with the asymmetry, or the negative eigenvalue
    """
    _require_symmetric(name, M)
    _refuse_negative(name, np.asarray(np.linalg.eigvalsh(M), dtype=np.float64))


def _refuse_negative(name: str, eigenvalues: Floats) -> None:
    """Raise if one of ascending eigenvalues, (..., n), is negative by more than rounding."""
    negative = eigenvalues[..., 0] < -RANK_TOLERANCE * np.abs(eigenvalues[..., -1])
    if negative.any():
        lowest = eigenvalues[..., 0][negative].min()
        raise RangeError(f"{name} has the eigenvalue {lowest:.3g}; allowed: positive semidefinite matrices")
