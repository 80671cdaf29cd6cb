"""Motion in the prediction: an edge smeared by an even way against its own bound, and velocities by hand."""

from __future__ import annotations

import csv
import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

import pss
from pss import Appearance, ImageSensor, Legible, PTZCamera, RangeError, Rectangle, ShapeError
from pss.cameras.views import Views
from pss.noise.blur import edge_blur, sensors_of, way_across_px, way_px
from pss.noise.factors import Defocus
from pss.visibility.targets import blur_modules
from render import backend
from render.lens.motion import moved
from render.lens.sampling import Sampling
from render.light import lit_scene
from render.light.radiosity import solve_light
from render.random_streams import random_stream
from render.renderer import RenderedView, Renderer
from render.sensor import capture, expected_electrons, fixed_pattern
from render.world.state import Light, Marker, MarkerPrint, Motion, Room, SceneObject, SceneState
from validate.markers.detector import Targets
from validate.markers.view_measurement import measure_capture
from validate.pixel_noise.laboratory import DICTIONARY, DISTANCE_M, FOCAL_PX, Factors, Pose, Setup

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "results" / "reference" / "exposure-motion"

ROUNDING = 1e-9
# A Gaussian of the same second moment in place of a box: an edge's variance is at most 4.3 % too low, where the way is
# eight times the blur, and 2.3 % where it is all there is. Of the rest, 1 % is the noise of the two sides, of which
# the closed form takes the mean, and the pixels.
GAUSSIAN_FOR_BOX = 0.05
# Relative, of σ over CAPTURES (1/√(2·CAPTURES) is 0.07) and of a localisation that is not told of motion (measured:
# 16 % too much along the way, 12 % too little across it).
CAPTURES, MEASURED = 100, 0.3
# Relative, of the spread of TRIALS estimates (1/√(2·TRIALS) is 0.016) and of the closed form.
TRIALS, OF_TRIALS = 2000, 0.08
SENSOR = ImageSensor()
CAMERA = PTZCamera((0, 0, 1), 0, 0, zoom=4, focus_distance_m=3)
POINT, NORMAL = np.array([[0.0, 3.0, 1.0]]), np.array([[0.0, -1.0, 0.0]])
LOOK = Appearance(0.015, 0.05, 0.006, np.array([[1.0, 0.0, 0.0]]))
HALF_PX, LENGTH_PX = 40, 10
WHITE_E, BLACK_E = 300.0, 200.0


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def edge(at_px: float, blur_px: float, way: float) -> np.ndarray:
    """Electrons in a row of pixels across an edge: a Gaussian, a pixel and a way, each by its own integral."""
    centres = np.arange(-HALF_PX, HALF_PX + 1.0) - at_px
    inside = (np.arange(16) + 0.5) / 16 - 0.5
    instants = (np.arange(64) + 0.5) / 64 - 0.5 if way else np.zeros(1)
    places = centres[:, None, None] + inside[:, None] + way * instants
    return BLACK_E + (WHITE_E - BLACK_E) * ndtr(places / blur_px).mean(axis=(1, 2))


def predicted_px2(blur_px: float, way: float, angle: float) -> float:
    """px², an edge at an `angle` to the way that goes `way` px across it: 2√π·s·σ_e²/(Δ²·ℓ)."""
    side = np.array([[[math.sin(angle)], [-math.cos(angle)]]])
    whole = np.array([[[way / math.cos(angle)], [0.0]]]) if way else np.zeros((1, 2, 1))
    s = float(edge_blur(np.full((1, 1), math.sqrt(blur_px**2 + 1 / 12)), side, whole).across[0, 0])
    noise = float(SENSOR.noise_electrons(np.array((WHITE_E + BLACK_E) / 2))) ** 2
    return 2 * math.sqrt(math.pi) * s * noise / ((WHITE_E - BLACK_E) ** 2 * LENGTH_PX)


