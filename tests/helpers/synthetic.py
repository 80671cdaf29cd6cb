"""Images of markers made without the renderer: a second route to the truth for the localisation tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from pss import ImageSensor
from render.world.marker_print import pattern

Floats = NDArray[np.float64]

SUPERSAMPLES = 12
DICTIONARY = "DICT_4X4_100"
SENSOR = ImageSensor(550.0, 0.5, 4.0, 10000.0, 6.0, 12, 64)


def homography(px_per_module: float, centre_px: tuple[float, float], angle_deg: float, squeeze: float, skew: float):
    """Module coordinates about the marker's centre to pixels; `squeeze` foreshortens, `skew` adds perspective."""
    angle = np.radians(angle_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    h = np.eye(3)
    h[:2, :2] = px_per_module * turn @ np.diag([squeeze, 1.0])
    h[:2, 2] = centre_px
    h[2, :2] = skew
    h[:2] += np.outer(np.array(centre_px), h[2]) * [1, 1, 0]
    return h


def marker_electrons(marker_id: int, h: Floats, size: int, white: float, black: float, blur_px: float = 0.0) -> Floats:
    """Mean electrons (size, size) of a marker with one module of quiet zone on grey, integrated over each pixel."""
    fine = (np.arange(size * SUPERSAMPLES) + 0.5) / SUPERSAMPLES - 0.5
    x, y = np.meshgrid(fine, fine)
    u, v, w = np.einsum("ij,jkl->ikl", np.linalg.inv(h), np.stack([x, y, np.ones_like(x)]))
    bits = np.pad(pattern(DICTIONARY, marker_id), 1, constant_values=True)
    half = len(bits) / 2
    column, row = np.floor(u / w + half).astype(int), np.floor(v / w + half).astype(int)
    inside = (column >= 0) & (row >= 0) & (column < len(bits)) & (row < len(bits))
    image = np.full(x.shape, (white + black) / 2)
    image[inside] = np.where(bits[row[inside], column[inside]], white, black)
    if blur_px:
        image = gaussian_filter(image, blur_px * SUPERSAMPLES)
    return image.reshape(size, SUPERSAMPLES, size, SUPERSAMPLES).mean(axis=(1, 3))


def corners(h: Floats, modules: int = 6) -> Floats:
    """Pixels of the black border's corners, (4, 2)."""
    half = modules / 2
    ideal = np.array([[-half, -half, 1], [half, -half, 1], [half, half, 1], [-half, half, 1]])
    mapped = ideal @ h.T
    return mapped[:, :2] / mapped[:, 2:]
