"""The Cramér–Rao bound of a marker's centre in one capture, computed independently of the estimator.

The marker is drawn finely, sample by sample, and blurred by a sampled disc; pixels are sums of samples. The derivative
of a pixel's sum by a shift is exact: what its one edge gains less what the other loses. Nothing of the registration is
used here, so that its spread can be compared with what is possible.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import fftconvolve

from pss import ImageSensor
from pss.hints import Bools, Floats
from render.world.marker_print import pattern

__all__ = ["centre_bound", "draw_finely", "fisher_information", "on_marker", "pixel_sums"]


def draw_finely(
    dictionary: str,
    marker_id: int,
    homography: Floats,
    shape: tuple[int, int],
    levels_e: tuple[float, float],
    disc_px: float = 0.0,
    samples: int = 16,
) -> Floats:
    """Electrons per pixel's area, before pixels sum them, (height · samples, width · samples), of a marker on white.

    Args:
        homography: modules about the marker's centre to pixels, (3, 3).
        shape: px, (height, width).
        levels_e: electrons of a black and of a white pixel.
        disc_px: px, diameter of the circle of confusion.
    """
    height, width = shape
    room = math.ceil(disc_px / 2) + 1
    x = (np.arange((width + 2 * room) * samples) + 0.5) / samples - 0.5 - room
    y = ((np.arange((height + 2 * room) * samples) + 0.5) / samples - 0.5 - room)[:, None]
    inverse = np.linalg.inv(homography)
    u, v, w = (row[0] * x + row[1] * y + row[2] for row in inverse)
    bits = np.pad(pattern(dictionary, marker_id), 1, constant_values=True)
    half, last = len(bits) / 2, len(bits) - 1
    # Beyond the marker the outermost modules go on: all of them are white.
    column, row = (np.clip(np.floor(place / w + half).astype(int), 0, last) for place in (u, v))
    black, white = levels_e
    fine = np.where(bits[row, column], white, black)
    if disc_px > 0:
        radius = disc_px / 2 * samples
        across = np.arange(-math.ceil(radius), math.ceil(radius) + 1)
        disc = (np.hypot(across, across[:, None]) <= radius).astype(float)
        fine = fftconvolve(fine, disc / disc.sum(), mode="same")
    inside = room * samples
    return np.asarray(fine[inside:-inside, inside:-inside])


def pixel_sums(fine: Floats, samples: int) -> tuple[Floats, Floats, Floats]:
    """Electrons of each pixel, and by how many they grow per px that it moves right or down, (height, width) each.

    Args:
        fine: electrons per pixel's area, (height · samples, width · samples).
    """
    height, width = (length // samples for length in fine.shape)
    electrons = fine.reshape(height, samples, width, samples).mean(axis=(1, 3))
    # Light at the lines between the pixels, from the samples on either side.
    padded = np.pad(fine, 1, mode="edge")
    upright = (padded[1:-1, :-1:samples] + padded[1:-1, 1::samples]) / 2
    level = (padded[:-1:samples, 1:-1] + padded[1::samples, 1:-1]) / 2
    by_x = np.diff(upright.reshape(height, samples, width + 1).mean(axis=1), axis=1)
    by_y = np.diff(level.reshape(height + 1, width, samples).mean(axis=2), axis=0)
    return electrons, by_x, by_y


def fisher_information(electrons: Floats, derivatives: Floats, sensor: ImageSensor) -> Floats:
    """Fisher's information on K parameters, (K, K), from N pixels with noise of their own.

    Args:
        electrons: mean of each pixel, (N,).
        derivatives: electrons per unit of each parameter, (K, N).
    """
    signal = np.maximum(electrons, 0)
    variance = sensor.noise_electrons(signal) ** 2 + (sensor.prnu_share * signal) ** 2 + sensor.dsnu_e**2
    return np.asarray((derivatives / variance) @ derivatives.T)


def on_marker(homography: Floats, shape: tuple[int, int], reach_modules: float) -> tuple[Floats, Floats, Bools]:
    """Modules (u, v) of the pixels of an image, and whether they are within ±`reach_modules`; `shape` each."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    u, v, w = np.einsum("ij,jhw->ihw", np.linalg.inv(homography), np.stack([x, y, np.ones_like(x)]))
    return u / w, v / w, np.maximum(np.abs(u / w), np.abs(v / w)) < reach_modules


def centre_bound(
    fine: Floats, samples: int, homography: Floats, modules: int, sensor: ImageSensor, margin_modules: float = 0.75
) -> Floats:
    """px², the least covariance (2, 2) of a marker's centre that comes of a homography, gain and offset, all unknown.

    Args:
        fine: electrons per pixel's area, (height · samples, width · samples), as of `draw_finely`.
        homography: modules about the marker's centre to pixels, (3, 3).
        modules: along the marker's side, its border counted.
        margin_modules: how far beyond the border pixels are known to show the marker.
    """
    electrons, by_x, by_y = pixel_sums(fine, samples)
    u, v, inside = on_marker(homography, electrons.shape, modules / 2 + margin_modules)
    y, x = (axis.astype(float) for axis in np.nonzero(inside))
    u, v = u[inside], v[inside]
    # The homography's own nine numbers, of which one is the scale of all others: pixel = (a, b) / c.
    c = homography[2] @ np.stack([u, v, np.ones_like(u)])
    place = np.stack([u, v, np.ones_like(u)])
    none = np.zeros_like(place)
    moves_x = np.concatenate([place, none, -x * place])[:8] / c
    moves_y = np.concatenate([none, place, -y * place])[:8] / c
    # Under a pattern that moves right, a pixel gets the value from its left.
    derivatives = -(moves_x * by_x[inside] + moves_y * by_y[inside])
    levels = np.stack([electrons[inside], np.ones_like(u)])
    information = fisher_information(electrons[inside], np.concatenate([derivatives, levels]), sensor)
    scale = 1 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    # The centre is (h₀₂, h₁₂) / h₂₂.
    return np.asarray(covariance[np.ix_([2, 5], [2, 5])] / homography[2, 2] ** 2)
