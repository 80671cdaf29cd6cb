"""Fit the ideal image of a marker to the pixels of a capture: maximum likelihood under the sensor's own noise.

Each pixel on the marker is one measurement, compared with the model there; nothing is resampled. The weights are the
sensor's variance at the *fitted* grey value: taken from the noisy pixel itself they would favour pixels that are dark
by chance. The parameters are the eight numbers of a homography, gain and offset, a linear shading of the light and the
variance of the blur; the inverse of their normal matrix, Fisher's, is their covariance.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from pss.hints import AnyFloats, Images
from validate.markers.marker_image import MarkerImage

__all__ = ["Fit", "Linearised", "Pixels", "centre_of", "local_scale", "marker_fields", "moved", "pixels_on"]


HOMOGRAPHY, PARAMETERS = 8, 13
# One step may change the blur's variance by this factor, and by as much in px² as from sharp to hardly blurred.
BLUR_FACTOR, BLUR_STEP_PX2 = 4.0, 0.3
# Keeps the normal matrix's scale finite where all pixels of a parameter are saturated; the inverse then fails.
TINY = 1e-30


@dataclass(frozen=True, eq=False)
class Fit:
    """Where the fit of a marker stands.

    Attributes:
        homography: modules about the marker's centre to pixels, (3, 3).
        gain_dn: digital numbers between black and white at the marker's centre; None: not yet known.
        offset_dn: digital numbers of black there, above the sensor's own dark level.
        shading: relative change of the light per half marker along u and v, (2,).
        blur_px2: px², variance of the lens's disc along any axis.
    """

    homography: AnyFloats
    gain_dn: float | None = None
    offset_dn: float = 0.0
    shading: tuple[float, float] = (0.0, 0.0)
    blur_px2: float = 0.0

    def after(self, step: AnyFloats, half: float) -> Fit:
        """The fit after a step of its parameters, (13,)."""
        homography = moved(self.homography, step[:HOMOGRAPHY], half)
        assert self.gain_dn is not None
        gain, offset = self.gain_dn + float(step[8]), self.offset_dn + float(step[9])
        shading = (self.shading[0] + float(step[10]), self.shading[1] + float(step[11]))
        sharpest = max((self.blur_px2 - BLUR_STEP_PX2) / BLUR_FACTOR, 0.0)
        softest = BLUR_FACTOR * self.blur_px2 + BLUR_STEP_PX2
        blur = min(max(self.blur_px2 + float(step[12]), sharpest), softest)
        return Fit(homography, gain, offset, shading, blur)


@dataclass(frozen=True, eq=False)
class Pixels:
    """Pixels of a capture: columns and rows `x`, `y` counted from `origin` (2,), and digital numbers `dn`, (N,) each.

    From an origin beside them, single precision resolves a hundred-thousandth of a pixel.
    """

    x: Images
    y: Images
    dn: Images
    origin: tuple[int, int]


def centre_of(homography: AnyFloats) -> AnyFloats:
    """px, the image of the marker's centre, (2,)."""
    return np.asarray(homography[:2, 2] / homography[2, 2])


def local_scale(homography: AnyFloats) -> AnyFloats:
    """px per module at the marker's centre: the Jacobian of the homography, (2, 2)."""
    scale = homography[:2, :2] - centre_of(homography)[:, None] * homography[2, :2]
    return np.asarray(scale / homography[2, 2])


def moved(homography: AnyFloats, step: AnyFloats, half: float) -> AnyFloats:
    """A homography after a step (8,) of its own parameters, on a marker of ±`half` modules; (3, 3)."""
    change = np.array([[1 + step[2], step[3], step[0]], [step[4], 1 + step[5], step[1]], [-step[6], -step[7], 1]])
    # From coordinates in half markers to modules.
    scale = np.array([half, half, 1.0])
    after = homography @ (change * (scale[:, None] / scale))
    return np.asarray(after / after[2, 2])


