"""Faces of more than three corners: any simple polygon is cut rightly, in every format; others are named by line."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pss import RangeError
from pss.surrogates import Mesh
from render.world.meshes import skin

# The L-shaped hexagon: 2 × 2 without a quarter.
L_SHAPE = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
L_AREA = 3.0
# Rounding of coordinates of about 10, doubles.
EXACT = 1e-12
# Corners are written with 17 digits; a face that is cut in its plane by rotated doubles is as exact.
ROTATED = 1e-9


def in_space(outline: np.ndarray, seed: int = 0) -> np.ndarray:
    """The outline (n, 2) in a plane of any orientation, (n, 3)."""
    rotation = Rotation.random(random_state=seed)
    return rotation.apply(np.column_stack([outline, np.zeros(len(outline))])) + [3.0, -2.0, 1.0]


def obj(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    lines = ["v " + " ".join(f"{x:.17g}" for x in vertex) for vertex in vertices]
    lines += ["f " + " ".join(f"{index + 1}/1/1" for index in face) for face in faces]
    return "\n".join(lines).encode()


def off(vertices: np.ndarray, faces: list[list[int]]) -> bytes:
    lines = ["OFF", "# a comment", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(f"{x:.17g}" for x in vertex) for vertex in vertices]
    lines += [" ".join(map(str, [len(face), *face])) for face in faces]
    return "\n".join(lines).encode()


def ply(vertices: np.ndarray, faces: list[list[int]], order: str = "") -> bytes:
    """Text, or binary with the byte order "<" or ">"; with a property and an element that are of no use here."""
    form = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"""ply