@pytest.mark.parametrize("blur_px", [0.7, 1.5])
@pytest.mark.parametrize("way", [0.0, 0.5, 1.5, 3.0, 6.0, 20.0])
@pytest.mark.parametrize("angle", [0.0, 0.6, 1.2])
def test_an_edge_is_known_as_well_as_the_bound_of_its_pixels(blur_px, way, angle):
    """The Fisher information of every pixel with its own noise, drawn with an even way."""
    step = 1e-3
    slope = (edge(step, blur_px, way) - edge(-step, blur_px, way)) / (2 * step)
    variance = SENSOR.noise_electrons(edge(0.0, blur_px, way)) ** 2
    bound = 1 / (LENGTH_PX * (slope**2 / variance).sum())
    assert predicted_px2(blur_px, way, angle) == pytest.approx(bound, rel=GAUSSIAN_FOR_BOX)


@pytest.mark.parametrize(("way", "share"), [(0.0, 1.0), (3.0, 2.0), (3.0, 0.5)])
def test_estimates_of_an_edge_scatter_as_predicted(way, share):
    """Noisy edges, found by least squares with the right profile; an exposure of twice the time goes twice the way."""
    rng, true = np.random.default_rng(5), edge(0.0, 1.0, way * share)
    sigma = SENSOR.noise_electrons(true)
    step = 1e-3
    slope = (edge(step, 1.0, way * share) - edge(-step, 1.0, way * share)) / (2 * step)
    noisy = rng.poisson(np.tile(true, (TRIALS * LENGTH_PX, 1))) + rng.normal(
        0, np.sqrt(sigma**2 - true), (TRIALS * LENGTH_PX, len(true))
    )
    residual = (noisy - true).reshape(TRIALS, LENGTH_PX, -1).sum(axis=1)
    found = (residual * slope / sigma**2).sum(axis=1) / (LENGTH_PX * (slope**2 / sigma**2).sum())
    assert found.std() == pytest.approx(math.sqrt(predicted_px2(1.0, way * share, 0.3)), rel=OF_TRIALS)


def test_the_blur_of_an_edge_by_hand():
    """Along the way 0.8² + 3²/12, across it 0.8² alone; askew both, of the same determinant."""
    still = np.full((1, 1), 0.8)
    way = np.array([[[3.0], [0.0]]])
    upright, level, askew = (
        edge_blur(still, np.array([[[x], [y]]]), way) for x, y in ((0.0, 2.0), (5.0, 0.0), (1.0, 1.0))
    )
    longest = math.sqrt(0.64 + 9 / 12)
    assert (upright.across[0, 0], upright.along[0, 0]) == pytest.approx((longest, 0.8))
    assert (level.across[0, 0], level.along[0, 0]) == pytest.approx((0.8, longest))
    assert askew.across[0, 0] == pytest.approx(math.sqrt(0.64 + 9 / 24))
    assert askew.across[0, 0] * askew.along[0, 0] == pytest.approx(0.8 * longest)
    assert abs(way_across_px(np.array([[[1.0], [1.0]]]), way)[0, 0]) == pytest.approx(3 / math.sqrt(2))


def noise(velocity, camera=CAMERA, sensor=SENSOR, model="physical"):
    target_appearance = dataclasses.replace(LOOK, velocity_m_per_s=None if velocity is None else [velocity])
    return pss.noise_model(model, sensor=sensor).covariance(camera, POINT, NORMAL, target_appearance)[0]


def test_the_noise_grows_most_along_the_way():
    """Across a facing tag's motion its edges stay sharp: what their ends lose counts, and the tilt is known less."""
    rest, moving = noise(None), noise((2.0, 0.0, 0.0))
    assert moving[0, 0] / rest[0, 0] > 1.5 * moving[1, 1] / rest[1, 1] > 1.5
    upwards = noise((0.0, 0.0, 2.0))
    assert upwards[1, 1] == pytest.approx(moving[0, 0], rel=1e-6)
    slanted = noise((1.4, 0.0, 1.4))
    assert slanted[0, 0] == pytest.approx(slanted[1, 1], rel=1e-6)
    # Towards the camera nothing moves in the middle of the image.
    np.testing.assert_allclose(noise((0.0, -2.0, 0.0)), rest, rtol=1e-9)


