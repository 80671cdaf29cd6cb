"""Mitsuba files as backdrops: what is read agrees with Mitsuba's own reading, and what is not is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh

import scenes
from pss import GeometryError, RangeError
from render.keys import state_key
from render.world.backdrop import read_backdrop
from scenes import SceneError

WORKSHOP = Path(__file__).parents[3] / "scenes" / "workshop.toml"
# Mitsuba keeps single precision, of places within some ten metres.
SINGLE_M = 1e-5
# An icosphere of 1280 faces lies within this part of the radius under the ball.
BALL_SHARE = 0.004

TRANSFORMS = {
    "nothing": "",
    "translate": '<translate x="1" y="-2" z="0.5"/>',
    "scale": '<scale x="0.5" y="2" z="1.5"/>',
    "one scale for all": '<scale value="0.3"/>',
    "rotate": '<rotate x="0.48" y="0.6" z="-0.64" angle="40"/>',
    "in order": '<translate value="1, 0, 0"/><rotate z="1" angle="90"/><scale y="2"/>',
    "matrix": '<matrix value="0 -1 0 3  2 0 0 0  0 0 1 -1  0 0 0 1"/>',
    "lookat": '<lookat origin="1, 2, 3" target="0, 0.5, 1" up="0, 0, 1"/>',
    "mirror": '<scale x="-1"/><translate z="2"/>',
}


PLACE = '<transform name="to_world">'


def scene(*content: str) -> str:
    return f'<scene version="3.0.0">{"".join(content)}</scene>'


def write(folder: Path, *content: str) -> Path:
    path = folder / "room.xml"
    path.write_text(scene(*content))
    return path


def shape(kind: str, inside: str = "") -> str:
    return f'<shape type="{kind}">{inside}</shape>'


def rays_from_outside(mesh, count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """From a sphere about the shape, towards places within its box: origins and unit directions, (N, 3)."""
    rng = np.random.default_rng(5)
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    away = rng.normal(size=(count, 3))
    origins = (low + high) / 2 + 2 * np.linalg.norm(high - low) * away / np.linalg.norm(away, axis=1, keepdims=True)
    ways = rng.uniform(low, high, (count, 3)) - origins
    return origins, ways / np.linalg.norm(ways, axis=1, keepdims=True)


def first_hit(mesh, origins: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Metres along each ray, inf for none: every triangle by itself, as three equations."""
    nearest = np.full(len(origins), np.inf)
    for a, b, c in mesh.corners_m:
        with np.errstate(all="ignore"):
            inverse = np.linalg.pinv(np.stack([ways, *np.broadcast_arrays(a - b + 0 * ways, a - c + 0 * ways)], -1))
            t, u, v = (inverse @ (a - origins)[..., None])[..., 0].T
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        nearest = np.where(hit, np.minimum(nearest, t), nearest)
    return nearest


def grazing(mesh, ways: np.ndarray) -> np.ndarray:
    """Whether a ray is nearly in the plane of any face, where single precision is far off."""
    return (np.abs(ways @ mesh.face_normals.T) < 0.05).any(axis=1)


@pytest.mark.render
@pytest.mark.parametrize("kind", ["rectangle", "cube", "disk"])
@pytest.mark.parametrize("name", TRANSFORMS)
def test_a_shape_is_where_mitsuba_puts_it(kind, name, mi, tmp_path):
    """Mitsuba reads the same file; its rays meet the shape where rays meet the triangles that were read."""
    path = write(tmp_path, shape(kind, f'<transform name="to_world">{TRANSFORMS[name]}</transform>'))
    mesh = read_backdrop(path).parts[0].shape
    loaded = mi.load_file(str(path))
    box = loaded.bbox()
    margin = 0.01 * np.ptp(mesh.vertices_m) if kind == "disk" else SINGLE_M  # the disk is drawn with 64 corners
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), np.array(box.min).ravel(), atol=margin)
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), np.array(box.max).ravel(), atol=margin)
    origins, ways = rays_from_outside(mesh)
    rays = mi.Ray3f(mi.Point3f(*origins.T), mi.Vector3f(*ways.T))
    theirs = np.ravel(np.array(loaded.ray_intersect(rays).t))
    ours = first_hit(mesh, origins, ways)
    both = np.isfinite(theirs) & np.isfinite(ours) & ~grazing(mesh, ways)
    assert both.sum() > 20
    # Rays that pass a rim within rounding (or the disk's corners) may hit for one and miss for the other.
    assert (np.isfinite(theirs) != np.isfinite(ours)).mean() <= 0.02
    np.testing.assert_allclose(ours[both], theirs[both], rtol=1e-4)


