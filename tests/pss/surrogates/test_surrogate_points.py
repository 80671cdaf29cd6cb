"""Points of interest: on the surface, with outward normals, even by area; hulls, clouds and samples of meshes."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pss import Box, GeometryError, PSSError, RangeError, Rectangle, ShapeError, Sphere
from pss.surrogates import (
    Capsule,
    Cylinder,
    Mesh,
    Surrogate,
    box_corners,
    convex_hull,
    dense_cloud,
    grid_on_rectangle,
    on_box,
    on_capsule,
    on_cylinder,
    on_mesh,
    on_rectangle,
    on_sphere,
    single_point,
)

# Relative to sizes of about one metre; a few roundings.
SAME_TO_ROUNDING = 1e-12
# A point on a surface has free space in front of it from here on, and the body behind it: far above rounding, and far
# below the size of anything.
SKIN_M = 1e-9
# χ² a degree of freedom over cells of equal area: 1 for independent points, far less for an even spread. The
# patterns' own unevenness comes from the cells' borders alone.
EVEN_UNEVENNESS = 0.25
# For independent ones of 30 or more cells: 1, with a standard deviation below 0.26; four of these.
INDEPENDENT_UNEVENNESS = (0.4, 2.05)
# Share of the largest distance that all points can keep from each other; independent ones have some pair below 0.1.
# Sample elimination leaves 0.7 of it and more on the plane (Yuksel 2015, section 4); corners cost a little.
POISSON_DISTANCE = 0.62
# A golden lattice on any rectangle keeps points apart by at least this share of the hexagonal net's distance
# (its worst aspect, 0.64 by the theory of badly approximable numbers, and the edges take nothing away).
GOLDEN_DISTANCE = 0.6
# Normals guessed from twelve neighbours on a ball of 1000 points, which span caps of some 6 degrees.
GUESSED_NORMAL_DEG = 3.0

SPHERE = Sphere("ball", (0.2, -0.3, 0.5), 0.6)
BOX = Box("box", (-0.5, -0.2, 0.1), (0.4, 0.7, 0.6))
CYLINDER = Cylinder("tin", (0.1, 0.2, -0.1), 0.5, 1.1)
CAPSULE = Capsule("limb", (-0.4, 0.3, -0.5), (0.5, -0.1, 0.6), 0.4)
BOARD = Rectangle("board", (0.1, 0.2, 0.4), 1.4, 0.9, facing_deg=35, elevation_deg=20)
SOLIDS = [(on_sphere, SPHERE), (on_box, BOX), (on_cylinder, CYLINDER), (on_capsule, CAPSULE)]


def mesh_of(body: trimesh.Trimesh) -> Mesh:
    return Mesh("mesh", np.array(body.vertices), np.array(body.faces))


def unevenness(counts: np.ndarray, areas: np.ndarray | float) -> float:
    """χ² a degree of freedom of the points in cells, for their areas."""
    expected = counts.sum() * np.broadcast_to(areas, counts.shape) / np.broadcast_to(areas, counts.shape).sum()
    return float(((counts - expected) ** 2 / expected).sum() / (counts.size - 1))


# ---- on shapes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("spread", "shape"), SOLIDS, ids=lambda value: getattr(value, "name", ""))
@pytest.mark.parametrize("count", [1, 7, 500])
def test_points_lie_on_the_surface_and_normals_lead_out(spread, shape, count):
    """What the shape blocks decides: nothing from the point outwards, and all of what goes in."""
    points = spread(shape, count)
    assert len(points) == count
    assert set(points.objects) == {shape.name}
    skin, near = SKIN_M * points.normals, 1e-3 * points.normals
    assert not shape.blocks(points.points_m + skin, points.points_m + near).any()
    assert shape.blocks(points.points_m - skin, points.points_m - skin / 2).all()
    # At right angles to the surface: two steps aside leave it by as much on both sides, to second order.
    aside = np.cross(points.normals, np.roll(points.normals, 1, axis=1) + 0.3)
    aside *= 1e-4 / np.linalg.norm(aside, axis=1, keepdims=True)
    lift = 1e-7 * points.normals  # above the curvature of 1 / 0.4 m
    for sign in (1, -1):
        free = ~shape.blocks(points.points_m + sign * aside + lift, points.points_m + sign * aside + near)
        assert free.all()


def test_a_cylinder_is_even_by_area():
    points = on_cylinder(CYLINDER, 3000)
    x, y, z = ((points.points_m - np.array(CYLINDER.centre_m)) / [0.5, 0.5, 0.55]).T
    turn, up = np.arctan2(y, x), points.normals[:, 2]
    side = np.histogram2d(z[up == 0], turn[up == 0], bins=(6, 8), range=((-1, 1), (-math.pi, math.pi)))[0]
    caps = [
        np.histogram2d((x**2 + y**2)[up == s], turn[up == s], bins=(3, 6), range=((0, 1), (-math.pi, math.pi)))[0]
        for s in (1, -1)
    ]
    areas = [2 * math.pi * 0.5 * 1.1 / 48] * 48 + [math.pi * 0.25 / 18] * 36
    counts = np.concatenate([side.ravel(), *(cap.ravel() for cap in caps)])
    assert counts.sum() == 3000
    assert unevenness(counts, np.array(areas)) < EVEN_UNEVENNESS
    bare = on_cylinder(CYLINDER, 3000, caps=False)
    assert (bare.normals[:, 2] == 0).all()
    z = (bare.points_m[:, 2] - CYLINDER.centre_m[2]) / 0.55
    counts = np.histogram2d(z, np.arctan2(*bare.normals[:, 1::-1].T), bins=(6, 8), range=((-1, 1), (-4, 4)))[0]
    assert unevenness(counts.sum(axis=1), 1.0) < EVEN_UNEVENNESS
    assert unevenness(counts[:, 1:-1].sum(axis=0), 1.0) < EVEN_UNEVENNESS


def test_a_capsule_is_even_by_area():
    points = on_capsule(CAPSULE, 3000)
    start, end = np.array(CAPSULE.start_m), np.array(CAPSULE.end_m)
    along = (points.points_m - start) @ (end - start) / np.linalg.norm(end - start)
    length = np.linalg.norm(end - start)
    rounded, side = 2 * math.pi * 0.4**2, 2 * math.pi * 0.4 * length
    counts = np.array([(along < 0).sum(), ((along >= 0) & (along <= length)).sum(), (along > length).sum()])
    np.testing.assert_allclose(counts, 3000 * np.array([rounded, side, rounded]) / (2 * rounded + side), atol=1)
    # About any line across, as many on one side as on the other; by eighths, seen along the axis.
    across = np.linalg.svd((end - start)[None])[2][1:]
    turn = np.arctan2(*(points.normals @ across.T).T)
    cells = np.histogram2d(along, turn, bins=(6, 8), range=((0, length), (-math.pi, math.pi)))[0]
    assert unevenness(cells, 1.0) < EVEN_UNEVENNESS
    for pole in (along < 0, along > length):
        beyond = np.where(along < 0, -along, along - length)[pole]
        cells = np.histogram2d(beyond, turn[pole], bins=(3, 6), range=((0, 0.4), (-math.pi, math.pi)))[0]
        assert unevenness(cells, 1.0) < EVEN_UNEVENNESS


def test_a_box_is_even_by_area():
    points = on_box(BOX, 3000)
    size = np.array(BOX.highest_m) - BOX.lowest_m
    share = (points.points_m - np.array(BOX.lowest_m)) / size
    counts, areas = [], []
    for axis in range(3):
        for sign in (-1, 1):
            on_face = points.normals[:, axis] == sign
            np.testing.assert_allclose(share[on_face, axis], (sign + 1) / 2, atol=SAME_TO_ROUNDING)
            u, v = np.delete(share[on_face], axis, axis=1).T
            counts.append(np.histogram2d(u, v, bins=4, range=((0, 1), (0, 1)))[0])
            areas.append(np.full((4, 4), np.delete(size, axis).prod() / 16))
    assert np.sum(counts) == 3000
    assert unevenness(np.array(counts), np.array(areas)) < EVEN_UNEVENNESS
    for count in range(1, 20):
        assert len(on_box(BOX, count)) == count


@pytest.mark.parametrize("height_m", [0.02, 0.3, 1.0, 7.0])
@pytest.mark.parametrize("count", [64, 333, 1000])
def test_a_rectangle_of_any_aspect_is_even(height_m, count):
    board = Rectangle("board", (0.1, 0.2, 0.4), 1.5, height_m, facing_deg=35, elevation_deg=20)
    points = on_rectangle(board, count)
    from_centre = points.points_m - np.array(board.centre_m)
    np.testing.assert_allclose(from_centre @ board.normal, 0, atol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(points.normals, np.tile(board.normal, (count, 1)), atol=SAME_TO_ROUNDING)
    u, v = from_centre @ board.right / 1.5, from_centre @ board.up / height_m
    for places in (u, v):
        np.testing.assert_array_less(np.abs(places), 0.5)
        assert unevenness(np.histogram(places, bins=8, range=(-0.5, 0.5))[0], 1.0) < EVEN_UNEVENNESS
    assert unevenness(np.histogram2d(u, v, bins=4, range=((-0.5, 0.5),) * 2)[0], 1.0) < EVEN_UNEVENNESS
    across_m = math.sqrt(1.5 * height_m / count)
    if across_m < min(1.5, height_m):
        nearest = cKDTree(points.points_m).query(points.points_m, k=2)[0][:, 1]
        assert nearest.min() > GOLDEN_DISTANCE * across_m * math.sqrt(2 / math.sqrt(3))


def test_grid_and_spiral_are_those_of_the_shapes():
    for surrogate, (points, normals) in (
        (grid_on_rectangle(BOARD, 5, 4, 0.1), BOARD.grid(5, 4, 0.1)),
        (on_sphere(SPHERE, 70), SPHERE.spiral(70)),
    ):
        np.testing.assert_array_equal(surrogate.points_m, points)
        np.testing.assert_allclose(surrogate.normals, normals, atol=SAME_TO_ROUNDING)


def test_corners_of_a_box():
    corners = box_corners(BOX)
    assert len({tuple(p) for p in corners.points_m}) == 8
    for point, normal in zip(corners.points_m, corners.normals, strict=True):
        assert all(x in ends for x, ends in zip(point, zip(BOX.lowest_m, BOX.highest_m, strict=True), strict=True))
        outwards = np.sign(point - (np.array(BOX.lowest_m) + BOX.highest_m) / 2)
        np.testing.assert_allclose(normal, outwards / math.sqrt(3), atol=SAME_TO_ROUNDING)


# ---- on meshes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "count"), [("area-uniform", 6000), ("poisson-disc", 600)])
def test_points_on_a_mesh_are_even_by_area_whatever_its_triangles(method, count):
    """A box whose faces are cut into triangles of very different sizes; cells of its faces."""
    body = trimesh.creation.box(extents=(1.0, 2.0, 0.5))
    body = body.subdivide(face_index=[0, 1, 2]).subdivide(face_index=[4, 5, 6, 7])
    points = on_mesh(mesh_of(body), count, method, rng=np.random.default_rng(1))
    assert len(points) == count
    counts, areas = [], []
    for axis, (u_size, v_size) in enumerate(((2.0, 0.5), (1.0, 0.5), (1.0, 2.0))):
        for sign in (-1, 1):
            on_face = points.normals[:, axis] > 0.5 if sign > 0 else points.normals[:, axis] < -0.5
            half = (1.0, 2.0, 0.5)[axis] / 2
            np.testing.assert_allclose(points.points_m[on_face, axis], sign * half, atol=SAME_TO_ROUNDING)
            u, v = (np.delete(points.points_m[on_face], axis, axis=1) / [u_size, v_size]).T
            counts.append(np.histogram2d(u, v, bins=3, range=((-0.5, 0.5),) * 2)[0])
            areas.append(np.full((3, 3), u_size * v_size / 9))
    assert np.sum(counts) == count
    value = unevenness(np.array(counts), np.array(areas))
    low, high = INDEPENDENT_UNEVENNESS if method == "area-uniform" else (0.0, EVEN_UNEVENNESS)
    assert low < value < high


def test_poisson_disc_points_keep_their_distance():
    ball = mesh_of(trimesh.creation.icosphere(subdivisions=3))
    largest = math.sqrt(2 * ball.face_areas_m2.sum() / (math.sqrt(3) * 400))
    independent, apart = (
        cKDTree(on_mesh(ball, 400, method, rng=np.random.default_rng(2)).points_m)
        for method in ("area-uniform", "poisson-disc")
    )
    nearest = [tree.query(tree.data, k=2)[0][:, 1].min() / largest for tree in (independent, apart)]
    assert nearest[0] < 0.2
    assert nearest[1] > POISSON_DISTANCE


def test_the_two_sides_of_a_thin_sheet_are_no_neighbours():
    """On a sheet much thinner than the points are apart, either side alone is as even as a sheet of its own."""
    sheet = mesh_of(trimesh.creation.box(extents=(1.0, 1.0, 1e-4)))
    points = on_mesh(sheet, 400, "poisson-disc", rng=np.random.default_rng(3))
    for sign in (-1, 1):
        side = points.points_m[points.normals[:, 2] * sign > 0.5]
        assert abs(len(side) - 200) < 10
        nearest = cKDTree(side).query(side, k=2)[0][:, 1]
        assert nearest.min() > POISSON_DISTANCE * math.sqrt(2 / (math.sqrt(3) * 200))


def test_samples_depend_on_the_generator_and_on_nothing_else():
    ball = mesh_of(trimesh.creation.icosphere(subdivisions=1))
    for method in ("area-uniform", "poisson-disc"):
        one, same, other = (on_mesh(ball, 50, method, rng=np.random.default_rng(seed)) for seed in (1, 1, 2))
        np.testing.assert_array_equal(one.points_m, same.points_m)
        assert (one.points_m != other.points_m).any()


# ---- clouds and hulls ------------------------------------------------------------------------------------------------


def test_a_clouds_normals_are_guessed_from_its_neighbours():
    points, normals = SPHERE.spiral(1000)
    guessed = dense_cloud(points, name="scan")
    angle = np.degrees(np.arccos(np.clip((guessed.normals * normals).sum(axis=1), -1, 1)))
    assert angle.max() < GUESSED_NORMAL_DEG
    given_normals = dense_cloud(points, 7 * normals)
    np.testing.assert_allclose(given_normals.normals, normals, atol=SAME_TO_ROUNDING)
    assert set(guessed.objects) == {"scan"}
    assert set(given_normals.objects) == {"cloud"}


def test_a_hull_has_the_corners_and_their_normals_whatever_lies_inside():
    """A box's corners, and points within: the three faces' areas weigh their normals."""
    corners = box_corners(BOX).points_m
    inner = np.random.default_rng(1).uniform(BOX.lowest_m, BOX.highest_m, (50, 3))
    hull = convex_hull(np.concatenate([inner, corners]), name="crate")
    assert len(hull) == 8
    size = np.array(BOX.highest_m) - BOX.lowest_m
    assert {tuple(p) for p in hull.points_m} == {tuple(p) for p in corners}
    signs = np.sign(hull.points_m - (np.array(BOX.lowest_m) + BOX.highest_m) / 2)
    # Each face is two triangles: a corner has one or both, so its weight is the face's area, half or whole.
    weights = hull.normals / signs * size
    ratio = weights / weights.max(axis=1, keepdims=True)
    assert (hull.normals * signs > 0).all()
    assert np.isin(np.round(ratio, 9), (0.5, 1.0)).all()


def test_a_hulls_normals_by_hand():
    """The tetrahedron of the axes: three faces of area 1/2 and a slanted one with (1, 1, 1)/2 as its area vector."""
    hull = convex_hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    expected = {(0, 0, 0): (-1, -1, -1), (1, 0, 0): (1, 0, 0), (0, 1, 0): (0, 1, 0), (0, 0, 1): (0, 0, 1)}
    for point, normal in zip(hull.points_m, hull.normals, strict=True):
        direction = np.array(expected[tuple(point)], dtype=float)
        np.testing.assert_allclose(normal, direction / np.linalg.norm(direction), atol=SAME_TO_ROUNDING)


# ---- the points themselves -------------------------------------------------------------------------------------------


def test_surrogates_are_joined_in_order():
    one, two = on_sphere(SPHERE, 5), on_rectangle(BOARD, 3)
    both = one + two
    assert len(both) == 8
    assert both.objects.tolist() == ["ball"] * 5 + ["board"] * 3
    np.testing.assert_array_equal(both.points_m, np.concatenate([one.points_m, two.points_m]))
    np.testing.assert_array_equal(both.take(np.array([6, 0])).points_m, [two.points_m[1], one.points_m[0]])
    np.testing.assert_array_equal(both.take(both.objects == "board").normals, two.normals)
    three = Surrogate.join([both, single_point((1, 2, 3), (0, 0, -4))])
    assert three.objects[-1] == "point"
    np.testing.assert_array_equal(three.normals[-1], [0, 0, -1])


@given(
    turn_deg=st.floats(-720, 720),
    translation=st.tuples(*[st.floats(-5, 5)] * 3),
)
def test_moved_points_stay_on_the_moved_shape(turn_deg, translation):
    """The same board, facing where it was turned to."""
    at_origin = Rectangle("board", (0, 0, 0), 1.4, 0.9, facing_deg=35, elevation_deg=20)
    there = Rectangle("board", translation, 1.4, 0.9, facing_deg=35 + turn_deg, elevation_deg=20)
    moved, expected = on_rectangle(at_origin, 9).moved(translation, turn_deg), on_rectangle(there, 9)
    np.testing.assert_allclose(moved.points_m, expected.points_m, atol=10 * SAME_TO_ROUNDING)
    np.testing.assert_allclose(moved.normals, expected.normals, atol=10 * SAME_TO_ROUNDING)
    assert moved.objects.tolist() == expected.objects.tolist()


def test_a_surrogate_is_hashable_and_its_arrays_cannot_be_changed():
    points = np.zeros((2, 3))
    surrogate = Surrogate(points, np.eye(3)[:2], np.array("a"))
    points[:] = 1
    assert surrogate.points_m.sum() == 0
    assert {surrogate: 1}[surrogate] == 1
    for array in (surrogate.points_m, surrogate.normals, surrogate.objects):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = array[1]


ONE = np.array([[0.0, 0.0, 1.0]])
TETRAHEDRON = Mesh("m", np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Surrogate(ONE, np.eye(3), np.array("a")), ShapeError, r"points_m \(1, 3\) and normals \(3, 3\)"),
        (lambda: Surrogate(ONE[:0], ONE[:0], np.array("a")), ShapeError, "N > 0"),
        (lambda: Surrogate(ONE * np.nan, ONE, np.array("a")), RangeError, "points_m holds nan"),
        (lambda: Surrogate(ONE, ONE * 1.01, np.array("a")), RangeError, "a normal has length 1.01"),
        (lambda: Surrogate(ONE, ONE, np.array(["a", "b"])), ShapeError, r"objects has shape \(2,\); allowed is \(1,\)"),
        (lambda: Surrogate.join([]), ShapeError, "allowed: one or more"),
        (lambda: Surrogate(ONE, ONE, np.array("a")).moved((0, 0)), ShapeError, "translation_m has 2 numbers"),
        (lambda: Surrogate(ONE, ONE, np.array("a")).moved(turn_deg=math.nan), RangeError, "turn_deg = nan"),
        (lambda: single_point((0, 0, 0), (0, 0, 0)), RangeError, "length 0"),
        (lambda: single_point(ONE, ONE), ShapeError, r"allowed are two of \(3,\)"),
        (lambda: on_rectangle(BOARD, 0), RangeError, "count = 0"),
        (lambda: on_box(BOX, 0), RangeError, "count = 0"),
        (lambda: on_cylinder(CYLINDER, 0), RangeError, "count = 0"),
        (lambda: on_capsule(CAPSULE, -1), RangeError, "count = -1"),
        (lambda: on_mesh(TETRAHEDRON, 0, rng=np.random.default_rng(1)), RangeError, "count = 0"),
        (lambda: on_mesh(TETRAHEDRON, 5, "even", rng=np.random.default_rng(1)), RangeError, "allowed: area-uniform, p"),
        (lambda: dense_cloud(np.eye(3), neighbours=2), RangeError, "neighbours = 2; allowed: 3 or more"),
        (lambda: dense_cloud(np.eye(3)[:2]), GeometryError, "2 points have no surface"),
        (lambda: dense_cloud(np.outer(np.arange(9), [1, 2, 3])), GeometryError, "lie on a line"),
        (lambda: dense_cloud(np.zeros((9, 3))), GeometryError, "lie on a line"),
        (lambda: dense_cloud(np.zeros(3)), ShapeError, r"points_m has shape \(3,\); allowed is \(N, 3\)"),
        (lambda: convex_hull(np.eye(3)), GeometryError, "3 points span no volume"),
        (lambda: convex_hull(BOARD.grid(4, 4)[0]), GeometryError, "not all in one plane"),
        (lambda: convex_hull(np.zeros(3)), ShapeError, r"allowed is \(P, 3\)"),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, error, message):
    with pytest.raises(error, match=message) as caught:
        make()
    assert isinstance(caught.value, PSSError)