def test_a_target_at_rest_is_the_same_to_the_bit():
    """No velocity, and one of zero; the paper's models know of no motion at all."""
    np.testing.assert_array_equal(noise((0.0, 0.0, 0.0)), noise(None))
    for model in ("as-printed", "corrected", "identity"):
        np.testing.assert_array_equal(noise((3.0, 0.0, 0.0), model=model), noise(None, model=model))


def test_the_way_is_the_difference_of_projections():
    """Half the exposure before and after, through a lens with distortion; a camera's own exposure is its own."""
    cameras = [
        dataclasses.replace(CAMERA, name=name, pan_deg=pan, radial_distortion=(-0.2, 0.0))
        for name, pan in (("short", 3.0), ("long", -3.0))
    ]
    sensors = {name: dataclasses.replace(SENSOR, exposure_ms=ms) for name, ms in (("short", 2.0), ("long", 20.0))}
    velocity = np.array([[1.0, -0.5, 0.3]])
    views = Views(cameras, POINT, NORMAL, dataclasses.replace(LOOK, velocity_m_per_s=velocity))
    way = way_px(views, sensors)
    for camera, found in zip(cameras, way, strict=True):
        half = velocity * sensors[camera.name].exposure_ms * 1e-3 / 2
        expected = camera.project(POINT + half)[0] - camera.project(POINT - half)[0]
        np.testing.assert_allclose(found[:, 0], expected[0], rtol=1e-4)
    assert [sensor.exposure_ms for sensor in sensors_of(sensors, views)] == [2.0, 20.0]
    assert way_px(Views(cameras, POINT, NORMAL, LOOK), sensors) is None


def test_an_exposure_has_a_best_length_for_what_moves():
    """At rest longer is always better; at 1.2 m/s the gain ends where the way is that of a module."""
    times = 2.0 ** np.arange(-2, 7)
    sensors = [dataclasses.replace(SENSOR, exposure_ms=ms, full_well_e=1e6, bits=16) for ms in times]
    rest = [noise(None, sensor=sensor)[0, 0] for sensor in sensors]
    moving = [noise((1.2, 0.0, 0.0), sensor=sensor)[0, 0] for sensor in sensors]
    assert (np.diff(rest) < 0).all()
    best = int(np.argmin(moving))
    assert 0 < best < len(times) - 1
    assert 0.2 < 1.2e-3 * times[best] / 0.015 < 1.0


def test_legibility_sees_motion():
    """A disc of cc has σ = cc/4 and a way of L has L/√12: the same to a detector that is told by their size."""
    velocity = np.array([[1.5, 0.0, 0.0]])
    views = Views([CAMERA], POINT, NORMAL, dataclasses.replace(LOOK, velocity_m_per_s=velocity))
    way = 1.5 * SENSOR.exposure_ms * 1e-3 * CAMERA.focal_px / 3
    module = 0.015 * CAMERA.focal_px / 3
    expected = 4 * way / math.sqrt(12) / module
    assert blur_modules(views, SENSOR)[0, 0] == pytest.approx(expected, rel=ROUNDING)
    assert blur_modules(views)[0, 0] == pytest.approx(0, abs=ROUNDING)
    for limit, passes in ((1.01 * expected, True), (0.99 * expected, False)):
        test = Legible(1.0, limit, sensor=SENSOR)
        assert test.passed(views, np.ones((1, 1), dtype=bool), ())[0, 0] == passes
    away = Views([dataclasses.replace(CAMERA, focus_distance_m=2)], POINT, NORMAL, LOOK)
    np.testing.assert_array_equal(blur_modules(away, SENSOR), blur_modules(away))
    still = dataclasses.replace(LOOK, velocity_m_per_s=np.zeros((1, 3)))
    same = Views(away.cameras, POINT, NORMAL, still)
    np.testing.assert_allclose(blur_modules(same, SENSOR), blur_modules(away), rtol=ROUNDING)
    assert Defocus().covariance(views).uu[0, 0] == pytest.approx(0, abs=ROUNDING)