def marker_fields(by_x: Images, by_y: Images, x: Images, y: Images, out: Images) -> None:
    """How an image with the slopes `by_x` and `by_y` at (x, y) in half markers, (N,), changes with a homography.

    Into the first eight rows of `out` (8 or more, N). The first two move everything alike, the others leave the centre.
    """
    out[0], out[1] = by_x, by_y
    np.multiply(by_x, x, out=out[2])
    np.multiply(by_x, y, out=out[3])
    np.multiply(by_y, x, out=out[4])
    np.multiply(by_y, y, out=out[5])
    radial = out[2] + out[5]
    np.multiply(radial, x, out=out[6])
    np.multiply(radial, y, out=out[7])


def pixels_on(capture_dn: NDArray[np.generic], homography: AnyFloats, reach: AnyFloats, thinning: int = 0) -> Pixels:
    """The pixels of a capture (height, width) within ±`reach` (2,) modules of a marker's centre.

    Args:
        thinning: a, to take one pixel in a² + 1: a square lattice, turned so that it visits all columns and all rows.
            One along the pixels' own would see all edges of a marker that is level at the same place in a pixel.
    """
    height, width = capture_dn.shape
    ends = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]]) * reach[:, None]
    outline = np.stack(_mapped(homography, *ends))
    left, top = (max(int(np.ceil(low)), 0) for low in outline.min(axis=1))
    right, bottom = (int(np.floor(high)) + 1 for high in outline.max(axis=1))
    block = capture_dn[top : min(bottom, height), left : min(right, width)]
    every = thinning**2 + 1
    y = np.arange(block.shape[0])[:, None]
    x = np.arange(0, block.shape[1], every) + (-thinning * y) % every
    u, v = _mapped(_from(homography, (left, top)), x.astype(np.float32), y.astype(np.float32))
    row, at = np.nonzero((np.abs(u) < reach[0]) & (np.abs(v) < reach[1]) & (x < block.shape[1]))
    column = x[row, at]
    return Pixels(column.astype(np.float32), row.astype(np.float32), block[row, column].astype(np.float32), (left, top))


def _on_marker(pixels: Pixels, homography: AnyFloats) -> tuple[Images, Images]:
    """Where pixels lie on the marker: (u, v) in modules, (N,) each."""
    return _mapped(_from(homography, pixels.origin), pixels.x, pixels.y)


def _from(homography: AnyFloats, origin: tuple[int, int]) -> Images:
    """From pixels counted from `origin` to modules, (3, 3)."""
    shift = np.array([[1, 0, -origin[0]], [0, 1, -origin[1]], [0, 0, 1.0]])
    inverse = cv2.invert(shift @ homography)[1]  # ten times as fast as NumPy's for so small a matrix
    return np.asarray(inverse / inverse[2, 2], dtype=np.float32)


def _mapped(homography: AnyFloats, x: AnyFloats, y: AnyFloats) -> tuple[AnyFloats, AnyFloats]:
    (a, b, c), (d, e, f), (g, h, i) = homography
    w = g * x + (h * y + i)
    return (a * x + (b * y + c)) / w, (d * x + (e * y + f)) / w


