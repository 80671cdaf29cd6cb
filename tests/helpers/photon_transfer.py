"""EMVA 1288 on the simulated sensor: a laboratory that takes frames, and an estimator that sees nothing but frames.

The estimator is Release 4.0's linear model, by exposure time at a constant irradiance, and shares no code with
`render.sensor`. To each figure it states a standard uncertainty, propagated from the number of pixels.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor, PTZCamera
from render.sensor import capture, fixed_pattern

Floats = NDArray[np.float64]
Frame = NDArray[np.uint16]

# DN², of rounding to whole numbers.
QUANTISATION_DN2 = 1 / 12
# Shares of the saturation signal that the standard fits gain and responsivity to, and linearity between.
FITTED_BELOW = 0.7
LINEAR_BETWEEN = (0.05, 0.95)
# The longest exposure in units of the one that saturates: one or two levels are saturated. On a longer flat, whose
# variance is nothing but noise, the reference package takes the last level for the one where saturation begins.
BEYOND_SATURATION = 1.03
# Electrons of dark current in the longest exposure: enough to be measured. Without dark current, the exposure in s.
LONGEST_DARK_E = 40.0
LONGEST_S = 1.0


# ---- the laboratory --------------------------------------------------------------------------------------------------


class Laboratory:
    """A camera before an integrating sphere: frames of so many mean photons a pixel in so many seconds.

    Another seed is another body with other noise.
    """

    def __init__(self, sensor: ImageSensor, resolution: tuple[int, int] = (320, 240), seed: int = 0) -> None:
        self.sensor, self._seed, self._taken = sensor, seed, 0
        width, height = resolution
        self._shape = (height, width)
        self._pattern = fixed_pattern(PTZCamera((seed, 2.0, 2.5), 0, 0, resolution=resolution), sensor)

    def frame(self, photons: float, exposure_s: float) -> Frame:
        """The next frame."""
        self._taken += 1
        sensor = dataclasses.replace(self.sensor, exposure_ms=exposure_s * 1e3)
        rng = np.random.default_rng(np.random.SeedSequence([self._seed, self._taken]))
        return capture(sensor.quantum_efficiency * np.full(self._shape, photons), sensor, rng, self._pattern)

    def exposures(self, levels: int) -> list[tuple[float, float]]:
        """(mean photons a pixel, seconds) of evenly spaced levels up to beyond saturation."""
        current = self.sensor.dark_current_e_per_s
        longest_s = LONGEST_DARK_E / current if current else LONGEST_S
        saturating = (self.sensor.saturation_e - current * longest_s) / self.sensor.quantum_efficiency
        photons = BEYOND_SATURATION * saturating
        return [(photons * k / levels, longest_s * k / levels) for k in range(1, levels + 1)]


# ---- what is read off the frames -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """Two equal exposures: their mean in DN and temporal variance in DN², over `pixels` pixels."""

    mean_dn: float
    variance_dn2: float
    pixels: int


def pair(first: Frame, second: Frame) -> Pair:
    """From the difference of two frames, in which every fixed pattern cancels; a drift of the lamp is taken off."""
    a, b = first.astype(float), second.astype(float)
    return Pair(float((a.mean() + b.mean()) / 2), float(np.var(a - b) / 2), a.size)


@dataclass(frozen=True)
class Level:
    """One exposure time: photons a pixel, seconds, and a bright and a dark pair of frames."""

    photons: float
    exposure_s: float
    bright: Pair
    dark: Pair

    @property
    def signal_dn(self) -> float:
        """Mean above the dark one."""
        return self.bright.mean_dn - self.dark.mean_dn

    @property
    def shot_dn2(self) -> float:
        """Temporal variance above the dark one."""
        return self.bright.variance_dn2 - self.dark.variance_dn2


@dataclass(frozen=True, eq=False)
class Stack:
    """L equal exposures: the mean frame in DN, and the mean over the pixels of their temporal variance in DN²."""

    frames: int
    mean_dn: Floats
    temporal_dn2: float

    @property
    def spatial_dn2(self) -> float:
        """Variance of the pixels' means, less what temporal noise leaves in a mean of L frames."""
        return float(self.mean_dn.var(ddof=1)) - self.temporal_dn2 / self.frames

    @property
    def spatial_error_dn2(self) -> float:
        """Standard uncertainty of `spatial_dn2`."""
        return float(self.mean_dn.var(ddof=1)) * float(np.sqrt(2 / self.mean_dn.size))


def stack(frames: Iterable[Frame]) -> Stack:
    """Sums over a series of frames, one in memory at a time."""
    count, total, squares = 0, np.zeros(()), np.zeros(())
    for frame in frames:
        values = frame.astype(float)
        count, total, squares = count + 1, total + values, squares + values**2
    mean = total / count
    return Stack(count, mean, float(((squares - count * mean**2) / (count - 1)).mean()))


# ---- the estimator ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Estimate:
    """A figure with its standard uncertainty."""

    value: float
    error: float