@pytest.mark.render
def test_a_sphere_and_meshes_are_where_mitsuba_puts_them(mi, tmp_path):
    trimesh.creation.icosphere(subdivisions=1, radius=0.5).export(tmp_path / "ball.ply")
    trimesh.creation.box(extents=(1, 2, 3)).export(tmp_path / "box.obj")
    place = '<transform name="to_world"><scale value="2"/><translate x="3"/></transform>'
    contents = (
        shape("sphere", '<point name="center" x="1" y="2" z="3"/><float name="radius" value="0.5"/>' + place),
        shape("ply", '<string name="filename" value="ball.ply"/>' + place),
        shape("obj", '<string name="filename" value="box.obj"/>' + place),
    )
    for content, margin in zip(contents, (BALL_SHARE, SINGLE_M, SINGLE_M), strict=True):
        path = write(tmp_path, content)
        mesh, box = read_backdrop(path).parts[0].shape, mi.load_file(str(path)).bbox()
        np.testing.assert_allclose(mesh.vertices_m.min(axis=0), np.array(box.min).ravel(), atol=margin)
        np.testing.assert_allclose(mesh.vertices_m.max(axis=0), np.array(box.max).ravel(), atol=margin)


DARK = '<float name="reflectance" value="0.1"/>'


def diffuse(reflectance: str) -> str:
    return shape("cube", f'<bsdf type="diffuse">{reflectance}</bsdf>')


@pytest.mark.parametrize(
    ("content", "albedo"),
    [
        (diffuse(""), 0.5),
        (shape("cube"), 0.5),
        (diffuse('<rgb name="reflectance" value="0.2, 0.2, 0.2"/>'), 0.2),
        (diffuse('<rgb name="reflectance" value="0.1, 0.5, 0.9"/>'), 0.1 * 0.2126 + 0.5 * 0.7152 + 0.9 * 0.0722),
        (diffuse('<rgb name="reflectance" value="#808080"/>'), 0.2158605),
        (diffuse('<spectrum name="reflectance" value="0.7"/>'), 0.7),
        (diffuse('<spectrum name="reflectance" value="400:0.2, 600:0.4, 700:0.4"/>'), (0.3 * 200 + 0.4 * 100) / 300),
        (diffuse('<texture type="checkerboard" name="reflectance"/>'), 0.3),
        (shape("cube", f'<bsdf type="twosided"><bsdf type="diffuse">{DARK}</bsdf></bsdf>'), 0.1),
        (f'<bsdf type="diffuse" id="a">{DARK}</bsdf>' + shape("cube", '<ref id="a"/>'), 0.1),
        ('<default name="r" value="0.9"/>' + diffuse('<rgb name="reflectance" value="$r"/>'), 0.9),
    ],
)  # fmt: skip
def test_diffuse_reflectance(content, albedo, tmp_path):
    backdrop = read_backdrop(write(tmp_path, content))
    assert backdrop.parts[0].albedo == pytest.approx(albedo, rel=1e-6)
    assert backdrop.warnings == ()


@pytest.mark.parametrize(("raw", "albedo"), [("false", 0.2158605 / 2), ("true", 128 / 255 / 2)])
def test_the_mean_of_a_bitmap(raw, albedo, tmp_path):
    """Half black, half 128 of 255, which sRGB decodes to 0.2159."""
    pixels = np.zeros((4, 4, 3), dtype=np.uint8)
    pixels[:2] = 128
    image = oiio.ImageBuf(oiio.ImageSpec(4, 4, 3, "uint8"))
    image.set_pixels(oiio.ROI(), pixels)
    image.write(str(tmp_path / "wood.png"))
    inside = f'<string name="filename" value="wood.png"/><boolean name="raw" value="{raw}"/>'
    content = diffuse(f'<texture type="bitmap" name="reflectance">{inside}</texture>')
    assert read_backdrop(write(tmp_path, content)).parts[0].albedo == pytest.approx(albedo, rel=1e-3)


