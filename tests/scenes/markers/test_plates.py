"""Markers placed by hand: on their object's surface, through no other, and off it by no more than sagitta and 2 mm."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from pss import Box, Rectangle, Sphere
from pss.surrogates import Mesh
from render.world.state import Marker
from scenes.markers.layout import PLATE_OFFSET_M, marker_at, upwards
from scenes.markers.plates import FLOAT_M, stand_off_problem, surface_under

SIDE_M = 0.08
BALL = Sphere("ball", (0.0, 0.0, 1.0), 0.3)
BOX = Box("box", (-0.2, -0.2, 0.0), (0.2, 0.2, 0.6))
BOARD = Rectangle("board", (0.0, 0.0, 1.0), 0.5, 0.4, facing_deg=30)
# A ball as 5120 faces: 0.08 % of its radius inside it, 0.25 mm.
BALL_MESH_M = 0.3e-3


def meshed(body: trimesh.Trimesh, name: str) -> Mesh:
    return Mesh(name, np.array(body.vertices), np.array(body.faces))


BALL_MESH = meshed(trimesh.creation.icosphere(subdivisions=4, radius=0.3).apply_translation((0, 0, 1)), "ball")
BOX_MESH = meshed(trimesh.creation.box(bounds=[BOX.lowest_m, BOX.highest_m]), "box")


def marker(on_m, normal) -> Marker:
    normal = np.array(normal, dtype=float) / np.linalg.norm(normal)
    return marker_at(1, "x", np.array(on_m, dtype=float), normal, upwards(normal), 10.0)


def on_ball(off_m: float, direction=(1.0, 0.3, 0.2)) -> Marker:
    """`off_m` from the ball, beside what every plate stands off."""
    direction = np.array(direction) / np.linalg.norm(direction)
    return marker(np.array(BALL.centre_m) + (BALL.radius_m + off_m) * direction, direction)


def problem(item: Marker, owner, *others) -> str | None:
    return stand_off_problem(item, SIDE_M, owner, others)


# ---- what lies under a plate -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [BALL, BALL_MESH], ids=["formula", "mesh"])
def test_a_ball_falls_away_by_its_sagitta(shape):
    """r − √(r² − d²), with d half the plate's diagonal at its corners and 0 in its middle."""
    direction = np.array([0.6, 0.0, 0.8])
    centre = np.array(BALL.centre_m) + BALL.radius_m * direction
    under = surface_under(shape, centre, direction, upwards(direction), SIDE_M)
    corner = BALL.radius_m - math.sqrt(BALL.radius_m**2 - 2 * (SIDE_M / 2) ** 2)
    heights = under.heights_m.reshape(9, 9)
    assert heights[4, 4] == pytest.approx(0, abs=BALL_MESH_M)
    assert heights[[0, 0, -1, -1], [0, -1, 0, -1]] == pytest.approx([-corner] * 4, abs=BALL_MESH_M)
    assert under.highest_m == pytest.approx(0, abs=BALL_MESH_M)


