"""The project's own exceptions.

Each also inherits the builtin a caller would expect, and its message carries the offending value and what is allowed,
so that a command line can print it as one line and a program can catch it either way.
"""

from __future__ import annotations

__all__ = ["GeometryError", "MissingLibraryError", "PSSError", "RangeError", "RiccatiError", "ShapeError"]


class PSSError(Exception):
    """Base of everything this project raises on purpose."""


class ShapeError(PSSError, ValueError):
    """An array has the wrong shape; the message prints the shape it got."""


class RangeError(PSSError, ValueError):
    """A value lies outside what is allowed; the message prints both."""


class GeometryError(PSSError, ValueError):
    """A geometric situation without an answer, such as a point at the camera's own centre."""


class RiccatiError(PSSError, ArithmeticError):
    """Eq. 4 has no stabilising solution, or none that double precision can reach; the message names the systems."""


class MissingLibraryError(PSSError, ImportError):
    """A library that the chosen option needs is not there (libLLVM, CUDA)."""
