"""Meshes in a scene: the same answers as the shapes they draw, in prediction, light and render alike."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

import scenes
from pss import Box, ImageSensor, PTZCamera, Sphere
from pss.surrogates import Mesh
from render import backend
from render.keys import state_key
from render.lens.sampling import Sampling
from render.light import lit_scene
from render.light.patches import MOST_SPLIT_PATCHES
from render.light.radiosity import solve_radiosity
from render.renderer import Renderer
from render.world import lit_meshes
from render.world.lit_meshes import SHEET_M, lit_mesh
from render.world.meshes import FEWEST_PATCHES, MOST_MESH_PATCHES, mesh_patches, patches_needed, shares, skin
from render.world.state import Light, MarkerPrint, Panel, Room, SceneObject, SceneState
from tests.helpers.visible_points import visible_points

WORKSHOP = Path(__file__).parents[2] / "scenes" / "workshop.toml"
BOX = Box("body", (-0.9, -0.9, 0.3), (-0.3, -0.3, 0.9))
PANELS = (Panel((-0.6, 0.5), (0.4, 0.8)), Panel((0.6, 0.5), (0.4, 0.8)))
BALL = Sphere("body", (0.25, 0.1, 1.25), 0.45)
# Relative to a body of about a metre; a few roundings.
SAME_TO_ROUNDING = 1e-9
# A box's patches are squares and those of its mesh triangles, each seen whole or not at all: near it, a few hundredths.
IRRADIANCE_POINT, IRRADIANCE_MEAN = 0.06, 0.01
# Seen in the image: the light's difference, and what shading between other vertices adds at shadow edges.
RADIANCE_MEDIAN, RADIANCE_95 = 0.005, 0.02
# A ball as 1280 faces: silhouette within 0.3 % of its radius, patches elsewhere.
BALL_POINT, BALL_MEAN = 0.08, 0.01
# Within 6° of grazing a plate's thickness decides who hides whom; the metric's points have none.
GRAZING = 0.1


def box_mesh(box: Box) -> Mesh:
    low, high = np.array(box.lowest_m), np.array(box.highest_m)
    body = trimesh.creation.box(bounds=[low, high])
    return Mesh(box.name, np.array(body.vertices), np.array(body.faces))


def ball_mesh(ball: Sphere, subdivisions: int = 3) -> Mesh:
    body = trimesh.creation.icosphere(subdivisions=subdivisions, radius=ball.radius_m)
    return Mesh(ball.name, np.array(body.vertices) + ball.centre_m, np.array(body.faces))


def sheet(name: str, centre, side: float) -> Mesh:
    half = side / 2
    corners = np.array(centre) + [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    return Mesh(name, corners, np.array([(0, 1, 2), (0, 2, 3)]))


def room(*shapes, albedo: float = 0.5, panels=PANELS) -> SceneState:
    objects = tuple(SceneObject(shape, albedo) for shape in shapes)
    style = MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04)
    return SceneState(Room(3.0, 3.0, 2.5, albedo, albedo, albedo), Light(0.2, panels), objects, (), style)


def floor_points(count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    points = np.random.default_rng(3).uniform((-1.4, -1.4, 0), (1.4, 1.4, 0), (count, 3))
    return points, np.tile([0.0, 0, 1], (count, 1))


# ---- prediction and light --------------------------------------------------------------------------------------------


def test_a_box_hides_the_same_points_as_a_mesh():
    """Slab test against triangles; a segment that grazes an edge to rounding is not among so few."""
    cameras = [PTZCamera((1.4, y, 2.0), 0, 0, focus_distance_m=2.0).aimed_at((0, 0, 0.5)) for y in (-1.4, 0.0, 1.4)]
    points, normals = floor_points(2000)
    by_box, by_mesh = (visible_points(cameras, points, normals, [shape]) for shape in (BOX, box_mesh(BOX)))
    np.testing.assert_array_equal(by_box, by_mesh)
    assert 0 < by_box.sum() < visible_points(cameras, points, normals).sum()


@pytest.mark.parametrize(
    ("shape", "mesh", "point", "mean"),
    [
        (BOX, box_mesh(BOX), IRRADIANCE_POINT, IRRADIANCE_MEAN),
        (BALL, ball_mesh(BALL), BALL_POINT, BALL_MEAN),
        (BALL, ball_mesh(BALL, 5), BALL_POINT, BALL_MEAN),
    ],
    ids=["box", "ball", "fine ball, merged patches"],
)
def test_a_mesh_lights_and_shades_the_floor_as_its_shape_does(shape, mesh, point, mean):
    points, normals = floor_points()
    of_shape, of_mesh = (solve_radiosity(room(body)).irradiance(points, normals) for body in (shape, mesh))
    ratio = of_mesh / of_shape
    assert np.abs(ratio - 1).max() < point
    assert ratio.mean() == pytest.approx(1, abs=mean)
    empty = solve_radiosity(room()).irradiance(points, normals)
    assert np.abs(of_shape / empty - 1).max() > 3 * point  # there is something to agree about


@pytest.mark.parametrize(
    "body",
    [ball_mesh(Sphere("ball", (0, 0, 1.0), 0.3)), box_mesh(Box("box", (-0.3, -0.3, 0.7), (0.3, 0.3, 1.3))),
     sheet("sheet", (0, 0, 1.0), 0.6)],
    ids=lambda mesh: mesh.name,
)  # fmt: skip
def test_a_mesh_casts_a_shadow(body):
    """Umbra, penumbra, open floor: none of the lamp's light, some of it, all of it (a black room)."""
    panels = (Panel((0.0, 0.0), (0.4, 0.4)),)
    with_it, without = (solve_radiosity(room(*bodies, albedo=0.0, panels=panels)) for bodies in ((body,), ()))
    points, up = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.4, 0, 0]]), np.tile([0.0, 0, 1], (3, 1))
    share = with_it.irradiance(points, up) / without.irradiance(points, up)
    assert share[0] == 0
    assert 0 < share[1] < 1
    assert share[2] == 1


