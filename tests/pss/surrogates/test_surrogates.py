"""Shapes: what blocks a line of sight, by walking along it in small steps, and how evenly the points are spread."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pss import Box, GeometryError, PSSError, RangeError, Rectangle, ShapeError, Sphere
from pss.surrogates import Capsule, Cylinder, any_blocks

# Relative to sizes of about one metre; a few roundings.
SAME_TO_ROUNDING = 1e-12
# Segments are walked in this many steps; those that come within a step of grazing the shape are left out …
STEPS = 2000
# … but never more than this share, or the test would be about nothing.
LARGEST_SHARE_LEFT_OUT = 0.1
# Neighbours on a hexagonal net of the same density would all be at 1; a Fibonacci spiral has 0.81 to 0.93 by theory of
# its lattice, a random set 0.5 on average with a spread of half of that.
SPIRAL_NEIGHBOUR = (0.80, 0.94)
SPIRAL_SPREAD = 0.03
# χ² a degree of freedom over cells of equal area: 1 for independent points; the spiral is far more even than that.
SPIRAL_UNEVENNESS = 0.1

SPHERE = Sphere("ball", (0.2, -0.3, 0.5), 0.6)
BOX = Box("box", (-0.5, -0.2, 0.1), (0.4, 0.7, 0.6))
CYLINDER = Cylinder("tin", (0.1, 0.2, -0.1), 0.5, 1.1)
CAPSULE = Capsule("limb", (-0.4, 0.3, -0.5), (0.5, -0.1, 0.6), 0.4)
BOARD = Rectangle("board", (0.1, 0.2, 0.4), 1.4, 0.9, facing_deg=35, elevation_deg=20)


def random_segments(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments of all lengths, both ends within 1.5 m: outside, inside and through the shapes."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (count, 3)), rng.uniform(-1.5, 1.5, (count, 3))


def depth_inside(shape: Sphere | Box | Cylinder | Capsule, points: np.ndarray) -> np.ndarray:
    """Metres inside the shape, negative outside (a lower bound there); shape (...)."""
    if isinstance(shape, Cylinder):
        x, y, z = np.moveaxis(points - np.array(shape.centre_m), -1, 0)
        return np.minimum(shape.radius_m - np.hypot(x, y), shape.height_m / 2 - np.abs(z))
    if isinstance(shape, Capsule):
        start, end = np.array(shape.start_m), np.array(shape.end_m)
        share = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
        return shape.radius_m - np.linalg.norm(points - start - share[..., None] * (end - start), axis=-1)
    if isinstance(shape, Sphere):
        return shape.radius_m - np.linalg.norm(points - np.array(shape.centre_m), axis=-1)
    return np.minimum(points - np.array(shape.lowest_m), np.array(shape.highest_m) - points).min(axis=-1)


@pytest.mark.parametrize("shape", [SPHERE, BOX, CYLINDER, CAPSULE], ids=lambda shape: shape.name)
def test_solids_block_what_walks_through_them(shape):
    starts, ends = random_segments(1500, 1)
    steps = (np.arange(STEPS) + 0.5) / STEPS
    walk = starts[:, None] + steps[:, None] * (ends - starts)[:, None]
    deepest = depth_inside(shape, walk).max(axis=1)
    clear = np.abs(deepest) > np.linalg.norm(ends - starts, axis=1) / STEPS
    assert clear.mean() > 1 - LARGEST_SHARE_LEFT_OUT
    blocked = shape.blocks(starts, ends)
    np.testing.assert_array_equal(blocked[clear], deepest[clear] > 0)
    assert 0.1 < blocked.mean() < 0.9


def test_a_board_blocks_what_solves_for_a_place_on_it():
    """start + t·way = centre + a·right + b·up, solved as three equations: t in (0, 1), |a| and |b| on the board."""
    starts, ends = random_segments(4000, 2)
    systems = np.stack(
        [ends - starts, np.tile(-BOARD.right, (4000, 1)), np.tile(-BOARD.up, (4000, 1))],
        axis=-1,
    )
    t, a, b = np.linalg.solve(systems, (np.array(BOARD.centre_m) - starts)[..., None])[..., 0].T
    expected = (t > 0) & (t < 1) & (np.abs(a) <= BOARD.width_m / 2) & (np.abs(b) <= BOARD.height_m / 2)
    blocked = BOARD.blocks(starts, ends)
    np.testing.assert_array_equal(blocked, expected)
    np.testing.assert_array_equal(BOARD.blocks(ends, starts), blocked)
    assert 0.05 < blocked.mean() < 0.95


@pytest.mark.parametrize(
    ("start", "end", "blocked"),
    [
        ((0, 0, 3), (0, 0, -3), True),  # through
        ((0, 0, 3), (0, 0, 1.001), False),  # ends before
        ((0, 0, 3), (0, 0, 0.5), True),  # ends inside
        ((0, 0, 0.2), (0, 0, -0.2), True),  # all inside
        ((0, 0, 3), (0, 0, 4), False),  # leads away: what lies behind the start is no obstacle
        ((3, 0, 1.001), (-3, 0, 1.001), False),  # passes above, parallel to a face of the box
        ((3, 0, 0.999), (-3, 0, 0.999), True),
        ((0, 0, 3), (0, 0, 1), False),  # ends on the surface: open segments
    ],
)
@pytest.mark.parametrize(
    "shape",
    [
        Sphere("ball", (0, 0, 0), 1.0),
        Box("box", (-1, -1, -1), (1, 1, 1)),
        Cylinder("tin", (0, 0, 0), 1.0, 2.0),
        Capsule("upright", (0, 0, -0.5), (0, 0, 0.5), 0.5),
    ],
    ids=lambda shape: shape.name,
)
def test_segments_are_open_and_end_where_they_end(shape, start, end, blocked):
    start, end = np.array(start, dtype=float), np.array(end, dtype=float)
    assert shape.blocks(start, end) == blocked
    assert shape.blocks(end, start) == blocked


@pytest.mark.parametrize(
    ("start", "end", "blocked"),
    [
        ((0.9, 0, 3), (0.9, 0, -3), True),  # along the axis, inside the rim
        ((1.1, 0, 3), (1.1, 0, -3), False),  # … and outside it
        ((0.8, 0.7, 3), (0.8, 0.7, -3), False),  # in the bounding box, outside the round
        ((0.9, 0, 3), (0.9, 0, 1.001), False),
        ((0, 0.1, 0), (0, 0.1, 5), True),  # starts inside, out by the cap
        ((0, 0.1, 0), (5, 0.1, 0.5), True),  # … and by the side
        ((-3, 0.99, 0), (3, 0.99, 0), True),  # level, through the side
        ((-3, 1.01, 0), (3, 1.01, 0), False),
        ((-3, 0, 0.9), (3, 0, 1.3), False),  # over the nearer edge of the cap
        ((-3, 0, 1.3), (0.5, 0, 0.95), True),  # down through the cap
    ],
)
def test_a_cylinder_by_hand(start, end, blocked):
    start, end, shape = np.array(start, dtype=float), np.array(end, dtype=float), Cylinder("tin", (0, 0, 0), 1.0, 2.0)
    assert shape.blocks(start, end) == blocked
    assert shape.blocks(end, start) == blocked


def test_a_long_capsule_is_as_wide_up_to_its_ends():
    capsule = Capsule("rod", (-10, 0, 0), (10, 0, 0), 0.5)
    x, blocked = np.array([0, 9.6, 9.99, 10.15, 10.25, -9.6, -10.25]), [True, True, True, True, False, True, False]
    starts = np.column_stack([x, np.full(7, 0.45), np.full(7, -3.0)])
    np.testing.assert_array_equal(capsule.blocks(starts, starts * [1, 1, -1]), blocked)


COORDINATE = st.floats(-2, 2, allow_subnormal=True)
PLACE = st.tuples(COORDINATE, COORDINATE, COORDINATE).map(np.array)


@given(start=PLACE, way=PLACE, exponent=st.integers(-320, 0), axes=st.lists(st.booleans(), min_size=3, max_size=3))
def test_the_shortest_and_the_axis_parallel_segments_are_where_they_start(start, way, exponent, axes):
    """A segment too short to leave is inside or outside as its start is; components may be zero, or nearly."""
    way = np.where(axes, way, 0.0) * 10.0**exponent
    for shape in (SPHERE, BOX, CYLINDER, CAPSULE):
        depth = depth_inside(shape, start)
        if abs(depth) > SAME_TO_ROUNDING + 2 * np.abs(way).sum():
            assert shape.blocks(start, start + way) == (depth > 0), shape.name


def test_a_capsule_is_the_same_in_any_direction():
    """Turned together, capsule and segments: the answer stays, for axis-parallel directions too."""
    starts, ends = random_segments(2000, 4)
    upright = Capsule("limb", (0.0, 0.0, -0.5), (0.0, 0.0, 0.5), 0.4)
    expected = upright.blocks(starts, ends)
    assert 0.1 < expected.mean() < 0.9
    for order in ((1, 2, 0), (2, 0, 1)):
        turned = Capsule("limb", tuple(np.take(upright.start_m, order)), tuple(np.take(upright.end_m, order)), 0.4)
        np.testing.assert_array_equal(turned.blocks(starts[:, order], ends[:, order]), expected)


def test_a_board_by_hand():
    board = Rectangle("board", (0, 0, 1), 2.0, 1.0)
    start = np.array([0.0, 2.0, 1.0])
    ends = np.array([[0, -2, 1], [1.9, -2, 1], [2.1, -2, 1], [0, -2, 1.9], [0, -2, 2.1], [0, 0, 1], [0, 1, 1.0]])
    np.testing.assert_array_equal(board.blocks(start, ends), [True, True, False, True, False, False, False])
    within = np.array([[-5.0, 0, 1]]), np.array([[5.0, 0, 1]])
    assert not board.blocks(*within).any()  # edge on, a thin board hides nothing


def test_any_of_several_shapes_blocks():
    starts, ends = random_segments(500, 3)
    shapes = (SPHERE, BOX, BOARD, CYLINDER, CAPSULE)
    one_by_one = np.array([shape.blocks(starts, ends) for shape in shapes])
    np.testing.assert_array_equal(any_blocks(shapes, starts, ends), one_by_one.any(axis=0))
    assert not any_blocks((), starts, ends).any()
    assert any_blocks(shapes, np.zeros(3), ends.reshape(5, 100, 3)).shape == (5, 100)


# ---- points of interest ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [36, 200, 1000, 4000])
def test_the_spiral_is_even_by_nearest_neighbours(count):
    points, normals = SPHERE.spiral(count)
    from_centre = points - np.array(SPHERE.centre_m)
    np.testing.assert_allclose(from_centre, SPHERE.radius_m * normals, atol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=SAME_TO_ROUNDING)
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    hexagonal = SPHERE.radius_m * math.sqrt(8 * math.pi / math.sqrt(3) / count)
    assert SPIRAL_NEIGHBOUR[0] < nearest.min() / hexagonal
    assert nearest.max() / hexagonal < SPIRAL_NEIGHBOUR[1]
    assert nearest.std() / nearest.mean() < SPIRAL_SPREAD


def test_the_spiral_is_even_by_area():
    """Cells between equal heights and equal azimuths have equal areas (Archimedes); so have those about any axis."""
    normals = SPHERE.spiral(4000)[1]
    for axis in range(3):
        height, x, y = normals[:, axis], normals[:, axis - 2], normals[:, axis - 1]
        counts, _, _ = np.histogram2d(height, np.arctan2(y, x), bins=6, range=((-1, 1), (-math.pi, math.pi)))
        expected = counts.sum() / counts.size
        assert counts.sum() == 4000
        assert ((counts - expected) ** 2 / expected).sum() / (counts.size - 1) < SPIRAL_UNEVENNESS


def test_a_spiral_between_two_heights_starts_at_the_top_and_stays_there():
    _, normals = SPHERE.spiral(500, highest_z=0.9, lowest_z=-0.2)
    assert normals[0, 2] == pytest.approx(0.9 - 1.1 / 1000)
    assert normals[-1, 2] == pytest.approx(-0.2 + 1.1 / 1000)
    np.testing.assert_allclose(np.diff(normals[:, 2]), -1.1 / 500, rtol=1e-9)


def test_the_grid_is_even_and_goes_row_by_row_from_the_top_left():
    """Someone who looks at the front reads the points like a page."""
    points, normals = BOARD.grid(7, 3, margin_m=0.1)
    np.testing.assert_allclose(normals, np.tile(BOARD.normal, (21, 1)))
    from_centre = points - np.array(BOARD.centre_m)
    across, up, off = from_centre @ BOARD.right, from_centre @ BOARD.up, from_centre @ BOARD.normal
    np.testing.assert_allclose(off, 0, atol=SAME_TO_ROUNDING)
    cell_w, cell_h = (1.4 - 0.2) / 7, (0.9 - 0.2) / 3
    np.testing.assert_allclose(
        across.reshape(3, 7), np.tile(cell_w * (np.arange(7) - 3), (3, 1)), atol=SAME_TO_ROUNDING
    )
    np.testing.assert_allclose(
        up.reshape(3, 7), np.tile(cell_h * (1 - np.arange(3))[:, None], 7), atol=SAME_TO_ROUNDING
    )
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    np.testing.assert_allclose(nearest, cell_w, rtol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(BOARD.grid(1, 1)[0], [BOARD.centre_m])


@pytest.mark.parametrize("facing_deg", [0, 35, 90, 180, 270])
@pytest.mark.parametrize("elevation_deg", [-40, 0, 60])
def test_a_board_has_a_right_handed_frame_with_a_level_right(facing_deg, elevation_deg):
    board = Rectangle("board", (0, 0, 1), 1, 1, facing_deg, elevation_deg)
    frame = np.array([board.right, board.up, board.normal])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=SAME_TO_ROUNDING)
    assert np.linalg.det(frame) == pytest.approx(1)
    assert board.right[2] == 0
    assert board.up[2] > 0
    assert math.degrees(math.asin(board.normal[2])) == pytest.approx(elevation_deg)


# ---- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Sphere("s", (0, 0, 0), 0.0), RangeError, r"Sphere\.radius_m = 0\.0; allowed: above 0"),
        (lambda: Sphere("s", (0, 0, 0), math.nan), RangeError, "nan; allowed: above 0"),
        (lambda: Sphere("s", (0, math.inf, 0), 1.0), RangeError, "inf.*allowed: finite"),
        (lambda: Sphere("s", (0, 0), 1.0), ShapeError, r"Sphere\.centre_m has 2 numbers; allowed is 3"),
        (lambda: Rectangle("r", (0, 0, 0), 1.0, -1.0), RangeError, r"Rectangle\.height_m = -1\.0; allowed: above 0"),
        (lambda: Rectangle("r", (0, 0, 0, 0), 1.0, 1.0), ShapeError, r"Rectangle\.centre_m has 4 numbers"),
        (lambda: Box("b", (0, 0, 0), (1, 1, 0)), RangeError, r"Box .*allowed: each of the first below the second"),
        (lambda: Box("b", (0, 0), (1, 1)), ShapeError, r"Box\.lowest_m has 2 numbers; allowed is 3"),
        (lambda: Cylinder("c", (0, 0, 0), 0.0, 1.0), RangeError, r"Cylinder\.radius_m = 0\.0; allowed: above 0"),
        (lambda: Cylinder("c", (0, 0, 0), 1.0, math.inf), RangeError, r"Cylinder\.height_m = inf"),
        (lambda: Capsule("c", (0, 0), (0, 0, 1), 1.0), ShapeError, r"Capsule\.start_m has 2 numbers"),
        (lambda: Capsule("c", (0, 0, 0), (0, 0, 1), -1.0), RangeError, r"Capsule\.radius_m = -1\.0"),
        (lambda: Capsule("c", (0, 0, 1), (0, 0, 1), 1.0), GeometryError, r"start_m = end_m = .*allowed: two places"),
        (lambda: SPHERE.spiral(0), RangeError, "count = 0; allowed: 1 or more"),
        (lambda: SPHERE.spiral(5, highest_z=1.2), RangeError, "highest_z = 1.2; allowed: -1 to 1"),
        (lambda: SPHERE.spiral(5, 0.1, 0.2), RangeError, "lowest_z = 0.2.*the lowest below"),
        (lambda: BOARD.grid(0, 4), RangeError, "columns = 0; allowed: 1 or more"),
        (lambda: BOARD.grid(4, 4, margin_m=0.45), RangeError, "margin_m = 0.45; allowed: 0 to less than half of"),
        (lambda: BOARD.grid(4, 4, margin_m=-0.1), RangeError, "margin_m = -0.1; allowed"),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, error, message):
    with pytest.raises(error, match=message) as caught:
        make()
    assert isinstance(caught.value, PSSError)
    assert isinstance(caught.value, ValueError)
