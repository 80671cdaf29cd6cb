"""Meshes in scene files: how they are posed, where markers lie on them, and what is wrong with them, a line each."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

import scenes
import scenes.markers.spread
import scenes.mesh_file
from pss.surrogates import Mesh
from render.keys import state_key
from scenes import SceneError
from scenes.markers.layout import PLATE_OFFSET_M, plate_corners_m
from scenes.markers.spread import spread_over
from scenes.mesh_file import contains, posed

FOLDER = Path(scenes.__file__).parent
ROOM = (FOLDER / "room.toml").read_text()
# Sums of a few decimal fractions of metres.
ROUNDING_M = 1e-9
SIDE_MODULES = 8

CRATE = """
[[objects]]
name = "crate"
kind = "mesh"
file = "crate.ply"
position_m = [-1.5, 1.0, 0.0]
albedo = 0.5
"""
SPREAD = (
    "markers = { count = 20, module_mm = 8.0, min_distance_m = 0.12, flatness_mm = 1.0, first_id = 84, seed = 3 }\n"
)
LARGER = ROOM.replace("DICT_4X4_100", "DICT_4X4_250")
PLACED = """
[[markers.placed]]
id = 200
object = "crate"
centre_m = [-1.5, 1.3, 0.3]
normal = [0.0, 1.0, 0.0]
module_mm = 10.0
"""


def crate() -> trimesh.Trimesh:
    """0.6 m wide, its foot on z = 0."""
    return trimesh.creation.box(bounds=[(-0.3, -0.3, 0.0), (0.3, 0.3, 0.6)])


def load(folder: Path, body: trimesh.Trimesh | None = None, text: str = LARGER + CRATE, name: str = "crate.ply"):
    (crate() if body is None else body).export(folder / name)
    (folder / "scene.toml").write_text(text)
    return scenes.load(folder / "scene.toml")


def refused(folder: Path, *arguments) -> list[str]:
    with pytest.raises(SceneError) as caught:
        load(folder, *arguments)
    return caught.value.problems


# ---- the mesh itself -------------------------------------------------------------------------------------------------


def test_a_mesh_is_an_object_like_others(tmp_path):
    scene = load(tmp_path)
    item = scene.state.objects[-1]
    assert (item.shape.name, item.albedo, scene.warnings) == ("crate", 0.5, ())
    np.testing.assert_allclose(item.shape.vertices_m.min(axis=0), (-1.8, 0.7, 0.0), atol=1e-6)
    assert scene.state.occluders[-1].blocks(np.array([-2.5, 1.0, 0.3]), np.array([-0.5, 1.0, 0.3]))
    assert "_mesh" not in str(scene.resolved())


def test_a_mesh_is_rolled_tilted_turned_and_moved():
    """Front (+y) and top (+z) by hand: roll takes the top to the right, tilt the front up, turn +y to +x."""
    arrows = Mesh("arrows", np.array([(0.0, 0, 0), (0, 1, 0), (0, 0, 1)]), np.array([(0, 1, 2)]))
    for pose, front, top in (
        ({}, (0, 1, 0), (0, 0, 1)),
        ({"turn_deg": 90}, (1, 0, 0), (0, 0, 1)),
        ({"tilt_deg": 90}, (0, 0, 1), (0, -1, 0)),
        ({"roll_deg": 90}, (0, 1, 0), (1, 0, 0)),
        ({"turn_deg": 90, "tilt_deg": 90, "roll_deg": 90}, (0, 0, 1), (0, -1, 0)),
    ):
        moved = posed(arrows, (3.0, 4.0, 5.0), **pose).vertices_m - (3.0, 4.0, 5.0)
        np.testing.assert_allclose(moved, [(0, 0, 0), front, top], atol=ROUNDING_M)


@pytest.mark.parametrize("suffix", ["ply", "stl", "obj", "glb", "off"])
def test_formats_give_the_same_surface(suffix, tmp_path):
    scene = load(tmp_path, None, LARGER + CRATE.replace("crate.ply", f"crate.{suffix}"), f"crate.{suffix}")
    assert scene.warnings == ()
    assert scene.state.objects[-1].shape.face_areas_m2.sum() == pytest.approx(6 * 0.36)


def test_a_file_without_normals_is_as_good_as_one_with(tmp_path):
    """Faces have the normals of their corners, whatever the file says of normals, or if it says nothing."""
    body, wrong = crate(), crate()
    wrong.vertex_normals = -np.array(wrong.vertex_normals)
    bare, message = body.export(file_type="ply", vertex_normal=False), wrong.export(file_type="ply", vertex_normal=True)
    assert b"property float nx" in message
    assert b"property float nx" not in bare
    meshes = []
    (tmp_path / "scene.toml").write_text(LARGER + CRATE)
    for content in (bare, message):
        (tmp_path / "crate.ply").write_bytes(content)
        scene = scenes.load(tmp_path / "scene.toml")
        assert scene.warnings == ()
        meshes.append(scene.state.objects[-1].shape)
    assert meshes[0].digest == meshes[1].digest


def test_the_files_content_counts_not_its_name(tmp_path):
    keys = [state_key(load(tmp_path).state)]
    keys.append(state_key(load(tmp_path, None, LARGER + CRATE.replace("crate.ply", "box.ply"), "box.ply").state))
    dented = crate()
    dented.vertices[3] += (0.001, 0, 0)
    keys.append(state_key(load(tmp_path, dented).state))
    assert keys[0] == keys[1] != keys[2]


def test_what_is_inside_a_closed_mesh():
    body = crate()
    mesh = Mesh("crate", np.array(body.vertices), np.array(body.faces))
    points = np.random.default_rng(1).uniform((-0.5, -0.5, -0.2), (0.5, 0.5, 0.8), (300, 3))
    inside = ((np.abs(points[:, :2]) < 0.3).all(axis=1)) & (points[:, 2] > 0) & (points[:, 2] < 0.6)
    assert [contains(mesh, point) for point in points] == inside.tolist()
    assert 10 < inside.sum() < 290


def opened() -> trimesh.Trimesh:
    body = crate()
    body.update_faces(np.arange(len(body.faces)) > 0)
    return body


def scaled(factor: float) -> trimesh.Trimesh:
    return crate().apply_scale(factor)


BROKEN = {
    # what: (body, replacement in the table, start of the problem, a part of what is said)
    "no file": (None, ('"crate.ply"', '"chair.ply"'), 'objects.crate.file = "chair.ply"; ', "the path of a mesh"),
    "millimetres": (scaled(1000), ("", ""), 'objects.crate.file = "crate.ply"; ', "600 m wide: in millimetres? scale"),
    "scale": (None, ("albedo", "scale = 100\nalbedo"), "objects.crate.scale = 100; ", "at most 6 m; this is 60 m wide"),
    "no scale": (None, ("albedo", "scale = 0\nalbedo"), "objects.crate.scale = 0; ", "above 0, in metres for one unit"),
    "through the floor": (None, ("1.0, 0.0]", "1.0, -0.1]"), "objects.crate.position_m = ", "whole mesh inside the"),
    "through a wall": (None, ("-1.5, 1.0", "-2.8, 1.0"), "objects.crate.position_m = ", "whole mesh inside the room"),
    "unknown key": (None, ("position_m", "centre_m"), "objects.crate.centre_m = ", "unknown key"),
    "around a camera": (None, ("-1.5, 1.0, 0.0]", "0.0, 2.6, 2.4]"), "cameras.4.position_m = ", 'the object "crate"'),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_a_wrong_mesh_is_one_line(what, tmp_path):
    body, (old, new), start, message = BROKEN[what]
    problems = refused(tmp_path, body, LARGER + CRATE.replace(old, new, 1))
    # A misspelt key that must be there is missing too.
    problems = [problem for problem in problems if "is missing" not in problem]
    assert len(problems) == 1, problems
    assert problems[0].startswith(f"{tmp_path / 'scene.toml'}: {start}")
    assert message in problems[0]
    assert "\n" not in problems[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "cannot be read"),
        (b"ply\nrubbish", "cannot be read"),
        (b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", "triangles"),
    ],
)
def test_a_file_without_a_mesh_is_one_line(content, message, tmp_path):
    (tmp_path / "crate.ply").write_bytes(content)
    (tmp_path / "scene.toml").write_text(LARGER + CRATE)
    with pytest.raises(SceneError) as caught:
        scenes.load(tmp_path / "scene.toml")
    (problem,) = caught.value.problems
    assert 'objects.crate.file = "crate.ply"; allowed: a mesh with triangles' in problem
    assert message in problem


def test_all_problems_of_mesh_and_scene_come_at_once(tmp_path):
    text = changed(LARGER, ("zoom = 3.0", "zoom = 50.0")) + CRATE.replace("crate.ply", "no.ply") + PLACED
    problems = refused(tmp_path, None, changed(text, ("id = 200", "id = 3")))
    assert len(problems) == 3
    assert any("3 already on" in problem for problem in problems)


def changed(text: str, *replacements: tuple[str, str]) -> str:
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def test_what_is_accepted_with_a_warning(tmp_path):
    (warning,) = load(tmp_path, opened()).warnings
    message = (
        'scene.toml: warning: objects.crate.file = "crate.ply"; not watertight: 11 of 11 faces are seen from both sides'
    )
    assert warning.endswith(message)
    inverted = crate()
    inverted.invert()
    (warning,) = load(tmp_path, inverted).warnings
    assert "12 of 12 faces are wound inside out, and were turned" in warning


# ---- markers spread over it ------------------------------------------------------------------------------------------


def spread(folder: Path, body: trimesh.Trimesh | None = None, **keys: object):
    line = SPREAD
    for key, value in keys.items():
        line, count = re.subn(rf"\b{key} = [\d.]+", f"{key} = {value}", line)
        assert count == 1
    return load(folder, body, LARGER + CRATE + line)


@pytest.mark.parametrize("body", ["crate", "ball"])
def test_markers_keep_their_distance_and_lie_flat(body, tmp_path):
    """Independent of how they were found: pairs one by one, and segments from each plate to the mesh beneath."""
    flatness_mm = 1.0 if body == "crate" else 5.0
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.4).apply_translation((0, 0, 0.6))
    state = spread(tmp_path, ball if body == "ball" else None, flatness_mm=flatness_mm).state
    mesh, markers = state.objects[-1].shape, [m for m in state.markers if m.object_name == "crate"]
    assert [marker.id for marker in markers] == list(range(84, 104))
    centres = np.array([marker.centre_m for marker in markers])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2) + np.eye(20)
    assert apart.min() >= 0.12 - 2 * (flatness_mm * 1e-3 + PLATE_OFFSET_M)  # the mesh's own points are that far apart
    line = np.linspace(-0.5, 0.5, 23)
    for marker in markers:
        side = SIDE_MODULES * marker.module_m
        across, along = (x.reshape(-1, 1) * side for x in np.meshgrid(line, line))
        plate = np.array(marker.centre_m) + across * marker.right + along * np.array(marker.up)
        normal = np.array(marker.normal)
        below = plate - (flatness_mm * 1e-3 + PLATE_OFFSET_M + 1e-6) * normal
        assert mesh.blocks(plate, below).all()  # no place of the plate is farther off than that …
        assert not mesh.blocks(plate, plate + 0.005 * normal).any()  # … nor under the surface
        assert mesh.blocks(plate, plate - (PLATE_OFFSET_M + 0.3e-3) * normal).any()  # and it just clears it


def test_the_same_seed_gives_the_same_places_and_another_others(tmp_path):
    first, again, other = (spread(tmp_path, seed=seed).state.markers for seed in (3, 3, 4))
    assert first == again != other


def test_markers_keep_clear_of_other_objects_and_of_the_room(tmp_path):
    """A crate on the floor has no markers on its bottom, and none where a second crate stands against it."""
    second = changed(CRATE, ('"crate"', '"other"'), ("-1.5, 1.0, 0.0", "-1.5, 1.6, 0.0"))
    state = load(tmp_path, None, LARGER + CRATE + SPREAD.replace("count = 20", "count = 30") + second).state
    markers = [marker for marker in state.markers if marker.object_name == "crate"]
    assert not [marker.id for marker in markers if marker.normal[2] < -0.5]
    assert len([marker.id for marker in markers if marker.normal[1] < -0.5]) >= 4
    assert not [marker.id for marker in markers if marker.normal[1] > 0.5]
    other = state.objects[-1].shape
    for marker in markers:
        corners = plate_corners_m(marker, SIDE_MODULES * marker.module_m)
        assert not other.blocks(corners, np.roll(corners, -1, axis=0)).any()


@pytest.mark.slow
def test_the_number_that_is_said_to_fit_fits(tmp_path, monkeypatch):
    monkeypatch.setattr(scenes.markers.spread, "TRIES", (400, 1000))  # for the sake of time
    text = LARGER + CRATE + SPREAD.replace("count = 20", "count = 120").replace("0.12", "0.2")
    (problem,) = refused(tmp_path, None, text)
    fits = int(re.search(r"markers\.count = 120; allowed: at most (\d+), as no more fit", problem).group(1))
    # A crate's five free faces of 0.6 m hold nine markers 0.2 m apart each, even if they are put there in rows.
    assert 5 * 4 <= fits <= 5 * 16
    assert len(load(tmp_path, None, text.replace("count = 120", f"count = {fits}")).state.markers) == 84 + fits


@pytest.mark.parametrize("distance_m", [0.23, 0.26, 0.33])
def test_as_many_markers_as_are_said_to_fit_do_whatever_was_asked_for(distance_m, monkeypatch):
    """The limit is one number: each larger count gets it, and it is kept."""
    monkeypatch.setattr(scenes.markers.spread, "TRIES", (40, 160))  # for the sake of time
    body = crate()
    mesh = Mesh("crate", np.array(body.vertices), np.array(body.faces))

    def fitting(count: int) -> int:
        sizes = {"module_mm": 8.0, "side_m": 0.064, "min_distance_m": distance_m, "flatness_m": 0.001}
        return len(spread_over(mesh, (), (4.0, 4.0, 3.0), count=count, first_id=0, seed=3, **sizes).markers)

    limit = fitting(120)
    assert 5 < limit < 120
    assert {count: fitting(count) for count in (limit, limit + 1, limit + 5)} == dict.fromkeys(
        (limit, limit + 1, limit + 5), limit
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "start", "message"),
    [
        ("module_mm = 8.0", "module_mm = 90.0", "min_distance_m = 0.12; ", "at least 1.0183, the diagonal of a plate"),
        ("0.12, flat", "2.0, flat", "count = 20; ", "at most 1, as no more fit 2 m apart"),
        ("first_id = 84", "first_id = 80", "first_id = 80; ", '80 to 83 already on "ball"'),
        ("first_id = 84", "first_id = 240", "first_id = 240; ", "0 to 230"),
        ("count = 20", "count = 0", "count = 0; ", "1 or more"),
    ],
)
def test_rules_of_spread_markers(old, new, start, message, tmp_path):
    (problem,) = refused(tmp_path, None, LARGER + CRATE + changed(SPREAD, (old, new)))
    assert f"objects.crate.markers.{start}" in problem
    assert message in problem


@pytest.mark.slow
def test_a_marker_larger_than_the_flat_parts_is_refused(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3).apply_translation((0, 0, 0.5))
    (problem,) = refused(tmp_path, ball, LARGER + CRATE + SPREAD)
    assert (
        "objects.crate.markers.module_mm = 8.0; allowed: plates of 64 mm on a part of the mesh that is flat" in problem
    )
