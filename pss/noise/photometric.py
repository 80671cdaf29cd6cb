"""Brightness and contrast: the precision of a tag's centre from its edges, given light, sensor and blur.

An edge of length ℓ px with the contrast Δ, under a Gaussian blur of σ = s px and noise σ_e per pixel, determines its
position with the variance 2√π·s·σ_e²/(Δ²·ℓ): the Cramér–Rao bound, since the squared slope of an error function
integrates to Δ²/(2√π·s). A tag's edges run along its two sides, and its centre is estimated together with the rest of
a homography. Foreshortening makes the result a full 2 × 2 covariance, and so does motion during the exposure, which
blurs the edges that it crosses (`pss.noise.blur`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.special import erf

from pss.cameras.appearance import Appearance
from pss.cameras.sensor import ImageSensor, electrons_per_radiance
from pss.cameras.views import Views
from pss.errors import RangeError
from pss.hints import Floats
from pss.noise.blur import EdgeBlur, edge_blur, sensors_of, still_variance_px2, way_px
from pss.noise.covariance import PixelCovariance

__all__ = ["BrightnessContrast", "module_sides", "sides_e"]


@dataclass(frozen=True)
class BrightnessContrast:
    """Photon, read and quantisation noise relative to the contrast after blur (Table 1). Without fitted parameters.

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
            still, way = np.sqrt(still_variance_px2(views)), way_px(views, self.sensor)
            squared_contrast, noise = self._levels(views, appearance)

            def moments(side: Floats, length: Floats) -> _Moments:
                """Of the edges along a side of the module, of `length` px."""
                blur = edge_blur(still, side, way)
                # 1/px² for each px of edge.
                strength = squared_contrast / (2 * math.sqrt(math.pi) * blur.across * noise)
                # They are `area / length` px apart; a step across, in modules, has (area / length)² · length of it.
                return _Moments(appearance.modules, area / length, length, blur, strength * area**2 / length)

            first, second = moments(down, b), moments(across, a)
            variance_across, variance_down = first.centre_variance(second), second.centre_variance(first)
            uu, vv, uv = (
                variance_across * across[:, i] * across[:, j] + variance_down * down[:, i] * down[:, j]
                for i, j in ((0, 0), (1, 1), (0, 1))
            )
        known = np.isfinite(uu) & np.isfinite(vv) & np.isfinite(uv)
        nothing = np.inf
        return PixelCovariance(np.where(known, uu, nothing), np.where(known, vv, nothing), np.where(known, uv, 0.0))

    def _levels(self, views: Views, appearance: Appearance) -> tuple[Floats, Floats]:
        """e⁻², the squared contrast of an edge and the mean variance of its two sides, (C, N) each."""
        sensors = sensors_of(self.sensor, views)
        dark = np.array([sensor.noise_electrons(np.zeros(())) for sensor in sensors], dtype=float).reshape(-1, 1) ** 2
        white, black = sides_e(views, appearance, self.sensor)
        return np.asarray((white - black) ** 2), np.asarray((white + black) / 2 + dark)


def sides_e(
    views: Views, appearance: Appearance, sensor: ImageSensor | Mapping[str, ImageSensor]
) -> tuple[Floats, Floats]:
    """Electrons, mean signal of the white and the black modules, (C, N) each; at most the saturation of the sensor."""
    sensors = sensors_of(sensor, views)
    per_radiance = np.array(
        [electrons_per_radiance(camera, each) for camera, each in zip(views.cameras, sensors, strict=True)]
    ).reshape(-1, 1)
    full_well = np.array([each.saturation_e for each in sensors]).reshape(-1, 1)
    collected = per_radiance * views.cos_off_axis**4
    if appearance.ring_light:
        collected = collected * np.maximum(views.cos_incidence, 0.0) / views.range_m**2
    white, black = (
        np.minimum(collected * np.asarray(radiance), full_well)
        for radiance in (appearance.white_w_per_m2_sr, appearance.black_w_per_m2_sr)
    )
    return np.asarray(white), np.asarray(black)


class _Moments:
    """The edges of an average tag in one direction, about its centre, as the basis of its position's variance.

    A tag is a black square of n modules a side, in which the n − 2 inner ones are each black or white with probability
    1/2: on average grey, and each module ± half the contrast. Under blur, a square's two opposite edges overlap, which
    reduces the information of each by exp(−d²/4s²), and their ends lose some length.
    """

    def __init__(self, modules: int, spacing_px: Floats, length_px: Floats, blur: EdgeBlur, weight: Floats) -> None:
        """All (C, N).

        Args:
            spacing_px: px, between lines one module apart.
            length_px: px, of a module along the edges.
            blur: of the edges.
            weight: 1/module² for each module of edge.
        """
        spacing, length = spacing_px / blur.across, length_px / blur.along
        overlap = np.exp(-(spacing**2) / 4)
        inner = modules - 2

        def square(side: int) -> Floats:
            """Effective length in modules of a square's edge of `side` modules: ∫ of its blurred profile, squared."""
            half = side * length / 2
            return np.asarray(side * erf(half) - 2 / math.sqrt(math.pi) / length * (1 - np.exp(-(half**2))))

        # A module's own edges, of half the contrast, are on all lines of the inner square. There are two on each inner
        # line and one on its outline, next to the grey square's edge, which has half the contrast too.
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
        """Modules², variance of the centre across these edges, estimated together with a homography.

        Of the homography's eight parameters, only the foreshortening along the same axis correlates with the position:
        it moves these edges by x² and the `other` ones by x·y.
        """
        known = self.zeroth - self.second**2 / (self.fourth + other.mixed)
        return np.asarray(np.where(known > 0, 1 / known, np.inf))


def module_sides(appearance: Appearance, views: Views) -> tuple[Floats, Floats]:
    """px, a module's two sides in the image, (C, 2, N) each."""
    assert views.normals is not None
    across_m, down_m = appearance.sides_m(views.normals)
    return views.image_of(across_m), views.image_of(down_m)
