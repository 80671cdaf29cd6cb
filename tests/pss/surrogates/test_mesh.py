"""Meshes as obstacles: against a ball and a box by formula, against every triangle by itself, and without leaks."""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import pss.surrogates._triangle_tree as triangle_tree
from pss import Box, GeometryError, PSSError, RangeError, Rectangle, ShapeError, Sphere
from pss.surrogates import Mesh, any_blocks
from tests.helpers.processes import environment

# Relative to sizes of about one metre; a few roundings.
SAME_TO_ROUNDING = 1e-12
# STL and PLY keep single precision, of coordinates of about one metre.
SINGLE_PRECISION_M = 1e-6
# A ball between a mesh's inner and outer sphere answers for neither; for so many triangles that are few segments.
LARGEST_SHARE_LEFT_OUT = 0.02


def icosphere(subdivisions: int, centre=(0.0, 0.0, 0.0), radius: float = 1.0) -> Mesh:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh("ball", np.array(ball.vertices) + centre, np.array(ball.faces))


def box_mesh(box: Box) -> Mesh:
    """Each face as two triangles, counterclockwise from outside."""
    ends = np.array([box.lowest_m, box.highest_m])
    vertices = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i, j, k in itertools.product((0, 1), repeat=3)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(box.name, vertices, np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]))