def test_a_peak_between_the_places_that_are_judged_counts():
    """A pyramid of 4 mm on a table, narrower than the places are apart: the height of its tip, exactly."""
    table = [(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    tip = [(0.004, 0.004, 0.0), (0.006, 0.004, 0), (0.006, 0.006, 0), (0.004, 0.006, 0), (0.005, 0.005, 0.004)]
    faces = [(0, 1, 2), (0, 2, 3), (4, 5, 8), (5, 6, 8), (6, 7, 8), (7, 4, 8)]
    spiked = Mesh("spiked", np.array(table + tip), np.array(faces))
    under = surface_under(spiked, np.zeros(3), np.array([0.0, 0, 1]), np.array([0.0, 1, 0]), SIDE_M)
    assert under.highest_m == pytest.approx(0.004)
    assert (under.heights_m == 0).all()


# ---- the rule --------------------------------------------------------------------------------------------------------

FREE = FLOAT_M - PLATE_OFFSET_M


@pytest.mark.parametrize("shape", [BALL, BALL_MESH], ids=["formula", "mesh"])
def test_a_plate_on_a_ball_may_float_by_two_millimetres(shape):
    assert problem(on_ball(0.0), shape) is None
    assert problem(on_ball(FREE - BALL_MESH_M), shape) is None
    assert "stands off by" in problem(on_ball(FREE + 2 * BALL_MESH_M), shape)
    assert "may by its sagitta of 5.4 mm and 2 mm" in problem(on_ball(0.01), shape)
    assert "mm through it" in problem(on_ball(-0.002), shape)
    assert "has no surface beneath" in problem(on_ball(0.1), shape)


@pytest.mark.parametrize("shape", [BOX, BOX_MESH], ids=["box", "mesh"])
@pytest.mark.parametrize(
    ("on_m", "normal", "message"),
    [
        ((0, 0.2, 0.3), (0, 1, 0), None),
        ((0.15, 0.2, 0.3), (0, 1, 0), None),
        ((0, 0.2 + FREE, 0.3), (0, 1, 0), None),
        ((0, 0.2 + FREE + 1e-4, 0.3), (0, 1, 0), "stands off by 2.1 mm"),
        ((0, 0.2, 0.3), (0, 1, 0.02), "through it"),  # tilted by 1.1°, 0.8 mm at its rim
        ((0, 0.2005, 0.3), (0, 1, 0.02), None),
        ((0, 0.204, 0.3), (0, 1, 0.1), "stands off by"),
        ((0.17, 0.2, 0.3), (0, 1, 0), "of it has no surface beneath"),  # over the edge by 10 mm
        ((0, 0.17, 0.3), (0, 1, 0), 'sticks through "box"'),  # buried
        ((0, 0.2, 0.3), (0, -1, 0), 'sticks through "box"'),  # face down
        ((0.2, 0.2, 0.3), (1, 1, 0), "of it has no surface beneath"),  # balanced on an edge
        ((0, 0.5, 0.3), (0, 1, 0), "all of it has no surface beneath"),
    ],
)
def test_a_plate_on_a_box(shape, on_m, normal, message):
    found = problem(marker(on_m, normal), shape)
    assert found is None if message is None else message in found


def test_a_plate_on_a_board():
    """Either side of it; not over its edge."""
    for side in (1, -1):
        assert problem(marker(BOARD.centre_m, side * BOARD.normal), BOARD) is None
    edge = np.array(BOARD.centre_m) + 0.23 * BOARD.right
    assert "of it has no surface beneath" in problem(marker(edge, BOARD.normal), BOARD)


CRATE = Box("crate", (0.25, -1, 0.9), (0.5, 1, 1.1))


@pytest.mark.parametrize("other", [BALL, BALL_MESH, CRATE], ids=["ball", "mesh", "box"])
def test_a_plate_through_another_object(other):
    wall = Rectangle("wall", (0.32, 0.0, 1.0), 2.0, 1.5, facing_deg=90)
    item = marker((0.32 - PLATE_OFFSET_M - 0.03, 0.0, 1.0), (1, 0, 0))
    near = Rectangle("wall", (0.29 - PLATE_OFFSET_M, 0.0, 1.0), 2.0, 1.5, facing_deg=90)
    assert problem(item, near) is None
    assert f'sticks through "{other.name}"' in problem(item, near, other)
    assert problem(marker((0.32, 0.6, 1.6), (1, 0, 0)), wall, other) is None


def test_a_plate_in_a_fold_sticks_through_what_rises_beside_it():
    """Two walls of one mesh: 3 cm from the corner a plate of 8 cm runs into the other."""
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (0, 1, 1)])
    fold = Mesh("fold", corners, np.array([(0, 1, 2), (0, 2, 3), (0, 3, 5), (0, 5, 4)]))
    assert problem(marker((0.05, 0.5, 0), (0, 0, 1)), fold) is None
    assert 'sticks through "fold"' in problem(marker((0.03, 0.5, 0), (0, 0, 1)), fold)