class Linearised:
    """The model of a marker's pixels about one fit: what a step of the parameters does to them, under their noise.

    Args:
        image: of the marker, near the fit's blur and local scale.

    Attributes:
        fit: the fit, now with gain and offset.
        covariance: of the parameters, (13, 13), the first two of which move the centre by half markers; None where the
            pixels do not determine them.
        dof: pixels less parameters.
        contrast2: mean over the pixels of (gain over σ)², no unit.
        correlation: of the pixels and the model.
    """

    def __init__(self, pixels: Pixels, fit: Fit, image: MarkerImage, sensor: ImageSensor) -> None:
        dn_per_e = 1 / sensor.gain_e_per_dn
        dark = np.float32(sensor.black_level_dn + sensor.dark_signal_e * dn_per_e)
        most = np.float32((sensor.saturation_e - sensor.dark_signal_e) * dn_per_e)
        dn = pixels.dn - dark
        self._half = half = np.float32(image.half)
        u, v = _on_marker(pixels, fit.homography)
        seen = image.at(u, v)
        value = seen.value
        if fit.blur_px2 != image.blur_px2:
            value += np.float32(fit.blur_px2 - image.blur_px2) * seen.by_blur
        self.fit = fit if fit.gain_dn is not None else _with_levels(fit, value, dn)
        gain = np.float32(self.fit.gain_dn)
        x, y = u / half, v / half
        shade = np.float32(fit.shading[0]) * x
        shade += np.float32(fit.shading[1]) * y
        shade += 1
        even = gain * value
        even += np.float32(self.fit.offset_dn)
        light = shade * even
        saturated = light > most
        np.minimum(light, most, out=light)
        electrons = np.maximum(light, 0)
        electrons *= np.float32(sensor.gain_e_per_dn)
        variance = electrons + np.float32(sensor.noise_electrons(np.zeros(())) ** 2 + sensor.dsnu_e**2)
        if sensor.prnu_share > 0:
            # Frozen over a camera's frames, but as unknown as all else in one of them.
            variance += (np.float32(sensor.prnu_share) * electrons) ** 2
        per_sigma = np.float32(sensor.gain_e_per_dn) / np.sqrt(variance)
        self._residual = (dn - light) * per_sigma
        self.contrast2 = float(gain * gain * (per_sigma @ per_sigma) / len(dn))
        light -= light.mean()
        dn -= dn.mean()
        self.correlation = float(light @ dn / np.sqrt(max(float(light @ light) * float(dn @ dn), TINY)))

        # What each parameter changes, in units of the pixel's own noise.
        fields = np.empty((PARAMETERS, len(x)), dtype=np.float32)
        shade *= per_sigma
        even *= per_sigma
        slope = shade * (-gain * half)
        marker_fields(slope * seen.by_u, slope * seen.by_v, x, y, fields)
        np.multiply(shade, value, out=fields[8])
        fields[9] = shade
        np.multiply(even, x, out=fields[10])
        np.multiply(even, y, out=fields[11])
        np.multiply(shade, seen.by_blur, out=fields[12])
        fields[12] *= gain
        if saturated.any():
            # However much brighter the model becomes, such a pixel stays as it is.
            fields[:, saturated] = 0
        self._fields, self.dof = fields, len(x) - PARAMETERS
        self.covariance = _inverse((fields @ fields.T).astype(float))

    def step(self) -> tuple[Fit, float, float]:
        """A Gauss–Newton step: the fit after it, its reduced χ², and how far the centre moved in its own σ."""
        assert self.covariance is not None
        gradient = (self._fields @ self._residual).astype(float)
        step = self.covariance @ gradient
        chi2 = (float(self._residual @ self._residual) - float(step @ gradient)) / self.dof
        (xx, xy), (_, yy) = self.covariance[:2, :2]
        x, y = step[:2]
        move = (yy * x * x - 2 * xy * x * y + xx * y * y) / max(xx * yy - xy * xy, TINY)
        return self.fit.after(step, float(self._half)), chi2, float(np.sqrt(max(move, 0.0) / 2))


def _with_levels(fit: Fit, value: Images, dn: Images) -> Fit:
    """The fit with the gain and offset that suit its image best, all pixels alike."""
    deviation = value - value.mean()
    gain = float(deviation @ dn / max(float(deviation @ deviation), TINY))
    return Fit(fit.homography, gain, float(dn.mean() - gain * value.mean()), fit.shading, fit.blur_px2)


def _inverse(normal: AnyFloats) -> AnyFloats | None:
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), TINY))
    scale = scale[:, None] * scale
    found, inverse = cv2.invert(normal * scale, flags=cv2.DECOMP_CHOLESKY)
    return np.asarray(inverse * scale) if found else None