def test_what_is_passed_over_or_guessed_is_one_line_each(tmp_path):
    lamp = shape("rectangle", '<emitter type="area"><rgb name="radiance" value="5"/></emitter>')
    metal = '<shape type="cube" id="kettle"><bsdf type="conductor"/></shape>'
    path = write(
        tmp_path, lamp, metal, shape("hair"), shape("hair"), "<include filename='a.xml'/>", "<integrator type='path'/>",
        "<emitter type='envmap'/>", diffuse('<texture type="bitmap" name="reflectance"/>'),
    )  # fmt: skip
    backdrop = read_backdrop(path)
    assert len(backdrop.parts) == 3
    emitters, passed, guessed = backdrop.warnings
    assert "2 emitters give no light" in emitters
    assert '2 × shape "hair", include' in passed
    assert "integrator" not in passed
    assert "albedo 0.5 taken for kettle, cube 3" in guessed


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("<scene><shape></scene>", RangeError, "no XML"),
        ("<html/>", RangeError, "root is <html>"),
        (scene(), GeometryError, "no shape"),
        (scene(shape("ply", '<string name="filename" value="no.ply"/>')), RangeError, "no.ply"),
        (scene(shape("cube", f'{PLACE}<matrix value="1 2 3"/></transform>')), RangeError, "3 numbers"),
        (scene(shape("cube", f'{PLACE}<bend x="1"/></transform>')), RangeError, "<bend>"),
        (scene(shape("cube", f'{PLACE}<scale x="a"/></transform>')), RangeError, "number is wrong"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_read_is_one_clear_error(text, error, message, tmp_path):
    path = tmp_path / "room.xml"
    path.write_text(text)
    with pytest.raises(error, match=message) as caught:
        read_backdrop(path)
    assert "\n" not in str(caught.value)


# ---- in a scene ------------------------------------------------------------------------------------------------------


def in_scene(folder: Path, backdrop: str, keys: str = ""):
    (folder / "room.xml").write_text(backdrop)
    text = (Path(__file__).parents[3] / "scenes" / "room.toml").read_text()
    path = folder / "scene.toml"
    path.write_text(f'{text}\n[backdrop]\nfile = "room.xml"\n{keys}\n')
    return scenes.load(path)


def test_a_backdrop_hides_and_counts_in_the_state_by_its_content(tmp_path):
    cube = f'<shape type="cube" id="crate">{PLACE}<scale value="0.2"/><translate z="{{z}}"/></transform></shape>'
    first, second = (in_scene(tmp_path, scene(cube.format(z=z))) for z in (2.0, 2.1))
    assert first.state.occluders[-1].name == "backdrop crate"
    assert first.state.occluders[-1].blocks(np.array([1.0, 0, 2]), np.array([-1.0, 0, 2]))
    assert state_key(first.state) != state_key(second.state)
    assert state_key(first.state) == state_key(in_scene(tmp_path, scene(cube.format(z="2.00"))).state)


def test_a_backdrop_with_y_up_in_centimetres_is_turned_and_scaled(tmp_path):
    """(x, y, z) of the file becomes (x, −z, y); then turned as cameras pan: +y to +x."""
    place = '<transform name="to_world"><translate x="50" y="100" z="-20"/></transform>'
    loaded = in_scene(
        tmp_path, scene(shape("cube", place)), 'up = "y"\nscale = 0.01\nturn_deg = 90\nposition_m = [0, 0, 1]'
    )
    centre = loaded.state.objects[-1].shape.vertices_m.mean(axis=0)
    np.testing.assert_allclose(centre, (0.2, -0.5, 2.0), atol=1e-9)


def test_a_backdrop_in_millimetres_is_hinted_at_and_one_beyond_the_walls_warned_of(tmp_path):
    wide = shape("cube", '<transform name="to_world"><scale value="1000"/></transform>')
    with pytest.raises(SceneError) as caught:
        in_scene(tmp_path, scene(wide))
    assert "2000 m wide: in millimetres? scale = 0.001" in str(caught.value)
    outside = '<shape type="cube" id="shed"><transform name="to_world"><translate x="4.1"/></transform></shape>'
    (warning,) = in_scene(tmp_path, scene(outside)).warnings
    assert warning.endswith('backdrop.file = "room.xml"; outside the room, and hidden by its walls: shed')


def test_a_missing_backdrop_is_told_with_all_other_mistakes():
    with pytest.raises(SceneError) as caught:
        scenes.load(WORKSHOP, ["backdrop.file=no.xml", "backdrop.up=x", "cameras.1.zoom=99"])
    assert len(caught.value.problems) == 2
    with pytest.raises(SceneError) as caught:
        scenes.load(WORKSHOP, ["backdrop.file=no.xml"])
    (problem,) = caught.value.problems
    assert (
        'backdrop.file = "no.xml" (override); allowed: a Mitsuba scene (XML) with shapes; there is no such file'
        in problem
    )
