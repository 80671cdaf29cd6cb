"""Matrices of up to 3 × 3 for many systems at once, entry by entry, without a LAPACK call for each.

A matrix is a tuple of rows of numbers or arrays (M,); a symmetric one is the tuple of its upper triangle, row by row.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["AT", "Entry", "Matrix", "Symmetric", "adjugate", "congruent", "cross", "dot", "full", "product", "trace"]

Entry = NDArray[np.float64] | float
Symmetric = tuple[Entry, ...]
Matrix = tuple[tuple[Entry, ...], ...]

# Position of entry (i, k) of a symmetric matrix in its upper triangle.
AT = {1: ((0,),), 2: ((0, 1), (1, 2)), 3: ((0, 1, 2), (1, 3, 4), (2, 4, 5))}


def full(S: Symmetric) -> Matrix:
    """All rows of a symmetric matrix."""
    return tuple(tuple(S[k] for k in row) for row in AT[2 if len(S) == 3 else 3])


def trace(S: Symmetric, T: Symmetric) -> Entry:
    """tr ST of two symmetric matrices."""
    if len(S) == 3:
        return S[0] * T[0] + 2 * (S[1] * T[1]) + S[2] * T[2]
    return S[0] * T[0] + S[3] * T[3] + S[5] * T[5] + 2 * (S[1] * T[1] + S[2] * T[2] + S[4] * T[4])


def adjugate(S: Symmetric) -> Symmetric:
    """Upper triangle of the adjugate of a symmetric 3 × 3 matrix: its inverse times its determinant."""
    a, b, c, d, e, f = S
    return d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b


def cross(S: Symmetric, T: Symmetric) -> Symmetric:
    """Mixed cofactors adj(S + T) − adj S − adj T, semidefinite if S and T are."""
    a, b, c, d, e, f = S
    p, q, r, s, t, u = T
    return (
        d * u + f * s - 2 * (e * t),
        c * t + e * r - b * u - f * q,
        b * t + e * q - c * s - d * r,
        a * u + f * p - 2 * (c * r),
        b * r + c * q - a * t - e * p,
        a * s + d * p - 2 * (b * q),
    )


def product(X: Matrix, Y: Matrix) -> Matrix:
    """X Y."""
    return tuple(tuple(dot(row, column) for column in zip(*Y, strict=True)) for row in X)


def congruent(X: Matrix, S: Symmetric) -> Symmetric:
    """Upper triangle of X S Xᵀ."""
    XS = product(X, full(S))
    return tuple(dot(XS[i], X[k]) for i in range(len(X)) for k in range(i, len(X)))


def dot(x: tuple[Entry, ...], y: tuple[Entry, ...]) -> Entry:
    """Sum of products of two rows."""
    total: Entry = x[0] * y[0]
    for a, b in zip(x[1:], y[1:], strict=True):
        total = total + a * b
    return total