@dataclass(frozen=True)
class Characterisation:
    """EMVA 1288's figures of a sensor.

    Attributes:
        system_gain_dn_per_e: K.
        quantum_efficiency: η.
        dark_noise_e: σ_d at no exposure.
        dark_current_e_per_s: μ_I, from the mean.
        prnu_share: PRNU, no unit.
        dsnu_e: DSNU.
        linearity_error: largest deviation from the fitted line, no unit; its `error` is the largest of the levels' own.
        saturation_e: photoelectrons at the level of the largest variance; its `error` is the levels' distance, since
            the largest variance is at the last level below saturation.
    """

    system_gain_dn_per_e: Estimate
    quantum_efficiency: Estimate
    dark_noise_e: Estimate
    dark_current_e_per_s: Estimate
    prnu_share: Estimate
    dsnu_e: Estimate
    linearity_error: Estimate
    saturation_e: Estimate


def fitted(levels: Sequence[Level]) -> list[Level]:
    """The levels below 70 % of the signal at which the temporal variance is largest."""
    limit = FITTED_BELOW * saturating(levels).signal_dn
    return [level for level in levels if level.signal_dn <= limit]


def saturating(levels: Sequence[Level]) -> Level:
    """The level of the largest temporal variance: beyond it, the full well takes the noise away."""
    return max(levels, key=lambda level: level.bright.variance_dn2)


def characterise(levels: Sequence[Level], bright: Stack, dark: Stack) -> Characterisation:
    """EMVA 1288's figures from a series of exposures, and from two stacks at one exposure."""
    used = fitted(levels)
    photons = np.array([level.photons for level in used])
    signal = np.array([level.signal_dn for level in used])
    shot = np.array([level.shot_dn2 for level in used])
    pixels = used[0].bright.pixels
    total = np.array([level.bright.variance_dn2 + level.dark.variance_dn2 for level in used])
    squares = np.array([level.bright.variance_dn2**2 + level.dark.variance_dn2**2 for level in used])

    gain = _through_origin(signal, shot, np.sqrt(2 * squares / pixels))
    response = _through_origin(photons, signal, np.sqrt(total / (2 * pixels)))
    prnu = _ratio(_root(_minus(bright, dark)), Estimate(float(bright.mean_dn.mean() - dark.mean_dn.mean()), 0.0))
    # The light falls on a sample of the pixels, whose mean response is uncertain by PRNU/√N.
    response = Estimate(response.value, float(np.hypot(response.error, response.value * prnu.value / pixels**0.5)))

    seconds = np.array([level.exposure_s for level in levels])
    dark_mean = np.array([level.dark.mean_dn for level in levels])
    dark_variance = np.array([level.dark.variance_dn2 for level in levels])
    _, current = _line(seconds, dark_mean, np.sqrt(dark_variance / (2 * pixels)))
    read, _ = _line(seconds, dark_variance, dark_variance * np.sqrt(2 / pixels))
    top = saturating(levels)
    efficiency = _ratio(response, gain)
    return Characterisation(
        gain,
        efficiency,
        _ratio(_root(Estimate(read.value - QUANTISATION_DN2, read.error)), gain),
        _ratio(current, gain),
        prnu,
        _ratio(_root(Estimate(dark.spatial_dn2, dark.spatial_error_dn2)), gain),
        linearity(levels),
        Estimate(top.photons * efficiency.value, (levels[1].photons - levels[0].photons) * efficiency.value),
    )


def linearity(levels: Sequence[Level]) -> Estimate:
    """Largest relative deviation of the signal from its line over the photons, between 5 and 95 % of saturation."""
    lowest, highest = (share * saturating(levels).signal_dn for share in LINEAR_BETWEEN)
    used = [level for level in levels if lowest <= level.signal_dn <= highest]
    photons, signal = (np.array([getattr(level, name) for level in used]) for name in ("photons", "signal_dn"))
    slope, offset = np.polyfit(photons, signal, 1, w=1 / signal)
    line = slope * photons + offset
    error = [
        np.sqrt((level.bright.variance_dn2 + level.dark.variance_dn2) / (2 * level.bright.pixels)) / level.signal_dn
        for level in used
    ]
    return Estimate(float(np.abs(signal / line - 1).max()), float(max(error)))


def _through_origin(x: Floats, y: Floats, error: Floats) -> Estimate:
    """The standard's unweighted line through the origin."""
    return Estimate(float(x @ y / (x @ x)), float(np.sqrt((x**2) @ (error**2)) / (x @ x)))


def _line(x: Floats, y: Floats, error: Floats) -> tuple[Estimate, Estimate]:
    """Offset and slope of an unweighted line."""
    design = np.column_stack([np.ones_like(x), x])
    solve = np.linalg.pinv(design)
    values, errors = solve @ y, np.sqrt(solve**2 @ error**2)
    return Estimate(float(values[0]), float(errors[0])), Estimate(float(values[1]), float(errors[1]))


def _minus(bright: Stack, dark: Stack) -> Estimate:
    error = float(np.hypot(bright.spatial_error_dn2, dark.spatial_error_dn2))
    return Estimate(bright.spatial_dn2 - dark.spatial_dn2, error)


def _root(square: Estimate) -> Estimate:
    """Of a variance; one that comes out negative is none, with the variance's own error as the limit."""
    if square.value <= square.error:
        return Estimate(float(np.sqrt(max(square.value, 0.0))), float(np.sqrt(square.error)))
    return Estimate(float(np.sqrt(square.value)), square.error / (2 * float(np.sqrt(square.value))))


def _ratio(above: Estimate, below: Estimate) -> Estimate:
    value = above.value / below.value
    return Estimate(value, abs(value) * float(np.hypot(above.error / (above.value or 1), below.error / below.value)))
