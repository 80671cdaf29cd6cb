"""The certificate of a view: its sampling noise beside its sensor noise."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, uniform_filter

from pss import RangeError
from render.lens.sampling import Sampled

__all__ = ["Certificate", "certify"]


# An edge crosses a marker's pixel if its samples spread (σ) by more than this many times its sensor noise.
EDGE_SPREAD = 0.5
# Side of the window over which the certificate pools the noise of edge pixels.
POOLED_PX = 5


@dataclass(frozen=True)
class Certificate:
    """A view's quality: sampling noise over sensor noise (σ/σ), from two independent half renders, and more.

    `edge_*` are over the marker pixels that an edge crosses (nan without any), `image_*` over all pixels. The tails of
    sharp edges are heavy: over one view, `edge_rms` is accurate to a factor of about 1.6. Two halves yield one sample
    of a pixel's noise, so that for the percentiles it is pooled with the edge pixels around it. `samples` is their
    total number; `saturated_share` (0 to 1) is the share of marker pixels that reach saturation.
    """

    edge_rms: float
    edge_median: float
    edge_p999: float
    image_rms: float
    image_p999: float
    samples: int
    saturated_share: float

    @classmethod
    def from_json(cls, content: object) -> Certificate:
        """A certificate from JSON, where missing numbers are null.

        Raises:
            RangeError: other keys, or a value that is not a number.
        """
        names = [field.name for field in dataclasses.fields(cls)]
        if not isinstance(content, dict) or set(content) != set(names):
            raise RangeError(f"certificate {str(content)[:60]!r}; allowed: {', '.join(names)}")
        for name, value in content.items():
            if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
                raise RangeError(f"{name!r} of a certificate is {str(value)[:60]!r}; allowed: a number, or null")
        return cls(**{name: float("nan") if value is None else value for name, value in content.items()})

    def meets(self, noise_ratio: float) -> bool:
        """Whether the 99.9th percentile over the edges of markers is within the requested bound."""
        return not self.edge_p999 > noise_ratio


def certify(
    image: Sampled,
    noise: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    marker: NDArray[np.int32],
    saturated: float,
    unseen: NDArray[np.bool_] | bool = False,
) -> Certificate:
    """Certificate of the sampling noise, from the difference of a view's two half renders.

    Args:
        saturated: share of the marker pixels that reach saturation.
        unseen: (height, width), pixels that certainly saturate: no capture shows their sampling noise.
    """
    sigma = noise(image.mean)
    ratio = np.where(unseen, np.float32(0), np.abs(image.half_difference) / 2 / sigma)
    on_edge = (np.sqrt(image.variance) > EDGE_SPREAD * sigma) & ~np.asarray(unseen)
    of_marker = on_edge & (maximum_filter(marker, 3) >= 0)
    edges = ratio[of_marker]
    pooled = _pooled(ratio, on_edge)
    nothing = float("nan")
    return Certificate(
        edge_rms=float(np.sqrt(np.mean(edges**2))) if edges.size else nothing,
        # |difference| of two Gaussian halves has its median at 0.6745 σ.
        edge_median=float(np.median(edges) / 0.6745) if edges.size else nothing,
        edge_p999=float(np.percentile(pooled[of_marker], 99.9)) if edges.size else nothing,
        image_rms=float(np.sqrt(np.mean(ratio**2))),
        image_p999=float(np.percentile(pooled[on_edge], 99.9)) if on_edge.any() else 0.0,
        samples=image.samples,
        saturated_share=saturated,
    )


def _pooled(ratio: NDArray[np.float32], on_edge: NDArray[np.bool_]) -> NDArray[np.float32]:
    """RMS of the ratio over the edge pixels in a small window about each pixel."""
    counted = uniform_filter(on_edge.astype(np.float32), POOLED_PX)
    square = uniform_filter(np.where(on_edge, ratio**2, 0).astype(np.float32), POOLED_PX)
    return np.sqrt(np.maximum(square, 0) / np.maximum(counted, 0.5 / POOLED_PX**2))