def test_the_scene_says_how_fast_its_markers_move():
    """Against the places to which the renderer itself carries the plates; None where nothing moves."""
    turn, about = (30.0, -20.0, 400.0), (0.2, 0.7, 1.1)
    board = Rectangle("board", (0.0, 1.0, 1.5), 0.4, 0.4, facing_deg=180.0)
    rest = Rectangle("rest", (1.0, 1.0, 1.5), 0.4, 0.4, facing_deg=180.0)

    def state_of(motion: Motion | None) -> SceneState:
        placed = (("board", 0.1), ("rest", 1.1))
        markers = tuple(
            Marker(number, name, (x, 0.999, 1.4), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), 0.01)
            for number, (name, x) in enumerate(placed)
        )
        style = MarkerPrint("DICT_4X4_100", 1.0, 0.8, 0.1)
        things = (SceneObject(board, 0.6, motion), SceneObject(rest, 0.6))
        return SceneState(Room(6, 6, 3, 0, 0, 0), Light(0, (), 40.0), things, markers, style)

    state = state_of(Motion((1.0, -2.0, 0.5), turn, about))
    meshes = lit_scene.bake(state, solve_light(state))
    velocity = lit_scene.appearance(state, meshes).velocity_m_per_s
    step_s = 1e-5
    before, after = (moved(meshes, state, sign * step_s).plates_m.mean(axis=1) for sign in (-1, 1))
    np.testing.assert_allclose(velocity, (after - before) / (2 * step_s), atol=1e-4)
    assert not velocity[1].any()
    by_hand = Rotation.from_rotvec(np.radians(turn) * 1e-6).apply(state.points_m[0] - about) + about
    np.testing.assert_allclose(velocity[0], (by_hand - state.points_m[0]) / 1e-6 + (1.0, -2.0, 0.5), atol=1e-4)
    assert lit_scene.appearance(state_of(None), meshes).velocity_m_per_s is None


@pytest.mark.parametrize(
    ("velocity", "error", "message"),
    [
        ([1.0, 0.0, 0.0], ShapeError, r"velocity_m_per_s has shape \(3,\); allowed: \(N, 3\)"),
        ([[1.0, 0.0, math.nan]], RangeError, "velocity_m_per_s holds .*nan.*; allowed: finite, in m/s"),
        (np.zeros((2, 3)), ShapeError, r"lengths \[1, 2\]; allowed: one"),
    ],
)
def test_a_wrong_velocity_is_told(velocity, error, message):
    with pytest.raises(error, match=message):
        dataclasses.replace(LOOK, velocity_m_per_s=velocity)
    two = dataclasses.replace(LOOK, along=None, velocity_m_per_s=np.zeros((2, 3)))
    with pytest.raises(ShapeError, match=r"Appearance\.velocity_m_per_s has length 2; allowed: 1"):
        pss.evaluate([CAMERA], POINT, NORMAL, appearance=two)


def test_some_of_the_points_keep_their_velocities():
    velocity = np.arange(9.0).reshape(3, 3)
    target_appearance = Appearance(0.01, 1.0, 0.1, velocity_m_per_s=velocity)
    np.testing.assert_array_equal(target_appearance.at(slice(1, 3)).velocity_m_per_s, velocity[1:])


# ---- what the chain measures ---------------------------------------------------------------------------------------


