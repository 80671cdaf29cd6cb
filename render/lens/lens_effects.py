"""Effects of a real lens beyond Mitsuba's thin lens, by moving samples: blur in focus, distortion, straight blades."""

from __future__ import annotations

from typing import Any

import numpy as np

from pss import PTZCamera
from pss.cameras.distortion import fold_radius, furthest_radius
from render.lens import thin_lens

__all__ = ["PlaceOnFilm"]

# Newton steps for the slope before distortion, from the slope after it: single precision after four, except at the
# lens's fold, where each step only halves the error.
NEWTON_STEPS = 12
# Closer to the fold the radius hardly grows: rounding over its slope would make the next step far too long.
SMALLEST_SLOPE = 1e-3
# Slope that replaces the fold of a lens without one.
NO_FOLD = 1e6


class PlaceOnFilm:
    """Position of a sample on Mitsuba's film and lens, for a lens with blur, distortion or blades."""

    def __init__(self, camera: PTZCamera, mi: Any) -> None:
        import drjit as dr

        self.mi, self.dr, self.blades = mi, dr, camera.aperture_blades
        self.blurs, self.distorts = camera.psf_sigma_um > 0, any(camera.radial_distortion)
        if self.blurs:
            self.quantiles = mi.Float(thin_lens.pixel_response(camera.psf_sigma_px).astype(np.float32))
        # Data, not constants, so that other settings need no new compilation.
        settings = (*camera.radial_distortion, camera.focal_px, *(n + 0.5 for n in camera.principal_point_px))
        self.k1, self.k2, self.focal, self.cx, self.cy = (dr.opaque(mi.Float, value) for value in settings)
        ends = fold_radius(*camera.radial_distortion), furthest_radius(*camera.radial_distortion)
        self.fold, self.furthest = (dr.opaque(mi.Float, min(end, NO_FOLD)) for end in ends)

    def film(self, x: Any, y: Any, u: Any, v: Any) -> Any:
        """Film position in px of a sample at (u, v), each in [0, 1), of the pixel with the corner (x, y)."""
        if self.blurs:
            u, v = self._response(u), self._response(v)
        x, y = x + u, y + v
        if not self.distorts:
            return self.mi.Point2f(x, y)
        x, y = (x - self.cx) / self.focal, (y - self.cy) / self.focal
        radius = self.dr.sqrt(x * x + y * y)
        # A blurred pixel at the fold collects from beyond it, where only the fold itself is imaged.
        bent = self.dr.minimum(radius, self.furthest)
        true = self.dr.minimum(bent, self.fold)
        for _ in range(NEWTON_STEPS):
            square = true * true
            excess = true * (1 + square * (self.k1 + square * self.k2)) - bent
            slope = self.dr.maximum(1 + square * (3 * self.k1 + 5 * self.k2 * square), SMALLEST_SLOPE)
            true = self.dr.clip(true - excess / slope, 0, self.fold)
        scale = self.focal * self.dr.select(radius > 0, true / radius, 1.0)
        return self.mi.Point2f(x * scale + self.cx, y * scale + self.cy)

    def aperture(self, sample: Any) -> Any:
        """Sample of Mitsuba's round lens at the same position in this lens's aperture."""
        if not self.blades:
            return sample
        dr, mi = self.dr, self.mi
        # One triangle from the centre to each blade, uniform by area.
        position = sample.x * self.blades
        blade = dr.minimum(dr.floor(position), self.blades - 1)
        outwards = dr.sqrt(position - blade)
        angle = 2 * dr.pi / self.blades
        (s, c), (t, d) = dr.sincos(blade * angle), dr.sincos((blade + 1) * angle)
        place = mi.Point2f(dr.lerp(c, d, sample.y), dr.lerp(s, t, sample.y)) * outwards
        return mi.warp.uniform_disk_to_square_concentric(place)

    def _response(self, u: Any) -> Any:
        dr, mi = self.dr, self.mi
        position = u * thin_lens.RESPONSE_QUANTILES
        step = dr.minimum(mi.UInt32(position), thin_lens.RESPONSE_QUANTILES - 1)
        low, high = dr.gather(mi.Float, self.quantiles, step), dr.gather(mi.Float, self.quantiles, step + 1)
        return dr.lerp(low, high, position - mi.Float(step))
