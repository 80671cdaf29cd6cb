"""Which points a filter can observe: the paper's "more rigorous definition" of an observable point (section 3.2).

In the paper a point is observable if c ≥ 2 cameras see it. These functions test A and H themselves, by the criterion of
Popov, Belevitch and Hautus: a mode of A is observed if H does not annihilate its eigenvectors. All arrays broadcast
over leading batch axes.

Zero is defined as follows: a measurement's information on a direction of an eigenspace is compared with its value
without cancellation, so that only equal units are compared; at or below `RANK_TOLERANCE` of it, it is rounding. For a
point seen by cameras: rays within about 1e-7 rad of parallel count as parallel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import RangeError, ShapeError
from pss.hints import Bools, Floats
from pss.inputs import numbers

__all__ = [
    "RANK_TOLERANCE",
    "eigen_3x3",
    "information_ratio",
    "is_detectable",
    "is_observable",
    "observability_matrix",
    "smallest_eigenvalue_3x3",
    "undetectable",
]


EPS = float(np.finfo(np.float64).eps)
# An eigenvalue this far below the largest is rounding noise in a matrix summed in double precision: for two cameras
# collinear with the point it is about 10 eps instead of zero.
RANK_TOLERANCE = 64 * EPS
# Singular values of A − λI below this span the eigenspace of λ. The next ones are about the time step in seconds.
NULL_TOLERANCE = 1e-9
# Rounding splits a triple eigenvalue 1 (constant acceleration) by about eps^(1/3) = 6e-6 into the unit circle.
MARGINAL_MODULUS = 1 - 3e-5
# Relative error of `smallest_eigenvalue_3x3` above which LAPACK is used instead, and the rounding errors of the closed
# form's last sums beside its eigenvector's residual, relative to the largest entry.
EIGENVALUE_ERROR = 1e-9
LAST_ROUNDINGS = 2 * EPS


def observability_matrix(A: ArrayLike, H: ArrayLike) -> Floats:
    """H, HA, …, HAⁿ⁻¹ stacked, (..., n·m, n), for A (..., n, n) and H (..., m, n).

    It has rank n where the state is observable. To decide this in double precision use `is_observable`: the powers of A
    mix states of unrelated units and magnitudes.

    Raises:
        ShapeError, RangeError: the shapes do not match, or a value is not finite
    """
    transition, jacobian = _checked(A, H)
    rows = [jacobian]
    for _ in range(transition.shape[-1] - 1):
        rows.append(rows[-1] @ transition)
    return np.concatenate(np.broadcast_arrays(*rows), axis=-2)


def is_observable(A: ArrayLike, H: ArrayLike) -> Bools:
    """Whether measurements H, (..., m, n), determine every mode of A, (..., n, n); shape (...).

    Rows of H may have different units: they are compared at unit length. The tolerance is that of this module.

    Raises:
        ShapeError, RangeError: the shapes do not match, or a value is not finite
    """
    transition, jacobian = _checked(A, H)
    return ~_unmeasured_mode(transition, _information(jacobian), slowest=-1.0)


def is_detectable(A: ArrayLike, H: ArrayLike | None = None, *, J: ArrayLike | None = None) -> Bools:
    """Whether every mode of A that does not decay is determined, by H (..., m, n) or by J = HᵀR⁻¹H (..., n, n).

    Only then has Eq. 4 a steady state. Unlike H, J also contains the precision of each measurement.

    Raises:
        ShapeError, RangeError: the shapes do not match, or a value is not finite
        RangeError: not exactly one of H and J is given
    """
    if (H is None) == (J is None):
        raise RangeError("is_detectable needs one of H and J; allowed: exactly one")
    if H is not None:
        transition, jacobian = _checked(A, H)
        return ~undetectable(transition, _information(jacobian))
    transition, information = _checked(A, J, name="J")
    if information.shape[-2] != information.shape[-1]:
        raise ShapeError(f"J has shape {information.shape}; allowed: (..., n, n)")
    return ~undetectable(transition, information)


def information_ratio(J: ArrayLike) -> Floats:
    """Smallest over largest eigenvalue of J, (...): 1 for equally well measured directions, 0 for an unmeasured one.

    J (..., n, n) must have one unit, such as its position block, 1/m². Zero where J is zero; never negative.

    Raises:
        ShapeError, RangeError: J is not square, or not finite
    """
    information = numbers(J, "J", "(..., n, n)")
    _checked(information, information, name="J")
    eigenvalues = np.linalg.eigvalsh(information)
    largest = eigenvalues[..., -1]
    return np.asarray(np.maximum(eigenvalues[..., 0], 0.0) / np.where(largest > 0, largest, 1.0))


def smallest_eigenvalue_3x3(
    xx: ArrayLike, xy: ArrayLike, xz: ArrayLike, yy: ArrayLike, yz: ArrayLike, zz: ArrayLike
) -> Floats:
    """Smallest eigenvalue (N,) of symmetric 3 × 3 matrices given by their six entries, (N,) each, as by `eigen_3x3`."""
    return np.asarray(_deflated([xx, xy, xz, yy, yz, zz], vectors=False)[0].min(axis=0))


def eigen_3x3(
    xx: ArrayLike, xy: ArrayLike, xz: ArrayLike, yy: ArrayLike, yz: ArrayLike, zz: ArrayLike
) -> tuple[Floats, Floats]:
    """Eigenvalues and eigenvectors of symmetric 3 × 3 matrices given by their six entries, (N,) each.

    The trigonometric formula yields the eigenvalue separate from the other two, where it is accurate; the others come
    from the 2 × 2 matrix orthogonal to its eigenvector. Matrices whose residual does not prove an error within
    `EIGENVALUE_ERROR` of λmin go to LAPACK, whose relative error is eps times the condition number.

    Returns:
        eigenvalues (3, N), in no order, and unit eigenvectors (3, 3, N), by component and eigenvalue

    Raises:
        ShapeError: the entries are not six arrays (N,)
        RangeError: an entry is not finite
    """
    return _deflated([xx, xy, xz, yy, yz, zz], vectors=True)


def _deflated(six: Sequence[ArrayLike], vectors: bool) -> tuple[Floats, Floats]:
    """`eigen_3x3`; eigenvectors (3, 3, 0) unless `vectors`."""
    entries = [numbers(entry, "entries", "six times (N,)") for entry in six]
    if entries[0].ndim != 1 or any(entry.shape != entries[0].shape for entry in entries):
        raise ShapeError(f"entries have the shapes {[entry.shape for entry in entries]}; allowed: six times (N,)")
    size = np.abs(entries).max(axis=0)
    if not np.isfinite(size).all():
        raise RangeError(f"matrix {int(np.flatnonzero(~np.isfinite(size))[0])} is not finite; allowed: finite entries")
    size = np.where(size > 0, size, 1.0)
    a, b, c, d, e, f = (entry / size for entry in entries)

    mean = (a + d + f) / 3
    spread = np.sqrt(((a - mean) ** 2 + (d - mean) ** 2 + (f - mean) ** 2 + 2 * (b * b + c * c + e * e)) / 6)
    unit = 1 / np.where(spread > 0, spread, 1.0)
    p, q, r, s, t, u = (a - mean) * unit, b * unit, c * unit, (d - mean) * unit, e * unit, (f - mean) * unit
    half_det = (p * (s * u - t * t) - q * (q * u - r * t) + r * (q * t - r * s)) / 2
    # 2 cos φ of the separate eigenvalue: the largest if the determinant is positive, else the smallest.
    apart = np.copysign(2 * np.cos(np.arccos(np.minimum(np.abs(half_det), 1.0)) / 3), half_det)
    x, y, z = v = _null_vector(p - apart, q, r, s - apart, t, u - apart)

    def applied(x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, Floats]:
        return a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z

    image = applied(*v)
    value = _dot(v, image)
    off = tuple(m - value * n for m, n in zip(image, v, strict=True))
    # Two unit vectors orthogonal to it, without a branch (Duff et al., "Building an orthonormal basis, revisited",
    # 2017).
    sign = np.copysign(1.0, z)
    k = -1 / (sign + z)
    first, second = (1 + sign * x * x * k, sign * (x * y * k), -sign * x), (x * y * k, sign + y * y * k, -y)
    image = applied(*first)
    uu, uw, ww = _dot(first, image), _dot(second, image), _dot(second, applied(*second))
    half = (uu - ww) / 2
    radius = np.hypot(half, uw)
    values = np.stack([value, (uu + ww) / 2 - radius, (uu + ww) / 2 + radius])
    axes = np.empty((3, 3, 0))
    if vectors:
        # The eigenvector of the larger of the two, from the numerically stable half of tan 2θ's formula.
        cos, sin = np.where(half >= 0, radius + half, uw), np.where(half >= 0, uw, radius - half)
        cos = np.where(radius > 0, cos, 1.0)
        norm = np.hypot(cos, sin)
        cos, sin = cos / norm, sin / norm
        rows = zip(v, first, second, strict=True)
        axes = np.stack([np.stack([m, cos * o - sin * n, cos * n + sin * o]) for m, n, o in rows])

    # Beside rounding, the coupling changes an eigenvalue by at most its square over the gap, √3 spreads.
    doubt = _dot(off, off) * unit + LAST_ROUNDINGS
    rough = np.flatnonzero(~(doubt <= EIGENVALUE_ERROR * values.min(axis=0)))
    if rough.size:
        matrices = np.stack([a, b, c, b, d, e, c, e, f], axis=-1)[rough].reshape(-1, 3, 3)
        if vectors:
            by_lapack = np.linalg.eigh(matrices)
            values[:, rough], axes[:, :, rough] = by_lapack.eigenvalues.T, np.moveaxis(by_lapack.eigenvectors, 0, -1)
        else:
            values[:, rough] = np.linalg.eigvalsh(matrices).T
    return values * size, axes


def _dot(x: tuple[Floats, ...], y: tuple[Floats, ...]) -> Floats:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


def _null_vector(a: Floats, b: Floats, c: Floats, d: Floats, e: Floats, f: Floats) -> tuple[Floats, Floats, Floats]:
    """Unit null vector of singular symmetric matrices of rank two: the adjugate's column of the largest diagonal."""
    xx, yy, zz = d * f - e * e, a * f - c * c, a * d - b * b
    xy, xz, yz = c * e - b * f, b * e - c * d, b * c - a * e
    first = (np.abs(xx) >= np.abs(yy)) & (np.abs(xx) >= np.abs(zz))
    second = ~first & (np.abs(yy) >= np.abs(zz))
    x, y, z = (np.where(first, p, np.where(second, q, r)) for p, q, r in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    scale = 1 / np.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


def undetectable(A: Floats, J: Floats) -> Bools:
    """Whether a mode of A that does not decay is unmeasured, (...,): the Popov–Belevitch–Hautus test, unchecked."""
    return _unmeasured_mode(A, J, slowest=MARGINAL_MODULUS)


def _unmeasured_mode(A: Floats, J: Floats, slowest: float) -> Bools:
    """Whether an eigenvalue of A above `slowest` in modulus has an eigenvector that J annihilates, (...,).

    J is evaluated on each eigenspace of A separately, which compares equal units: for the motion models that is the
    position block of J, with the same result as the closed form.
    """
    n = A.shape[-1]
    eigenvalues = np.linalg.eigvals(A)
    if A.ndim == 2:
        eigenvalues = np.unique(eigenvalues)  # each eigenspace once, where A is triangular
    if np.isrealobj(eigenvalues) or not eigenvalues.imag.any():
        eigenvalues = np.asarray(eigenvalues.real)
    _, singular_values, right = np.linalg.svd(A[..., None, :, :] - eigenvalues[..., None, None] * np.eye(n))
    norm = np.maximum(1.0, np.linalg.norm(A, axis=(-2, -1)))[..., None, None]
    lasting = (np.abs(eigenvalues) > slowest)[..., None] & (singular_values <= NULL_TOLERANCE * norm)
    basis = np.conj(right) * lasting[..., None]  # rows, the others zero
    J = J[..., None, :, :]
    measured = basis @ J @ np.conj(np.swapaxes(basis, -1, -2))
    # The information without cancellation.
    scale = np.einsum("...ij,...jj->...", np.abs(basis) ** 2, J)[..., None, None]
    padding = np.eye(n) * ~lasting[..., None]
    weakest = np.linalg.eigvalsh(measured / np.where(scale > 0, scale, 1.0) + padding)[..., 0]
    return np.asarray((weakest <= RANK_TOLERANCE).any(axis=-1))


def _information(H: Floats) -> Floats:
    """HᵀH with rows of H at unit length, (..., n, n)."""
    length = np.linalg.norm(H, axis=-1, keepdims=True)
    rows = H / np.where(length > 0, length, 1.0)
    return np.asarray(np.swapaxes(rows, -1, -2) @ rows)


def _checked(A: ArrayLike, H: ArrayLike | None, name: str = "H") -> tuple[Floats, Floats]:
    transition, measured = numbers(A, "A", "(..., n, n)"), numbers(H, name, "(..., m, n)")
    if transition.ndim < 2 or transition.shape[-1] != transition.shape[-2]:
        raise ShapeError(f"A has shape {transition.shape}; allowed: (..., n, n)")
    if measured.ndim < 2 or measured.shape[-1] != transition.shape[-1]:
        raise ShapeError(f"{name} has shape {measured.shape}; allowed beside A {transition.shape}: (..., m, n)")
    try:
        np.broadcast_shapes(transition.shape[:-2], measured.shape[:-2])
    except ValueError:
        shapes = f"A {transition.shape}, {name} {measured.shape}"
        raise ShapeError(f"{shapes}; allowed: leading axes that broadcast") from None
    for label, array in (("A", transition), (name, measured)):
        if not np.isfinite(array).all():
            raise RangeError(f"{label} has the value {array[~np.isfinite(array)][0]}; allowed: finite values")
    return transition, measured
