"""Sampling noise of a view from independent replicates, in units of its sensor noise, over the edges of markers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.stats
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, uniform_filter

from pss import ImageSensor, PTZCamera
from render.certificate import EDGE_SPREAD, POOLED_PX
from render.lens import thin_lens
from render.lens.sampling import Sampled, Sampling, pixel_means, sample_image
from render.renderer import Renderer
from render.sensor import expected_electrons

__all__ = ["Noise", "Spent", "Study", "spent"]

Floats = NDArray[np.floating]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Noise:
    """σ of the sampling noise over σ of the sensor's, over the pixels of markers that an edge crosses."""

    median: float
    rms: float
    p999: float

    def __str__(self) -> str:
        return f"{self.median:.3f} | {self.rms:.3f} | {self.p999:.3f}"


@dataclass(frozen=True)
class Spent:
    """What a call cost: seconds by the clock, and of all cores together, which other work on them hardly changes."""

    seconds: float
    cpu_seconds: float

    def __str__(self) -> str:
        return f"{self.seconds:.1f} | {self.cpu_seconds:.1f}"


def spent(call: Callable[[], Any]) -> tuple[Any, Spent]:
    """What `call` gives and what it cost."""
    begin, used = time.perf_counter(), time.process_time()
    result = call()
    return result, Spent(time.perf_counter() - begin, time.process_time() - used)


class Study:
    """One view of a renderer's scene: its sensor noise, and which of its pixels an edge crosses."""

    def __init__(self, renderer: Renderer, mi: Any, camera: PTZCamera, sensor: ImageSensor, sampling: Sampling) -> None:
        self.renderer, self.mi, self.camera, self.sampling = renderer, mi, camera, sampling
        self.request = renderer.request(camera, sensor, sampling)
        height_width = camera.resolution[::-1]
        electrons = np.asarray(expected_electrons(np.ones(height_width), camera, sensor), dtype=np.float32)

        def sigma(radiance: Floats) -> NDArray[np.float32]:
            return np.asarray(sensor.noise_electrons(radiance * electrons) / electrons, dtype=np.float32)

        self._sigma = sigma
        self._sampler = pixel_means(renderer._scene, thin_lens.load_sensor(camera, mi), mi)
        self._images: list[Floats] = []
        first = self.replicate(0)
        self.image, self.samples, self.sigma = first.mean, first.samples, sigma(first.mean)
        self.on_edge: Bools = np.sqrt(first.variance) > EDGE_SPREAD * self.sigma
        marker = renderer.render(self.request).marker_id
        self.of_marker: Bools = self.on_edge & (maximum_filter(marker, 3) >= 0)

    def replicate(self, seed: int) -> Sampled:
        """The view sampled by need with random numbers of its own."""
        rng = np.random.default_rng(seed)
        return sample_image(self._sampler, self.camera.resolution, self._sigma, self.sampling, rng)

    def replicates(self, number: int) -> list[Floats]:
        """So many independent images, sampled by need."""
        while len(self._images) < number:
            self._images.append(self.replicate(1 + len(self._images)).mean)
        return self._images[:number]

    def noise(self, images: list[Floats], part: tuple[slice, slice] = (slice(None), slice(None))) -> Noise:
        """From independent replicates of the image, or of a `part` (rows, columns) of it.

        The 99.9th percentile is of variances pooled over the edge's pixels in windows of `POOLED_PX`, as the
        certificate's: few replicates alone would add their own scatter to its tail.
        """
        variance = np.var(images, axis=0, ddof=1) / self.sigma[part] ** 2
        on_edge, of_marker = self.on_edge[part], self.of_marker[part]
        counted = uniform_filter(on_edge.astype(float), POOLED_PX)
        pooled = uniform_filter(np.where(on_edge, variance, 0.0), POOLED_PX) / np.maximum(counted, 0.5 / POOLED_PX**2)
        freedom = len(images) - 1
        return Noise(
            float(np.sqrt(np.median(variance[of_marker]) / (scipy.stats.chi2.median(freedom) / freedom))),
            float(np.sqrt(variance[of_marker].mean())),
            float(np.sqrt(np.percentile(pooled[of_marker], 99.9))),
        )
