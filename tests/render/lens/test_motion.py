"""Motion blur: what moves while the shutter is open is smeared along its way, and nothing is lost or shifted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import scenes
from pss import ImageSensor, PTZCamera, Rectangle
from render import backend
from render.lens import motion
from render.lens.motion import MOST_INSTANTS, SHARE_OF_CONTRAST, instants, moved, over_shutter
from render.lens.sampling import Sampling
from render.light import lit_scene
from render.light.radiosity import solve_light
from render.renderer import Renderer
from render.world.state import Light, Marker, MarkerPrint, Motion, Room, SceneObject, SceneState
from scenes import SceneError
from tests.conftest import ROOM_FILE
from tests.helpers.views import centroid, variance

ROUNDING = 1e-9
EXPOSURE_MS = 10.0
SENSOR = ImageSensor(550.0, 0.5, EXPOSURE_MS, 10_000.0, 6.0, 12, 64)
# A board of 0.1 m, 4 m away, is 20 px wide; black all around, so that moments of the image are those of the board.
CAMERA = PTZCamera((0, -3, 1.5), 0, 0, zoom=4, focus_distance_m=4, f_number=8, resolution=(320, 240))
BOARD = Rectangle("board", (0.0, 1.0, 1.5), 0.1, 0.1, facing_deg=180.0)
MARKER = Marker(0, "board", (0.0, 0.999, 1.5), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), 0.002)
# Relative, of the light; px, of the centre; px², of the variance: the sampling noise (measured: 2e-4, 0.002, 0.012).
LIGHT, CENTRE_PX, SPREAD_PX2 = 1e-3, 0.01, 0.05


def state_of(item: SceneObject) -> SceneState:
    """A board with a small marker in a black room, lit by the camera's own light."""
    style = MarkerPrint("DICT_4X4_100", 1.0, 0.6, 0.6)
    return SceneState(Room(6, 6, 3, 0, 0, 0), Light(0, (), 40.0), (item,), (MARKER,), style)


