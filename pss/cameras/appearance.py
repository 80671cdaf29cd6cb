"""The targets' appearance: their size, the radiance of their white and black modules, and their motion.

It is independent of the camera: all cameras use the same appearance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pss.errors import RangeError, ShapeError
from pss.inputs import numbers

__all__ = ["Appearance"]


@dataclass(frozen=True, eq=False)
class Appearance:
    """The appearance of the targets at N points: square tags of black and white modules.

    Radiances are those emitted by the target (if diffuse: albedo · irradiance / π). They come from the scene
    description, never from an image.

    Attributes:
        module_m: m, side of a module; a number or (N,).
        white_w_per_m2_sr: W/(m² sr), radiance of the white modules; a number or (N,).
        black_w_per_m2_sr: W/(m² sr), radiance of the black modules; a number or (N,).
        along: unit vectors along one side of the tag, (N, 3); None for a horizontal one in the surface.
        modules: modules along a side of the tag, its border counted (ArUco 4 × 4: 6).
        ring_light: each camera has its own light, which is the only one in its images. The radiances are those of a
            target facing the camera at 1 m; at distance D and incidence angle α they are multiplied by cos α/D².
        velocity_m_per_s: m/s in the world, of each target at the middle of the exposure, (N, 3); None: all at rest. It
            causes motion blur during the sensor's exposure.

    Raises:
        RangeError: a size not above 0, black not darker than white, a velocity that is not finite.
        ShapeError: arrays of different lengths.
    """

    module_m: ArrayLike
    white_w_per_m2_sr: ArrayLike
    black_w_per_m2_sr: ArrayLike
    along: ArrayLike | None = None
    modules: int = 6
    ring_light: bool = False
    velocity_m_per_s: ArrayLike | None = None

    def __post_init__(self) -> None:
        shapes = set()
        for name in ("module_m", "white_w_per_m2_sr", "black_w_per_m2_sr"):
            value = numbers(getattr(self, name), f"Appearance.{name}", "a number or (N,)")
            if value.ndim > 1:
                raise ShapeError(f"Appearance.{name} has shape {value.shape}; allowed: a number or (N,)")
            shapes |= set(value.shape)
            bad = ~(np.isfinite(value) & (value >= 0))
            if bad.any():
                raise RangeError(f"Appearance.{name} = {value[bad].flat[0]!r}; allowed: 0 or more, finite")
            object.__setattr__(self, name, value)
        for name in ("along", "velocity_m_per_s"):
            if getattr(self, name) is None:
                continue
            vectors = numbers(getattr(self, name), f"Appearance.{name}", "(N, 3)")
            if vectors.ndim != 2 or vectors.shape[1] != 3:
                raise ShapeError(f"Appearance.{name} has shape {vectors.shape}; allowed: (N, 3)")
            shapes.add(vectors.shape[0])
            object.__setattr__(self, name, vectors)
        velocity = self.velocity_m_per_s
        if velocity is not None and not np.isfinite(velocity).all():
            worst = np.asarray(velocity)[~np.isfinite(velocity)].flat[0]
            raise RangeError(f"Appearance.velocity_m_per_s holds {worst!r}; allowed: finite, in m/s")
        if len(shapes) > 1:
            raise ShapeError(f"Appearance's arrays have lengths {sorted(shapes)}; allowed: one")
        if not (np.asarray(self.module_m) > 0).all():
            raise RangeError("Appearance.module_m holds 0; allowed: above 0 metres")
        if not (np.asarray(self.black_w_per_m2_sr) < np.asarray(self.white_w_per_m2_sr)).all():
            raise RangeError("Appearance: black is not darker than white; allowed: black_w_per_m2_sr below white's")
        if self.modules < 3:
            raise RangeError(
                f"Appearance.modules = {self.modules!r}; allowed: 3 or more (a border and what it encloses)"
            )

    def sides_m(self, normals: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """m, a module's two sides in the world, (N, 3) each, on surfaces with unit `normals` (N, 3)."""
        if self.along is None:
            # Any direction in the surface would do: take a horizontal one, and x where the surface itself is
            # horizontal.
            along = np.column_stack([-normals[:, 1], normals[:, 0], np.zeros(len(normals))])
            flat = np.hypot(normals[:, 0], normals[:, 1]) < 1e-9
            along[flat] = (1.0, 0.0, 0.0)
        else:
            along = np.asarray(self.along, dtype=float)
            along = along - normals * (along * normals).sum(axis=1, keepdims=True)
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        module = np.broadcast_to(np.asarray(self.module_m), len(normals))[:, None]
        return module * along, module * np.cross(normals, along)

    def check_length(self, points: int) -> None:
        """Raise `ShapeError` unless the arrays fit `points` points."""
        for name in ("module_m", "white_w_per_m2_sr", "black_w_per_m2_sr", "along", "velocity_m_per_s"):
            value = getattr(self, name)
            if value is not None and np.ndim(value) > 0 and len(np.asarray(value)) != points:
                raise ShapeError(
                    f"Appearance.{name} has length {len(np.asarray(value))}; allowed: {points}, the points'"
                )

    def at(self, rows: slice | NDArray[np.intp]) -> Appearance:
        """The appearance of the points in `rows`."""

        def part(value: ArrayLike | None) -> ArrayLike | None:
            return value if value is None or np.ndim(value) == 0 else np.asarray(value)[rows]

        size, white, black = (part(v) for v in (self.module_m, self.white_w_per_m2_sr, self.black_w_per_m2_sr))
        assert size is not None
        assert white is not None
        assert black is not None
        velocity = part(self.velocity_m_per_s)
        return Appearance(size, white, black, part(self.along), self.modules, self.ring_light, velocity)
