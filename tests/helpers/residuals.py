"""Measured pixels whose residuals have exactly the covariance that is stated."""

from __future__ import annotations

import numpy as np

from pss.cameras.camera import PTZCamera


def room(points=4, seed=1):
    places = [(3, 3, 2.8), (-3, 3, 2.5), (3, -3, 2.2), (-3, -3, 2.8)]
    cameras = [PTZCamera(p, 0, 0, zoom=1 + 0.3 * k).aimed_at((0, 0, 1)) for k, p in enumerate(places)]
    return cameras, np.random.default_rng(seed).uniform([-1, -1, 0.5], [1, 1, 1.8], size=(points, 3))


def pixel_covariances(cameras, points, seed=2):
    """One ellipse for each view and point, of 0.05 to 0.3 px, (C, N, 2, 2)."""
    root = np.random.default_rng(seed).uniform(-0.2, 0.2, size=(len(cameras), points, 2, 2)) + 0.1 * np.eye(2)
    return root @ root.mT + 0.05**2 * np.eye(2)


def exact_residuals(rng, covariance, trials):
    """px, residuals of all views (C, T, N, 2) whose mean is 0 and whose covariance is R exactly, not just on average.

    What is left to chance is then the filter's own draws, so that the bands are as narrow as the runs are many.
    """
    views, points = covariance.shape[:2]
    draws = rng.standard_normal((points, trials, 2 * views))
    draws -= draws.mean(axis=1, keepdims=True)
    sample = draws.mT @ draws / trials
    draws = draws @ np.linalg.inv(np.linalg.cholesky(sample)).mT
    unit = draws.reshape(points, trials, views, 2).transpose(2, 1, 0, 3)
    return (np.linalg.cholesky(covariance)[:, None] @ unit[..., None])[..., 0]


def measured(cameras, points_m, residuals):
    return np.stack([camera.project(points_m)[0] for camera in cameras])[:, None] + residuals
