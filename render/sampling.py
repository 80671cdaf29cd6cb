"""Sampling by need: many samples where the pixel's own variance asks for them, few in the flat rest.

A pilot pass decides how many samples each pixel needs for its sampling noise to stay below a chosen fraction of its
sensor noise; independent samples then make the image, in two halves whose difference certifies what was reached. The
samples of a pixel are a Sobol net in four dimensions (pixel x, y and lens x, y together) under a digital shift of the
pixel's own, so that defocused edges converge as sharp ones do. (A Kronecker lattice was tried: marker edges that run
along the sensor's rows see its poor one-dimensional projections and converge no faster than random samples.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.stats import qmc

__all__ = ["Sampled", "Sampling", "film_samples", "pixel_means", "sample_image"]

Floats32 = NDArray[np.float32]

RAYS_AT_ONCE = 1 << 24
TILE_PX = 32
# The sampling error of a pixel that an edge crosses falls as n^-0.65 or faster under a Sobol net, sharp or defocused
# (measured from 8 to 2048 samples; benchmarks/README.md); independent samples would give n^-0.5.
CONVERGENCE_EXPONENT = 0.65


@dataclass(frozen=True)
class Sampling:
    """How many samples a pixel gets.

    Attributes:
        noise_ratio: sampling noise (σ) aimed at, in units of the pixel's sensor noise (σ).
        pilot: samples of the pilot pass.
        fewest, most: bounds on a pixel's samples; even numbers.
    """

    noise_ratio: float = 0.25
    pilot: int = 8
    fewest: int = 4
    most: int = 4096


@dataclass(frozen=True, eq=False)
class Sampled:
    """An image and the difference of its two halves: half of it estimates the sampling error of each pixel."""

    mean: Floats32
    half_difference: Floats32
    samples: int


@cache
def sobol_net(count: int) -> NDArray[np.uint32]:
    """The first `count` (a power of two) points of the 4-D Sobol sequence as 32-bit fractions, (4, count)."""
    points = qmc.Sobol(4, scramble=False, bits=32).random(count)
    return np.ascontiguousarray((points.T * 2.0**32).astype(np.uint32))


# (pixel numbers (M,), samples a pixel, random numbers) -> mean and variance of the samples, (M,) each
PixelSampler = Callable[[NDArray[np.uint32], int, np.random.Generator], tuple[Floats32, Floats32]]


def sample_image(
    sampler: PixelSampler,
    resolution: tuple[int, int],
    sensor_noise: Callable[[Floats32], Floats32],
    sampling: Sampling,
    rng: np.random.Generator,
) -> Sampled:
    """Render an image of `resolution` (width, height) by need.

    Args:
        sensor_noise: from an image (height, width) to the σ of one capture's noise, in the image's unit.
    """
    width, height = resolution
    everywhere = np.arange(width * height, dtype=np.uint32)
    mean, variance = (image.reshape(height, width) for image in sampler(everywhere, sampling.pilot, rng))
    # An edge may miss the pilot's few samples in one pixel and show in the next.
    worst = maximum_filter(variance, size=3)
    excess = np.sqrt(worst) / (sampling.noise_ratio * sensor_noise(mean))
    wanted = excess ** (1 / CONVERGENCE_EXPONENT)
    # Powers of two keep the number of kernels small; half of them, because the image is made of two halves.
    exponent = np.ceil(np.log2(np.clip(wanted, sampling.fewest, sampling.most))).astype(int).ravel()

    halves = np.zeros((2, width * height), dtype=np.float32)
    spent = sampling.pilot * width * height
    for power in np.unique(exponent):
        pixels = everywhere[exponent == power]
        for half in halves:
            half[pixels], _ = sampler(pixels, 2 ** (int(power) - 1), rng)
        spent += len(pixels) * 2 ** int(power)
    first, second = halves.reshape(2, height, width)
    return Sampled((first + second) / 2, first - second, spent)


def pixel_means(scene: Any, sensor: Any, mi: Any) -> PixelSampler:
    """A sampler of `scene` through `sensor` for the vectorised variants of Mitsuba."""
    import drjit as dr

    width, height = (int(n) for n in sensor.film().crop_size())

    def gather(values: NDArray[np.uint32], where: Any) -> Any:
        return dr.gather(mi.UInt32, mi.UInt32(values), where)

    def trace(pixels: NDArray[np.uint32], count: int, shifts: NDArray[np.uint32]) -> tuple[Floats32, Floats32]:
        index = dr.arange(mi.UInt32, len(pixels) * count)
        pixel, sample = index // count, index % count
        number = gather(pixels, pixel)
        # A float holds 24 bits exactly, so that no sample rounds up to 1, beyond its pixel.
        u = [
            mi.Float((gather(net, sample) ^ gather(shift, pixel)) >> 8) * 2.0**-24
            for net, shift in zip(sobol_net(count), shifts, strict=True)
        ]
        film = mi.Point2f((mi.Float(number % width) + u[0]) / width, (mi.Float(number // width) + u[1]) / height)
        ray, _ = sensor.sample_ray(0.0, 0.5, film, mi.Point2f(u[2], u[3]))
        hit = scene.ray_intersect(ray, mi.RayFlags.All, True)
        radiance = hit.emitter(scene).eval(hit)[0]
        total = dr.block_sum(radiance, count)
        total_of_squares = dr.block_sum(radiance * radiance, count)
        mean = total / count
        variance = dr.maximum(total_of_squares / count - mean * mean, 0.0) * (count / max(count - 1, 1))
        dr.eval(mean, variance)
        return mean.numpy(), variance.numpy()

    def sampler(pixels: NDArray[np.uint32], count: int, rng: np.random.Generator) -> tuple[Floats32, Floats32]:
        shifts = rng.integers(0, 2**32, size=(4, len(pixels)), dtype=np.uint32)
        step = max(1, RAYS_AT_ONCE // count)
        parts = [
            trace(pixels[start : start + step], count, shifts[:, start : start + step])
            for start in range(0, len(pixels), step)
        ]
        means, variances = zip(*parts, strict=True)
        return np.concatenate(means), np.concatenate(variances)

    return sampler


def film_samples(scene: Any, sensor: Any, mi: Any) -> PixelSampler:
    """The same for the scalar variants, which trace no lists of rays: whole tiles of the film through `mi.render`.

    About ten times slower a sample, and a tile pays for all its pixels when one of them needs many samples.
    """
    width, height = (int(n) for n in sensor.film().crop_size())
    parameters = mi.traverse(sensor)
    moments = mi.load_dict({"type": "moment", "nested": {"type": "path", "max_depth": 1}})

    def crop(offset: tuple[int, int], size: tuple[int, int]) -> None:
        parameters["film.crop_offset"], parameters["film.crop_size"] = offset, size
        parameters.update()

    def sampler(pixels: NDArray[np.uint32], count: int, rng: np.random.Generator) -> tuple[Floats32, Floats32]:
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
