"""Patches of light: none lost by splitting, fine where objects nearly touch, dark where a lamp covers the ceiling."""

import numpy as np
import pytest

from pss import Box, Rectangle, Sphere
from render.light.patches import FINEST_PATCH_M, MOST_SPLIT_PATCHES, OBJECT_PATCH_M, scene_patches
from render.world.state import Light, MarkerPrint, Panel, Room, SceneObject, SceneState

PRINT = MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04)
PLINTH = Box("plinth", (-0.3, -0.3, 0.0), (0.3, 0.3, 0.6))
# 1 cm above the plinth at its lowest.
BALL = Sphere("ball", (0.0, 0.0, 0.81), 0.2)
AREA = 1e-12


def state(*shapes, panels=()) -> SceneState:
    objects = tuple(SceneObject(shape, 0.5) for shape in shapes)
    return SceneState(Room(3.0, 4.0, 2.5, 0.2, 0.6, 0.8), Light(0.2, panels), objects, (), PRINT)


def areas(corners: np.ndarray) -> np.ndarray:
    """m², (P,), of parallelograms (P, 4, 3)."""
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]), axis=1)


def longest(corners: np.ndarray) -> np.ndarray:
    """m, (P,), the longer edge of parallelograms (P, 4, 3)."""
    return np.linalg.norm(corners[:, [1, 3]] - corners[:, [0]], axis=-1).max(axis=1)


def flat(found) -> np.ndarray:
    """(P,), which patches are not the ball's triangles."""
    return ~(found.corners_m[:, 3] == found.corners_m[:, 2]).all(axis=1)


def test_splitting_keeps_the_area_and_the_side_that_is_lit():
    found = scene_patches(state(PLINTH, BALL))
    tiles = flat(found)
    room = 2 * (3 * 4 + 3 * 2.5 + 4 * 2.5)
    plinth = 2 * 0.6 * 0.6 + 4 * 0.6 * 0.6
    assert areas(found.corners_m[tiles]).sum() == pytest.approx(room + plinth, rel=AREA)
    np.testing.assert_allclose(found.centres_m[tiles], found.corners_m[tiles].mean(axis=1), atol=1e-12)
    inside = np.array([0.0, 0.0, 1.25])
    walls = tiles & (np.abs(found.centres_m[:, 1]) > 1.99)
    assert (((inside - found.centres_m[walls]) * found.normals[walls]).sum(axis=1) > 0).all()


def test_patches_under_a_ball_are_as_fine_as_the_gap():
    found = scene_patches(state(PLINTH, BALL))
    top = flat(found) & (np.abs(found.centres_m[:, 2] - 0.6) < 1e-9)
    distance = np.hypot(*found.centres_m[top, :2].T)
    sizes = longest(found.corners_m[top])
    assert sizes[distance < 0.1].max() <= FINEST_PATCH_M
    # The corners of the plinth's top have nothing right above them.
    assert sizes[distance > 0.3].max() > 2 * FINEST_PATCH_M


def test_patches_far_from_other_objects_stay_coarse():
    alone = scene_patches(state(PLINTH))
    tops = flat(alone) & (np.abs(alone.centres_m[:, 2] - 0.6) < 1e-9)
    np.testing.assert_allclose(longest(alone.corners_m[tops]), OBJECT_PATCH_M)


def test_what_another_object_covers_is_not_split():
    """A box that stands on the whole of another: nothing shines there."""
    stacked = scene_patches(state(PLINTH, Box("upper", (-0.3, -0.3, 0.6), (0.3, 0.3, 1.0))))
    top = flat(stacked) & (np.abs(stacked.centres_m[:, 2] - 0.6) < 1e-9)
    assert longest(stacked.corners_m[top]).min() > 2 * FINEST_PATCH_M


def board(width_m: float, height_m: float) -> Rectangle:
    """A board 5 cm before the room's wall at y = 2 m."""
    return Rectangle("board", (0.0, 1.95, 1.2), width_m, height_m, facing_deg=180.0)


def test_a_board_close_to_a_wall_splits_the_wall():
    found = scene_patches(state(board(0.8, 0.6)))
    wall = flat(found) & (np.abs(found.centres_m[:, 1] - 2.0) < 1e-9)
    behind = wall & (np.abs(found.centres_m[:, 0]) < 0.3) & (np.abs(found.centres_m[:, 2] - 1.2) < 0.2)
    assert longest(found.corners_m[behind]).max() < 2 * FINEST_PATCH_M


def test_large_gaps_are_split_as_far_as_there_are_patches():
    few, many = scene_patches(state()), scene_patches(state(board(2.8, 2.2)))
    assert 100 < len(many.albedo) - len(few.albedo) < 100 + MOST_SPLIT_PATCHES


def test_the_ceiling_reflects_nothing_where_lamps_cover_it():
    panels = (Panel((-0.7, 0.6), (0.2, 0.65)), Panel((0.7, -1.0), (0.3, 0.6)))
    found = scene_patches(state(panels=panels))
    ceiling = np.abs(found.centres_m[:, 2] - 2.5) < 1e-9
    lost = (areas(found.corners_m[ceiling]) * (1 - found.albedo[ceiling] / 0.8)).sum()
    assert lost == pytest.approx(0.2 * 0.65 + 0.3 * 0.6, rel=1e-9)
