"""Meshes asked of Mitsuba give the answers of the metric's own search, and so the same light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenes
from pss import Sphere
from pss.surrogates import any_blocks
from render.light.radiosity import solve_light
from render.world.traced_meshes import TracedMeshes, joined_meshes, with_traced_meshes

HALLWAY = Path(__file__).parents[3] / "scenes" / "hallway.toml"
SEGMENTS = 20_000
# Single precision may decide otherwise for a line of sight that grazes an edge within a micrometre: none of 200,000 do.
MOST_OTHERWISE = 2
# A patch that one line of sight decides otherwise is no more than this part of a point's light.
SAME_LIGHT = 1e-3


@pytest.fixture(scope="module")
def hallway():
    return scenes.load(HALLWAY).state


@pytest.fixture(scope="module")
def segments():
    rng = np.random.default_rng(3)
    low, high = np.array([-2.9, -4.9, 0.05]), np.array([2.9, 4.9, 2.95])
    # Half of them end near a body, where most is to be decided.
    ends = rng.uniform(low, high, (SEGMENTS, 3))
    ends[::2] = rng.normal([-0.8, -2.0, 1.0], 0.3, (SEGMENTS // 2, 3))
    return rng.uniform(low, high, (SEGMENTS, 3)), ends


def test_traced_meshes_block_what_the_metrics_meshes_block(hallway, segments, mi):
    own = any_blocks(hallway.occluders, *segments)
    traced = any_blocks(with_traced_meshes(hallway.occluders, mi), *segments)
    assert 0.1 < own.mean() < 0.9
    assert (own != traced).sum() <= MOST_OTHERWISE


def test_a_segment_ends_where_it_is_said_to(hallway, mi):
    """What lies behind the end of a segment hides nothing, and nothing is asked of no segments."""
    (traced,) = with_traced_meshes(hallway.occluders, mi)
    start, towards = np.array([-0.8, -4.0, 1.2]), np.array([0.0, 1.0, 0.0])
    ends = start + np.array([1.5, 2.5])[:, None] * towards
    assert traced.blocks(start, ends).tolist() == [False, True]
    assert traced.blocks(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_the_light_is_the_same_by_either(hallway, mi):
    points, normals = hallway.points_m, hallway.normals
    traced = solve_light(hallway, mi)
    assert any(isinstance(shape, TracedMeshes) for shape in traced.occluders)
    own = type(traced)(traced.corners_m, traced.centres_m, traced.normals, traced.radiosity, hallway.occluders)
    np.testing.assert_allclose(traced.irradiance(points, normals), own.irradiance(points, normals), rtol=SAME_LIGHT)


@pytest.mark.slow
def test_other_shapes_and_other_variants_keep_their_own_search(hallway):
    class Scalar:
        def variant(self):
            return "scalar_rgb"

    ball = Sphere("ball", (0.0, 0.0, 1.0), 0.2)
    kept = with_traced_meshes([ball, *hallway.occluders], Scalar())
    assert kept[0] is ball
    assert [type(shape) for shape in kept] == [type(shape) for shape in joined_meshes([ball, *hallway.occluders])]
    assert with_traced_meshes([ball], None) == (ball,)
