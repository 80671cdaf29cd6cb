"""Adaptive sampling: many samples where a pixel's variance needs them, few elsewhere.

A pilot pass determines the number of samples that each pixel needs for its sampling noise to stay below a given
fraction of its sensor noise. Independent samples then form the image, in two halves whose difference certifies the
result. The samples of a pixel are a Sobol net in four dimensions (pixel x, y and lens x, y together) with a digital
shift per pixel, so that defocused edges converge as fast as sharp ones. (With a Kronecker lattice, marker edges along
the sensor's rows meet its poor one-dimensional projections and converge no faster than random samples.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.stats import qmc

from pss import PTZCamera
from pss.hints import Images
from render.lens.lens_effects import PlaceOnFilm
from render.light.emission import Emission

__all__ = ["RingLight", "Sampled", "Sampling", "film_samples", "pixel_means", "sample_image"]


# A pixel is resampled if it needs more than this many doublings beyond the pilot's estimate.
POWERS_SHORT = 1
# Rounds of sampling after the pilot, each planned by the results of the previous one.
MOST_ROUNDS = 5
ITSELF = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]], dtype=bool)
AROUND = ~ITSELF
RAYS_AT_ONCE = 1 << 24
TILE_PX = 32
# The sampling error of a pixel that an edge crosses falls as n^-0.65 or faster under a Sobol net, sharp or defocused
# (measured from 8 to 2048 samples; benchmarks/README.md); independent samples would give n^-0.5.
CONVERGENCE_EXPONENT = 0.65
# Pixels of one sample count differ in how well the net suits the edge that crosses them: the target is this far below
# the bound, so that all but one in a thousand keep it (benchmarks/README.md).
AIM = 0.58


@dataclass(frozen=True)
class Sampling:
    """Bounds that determine the number of samples of a pixel.

    Attributes:
        noise_ratio: bound on the sampling noise (σ) of the noisiest pixels, the 99.9th percentile of those that an edge
            crosses, in units of the pixel's sensor noise (σ).
        pilot: samples of the pilot pass.
        fewest, most: bounds on a pixel's samples; even numbers.
    """

    noise_ratio: float = 0.25
    pilot: int = 8
    fewest: int = 4
    most: int = 4096


@dataclass(frozen=True)
class RingLight:
    """A camera's ring light: at `position_m` (3,), the lens centre, of `intensity_w_per_sr` in all directions."""

    position_m: tuple[float, float, float]
    intensity_w_per_sr: float


@dataclass(frozen=True, eq=False)
class Sampled:
    """An image with an estimate of its sampling noise.

    Attributes:
        mean: the image, (height, width).
        half_difference: difference of its two independent halves; half of it estimates the sampling error.
        variance: of the single samples within each pixel; large where an edge crosses the pixel.
        samples: total number, including the pilot's.
    """

    mean: Images
    half_difference: Images
    variance: Images
    samples: int


@cache
def sobol_net(count: int) -> NDArray[np.uint32]:
    """The first `count` (a power of two) points of the 4-D Sobol sequence as 32-bit fractions, (4, count)."""
    points = qmc.Sobol(4, scramble=False, bits=32).random(count)
    return np.ascontiguousarray((points.T * 2.0**32).astype(np.uint32))


# (pixel numbers (M,), samples a pixel, random numbers) -> mean and variance of the samples, (M,) each
PixelSampler = Callable[[NDArray[np.uint32], int, np.random.Generator], tuple[Images, Images]]


