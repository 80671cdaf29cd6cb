"""The solved light against a path-traced reference, which knows neither patches nor form factors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.path_traced import path_traced_irradiance
from render.light.radiosity import LIFT_M, form_factors, solve_light
from render.world.state import Room

pytestmark = pytest.mark.render

# Relative, RMS over the markers (measured: 1.5 %; the ball's underside, 1 to 5 cm above the plinth, is 10 % off).
MARKERS = 0.02
# Paths a marker: they leave a standard error of 0.28 % (RMS), of which nothing is taken off.
SAMPLES = 1 << 16
NOISE = 0.004
# The family of 84 comparisons in units of the reference's own error: beyond 5 with a chance of 1 % (15 parts' t).
SCORE = 5.0


@pytest.fixture(scope="module")
def reference(room, mi) -> tuple[np.ndarray, np.ndarray]:
    """W/m² at the room's markers, with standard errors."""
    return path_traced_irradiance(room.state, room.state.points_m, room.state.normals, mi, SAMPLES)


def test_light_on_the_markers_is_the_path_traced_one(room, reference):
    """Within 2 %, RMS over all markers of the room, those in the ball's own shadow too."""
    state = room.state
    traced, error = reference
    off = solve_light(state).irradiance(state.points_m, state.normals) / traced - 1
    rms, noise = np.sqrt(np.mean(off**2)), np.sqrt(np.mean((error / traced) ** 2))
    worst = np.abs(off).argmax()
    print(
        f"radiosity against {SAMPLES} paths a marker: RMS {rms:.2%}, mean {off.mean():+.2%}, median of the absolute "
        f"{np.median(np.abs(off)):.2%}, largest {off[worst]:+.2%} (marker {state.markers[worst].id}); noise {noise:.2%}"
    )
    assert noise < NOISE
    assert rms < MARKERS


def test_the_reference_is_lamberts_formula_where_nothing_reflects_or_hides(room, mi):
    """In a black room without objects the reference gives the lamps' form factors, at any distance and angle."""
    state = room.state
    panels, size = state.light.panels, state.room
    black = Room(size.width_m, size.length_m, size.height_m, 0.0, 0.0, 0.0)
    state = dataclasses.replace(state, room=black, objects=(), markers=())
    rng = np.random.default_rng(3)
    points = rng.uniform((-2.5, -2.5, 0.2), (2.5, 2.5, 2.0), (84, 3))
    normals = rng.normal(size=(84, 3))
    normals[:, 2] = np.abs(normals[:, 2])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    traced, error = path_traced_irradiance(state, points, normals, mi, 1 << 14)
    expected = np.zeros(len(points))
    for panel in panels:
        (x, y), (width, length) = panel.centre_m, panel.size_m
        # 2 mm under the ceiling, counter-clockwise as seen from below.
        signs = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)]) / 2
        lamp = np.column_stack([np.array([x, y]) + signs * (width, length), np.full(4, size.height_m - 2e-3)])
        lamps = np.broadcast_to(lamp, (len(points), 4, 3))
        expected += np.pi * state.light.radiance_w_per_m2_sr * form_factors(points + LIFT_M * normals, normals, lamps)
    lit = expected > 0
    assert lit.sum() > len(lit) / 2
    np.testing.assert_allclose(traced[~lit], 0)
    assert (np.abs(traced - expected)[lit] < SCORE * error[lit]).all()
