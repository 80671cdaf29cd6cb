"""Brightness and contrast: how well the edges of a tag fix its centre, given the light, the sensor and the blur.

An edge of length ℓ px with the contrast Δ, seen through a Gaussian blur of σ = s px with noise σ_e a pixel, fixes its
own position to the variance 2√π·s·σ_e²/(Δ²·ℓ): the Cramér–Rao bound, since the squared slope of an error function
integrates to Δ²/(2√π·s). A tag's edges run along its two sides, and its centre is estimated together with the rest of
a homography. Foreshortening makes the result a full 2 × 2 covariance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from pss.errors import RangeError
from pss.noise.covariance import PixelCovariance
from pss.noise.factors import of_camera
from pss.photometry import Appearance, ImageSensor, electrons_per_radiance
from pss.views import Views

__all__ = ["BrightnessContrast", "module_sides"]

Floats = NDArray[np.float64]

# px², variance of a square pixel's own width.
PIXEL_VARIANCE_PX2 = 1 / 12
# A uniform disc of diameter cc has the standard deviation cc/4 along any axis.
DIAMETERS_PER_SIGMA = 4.0


@dataclass(frozen=True)
class BrightnessContrast:
    """Photon, read and quantisation noise against the contrast that is left after defocus (Table 1). No fit in it.

    Needs `appearance` in `pss.evaluate`.

    Attributes:
        sensor: the cameras' image sensor, or one for each by the camera's name.
    """

    sensor: ImageSensor | Mapping[str, ImageSensor] = field(default_factory=ImageSensor)
    name: str = "brightness-contrast"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², of the tag's centre.

        Raises:
            RangeError: `views` has no appearance.
        """
        appearance = views.appearance
        if appearance is None:
            raise RangeError(f"noise factor {self.name!r} has no appearance; allowed: evaluate(…, appearance=…)")
        across, down = module_sides(appearance, views)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            a, b = (np.hypot(side[:, 0], side[:, 1]) for side in (across, down))
            area = np.abs(across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0])
            blur = np.sqrt(_blur_variance(views))
            strength = self._edge_information(views, appearance, blur)
            # Edges that run down lie `area / b` px apart, and fix a step across (in modules) as (area / b)² · b.
            first = _Moments(appearance.modules, area / b / blur, b / blur, strength * area**2 / b)
            second = _Moments(appearance.modules, area / a / blur, a / blur, strength * area**2 / a)
            variance_across, variance_down = first.centre_variance(second), second.centre_variance(first)
            uu, vv, uv = (
                variance_across * across[:, i] * across[:, j] + variance_down * down[:, i] * down[:, j]
                for i, j in ((0, 0), (1, 1), (0, 1))
            )
        known = np.isfinite(uu) & np.isfinite(vv) & np.isfinite(uv)
        nothing = np.inf
        return PixelCovariance(np.where(known, uu, nothing), np.where(known, vv, nothing), np.where(known, uv, 0.0))

    def _edge_information(self, views: Views, appearance: Appearance, blur: Floats) -> Floats:
        """1/px² for each px of edge: Δ²/(2√π·s·σ_e²), (C, N)."""
        if isinstance(self.sensor, ImageSensor):
            sensors = [self.sensor] * len(views.cameras)
        else:
            sensors = [of_camera(self.sensor, camera.name, "sensor") for camera in views.cameras]
        per_radiance = np.array(
            [electrons_per_radiance(camera, sensor) for camera, sensor in zip(views.cameras, sensors, strict=True)]
        ).reshape(-1, 1)
        full_well = np.array([sensor.saturation_e for sensor in sensors]).reshape(-1, 1)
        dark = np.array([sensor.noise_electrons(np.zeros(())) for sensor in sensors], dtype=float).reshape(-1, 1) ** 2
        collected = per_radiance * views.cos_off_axis**4
        if appearance.ring_light:
            collected = collected * np.maximum(views.cos_incidence, 0.0) / views.range_m**2
        white, black = (
            np.minimum(collected * np.asarray(radiance), full_well)
            for radiance in (appearance.white_w_per_m2_sr, appearance.black_w_per_m2_sr)
        )
        noise = (white + black) / 2 + dark
        return np.asarray((white - black) ** 2 / (2 * math.sqrt(math.pi) * blur * noise))


class _Moments:
    """The edges of an average tag that run one way, about its centre: what a step across them is known by.

    A tag is a black square of n modules a side, in which the n − 2 inner ones are each black or white with the
    probability 1/2: on average grey, and every module by itself ± half the contrast. Blurred, a square's two opposite
    edges overlap, which takes away exp(−d²/4s²) of the information of each, and lose some length at their ends.
    """

    def __init__(self, modules: int, spacing: Floats, length: Floats, weight: Floats) -> None:
        """All (C, N).

        Args:
            spacing: of lines a module apart, in units of the blur.
            length: of a module along the edges, in units of the blur.
            weight: 1/module² for each module of edge.
        """
        overlap = np.exp(-(spacing**2) / 4)
        inner = modules - 2

        def square(side: int) -> Floats:
            """Modules that a square's edge counts, of `side` modules: ∫ of its blurred profile, squared."""
            half = side * length / 2
            return np.asarray(side * erf(half) - 2 / math.sqrt(math.pi) / length * (1 - np.exp(-(half**2))))

        # A module's own edges, of half the contrast, stand on all lines of the inner square; there are two on each
        # line within and one on its outline, where the grey square's edge, of half the contrast too, is beside it.
        own = inner * (1 - overlap) * square(1) / 4
        outline, frame = square(modules) * (1 - overlap / 2), square(inner) * (1 / 4 - overlap / 2) + own
        outer, edge = modules / 2, inner / 2
        within = np.arange(1, inner) - edge

        def moment(power: int) -> Floats:
            at_lines = 2 * own * (np.abs(within) ** power).sum()
            return np.asarray(2 * outline * outer**power + 2 * frame * edge**power + at_lines)

        self.zeroth, self.second, self.fourth = (weight * moment(power) for power in (0, 2, 4))
        # The mean square along an edge from −h to h is h²/3.
        along = 2 * own * (within**2).sum() + 2 * frame * edge**2
        self.mixed = weight * (2 * outline * outer**4 / 3 + along * edge**2 / 3)

    def centre_variance(self, other: _Moments) -> Floats:
        """Modules², of the centre across these edges, estimated together with a homography.

        Of the homography's eight numbers the foreshortening along the same axis, which moves edges by x² here and by
        x·y on the `other` ones, is the only one that a step can be taken for.
        """
        known = self.zeroth - self.second**2 / (self.fourth + other.mixed)
        return np.asarray(np.where(known > 0, 1 / known, np.inf))


def _blur_variance(views: Views) -> Floats:
    """px², of all that smears an edge: the lens in focus, out of it, and the pixel's own width."""
    defocus_px = views.circle_of_confusion_px / DIAMETERS_PER_SIGMA
    return np.asarray(views.arrays.psf_sigma_px**2 + PIXEL_VARIANCE_PX2 + defocus_px**2)


def module_sides(appearance: Appearance, views: Views) -> tuple[Floats, Floats]:
    """px, a module's two sides in the image, (C, 2, N) each."""
    assert views.normals is not None
    across_m, down_m = appearance.sides_m(views.normals)
    return views.image_of(across_m), views.image_of(down_m)