def sample_image(
    sampler: PixelSampler,
    resolution: tuple[int, int],
    sensor_noise: Callable[[Images], Images],
    sampling: Sampling,
    rng: np.random.Generator,
    saturates: Callable[[Images], NDArray[np.bool_]] | None = None,
) -> Sampled:
    """Render an image of `resolution` (width, height) with adaptive sampling.

    Args:
        sensor_noise: function from an image (height, width) to the σ of one capture's noise, in the image's unit.
        saturates: function from an image to where the sensor certainly saturates. If a pixel and all its neighbours do,
            more samples would have no effect, and it gets the fewest. None: nowhere.
    """
    width, height = resolution
    everywhere = np.arange(width * height, dtype=np.uint32)
    pilot_mean, pilot_variance = sampler(everywhere, sampling.pilot, rng)
    exponent = _needed_exponent(
        pilot_mean, pilot_variance, AROUND | ITSELF, resolution, sensor_noise, sampling, saturates
    )

    halves = np.zeros((2, width * height), dtype=np.float32)
    variance = np.zeros(width * height, dtype=np.float32)
    spent = sampling.pilot * width * height

    def fill(chosen: NDArray[np.bool_]) -> int:
        """Resample some pixels, both halves; returns the number of samples."""
        used = 0
        for power in np.unique(exponent[chosen]):
            pixels = everywhere[chosen & (exponent == power)]
            found = [sampler(pixels, 2 ** (int(power) - 1), rng) for _ in halves]
            for half, (mean, _) in zip(halves, found, strict=True):
                half[pixels] = mean
            variance[pixels] = (found[0][1] + found[1][1]) / 2
            used += len(pixels) * 2 ** int(power)
        return used

    spent += fill(np.ones(width * height, dtype=bool))
    # Details that the pilot missed, such as the sliver of an edge in a pixel's corner, may be visible in the neighbours
    # now. The pixel's own samples are not considered: keeping them because of their low variance would be a bias.
    for _ in range(MOST_ROUNDS - 1):
        second = _needed_exponent(halves.mean(axis=0), variance, AROUND, resolution, sensor_noise, sampling, saturates)
        short = second > exponent + POWERS_SHORT
        if not short.any():
            break
        exponent[short] = second[short]
        spent += fill(short)
    first, other = halves.reshape(2, height, width)
    return Sampled((first + other) / 2, first - other, variance.reshape(height, width), spent)


def _needed_exponent(
    mean: Images,
    variance: Images,
    footprint: NDArray[np.bool_],
    resolution: tuple[int, int],
    sensor_noise: Callable[[Images], Images],
    sampling: Sampling,
    saturates: Callable[[Images], NDArray[np.bool_]] | None,
) -> NDArray[np.int64]:
    """Power of two of the samples that each pixel needs, (height · width,), by the worst in `footprint`."""
    width, height = resolution
    mean = mean.reshape(height, width)
    noise = sensor_noise(mean)
    # An edge may be missed by the few samples of one pixel and appear in the next.
    worst = maximum_filter(variance.reshape(height, width), footprint=footprint)
    by_spread = (np.sqrt(worst) / (AIM * sampling.noise_ratio * noise)) ** (1 / CONVERGENCE_EXPONENT)
    # An edge between two pixels leaves both flat but for a sliver. A sliver missed by a net of n samples is narrower
    # than 1/n of the pixel: the error of two halves of n/2 is below (σ) the contrast over n.
    contrast = maximum_filter(mean, footprint=footprint) - minimum_filter(mean, footprint=footprint)
    by_contrast = contrast / (sampling.noise_ratio * noise)
    needed = np.clip(np.maximum(by_spread, by_contrast), sampling.fewest, sampling.most)
    if saturates is not None:
        needed[minimum_filter(saturates(mean), size=3)] = sampling.fewest
    return np.ceil(np.log2(needed)).astype(np.int64).ravel()


