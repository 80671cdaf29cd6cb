"""The ring light: D² and cos α, in the render and in the prediction; the scene file's switch."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import scenes
from pss import Appearance, PTZCamera, RangeError, evaluate
from render import backend
from render.lens import thin_lens
from render.lens.sampling import RingLight, Sampling, pixel_means, sample_image
from render.light import lit_scene
from render.light.radiosity import UnitLight, solve_light
from render.renderer import Renderer
from render.world.state import Light, MarkerPrint, Panel, Room, SceneState
from scenes import SceneError
from tests.helpers.scene_texts import ROOM

pytestmark = pytest.mark.render

# Relative: the law holds at a point, and a window of pixels spans a little of D and α; sampling adds less.
LAW = 2e-3
INTENSITY = 0.4
ALBEDO = 0.5


def bare_room() -> SceneState:
    room = Room(width_m=8, length_m=8, height_m=3, wall_albedo=ALBEDO, floor_albedo=0.3, ceiling_albedo=0.7)
    return SceneState(room, Light(0.0, (), INTENSITY), (), (), MarkerPrint("DICT_4X4_50", 1.0, 0.9, 0.05))


@pytest.fixture(scope="module")
def wall(mi):
    """A bare room under ring lights, loaded."""
    state = bare_room()
    return lit_scene.load_scene(lit_scene.bake(state, solve_light(state)), mi)


def radiance_ahead(mi, scene, camera):
    ring = RingLight(camera.position_m, INTENSITY)
    sampler = pixel_means(scene, thin_lens.load_sensor(camera, mi), mi, None, ring)
    image = sample_image(
        sampler, camera.resolution, lambda x: np.ones_like(x), Sampling(fewest=64, most=64), np.random.default_rng(0)
    )
    return float(image.mean.mean())


def small(position, pan_deg=0.0):
    return PTZCamera(position, pan_deg, 0, zoom=8, resolution=(8, 6), pixel_pitch_m=1e-5, widest_fov_deg=4.0)


@pytest.mark.parametrize("distance_m", [1.0, 2.0, 3.5, 7.0])
def test_light_falls_with_the_square_of_the_distance(mi, wall, distance_m):
    """ρ/π · I/D² on a wall straight ahead."""
    found = radiance_ahead(mi, wall, small((0, 4 - distance_m, 1.5)))
    assert found == pytest.approx(ALBEDO / math.pi * INTENSITY / distance_m**2, rel=LAW)


@pytest.mark.parametrize("turn_deg", [0, 20, 45, 60])
def test_light_falls_with_the_cosine_of_incidence(mi, wall, turn_deg):
    """Looking at the wall askew: cos α/D² with D = 2/cos α."""
    turn = math.radians(turn_deg)
    found = radiance_ahead(mi, wall, small((-1.5, 2.0, 1.5), turn_deg))
    expected = ALBEDO / math.pi * INTENSITY * math.cos(turn) ** 3 / 4
    assert found == pytest.approx(expected, rel=LAW + 0.01 * math.tan(turn))


def test_prediction_and_render_have_the_same_light(mi):
    """The radiance that the noise factor reckons with, from `glow.appearance`, is that of the rendered plate."""
    room = scenes.load(Path(__file__).parents[3] / "scenes" / "room.toml")
    state = dataclasses.replace(room.state, light=Light(0.0, (), INTENSITY))
    meshes = lit_scene.bake(state, solve_light(state))
    renderer = Renderer(state, meshes, backend.choose())
    camera = dataclasses.replace(room.camera("4"), resolution=(640, 480), pixel_pitch_m=9.3e-6)
    view = renderer.render(renderer.request(camera, room.sensor, Sampling()))
    target_appearance = lit_scene.appearance(state, meshes)
    assert target_appearance.ring_light
    compared = 0
    for index, marker in enumerate(state.markers):
        point = np.array(marker.centre_m)
        seen = evaluate([camera], [point], [marker.normal], occluder=state.occluders).visible.all()
        corner = point + 3.6 * marker.module_m * (marker.right + np.array(marker.up))  # in the quiet zone
        x, y = np.round(camera.project(corner)[0]).astype(int)
        sharp = camera.cos_incidence(point, marker.normal) > 0.6
        if seen and sharp and 0 <= x < 640 and 0 <= y < 480 and view.marker_id[y, x] == marker.id:
            d = camera.range_m(corner)
            expected = target_appearance.white_w_per_m2_sr[index] * camera.cos_incidence(corner, marker.normal) / d**2
            found = float(view.radiance[y, x])
            if found > 0.9 * expected:  # not on an edge
                assert found == pytest.approx(float(expected), rel=0.02)
                compared += 1
    assert compared >= 8


def test_the_noise_factor_knows_the_ring(mi):
    """Twice as far is a quarter of the light: in the dim, four times the noise and more."""
    camera = PTZCamera((0, 0, 1), 0, 0, zoom=8, focus_distance_m=3)
    normal = [[0, -1.0, 0]]
    near, far = np.array([[0.0, 3, 1]]), np.array([[0.0, 6, 1]])
    target_appearance = Appearance(0.02, 0.01, 0.001, ring_light=True)
    for point, share in ((near, 1 / 9), (far, 1 / 36)):
        lit = evaluate([camera], point, normal, noise="physical", appearance=target_appearance).noise_px2
        same = Appearance(0.02, 0.01 * share, 0.001 * share)
        np.testing.assert_allclose(
            lit, evaluate([camera], point, normal, noise="physical", appearance=same).noise_px2, rtol=1e-9
        )


def test_the_scene_file_switches_the_light(tmp_path):
    lines = ROOM.splitlines()
    start = lines.index("[light]")
    end = next(i for i in range(start + 1, len(lines)) if lines[i].startswith("["))
    ring = lines[: start + 1] + ['kind = "ring"', "ring_w_per_sr = 0.4", ""] + lines[end:]
    (tmp_path / "ring.toml").write_text("\n".join(ring))
    scene = scenes.load(tmp_path / "ring.toml")
    assert scene.state.light == Light(0.0, (), 0.4)
    assert isinstance(solve_light(scene.state), UnitLight)
    (tmp_path / "both.toml").write_text("\n".join(ring).replace('"ring"', '"ambient"', 1))
    with pytest.raises(SceneError) as caught:
        scenes.load(tmp_path / "both.toml")
    text = str(caught.value)
    assert 'light.ring_w_per_sr = 0.4; allowed: not beside kind = "ambient"' in text
    assert "light.panels is missing; allowed: at least one" in text
    assert "light.radiance_w_per_m2_sr is missing; allowed: a number above 0" in text


def test_a_state_has_one_kind_of_light():
    with pytest.raises(RangeError, match="allowed: one of the two"):
        Light(0.2, (Panel((0.0, 0.0), (1.0, 1.0)),), 0.4)