def moving_marker(white_e: float, way: float) -> tuple[Setup, RenderedView, np.ndarray]:
    """The laboratory's marker, turned by 30° and going to the right; its view, and its predicted covariance in px²."""
    setup = Setup(Factors(10.0, 2.0, 20.0, white_e), Pose(7, 30.0, 90.0, (-0.1, 0.4)))
    speed = way * DISTANCE_M / FOCAL_PX / (setup.sensor.exposure_ms * 1e-3)
    (board,) = setup.state.objects
    moving = dataclasses.replace(board, motion=Motion((speed, 0.0, 0.0)))
    state = dataclasses.replace(setup.state, objects=(moving,))
    meshes = lit_scene.bake(state, solve_light(state))
    renderer = Renderer(state, meshes, backend.choose())
    view = renderer.render(renderer.request(setup.camera, setup.sensor, Sampling(noise_ratio=0.4)))
    model = pss.noise_model("physical", sensor=setup.sensor)
    target_appearance = lit_scene.appearance(state, meshes)
    predicted = model.covariance(setup.camera, state.points_m, state.normals, target_appearance)[0]
    return setup, view, predicted


@pytest.mark.render
@pytest.mark.parametrize(("white_e", "way"), [(100.0, 0.75), (800.0, 6.0)])
def test_rendered_markers_scatter_as_predicted(mi, white_e, way):
    """One speed, two exposures: σ along the way and across it, as OpenCV and the localisation find it."""
    setup, view, predicted = moving_marker(white_e, way)
    electrons = np.asarray(expected_electrons(view.radiance, setup.camera, setup.sensor), dtype=np.float32)
    pattern = fixed_pattern(setup.camera, setup.sensor)
    found = []
    for trial in range(CAPTURES):
        numbers = capture(electrons, setup.sensor, random_stream(1, view.key, "motion", trial), pattern)
        found.append(measure_capture(numbers, Targets(DICTIONARY, (7,)), setup.sensor)[0][0])
    scatter = np.array(found)[np.isfinite(np.array(found)[:, 0])].std(axis=0, ddof=1)
    np.testing.assert_allclose(scatter, np.sqrt(np.diag(predicted)), rtol=MEASURED)


# ---- the page --------------------------------------------------------------------------------------------------------


def test_the_page_shows_the_sweeps_own_numbers():
    """docs/hallway.md: every step of results/reference, and the RMS of the points that the steps have in common."""
    page = (ROOT / "docs" / "hallway.md").read_text(encoding="utf-8").replace(",", "")
    of_steps, of_points = (rows_of(REFERENCE / f"{name}.csv") for name in ("configurations", "points"))
    steps = {(float(row["value"]), row["noise_model"]): row for row in of_steps}
    values = sorted({value for value, _ in steps})
    assert values == [0.25 * 2**k for k in range(8)]
    for value in values:
        row = steps[value, "physical"]
        predicted = [
            f"{float(steps[value, m]['pss_single_frame']):.0f}" for m in ("as-printed", "corrected", "physical")
        ]
        measured, low, high = (
            f"{float(row[f'measured_pss_{end}']):.0f}" for end in ("single_frame", "ci_low", "ci_high")
        )
        line = rf"\| {value:g} \| {1.2 * value:.1f} \| " + r" \| ".join(predicted) + r" \| \d+ "
        assert re.search(line + rf"\| {measured} \[{low} {high}\] \| {row['detected']} \|", page), value
    for longest in (4.0, 8.0):
        used = [value for value in values if value <= longest]
        found = [{r["point"]: r for r in of_points if r["configuration"] == f"exposure_ms={v:g}"} for v in used]
        common = set.intersection(*(set(rows) for rows in found))
        assert len(common) == {4.0: 7, 8.0: 3}[longest]
        for value, rows in zip(used, found, strict=True):
            pooled = (
                1e6 * math.sqrt(sum(float(rows[point][name]) ** 2 for point in common) / len(common))
                for name in ("measured_rms_m", "single_frame_rms_m")
            )
            cells = " | ".join(f"{number:.1f}" for number in pooled)
            assert re.search(rf"\| {value:g} \|(.*\|)? {re.escape(cells)} \|", page), (value, cells)
