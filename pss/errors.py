"""The project's exceptions.

Each also inherits the corresponding builtin exception. The message has the offending value and what is allowed, so that
a command can print it as one line.
"""

from __future__ import annotations

__all__ = ["GeometryError", "MissingLibraryError", "PSSError", "RangeError", "RiccatiError", "ShapeError"]


class PSSError(Exception):
    """Base class of all exceptions that this project raises on purpose."""


class ShapeError(PSSError, ValueError):
    """An array has the wrong shape; the message has the actual shape."""


class RangeError(PSSError, ValueError):
    """A value is out of range; the message has the value and what is allowed."""


class GeometryError(PSSError, ValueError):
    """A degenerate geometry, such as a point at the camera's centre."""


class RiccatiError(PSSError, ArithmeticError):
    """Eq. 4 has no stabilising solution, or none that double precision can reach; the message names the systems."""


class MissingLibraryError(PSSError, ImportError):
    """A library required by the chosen option is not installed (libLLVM, CUDA)."""