format {form} 1.0
comment TextureFile none.png
element vertex {len(vertices)}
property double x
property double y
property double z
property uchar red
element edge 1
property int a
property int b
element face {len(faces)}
property uchar flags
property list uchar int vertex_indices
end_header
"""
    if not order:
        rows = [" ".join(f"{x:.17g}" for x in vertex) + " 7" for vertex in vertices] + ["0 1"]
        rows += [" ".join(map(str, [9, len(face), *face])) for face in faces]
        return (head + "\n".join(rows) + "\n").encode()
    data = b"".join(struct.pack(f"{order}dddB", *vertex, 7) for vertex in vertices) + struct.pack(f"{order}ii", 0, 1)
    data += b"".join(struct.pack(f"{order}BB{len(face)}i", 9, len(face), *face) for face in faces)
    return head.encode() + data


FORMATS = {
    "obj": obj,
    "off": off,
    "ply": ply,
    "little.ply": lambda vertices, faces: ply(vertices, faces, "<"),
    "big.ply": lambda vertices, faces: ply(vertices, faces, ">"),
}


def read(folder: Path, vertices: np.ndarray, faces: list[list[int]], form: str = "obj") -> Mesh:
    path = folder / f"mesh.{form}"
    path.write_bytes(FORMATS[form](vertices, faces))
    return Mesh.from_file(path)


def prism(outline: np.ndarray, height: float = 1.0) -> tuple[np.ndarray, list[list[int]]]:
    """A closed solid: the outline as floor and top, a quad at each edge."""
    count = len(outline)
    vertices = np.concatenate([np.column_stack([outline, np.full(count, z)]) for z in (0.0, height)])
    ring = list(range(count))
    walls = [[n, (n + 1) % count, (n + 1) % count + count, n + count] for n in ring]
    return vertices, [ring[::-1], [n + count for n in ring], *walls]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("polygons")


# ---- right areas and sights ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("start", range(6))
def test_an_l_has_its_area_from_any_starting_corner(folder, start, form):
    """Fanned, four of the six have an area of 4."""
    for seed in range(3):
        for outline in (L_SHAPE, L_SHAPE[::-1]):
            vertices = in_space(np.roll(outline, start, axis=0), seed)
            mesh = read(folder, vertices, [list(range(6))], form)
            assert mesh.face_areas_m2.sum() == pytest.approx(L_AREA, rel=ROTATED)
            # Wound as the file has it.
            normal = np.cross(vertices - vertices[0], np.roll(vertices, -1, axis=0) - vertices[0]).sum(axis=0)
            np.testing.assert_allclose(mesh.face_normals @ normal / np.linalg.norm(normal), 1, atol=ROTATED)


@pytest.mark.parametrize("start", range(6))
def test_the_notch_of_an_l_shaped_prism_is_open(folder, start):
    """Segments within the quarter that the L leaves out; both layers see the same triangles."""
    mesh = read(folder, *prism(np.roll(L_SHAPE, start, axis=0)))
    rng = np.random.default_rng(4)
    low, high = (1.001, 1.001, -0.5), (2.0, 2.0, 1.5)
    starts, ends = (rng.uniform(low, high, (500, 3)) for _ in range(2))
    assert not mesh.blocks(starts, ends).any()
    below, above = rng.uniform((0.01, 0.01, -1), (0.99, 1.99, -0.5), (200, 3)), rng.uniform(0.01, 0.99, (200, 3))
    assert mesh.blocks(below, above + (0, 0, 2)).all()
    assert not skin(mesh).open_faces.any()
    assert skin(mesh).turned == 0
    corners = skin(mesh).corners_m
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(L_AREA, rel=EXACT)


def test_straight_edges_keep_their_corners_so_that_neighbours_join(folder):
    """A closed prism over a concave outline, each of whose edges is halved, once for two neighbours."""
    outline = np.stack([L_SHAPE, (L_SHAPE + np.roll(L_SHAPE, -1, axis=0)) / 2], axis=1).reshape(-1, 2)
    mesh = read(folder, *prism(outline))
    assert not skin(mesh).open_faces.any()
    assert (mesh.face_areas_m2 > 0).all()
    assert len(mesh.faces) == 2 * (len(outline) - 2) + 2 * len(outline)


def test_equal_neighbouring_corners_are_one(folder):
    mesh = read(
        folder, np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 0)], dtype=float), [[0, 1, 2, 3], [0, 1, 2, 2]]
    )
    assert mesh.face_areas_m2.tolist() == [0.5, 0.5]


def test_a_slightly_bent_face_is_cut_and_a_bent_one_is_not(folder):
    def lifted(height: float) -> np.ndarray:
        return np.column_stack([L_SHAPE, height * np.array([0, 1, -1, 0, 1, -1])])

    flat = read(folder, lifted(0.05), [list(range(6))])
    assert flat.face_areas_m2.sum() == pytest.approx(L_AREA, rel=0.02)
    with pytest.raises(
        RangeError, match=r"line 7: a face of 6 corners is bent by \d\d% of its extent; allowed: simple"
    ):
        read(folder, lifted(0.5), [list(range(6))])


# ---- all simple polygons ---------------------------------------------------------------------------------------------


def star(radii: list[float]) -> np.ndarray:
    """Star-shaped about the origin, concave wherever radii alternate."""
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    return np.array(radii)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def spiral(corners: int, turns: float, width: float) -> np.ndarray:
    """A band that winds about the origin, counterclockwise: its outer edge outwards, its inner edge back."""
    angles = np.linspace(0.5, 2 * np.pi * turns + 0.5, corners)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    inner = angles[:, None] * directions
    return np.concatenate([inner + width * directions, inner[::-1]])


def comb(depths: list[float]) -> np.ndarray:
    """A bar with teeth: vertical edges, collinear corners at their feet and at their tips."""
    corners = [(0.0, -1.0), (2.0 * len(depths), -1.0)]
    for number, depth in reversed(list(enumerate(depths))):
        left = 2.0 * number
        corners += [(left + 2, 0.0), (left + 1, 0.0), (left + 1, depth), (left, depth)]
    return np.array([*corners, (0.0, 0.0)])


OUTLINES = st.one_of(
    st.lists(st.floats(0.05, 1.0), min_size=4, max_size=24).map(star),
    # 45 corners over at most 3 turns: chords stay clear of the next turn of the band.
    st.builds(spiral, st.just(45), st.floats(0.3, 3.0), st.floats(0.1, 4.0)),
    st.lists(st.floats(0.2, 3.0), min_size=1, max_size=5).map(comb),
)


def shoelace(outline: np.ndarray) -> float:
    x, y = outline.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def holds(outline: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which points (P, 2) are inside, by counting the edges that a ray along x crosses."""
    start, end = outline, np.roll(outline, -1, axis=0)
    over = (start[:, 1] > points[:, 1, None]) != (end[:, 1] > points[:, 1, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (points[:, 1, None] - start[:, 1]) / (end - start)[:, 1]
        crossing = start[:, 0] + share * (end - start)[:, 0]
    return (over & (crossing > points[:, 0, None])).sum(axis=1) % 2 == 1


@settings(max_examples=40, deadline=None)
@given(outline=OUTLINES, start=st.integers(0, 100), seed=st.integers(0, 100))
def test_any_simple_polygon_is_covered_once(folder, outline, start, seed):
    """The area is the shoelace formula's, and a point is in one triangle if it is inside, and else in none."""
    shifted = np.roll(outline, start, axis=0)
    count = len(outline)
    mesh = read(folder, in_space(shifted, seed), [list(range(count))])
    area = shoelace(outline)
    assert mesh.face_areas_m2.sum() == pytest.approx(area, rel=ROTATED)
    assert len(mesh.faces) == count - 2
    assert set(mesh.faces.reshape(-1)) == set(range(count))
    # Each edge of the outline bounds one triangle; the others are between two.
    edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    unique, times = np.unique(edges, axis=0, return_counts=True)
    once = {tuple(sorted((n, (n + 1) % count))) for n in range(count)}
    assert {tuple(edge) for edge in unique[times == 1]} == once
    points = np.random.default_rng(seed).uniform(outline.min(axis=0), outline.max(axis=0), (100, 2))
    inside = holds(outline, points)
    covered = sum(holds(shifted[face], points).astype(int) for face in mesh.faces)
    assert covered.tolist() == inside.tolist()


def test_a_large_outline_is_cut_too(folder):
    """A spiral of 1,000 corners, the most that a face may have that is not convex."""
    outline = spiral(500, 6.0, 5.0)
    mesh = read(folder, in_space(outline), [list(range(1000))])
    assert mesh.face_areas_m2.sum() == pytest.approx(shoelace(outline), rel=ROTATED)
    with pytest.raises(RangeError, match="is not convex; allowed: at most 1000 corners"):
        read(folder, in_space(spiral(501, 6.0, 5.0)), [list(range(1002))])
    circle = star([1.0] * 5000)
    disc = read(folder, in_space(circle), [list(range(5000))])
    assert disc.face_areas_m2.sum() == pytest.approx(math.pi, rel=1e-6)


# ---- refused ---------------------------------------------------------------------------------------------------------

WRONG = {
    "bow tie": ([(0, 0), (1, 1), (1, 0), (0, 1)], "touches or crosses itself|has no area"),
    "crooked bow tie": ([(0, 0), (2, 2), (2, 0), (0, 1)], "touches or crosses itself"),
    "pentagram": (star([1.0] * 5)[[0, 2, 4, 1, 3]], "touches or crosses itself"),
    "twice round": (
        star([1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7])[[0, 2, 4, 6, 1, 3, 5, 7]],
        "touches or crosses itself",
    ),
    "a spike": ([(0, 0), (1, 0), (3, 0), (1, 0), (1, 1), (0, 1)], "touches or crosses itself"),
    "a line": ([(0, 0), (1, 0), (2, 0), (3, 0)], "has no area"),
    "a point": ([(1, 1)] * 4, "has 0 different ones"),
}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_simple_polygon_is_named_by_file_and_place(folder, case, form):
    outline, reason = WRONG[case]
    vertices = np.concatenate([in_space(np.array(outline, dtype=float)), np.eye(3)])
    count = len(outline)
    place = {"obj": f"line {count + 5}", "off": f"line {count + 8}", "ply": f"line {16 + count + 3 + 2}"}
    expected = place.get(form, "face 1 from 0")
    with pytest.raises(RangeError, match=rf"mesh.{form}' cannot be read \({expected}: a face of .* ({reason})"):
        read(folder, vertices, [[count, count + 1, count + 2], list(range(count))], form)


def test_faces_and_numbers_that_are_wrong_are_named_by_their_line(folder):
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    faces = "element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n"
    for name, text, message in (
        ("a.obj", square + "f 1 2\n", "line 5: a face of 2 corners; allowed: 3 or more"),
        ("a.obj", square + "# more\nf 1 2 3 9\n", "line 6: vertex number 8 from 0; allowed: 0 to 3"),
        ("a.obj", square + "f 1 2 3 0\n", "line 5: vertex number -1 from 0"),
        ("a.obj", square + "f 1 2 x 4\n", r"line 5: 'f 1 2 x 4'; allowed: `v X Y Z`, `f 1 2 3`"),
        ("a.obj", "v 1 2\n", "line 1: 'v 1 2'; allowed"),
        ("a.off", "OFF 3 1 0\n0 0 0\n1 0 0\n0 1\n3 0 1 2\n", "line 4: '0 1'; allowed: X Y Z of a vertex"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n", "line 6: '0 1 2'; allowed: whole numbers, 4 of them"),
        ("a.off", "OFF\n3 9 0\n0 0 0\n", "2 lines; allowed: the numbers of vertices and faces, and as many lines"),
        ("a.ply", head + faces + "4 0 0 0\n", "line 11: allowed: the 1 properties of `face`, lists with their length"),
        ("a.ply", head + faces + "2 0 0\n", "line 11: a face of 2 corners"),
        ("a.ply", head + faces, "it ends before the last face of 1"),
        ("a.ply", head.replace("float z", "float w") + "end_header\n0 0 0\n", "no x, y and z"),
        ("a.ply", head.replace("float x", "word x") + "end_header\n", "line 4: 'property word x'; allowed: format"),
    ):
        (folder / name).write_text(text)
        with pytest.raises(RangeError, match=message):
            Mesh.from_file(folder / name)


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_binary_ply_may_mix_faces_and_may_not_end_early(folder, order):
    vertices = np.concatenate([in_space(L_SHAPE), in_space(L_SHAPE) + 10])
    faces = [[0, 1, 2], list(range(6, 12)), [3, 4, 5], [7, 8, 9, 6]]
    path = folder / "mixed.ply"
    content = ply(vertices, faces, order)
    path.write_bytes(content)
    areas = Mesh.from_file(path).face_areas_m2
    assert areas[1:5].sum() == pytest.approx(L_AREA)
    for end in range(content.index(b"end_header") + 11, len(content), 5):
        path.write_bytes(content[:end])
        with pytest.raises(RangeError, match="it ends before the last"):
            Mesh.from_file(path)


def test_obj_counts_backwards_from_the_last_vertex_and_joins_lines(folder):
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 \\\n -1\nv 0 0 5\nv 1 0 5\nv 1 1 5\nf -3//2 -2//2 -1//2\nusemtl m\nl 1 2\n"
    )
    (folder / "back.obj").write_text(text)
    assert Mesh.from_file(folder / "back.obj").faces.tolist() == [[0, 1, 2], [3, 4, 5]]