@pytest.fixture(scope="module")
def image(mi):
    """Radiance of the board as it moves, with its pixels' coordinates."""

    def render(how: Motion | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        state = state_of(SceneObject(BOARD, 0.6, how))
        renderer = Renderer(state, lit_scene.bake(state, solve_light(state)), backend.choose())
        view = renderer.render(renderer.request(CAMERA, SENSOR, Sampling(noise_ratio=0.1)))
        y, x = np.mgrid[:240, :320].astype(float)
        return view.radiance.astype(float), x, y

    return render


@pytest.mark.render
@pytest.mark.parametrize(("velocity", "axis"), [((6.0, 0, 0), 0), ((0, 0, -3.0), 1)])
def test_a_moving_board_is_smeared_along_its_way(image, velocity, axis):
    """The image's second moment along a way of L px has a part of L²/12; the light and the centre stay."""
    half = tuple(part / 2 for part in velocity)
    still, slow, fast = (image(how) for how in (None, Motion(half), Motion(velocity)))
    way = np.linalg.norm(velocity) * EXPOSURE_MS * 1e-3 * CAMERA.focal_px / 4.0
    assert way > 5
    for moving in (slow, fast):
        assert moving[0].sum() == pytest.approx(still[0].sum(), rel=LIGHT)
        np.testing.assert_allclose(centroid(*moving), centroid(*still), atol=CENTRE_PX)
    # From half the way to all of it: a sharp edge's own moment depends on where in a pixel it falls.
    expected = np.zeros(2)
    expected[axis] = way**2 / 12 * 3 / 4
    np.testing.assert_allclose(variance(*fast) - variance(*slow), expected, atol=SPREAD_PX2)


@pytest.mark.render
def test_a_turning_board_keeps_its_middle_and_blurs_its_corners(image):
    """About its own middle: the centre of the light stays; the corners, which travel, are neither black nor white."""
    turning = image(Motion(turn_rate_deg_per_s=(0.0, 3000.0, 0.0), about_m=BOARD.centre_m))
    still = image(None)
    np.testing.assert_allclose(centroid(*turning), centroid(*still), atol=CENTRE_PX)
    bright = still[0].max()
    half_lit = [((0.02 * bright < part) & (part < 0.8 * bright)).sum() for part in (still[0], turning[0])]
    assert half_lit[1] > half_lit[0] + 50


def test_velocities_are_carried_to_vertices_and_plates():
    """`moved` by hand: a turn of 90° a second about z, and a metre along x, for half a second."""
    how = Motion((1.0, 0.0, 0.0), (0.0, 0.0, 90.0), (0.0, 0.0, 0.0))
    state = state_of(SceneObject(BOARD, 0.6, how))
    meshes = lit_scene.bake(state, solve_light(state))
    later = moved(meshes, state, 0.5)
    turn = np.array([(1, -1, 0), (1, 1, 0), (0, 0, 2**0.5)]) / 2**0.5
    for name, owners in (("vertices_m", meshes.vertex_objects), ("plates_m", meshes.plate_objects)):
        before, after = getattr(meshes, name), getattr(later, name)
        np.testing.assert_allclose(after[owners == 0], before[owners == 0] @ turn.T + (0.5, 0, 0), atol=ROUNDING)
        np.testing.assert_array_equal(after[owners < 0], before[owners < 0])
    # The plate's back goes with its front.
    assert (meshes.vertex_objects == 0).sum() == len(later.vertices_m) - (meshes.vertex_objects < 0).sum() >= 8 + 4
    np.testing.assert_array_equal(moved(meshes, state, 0.0).plates_m, meshes.plates_m)


def test_instants_are_the_middles_of_equal_parts():
    """A power of two of them, as many as the way in the image asks for, symmetric about the middle of the exposure."""
    np.testing.assert_array_equal(instants(0.0, 0.01), [0.0])
    for travel in (0.15, 0.4, 3.0, 500.0):
        times = instants(travel, 0.01)
        assert len(times) & (len(times) - 1) == 0
        assert len(times) == MOST_INSTANTS or travel / (8 * len(times) ** 2) <= SHARE_OF_CONTRAST
        np.testing.assert_allclose(times, -times[::-1], atol=ROUNDING)
        np.testing.assert_allclose(np.diff(times), 0.01 / len(times), rtol=ROUNDING)


@pytest.mark.parametrize("count", [4, 16, 64])
def test_samples_are_shared_among_the_instants(count):
    """Mean and variance are those of all samples together, with more samples than instants or fewer."""
    drawn = []

    def at_level(level: float):
        def sampler(pixels, number, rng):
            values = level + rng.standard_normal((len(pixels), number))
            drawn.append(values)
            spread = values.var(axis=1, ddof=1) if number > 1 else np.zeros(len(pixels))
            return values.mean(axis=1), spread

        return sampler

    shared = over_shutter([at_level(level) for level in range(16)])
    mean, spread = shared(np.arange(50, dtype=np.uint32), count, np.random.default_rng(1))
    together = np.concatenate(drawn, axis=1)
    assert together.shape == (50, count)
    assert len(drawn) == min(count, 16)
    np.testing.assert_allclose(mean, together.mean(axis=1), rtol=1e-5)
    np.testing.assert_allclose(spread, together.var(axis=1, ddof=1), rtol=1e-4)


def test_what_does_not_move_in_the_image_needs_one_scene():
    """A camera that sees nothing of the motion pays nothing for it."""
    state = state_of(SceneObject(BOARD, 0.6, Motion(velocity_m_per_s=(0.0, 1e-3, 0.0))))
    meshes = lit_scene.bake(state, solve_light(state))
    assert motion.travel_px(meshes, state, CAMERA, EXPOSURE_MS * 1e-3) < 8 * SHARE_OF_CONTRAST
    away = dataclasses.replace(CAMERA, pan_deg=180.0)
    fast = state_of(SceneObject(BOARD, 0.6, Motion(velocity_m_per_s=(4.0, 0.0, 0.0))))
    assert motion.travel_px(meshes, fast, away, EXPOSURE_MS * 1e-3) == 0
    assert motion.travel_px(meshes, fast, CAMERA, EXPOSURE_MS * 1e-3) == pytest.approx(8.05, rel=2e-3)


def test_the_scene_file_says_what_moves():
    """Velocity in m/s; spin as a camera pans, from +y to +x, about the shape's middle."""
    scene = scenes.load(ROOM_FILE, ["objects.ball.velocity_m_per_s=[0, 1.5, 0]", "objects.board.spin_deg_per_s=90"])
    how = {item.shape.name: item.motion for item in scene.state.objects}
    ball, board = (next(o.shape for o in scene.state.objects if o.shape.name == name) for name in ("ball", "board"))
    assert how["ball"] == Motion((0.0, 1.5, 0.0), (0.0, 0.0, 0.0), ball.centre_m)
    assert how["board"] == Motion((0.0, 0.0, 0.0), (0.0, 0.0, -90.0), board.centre_m)
    assert all(item.motion is None for item in scenes.load(ROOM_FILE).state.objects)
    with pytest.raises(SceneError, match=r"velocity_m_per_s.*allowed: \[x, y, z\], in metres per second"):
        scenes.load(ROOM_FILE, ["objects.ball.velocity_m_per_s=1.5"])