def soup(triangles: int, seed: int, size_m: float = 0.5) -> Mesh:
    """Triangles anywhere within about a metre."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (triangles, 1, 3)) + rng.uniform(-size_m, size_m, (triangles, 3, 3))
    return Mesh("soup", corners.reshape(-1, 3), np.arange(3 * triangles).reshape(-1, 3))


def random_segments(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (count, 3)), rng.uniform(-1.5, 1.5, (count, 3))


def one_by_one(mesh: Mesh, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """start + t·way = first + a·(second − first) + b·(third − first), solved as three equations for each triangle."""
    blocked = np.zeros(len(starts), dtype=bool)
    for first, second, third in mesh.vertices_m[mesh.faces]:
        matrix = np.stack([ends - starts, *(np.tile(first - other, (len(starts), 1)) for other in (second, third))], -1)
        t, a, b = np.linalg.solve(matrix, (first - starts)[..., None])[..., 0].T
        blocked |= (t > 0) & (t < 1) & (a >= 0) & (b >= 0) & (a + b <= 1)
    return blocked


@pytest.mark.parametrize("triangles", [1, 5, 8, 9, 33, 400])
def test_a_mesh_blocks_what_any_of_its_triangles_does(triangles):
    mesh = soup(triangles, triangles, size_m=1.0 if triangles < 40 else 0.2)
    starts, ends = random_segments(1500, 1)
    expected = one_by_one(mesh, starts, ends)
    np.testing.assert_array_equal(mesh.blocks(starts, ends), expected)
    np.testing.assert_array_equal(mesh.blocks(ends, starts), expected)
    assert 0.01 < expected.mean() < 0.98


def test_a_box_of_triangles_is_a_box():
    """But for segments that lie wholly inside: the surface does not block those."""
    box = Box("box", (-0.5, -0.25, 0.125), (0.5, 0.75, 0.625))
    mesh = box_mesh(box)
    starts, ends = random_segments(4000, 2)
    # Through the middle of each face, where the edge between its two triangles is, and axis-parallel ones all over.
    steps = np.linspace(-1.5, 1.5, 49) + 1 / 64
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps))
    for axis in range(3):
        for middle in (np.zeros((1, 2)), np.column_stack([u, v])):
            start = np.insert(middle + np.delete((np.array(box.lowest_m) + box.highest_m) / 2, axis), axis, -3, axis=1)
            starts, ends = np.vstack([starts, start]), np.vstack([ends, start + 6 * np.eye(3)[axis]])
    inside = [((np.array(box.lowest_m) < p) & (p < np.array(box.highest_m))).all(axis=1) for p in (starts, ends)]
    within = inside[0] & inside[1]
    np.testing.assert_array_equal(mesh.blocks(starts, ends), box.blocks(starts, ends) & ~within)
    assert within.any()
    assert mesh.blocks(starts, ends)[-(len(u) + 1)]  # through the middle


def test_an_icosphere_is_a_ball_between_its_inner_and_outer_radius():
    centre, radius = np.array([0.2, -0.1, 0.3]), 0.7
    mesh = icosphere(3, centre, radius)
    inner = ((mesh.corners_m[:, 0] - centre) * mesh.face_normals).sum(axis=1).min()
    starts, ends = random_segments(4000, 3)
    outside = np.linalg.norm(starts - centre, axis=1) > radius
    outside &= np.linalg.norm(ends - centre, axis=1) > radius
    starts, ends = starts[outside], ends[outside]
    least, most = (Sphere("ball", tuple(centre), r).blocks(starts, ends) for r in (inner, radius))
    blocked, clear = mesh.blocks(starts, ends), least == most
    assert clear.mean() > 1 - LARGEST_SHARE_LEFT_OUT
    np.testing.assert_array_equal(blocked[clear], least[clear])
    assert 0.1 < blocked.mean() < 0.9


@given(
    place=st.tuples(*[st.floats(-3, 3)] * 3),
    turn_deg=st.floats(0, 360),
    seed=st.integers(0, 2**20),
)
@settings(max_examples=25, deadline=None)
def test_nothing_leaks_out_of_a_closed_mesh(place, turn_deg, seed):
    """From inside to far outside, by way of every vertex and every edge exactly, and in between: all are blocked."""
    mesh = icosphere(1).moved(place, turn_deg)
    rng = np.random.default_rng(seed)
    corners = mesh.corners_m
    weights = rng.dirichlet(np.ones(3), len(corners))[..., None]
    ways_out = [mesh.vertices_m, (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3) / 2, (weights * corners).sum(1)]
    share = rng.uniform(size=(1, 3))
    ways_out.append((corners * share[..., None] + np.roll(corners, 1, axis=1) * (1 - share[..., None])).reshape(-1, 3))
    out = np.concatenate(ways_out) - np.array(place)
    start = np.array(place) + rng.uniform(-0.2, 0.2, 3) * rng.integers(0, 2)
    assert mesh.blocks(start, start + 3 * out).all()
    assert mesh.blocks(start + 3 * out, start).all()
    # And from outside to outside, past all of it, none is.
    assert not mesh.blocks(np.array(place) + 2 * out, np.array(place) + 3 * out).any()


def test_segments_are_open_and_degenerate_ones_cross_nothing():
    mesh = box_mesh(Box("box", (-1, -1, -1), (1, 1, 1)))
    start = np.array([0.3, 0.1, 3.0])
    ends = np.array([[0.3, 0.1, 1], [0.3, 0.1, 1.001], [0.3, 0.1, 0.999], [0.3, 0.1, 3], [0.3, 0.1, 4]])
    np.testing.assert_array_equal(mesh.blocks(start, ends), [False, False, True, False, False])
    inside = np.array([[0, 0, 0], [0.5, 0.5, 0.5]]), np.array([[0, 0, 0], [-0.5, 0, 0]])
    assert not mesh.blocks(*inside).any()
    within_a_face = np.array([-3.0, 0.3, 1]), np.array([3.0, 0.3, 1])
    assert not Mesh("face", mesh.vertices_m, mesh.faces[10:]).blocks(*within_a_face)


def test_shapes_of_segments_broadcast():
    mesh = icosphere(1)
    starts, ends = random_segments(60, 5)
    assert mesh.blocks(np.zeros(3), ends.reshape(5, 12, 3)).shape == (5, 12)
    flat = mesh.blocks(starts, ends)
    np.testing.assert_array_equal(any_blocks([mesh], starts.reshape(5, 12, 3), ends.reshape(5, 12, 3)).ravel(), flat)
    assert mesh.blocks(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize(("box_pairs", "triangle_pairs"), [(1, 1), (500, 40)])
def test_memory_bounds_change_nothing(monkeypatch, box_pairs, triangle_pairs):
    starts, ends = random_segments(150, 6)
    expected = soup(300, 7).blocks(starts, ends)
    monkeypatch.setattr(triangle_tree, "MOST_BOX_PAIRS", box_pairs)
    monkeypatch.setattr(triangle_tree, "MOST_TRIANGLE_PAIRS", triangle_pairs)
    np.testing.assert_array_equal(soup(300, 7).blocks(starts, ends), expected)
    assert 0 < expected.mean() < 1


def test_a_moved_mesh_is_turned_as_cameras_pan():
    """A board of two triangles, turned, is the board that faces there."""

    def triangles(board):
        x, y = board.right * board.width_m / 2, board.up * board.height_m / 2
        return Mesh(board.name, np.array(board.centre_m) + [-x - y, x - y, x + y, -x + y], [[0, 1, 2], [0, 2, 3]])

    starts, ends = random_segments(2000, 8)
    moved = triangles(Rectangle("board", (0, 0, 0), 1.4, 0.9, elevation_deg=20)).moved((0.1, -0.2, 0.3), 70)
    expected = Rectangle("board", (0.1, -0.2, 0.3), 1.4, 0.9, facing_deg=70, elevation_deg=20)
    np.testing.assert_array_equal(moved.blocks(starts, ends), expected.blocks(starts, ends))
    np.testing.assert_allclose(moved.face_normals, np.tile(expected.normal, (2, 1)), atol=SAME_TO_ROUNDING)
    assert moved.face_areas_m2.sum() == pytest.approx(1.4 * 0.9)


def test_a_mesh_can_be_hashed_and_not_be_changed():
    vertices = np.eye(3)
    mesh = Mesh("m", vertices, np.array([[0, 1, 2]]))
    vertices[:] = 0
    assert mesh.vertices_m.sum() == 3
    assert {mesh: 1}[mesh] == 1
    for array in (mesh.vertices_m, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError):
        mesh.name = "other"


# ---- files -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "off", "glb"])
def test_files_give_back_what_was_written(tmp_path, suffix):
    ball = icosphere(1, (0.1, 0.2, 0.3), 0.4)
    trimesh.Trimesh(ball.vertices_m * 1000, ball.faces, process=False).export(tmp_path / f"ball.{suffix}")
    read = Mesh.from_file(tmp_path / f"ball.{suffix}", scale=0.001)
    assert read.name == "ball"
    np.testing.assert_allclose(read.corners_m, ball.corners_m, atol=SINGLE_PRECISION_M)
    assert Mesh.from_file(str(tmp_path / f"ball.{suffix}"), name="globe").name == "globe"


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\n"


@pytest.mark.parametrize(
    ("file", "content", "error", "message"),
    [
        ("missing.stl", None, RangeError, "missing.stl' is not a file; allowed: STL"),
        ("bad.ply", "nonsense", RangeError, "bad.ply' cannot be read"),
        ("unknown.foo", "nonsense", RangeError, "unknown.foo' cannot be read"),
        ("beyond.obj", SQUARE + "f 1 2 7\n", RangeError, "beyond.obj' cannot be read"),
        ("beyond.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n", RangeError, "beyond.off' cannot be read"),
        ("empty.stl", "", GeometryError, "empty.stl' holds no triangles"),
        ("points.obj", SQUARE, GeometryError, "points.obj' holds no triangles"),
        ("nan.obj", "v 0 0 nan\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", RangeError, "vertices_m holds nan; allowed are finite"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", GeometryError, "no face with an area"),
    ],
)
def test_files_that_are_no_mesh_are_named(tmp_path, file, content, error, message):
    if content is not None:
        (tmp_path / file).write_text(content)
    with pytest.raises(error, match=message) as caught:
        Mesh.from_file(tmp_path / file)
    assert isinstance(caught.value, PSSError)


@pytest.mark.parametrize(
    ("vertices", "faces", "error", "message"),
    [
        (np.eye(3)[:, :2], [[0, 1, 2]], ShapeError, r"vertices_m has shape \(3, 2\)"),
        (np.zeros((2, 3, 3)), [[0, 1, 2]], ShapeError, r"vertices_m has shape \(2, 3, 3\); allowed is \(V, 3\)"),
        (np.full((3, 3), np.inf), [[0, 1, 2]], RangeError, "allowed are finite"),
        (np.eye(3), [0, 1, 2], ShapeError, r"faces has shape \(3,\); allowed is \(F, 3\)"),
        (np.eye(3), np.zeros((0, 3), dtype=int), GeometryError, "has no faces"),
        (np.eye(3), [[0, 1, 3]], RangeError, "faces names vertex 3; allowed: 0 to 2"),
        (np.eye(3), [[0, 1, -1]], RangeError, "faces names vertex -1; allowed: 0 to 2"),
        (np.eye(3), [[0.0, 1.0, 2.0]], RangeError, "faces is of float64; allowed: whole numbers"),
        (np.eye(3), [[0, 1, 1]], GeometryError, "no face with an area"),
    ],
)
def test_arrays_that_are_no_mesh_are_named(vertices, faces, error, message):
    with pytest.raises(error, match=message):
        Mesh("m", vertices, faces)


def test_mistakes_in_a_pose_or_scale_are_named(tmp_path):
    mesh = icosphere(0)
    for make, message in (
        (lambda: mesh.moved((0, 0, np.nan)), "translation_m"),
        (lambda: mesh.moved(turn_deg=np.inf), "turn_deg = inf; allowed: finite degrees"),
        (lambda: Mesh.from_file(tmp_path, scale=0.0), "scale = 0.0; allowed: above 0"),
        (lambda: Mesh.from_file(tmp_path), "is not a file"),
    ):
        with pytest.raises(RangeError, match=message):
            make()


def test_the_metric_starts_without_the_library_that_reads_meshes():
    """Asked in a process of its own, where nothing is loaded yet."""
    root = Path(__file__).resolve().parents[3]
    script = "import pss.surrogates, sys; print('trimesh' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=True,
        cwd=root,
        env=environment(),
        timeout=120,
    )
    assert done.stdout.strip() == "False"