def pixel_means(
    scene: Any, sensor: Any, mi: Any, camera: PTZCamera | None = None, ring: RingLight | None = None
) -> PixelSampler:
    """A sampler of `scene` through `sensor` for the vectorised variants of Mitsuba.

    Args:
        camera: for the effects that Mitsuba's thin lens lacks: blur in focus, radial distortion and blades.
        ring: lights `scene`, baked at 1 W/m², from the camera.
    """
    import drjit as dr

    width, height = (int(n) for n in sensor.film().crop_size())
    place = PlaceOnFilm(camera, mi) if camera is not None else None
    emission = Emission(scene, mi)
    if ring is not None:
        # Data, not constants, so that another camera needs no new compilation.
        intensity = dr.opaque(mi.Float, ring.intensity_w_per_sr)
        origin = mi.Point3f(*(dr.opaque(mi.Float, x) for x in ring.position_m))

        def lit_by_ring(point: Any, normal: Any) -> Any:
            away = point - origin
            squared = dr.squared_norm(away)
            return intensity * dr.maximum(-dr.dot(normal, away), 0) * dr.rsqrt(squared) / squared

    def gather(values: NDArray[np.uint32], where: Any) -> Any:
        return dr.gather(mi.UInt32, mi.UInt32(values), where)

    # Data, not constants: the same code for both.
    not_a_number, black = (dr.opaque(mi.Float, value) for value in (np.nan, 0.0))

    def trace(pixels: NDArray[np.uint32], count: int, shifts: NDArray[np.uint32], missed: Any) -> tuple[Images, Images]:
        index = dr.arange(mi.UInt32, len(pixels) * count)
        pixel, sample = index // count, index % count
        number = gather(pixels, pixel)
        # A float represents 24 bits exactly, so that no sample rounds up to 1, beyond its pixel.
        u = [
            mi.Float((gather(net, sample) ^ gather(shift, pixel)) >> 8) * 2.0**-24
            for net, shift in zip(sobol_net(count), shifts, strict=True)
        ]
        x, y = mi.Float(number % width), mi.Float(number // width)
        through = mi.Point2f(u[2], u[3])
        if place is None:
            film = mi.Point2f((x + u[0]) / width, (y + u[1]) / height)
        else:
            at, through = place.film(x, y, u[0], u[1]), place.aperture(through)
            film = mi.Point2f(at.x / width, at.y / height)
        ray, _ = sensor.sample_ray(0.0, 0.5, film, through)
        radiance = emission.radiance(ray, missed, lit_by_ring if ring is not None else None)
        total = dr.block_sum(radiance, count)
        total_of_squares = dr.block_sum(radiance * radiance, count)
        mean = total / count
        variance = dr.maximum(total_of_squares / count - mean * mean, 0.0) * (count / max(count - 1, 1))
        dr.eval(mean, variance)
        return mean.numpy(), variance.numpy()

    def sampler(pixels: NDArray[np.uint32], count: int, rng: np.random.Generator) -> tuple[Images, Images]:
        mean, variance = traced(pixels, count, rng, not_a_number)
        # Samples that pass through a seam are not light: their pixels are drawn again. If they miss again the result is
        # black: the back of an open surface, or the void.
        again = np.isnan(mean)
        if again.any():
            mean[again], variance[again] = traced(pixels[again], count, rng, black)
        return mean, variance

    def traced(pixels: NDArray[np.uint32], count: int, rng: np.random.Generator, missed: Any) -> tuple[Images, Images]:
        shifts = rng.integers(0, 2**32, size=(4, len(pixels)), dtype=np.uint32)
        step = max(1, RAYS_AT_ONCE // count)
        parts = [
            trace(pixels[start : start + step], count, shifts[:, start : start + step], missed)
            for start in range(0, len(pixels), step)
        ]
        means, variances = zip(*parts, strict=True)
        return np.concatenate(means), np.concatenate(variances)

    return sampler


def film_samples(scene: Any, sensor: Any, mi: Any) -> PixelSampler:
    """The same for the scalar variants, which cannot trace lists of rays: whole tiles of the film by `mi.render`.

    About ten times slower per sample, and a whole tile is sampled if one of its pixels needs many samples.
    """
    width, height = (int(n) for n in sensor.film().crop_size())
    parameters = mi.traverse(sensor)
    moments = mi.load_dict({"type": "moment", "nested": {"type": "path", "max_depth": 1}})

    def crop(offset: tuple[int, int], size: tuple[int, int]) -> None:
        parameters["film.crop_offset"], parameters["film.crop_size"] = offset, size
        parameters.update()

    def sampler(pixels: NDArray[np.uint32], count: int, rng: np.random.Generator) -> tuple[Images, Images]:
        mean = np.zeros((height, width), dtype=np.float32)
        square = np.zeros((height, width), dtype=np.float32)
        side = TILE_PX if len(pixels) < width * height else max(width, height)
        tiles = np.unique(np.column_stack([pixels // width // side, pixels % width // side]), axis=0)
        for row, column in tiles * side:
            size = (min(side, width - int(column)), min(side, height - int(row)))
            crop((int(column), int(row)), size)
            seed = int(rng.integers(2**31))
            part = np.array(mi.render(scene, sensor=sensor, integrator=moments, spp=count, seed=seed))
            # Channels: the film's own, then first and second moments of X, Y and Z; grey light has its value in Y.
            mean[row : row + size[1], column : column + size[0]] = part[..., -5]
            square[row : row + size[1], column : column + size[0]] = part[..., -2]
        crop((0, 0), (width, height))
        mean, square = mean.ravel()[pixels], square.ravel()[pixels]
        return mean, np.maximum(square - mean**2, 0) * (count / max(count - 1, 1))

    return sampler