def test_several_meshes_cast_the_shadows_of_all():
    """Joined into one obstacle or one by one."""
    bodies = (box_mesh(BOX), ball_mesh(BALL), sheet("sheet", (0.8, -0.8, 0.5), 0.5))
    solved = solve_radiosity(room(*bodies))
    points, normals = floor_points(100)
    apart = dataclasses.replace(solved, occluders=bodies).irradiance(points, normals)
    np.testing.assert_allclose(solved.irradiance(points, normals), apart, rtol=SAME_TO_ROUNDING)


# ---- sides, patches, vertices ----------------------------------------------------------------------------------------


def test_a_closed_mesh_that_is_wound_inside_out_is_turned():
    right = box_mesh(BOX)
    wrong = dataclasses.replace(right, faces=right.faces[:, ::-1])
    assert (skin(right).turned, skin(wrong).turned) == (0, 12)
    for mesh in (right, wrong):
        lit = lit_mesh(mesh, 0.2)
        outwards = lit.vertices_m - (np.array(BOX.lowest_m) + BOX.highest_m) / 2
        assert ((outwards * lit.normals).sum(axis=1) > 0).all()


def test_a_mesh_with_a_hole_is_seen_from_both_sides():
    whole = box_mesh(BOX)
    holed = dataclasses.replace(whole, faces=whole.faces[:-1])
    assert not skin(whole).open_faces.any()
    assert skin(holed).open_faces.all()
    lit = lit_mesh(sheet("sheet", (0, 0, 1.0), 0.6), 0.2)
    assert set(np.round(lit.normals[:, 2])) == {1.0, -1.0}
    np.testing.assert_allclose(lit.vertices_m[:, 2] - 1, SHEET_M * lit.normals[:, 2], atol=1e-12)


def test_split_faces_cover_the_mesh_and_are_small():
    """Area and volume stay, by sums over triangles; no edge is longer than the diagonal of the square asked for."""
    lit = lit_mesh(box_mesh(BOX), 0.1)
    corners = lit.vertices_m[lit.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(6 * 0.6**2)
    assert np.linalg.det(corners - 1.0).sum() / 6 == pytest.approx(0.6**3)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert edges.max() <= 0.1 * math.sqrt(2) * (1 + 1e-6)


def test_shading_is_smooth_on_a_ball_and_sharp_on_a_box():
    ball = lit_mesh(ball_mesh(BALL, 4), 0.2)
    assert len(ball.vertices_m) == 2562  # one vertex at each corner of the icosphere
    radial = (ball.vertices_m - BALL.centre_m) / BALL.radius_m
    assert (radial * ball.normals).sum(axis=1).min() > math.cos(math.radians(2))
    box = lit_mesh(box_mesh(BOX), 0.2)
    assert set(np.abs(box.normals).max(axis=1).round(12)) == {1.0}


def test_patches_of_fine_meshes_are_merged_and_keep_the_area():
    """A closed body's area vectors cancel; the patches' area is the body's, but for what faces of one patch curve."""
    fine = ball_mesh(BALL, 6)
    wanted = patches_needed(fine, 0.3)
    assert FEWEST_PATCHES < wanted < 500
    corners, seen = mesh_patches(fine, 0.3, wanted)
    assert len(corners) == len(seen) <= wanted
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    total = 4 * math.pi * BALL.radius_m**2
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(total, rel=0.02)
    np.testing.assert_allclose(vectors.sum(axis=0), 0, atol=1e-3 * total)
    np.testing.assert_allclose(np.linalg.norm(seen - BALL.centre_m, axis=1), BALL.radius_m, rtol=1e-3)


@pytest.mark.slow
def test_patches_of_all_meshes_together_are_bounded():
    assert shares([10, 2000, 90, 700], 1500) == [10, 700, 90, 700]
    assert sum(shares([900] * 7, MOST_MESH_PATCHES)) <= MOST_MESH_PATCHES
    walls = [sheet(f"wall {z}", (0, 0, z / 10), 2.9) for z in range(1, 20)]
    without = len(solve_radiosity(room()).radiosity)
    assert len(solve_radiosity(room(*walls)).radiosity) <= without + MOST_MESH_PATCHES + MOST_SPLIT_PATCHES


def test_a_fine_mesh_shows_a_mean_of_the_light_at_fewer_places(monkeypatch):
    """Light that varies over a ball as a linear function of place and direction is kept within a few hundredths."""
    monkeypatch.setattr(lit_meshes, "MOST_RECEIVERS", 1024)
    fine = lit_mesh.__wrapped__(ball_mesh(BALL, 5), 0.2)
    assert len(fine.receivers_m) <= 1024 < len(fine.vertices_m)

    def light(points, normals):
        return 2 + points[:, 0] + normals[:, 2]

    error = fine.lit_by(light) / light(fine.vertices_m, fine.normals) - 1
    assert np.sqrt((error**2).mean()) < 0.03
    # The two sides of a thin slab are no neighbours.
    slab = trimesh.creation.box(extents=(1.0, 1.0, 0.004)).subdivide().subdivide().subdivide().subdivide()
    monkeypatch.setattr(lit_meshes, "MOST_RECEIVERS", 256)
    sides = lit_mesh.__wrapped__(Mesh("slab", np.array(slab.vertices), np.array(slab.faces)), 0.2)
    large = np.abs(sides.normals[:, 2]) > 0.9
    assert len(sides.receivers_m) <= 256 < large.sum()
    np.testing.assert_allclose(
        sides.lit_by(lambda points, normals: normals[:, 2])[large], sides.normals[large, 2], atol=0.02
    )


# ---- renders ---------------------------------------------------------------------------------------------------------

SENSOR = ImageSensor(550.0, 0.5, 4.0, 10_000.0, 6.0, 12, 64)


@pytest.mark.render
def test_a_box_and_its_mesh_look_the_same(mi):
    camera = PTZCamera((1.3, 1.2, 2.0), 0, 0, zoom=1.5, focus_distance_m=2.5, resolution=(96, 72), pixel_pitch_m=6e-5)
    camera = camera.aimed_at((-0.6, -0.6, 0.5))
    images = []
    for shape in (BOX, box_mesh(BOX)):
        state = room(shape)
        renderer = Renderer(state, lit_scene.bake(state, solve_radiosity(state)), backend.choose())
        images.append(renderer.render(renderer.request(camera, SENSOR, Sampling())))
    np.testing.assert_allclose(images[0].depth_m, images[1].depth_m, rtol=1e-5)
    differ = np.abs(images[1].radiance / images[0].radiance - 1)
    print(f"median {np.median(differ):.4f}, 95 %: {np.percentile(differ, 95):.4f}")
    assert np.median(differ) < RADIANCE_MEDIAN
    assert np.percentile(differ, 95) < RADIANCE_95


class EvenLight:
    """Stands in for the solved light where only geometry is asked."""

    def irradiance(self, points_m, normals):
        return np.ones(len(points_m))


@pytest.mark.render
def test_what_the_prediction_hides_is_not_in_the_render(mi):
    """Markers of the shipped workshop, in the layer of marker numbers of all its cameras."""
    scene = scenes.load(WORKSHOP)
    state = scene.state
    renderer = Renderer(state, lit_scene.bake(state, EvenLight()), backend.choose())
    numbers, compared, hidden = np.array([marker.id for marker in state.markers]), 0, 0
    for camera in scene.cameras:
        small = dataclasses.replace(camera, resolution=(480, 360), pixel_pitch_m=4.65e-6 * 1280 / 480)
        seen = visible_points([small], state.points_m, state.normals, state.occluders)[0]
        layer = renderer.render(renderer.request(small, scene.sensor, Sampling())).marker_id
        cosine = small.cos_incidence(state.points_m, state.normals)
        fair = small.in_frustum(state.points_m) & (np.abs(cosine) > GRAZING)
        x, y = np.rint(small.project(state.points_m)[0]).astype(int).T
        shown = layer[np.where(fair, y, 0), np.where(fair, x, 0)] == numbers
        np.testing.assert_array_equal(shown[fair], seen[fair])
        compared += fair.sum()
        alone = visible_points([small], state.points_m, state.normals, state.occluders[:1])[0]
        hidden += (fair & alone & ~seen).sum()
    assert compared > 60
    assert hidden >= 1  # by the stool, where the figure itself does not


def test_the_state_key_changes_with_one_vertex():
    mesh = box_mesh(BOX)
    moved = mesh.vertices_m.copy()
    moved[3, 1] += 1e-9
    keys = {state_key(room(body)) for body in (mesh, dataclasses.replace(mesh, vertices_m=moved))}
    assert len(keys) == 2
    assert state_key(room(mesh)) == state_key(room(box_mesh(BOX)))
    assert mesh == box_mesh(BOX) != dataclasses.replace(mesh, vertices_m=moved)
