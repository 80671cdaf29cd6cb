"""Each convention of docs/conventions.md as one test, whose docstring states it."""

import ast
import dataclasses
import inspect
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import pss
from pss import (
    ConstantVelocity,
    ImageSensor,
    PTZCamera,
    RandomWalk,
    RangeError,
    Rectangle,
    Sphere,
    evaluate,
    noise_model,
)
from pss.cameras.motors import PTZLimits
from pss.noise import DistanceIncidence, IdentityNoise, NoiseModel
from render.lens.thin_lens import film_position, sensor_dict
from render.light.exposure import AutoExposure
from render.random_streams import random_stream
from render.world.geometry import surfaces
from render.world.state import Light, Marker, MarkerPrint, Panel, Room, SceneState

ROOT = Path(__file__).resolve().parents[2]
# Relative, and in pixels: a few roundings.
SAME_TO_ROUNDING = 1e-12
SAME_PIXEL_PX = 1e-9

CAMERA = PTZCamera((0, 0, 1), 0, 0, resolution=(1280, 960), focus_distance_m=4)
POINTS = np.array([[0.0, 0.0, 1.0], [0.1, 0.2, 1.3], [-0.3, 0.1, 0.8]])
NORMALS = np.tile([0.0, -1.0, 0.0], (3, 1))
PAIR = [PTZCamera((x, -3, 1.5), 0, 0, focus_distance_m=3).aimed_at((0, 0, 1)) for x in (-1.5, 1.5)]


def seen_at(point, camera=CAMERA):
    """Pixels right of and above the middle of the image."""
    (u, v), _ = camera.project(point)
    cx, cy = camera.principal_point_px
    return u - cx, cy - v


# ---- world and camera ------------------------------------------------------------------------------------------------


def test_world_is_right_handed_in_metres_with_z_up():
    """World: right-handed, metres, z up. Who looks along +y has +x on the right, and x × y = z is up in the image."""
    right, _ = seen_at((1, 3, 1))
    _, up = seen_at((0, 3, 2))
    assert right > 0
    assert up > 0
    np.testing.assert_array_equal(np.cross([1, 0, 0], [0, 1, 0]), [0, 0, 1])
    assert CAMERA.range_m((0, 3, 1)) == 3


def test_rooms_stand_on_the_floor_and_are_centred():
    """World: the floor is at z = 0, and the room is centred on x = y = 0; width runs along x, length along y."""
    state = SceneState(Room(5, 9, 3, 0.5, 0.5, 0.5), Light(1.0, ()), (), (), MarkerPrint("DICT_4X4_100", 1, 0.9, 0.1))
    corners = np.concatenate([surface.triangles()[0] for surface in surfaces(state)])
    np.testing.assert_allclose(corners.min(axis=0), [-2.5, -4.5, 0], atol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(corners.max(axis=0), [2.5, 4.5, 3], atol=SAME_TO_ROUNDING)


def test_camera_frame_is_opencvs():
    """Camera frame: x right, y down, z forward, as in OpenCV; the rows of `rotation` are these axes in the world."""
    np.testing.assert_allclose(CAMERA.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(CAMERA.to_camera_frame((2, 5, 4)), [2, -3, 5], atol=SAME_TO_ROUNDING)
    assert np.linalg.det(PTZCamera((0, 0, 0), 77, -33).rotation) == pytest.approx(1)


@pytest.mark.parametrize(
    ("pan_deg", "forward"), [(0, (0, 1, 0)), (90, (1, 0, 0)), (-90, (-1, 0, 0)), (180, (0, -1, 0))]
)
def test_pan_turns_about_world_z_from_plus_y_to_plus_x(pan_deg, forward):
    """Pan: degrees about world z; 0° looks along +y, positive turns towards +x."""
    np.testing.assert_allclose(PTZCamera((0, 0, 0), pan_deg, 0).rotation[2], forward, atol=SAME_TO_ROUNDING)


def test_tilt_is_positive_upwards():
    """Tilt: degrees above the horizon, whatever the pan."""
    for pan_deg in (0, 40, 200):
        assert PTZCamera((0, 0, 0), pan_deg, 30).rotation[2, 2] == pytest.approx(0.5)
        assert PTZCamera((0, 0, 0), pan_deg, -30).rotation[2, 2] == pytest.approx(-0.5)


def test_roll_is_zero():
    """Roll 0: the camera's x axis is level, and up in the world is up in the image."""
    for pan_deg in range(-180, 181, 30):
        for tilt_deg in (-80, -20, 0, 45):
            right, down, _ = PTZCamera((0, 0, 0), pan_deg, tilt_deg).rotation
            assert right[2] == 0
            assert down[2] < 0


def test_boards_face_as_cameras_pan():
    """Facing and elevation of a board's front are the pan and tilt of a camera that looks out of it."""
    board, camera = Rectangle("board", (0, 0, 1), 2, 1, 35, -10), PTZCamera((0, 0, 1), 35, -10)
    np.testing.assert_allclose(board.normal, camera.rotation[2], atol=SAME_TO_ROUNDING)
    # Right is as seen by who looks at the front: the opposite of the camera's right.
    np.testing.assert_allclose(board.right, -camera.rotation[0], atol=SAME_TO_ROUNDING)


def test_normals_point_outwards():
    """Normals are unit vectors away from the body; a point whose normal looks away from the camera is not seen."""
    points, normals = Sphere("ball", (0, 3, 1), 0.5).spiral(50)
    assert ((points - [0, 3, 1]) * normals).sum(axis=1) == pytest.approx(0.5)
    assert CAMERA.cos_incidence((0, 2.5, 1), (0, -1, 0)) == pytest.approx(1)
    assert CAMERA.cos_incidence((0, 2.5, 1), (0, 1, 0)) == pytest.approx(-1)


# ---- zoom and pixels -------------------------------------------------------------------------------------------------


def test_zoom_divides_the_field_of_view():
    """Zoom: the paper's multiplier, horizontal field of view = 90°/zoom ("×2 → 45°"); it is no magnification."""
    for zoom in (1, 2, 4, 8):
        camera = PTZCamera((0, 0, 0), 0, 0, zoom=zoom)
        assert camera.horizontal_fov_deg == 90 / zoom
        half = math.radians(90 / zoom / 2)
        (u, _), _ = camera.project((math.sin(half), math.cos(half), 0))
        assert u == pytest.approx(1279.5, abs=SAME_PIXEL_PX)


def test_zoom_is_from_one_to_the_cameras_limit():
    """Zoom ≥ 1, with a limit for each camera, 8 if nothing else is said."""
    assert CAMERA.max_zoom == 8
    for zoom, max_zoom in ((0.9, 8), (8.1, 8), (3.1, 3)):
        with pytest.raises(RangeError, match=f"zoom = {zoom}; allowed: 1 to {max_zoom}"):
            dataclasses.replace(CAMERA, zoom=zoom, max_zoom=max_zoom)
    assert dataclasses.replace(CAMERA, zoom=12, max_zoom=12).horizontal_fov_deg == 7.5


def test_pixel_zero_is_the_centre_of_the_top_left_pixel():
    """Pixels: OpenCV's, x right, y down; the sensor reaches from −0.5 to width − 0.5."""
    assert CAMERA.principal_point_px == (639.5, 479.5)
    ray = np.linalg.inv(CAMERA.intrinsic_matrix) @ [0, 0, 1]  # pixel (0, 0)
    top_left = ray @ CAMERA.rotation + CAMERA.position_m
    right, up = seen_at(top_left)
    assert right < 0 < up
    assert CAMERA.in_frustum(top_left)
    for pixel, inside in (((-0.49, 0), True), ((-0.51, 0), False), ((0, 959.49), True), ((0, 959.51), False)):
        ray = np.linalg.inv(CAMERA.intrinsic_matrix) @ [*pixel, 1]
        assert CAMERA.in_frustum(ray @ CAMERA.rotation + CAMERA.position_m) == inside


def test_mitsubas_film_is_half_a_pixel_on_and_one_module_knows():
    """Mitsuba's film has the first pixel's centre at (0.5, 0.5); render/lens/thin_lens.py alone converts."""
    np.testing.assert_array_equal(film_position(np.array([[0.0, 0.0], [-0.5, 959.5]])), [[0.5, 0.5], [0, 960]])


# ---- thin lens -------------------------------------------------------------------------------------------------------


def test_the_image_distance_follows_from_the_field_of_view():
    """Thin lens: image distance v = focal length in pixels · pitch, so that the field of view is exact at any focus."""
    for focus_distance_m in (0.3, 4, 50):
        camera = dataclasses.replace(CAMERA, focus_distance_m=focus_distance_m)
        assert camera.image_distance_m == camera.focal_px * camera.pixel_pitch_m
        vergence = 1 / camera.image_distance_m + 1 / focus_distance_m
        assert 1 / camera.focal_length_m == pytest.approx(vergence, rel=SAME_TO_ROUNDING)


def test_the_aperture_is_focal_length_over_f_number_and_mitsuba_gets_a_radius():
    """Aperture: diameter a = f/N; `aperture_radius` is half of it."""
    assert CAMERA.aperture_diameter_m == CAMERA.focal_length_m / CAMERA.f_number
    described = sensor_dict(CAMERA, SimpleNamespace(ScalarTransform4f=np.asarray))
    assert described["aperture_radius"] == CAMERA.aperture_diameter_m / 2
    assert described["focus_distance"] == CAMERA.focus_distance_m
    assert (described["fov"], described["fov_axis"]) == (CAMERA.horizontal_fov_deg, "x")


def test_the_circle_of_confusion_is_a_diameter_in_pixels():
    """Eq. 14 equals a·f_px/d·|z − d|/z."""
    z, d = 2.5, CAMERA.focus_distance_m
    expected = CAMERA.aperture_diameter_m * CAMERA.focal_px / d * abs(z - d) / z
    assert CAMERA.circle_of_confusion_px((0, z, 1)) == pytest.approx(expected, rel=1e-10)


def test_focus_is_a_plane_so_that_eq_14_reads_depth_and_eq_11_range():
    """D of Eq. 14 is the depth along the axis; D of Eq. 11 is the distance to the lens centre."""
    beside = np.array([[3.0, 4.0, 1.0]])  # depth 4 m = focus distance, range 5 m
    assert CAMERA.circle_of_confusion_px(beside)[0] == pytest.approx(0, abs=SAME_PIXEL_PX)
    normal = np.array([[-0.6, -0.8, 0.0]])
    np.testing.assert_allclose(
        NoiseModel("Eq. 11", (DistanceIncidence(),)).covariance(CAMERA, beside, normal)[0], 25 * np.eye(2)
    )


# ---- σ and units -----------------------------------------------------------------------------------------------------


def test_sigma_is_a_standard_deviation_in_metres():
    """σ: standard deviation (m), the root of the covariance's largest eigenvalue (m²); the RMS is √tr."""
    result = evaluate(PAIR, POINTS, NORMALS)
    largest = np.linalg.eigvalsh(result.covariance)[:, -1]
    np.testing.assert_allclose(result.sigma_m, np.sqrt(largest), rtol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(result.rms_m**2, np.trace(result.covariance, axis1=1, axis2=2), rtol=SAME_TO_ROUNDING)
    assert (result.sigma_m < result.rms_m).all()
    assert (result.rms_m <= math.sqrt(3) * result.sigma_m).all()


def test_the_noise_is_a_covariance_in_square_pixels():
    """R_k: px²; twice the deviation in pixels is four times R and twice the single-frame σ."""
    single, double = (
        evaluate(PAIR, POINTS, NORMALS, noise=NoiseModel("n", (IdentityNoise(variance_px2),)))
        for variance_px2 in (1.0, 4.0)
    )
    np.testing.assert_allclose(double.single_frame_sigma_m, 2 * single.single_frame_sigma_m, rtol=SAME_TO_ROUNDING)


def test_pss_is_per_metre():
    """PSS: 1/m; in a world of twice the size, with twice the steps, σ∞ doubles and the PSS halves."""

    def scaled(scale):
        cameras = [
            dataclasses.replace(
                camera, position_m=tuple(scale * np.array(camera.position_m)), focus_distance_m=3 * scale
            )
            for camera in PAIR
        ]
        return evaluate(cameras, scale * POINTS, NORMALS, noise="identity", process=RandomWalk(1e-3 * scale))

    once, twice = scaled(1), scaled(2)
    np.testing.assert_allclose(twice.sigma_m, 2 * once.sigma_m, rtol=1e-9)
    assert twice.pss == pytest.approx(once.pss / 2, rel=1e-9)


def test_eq_11_is_kept_as_printed_and_its_unit_scale_is_explicit():
    """Eq. 11 adds m² to px²: `px2_per_m2` is the scale, 1 px²/m² if nothing else is said."""
    far, turned = np.array([[0.0, 3.0, 1.0]]), np.array([[0.0, -1.0, 0.0]])
    for scale in (1.0, 0.1, 10.0):
        first = noise_model("as-printed", px2_per_m2=scale).without("resolution", "defocus")
        np.testing.assert_allclose(first.covariance(CAMERA, far, turned)[0], scale * 9 * np.eye(2))
    assert noise_model("as-printed").factors[0] == DistanceIncidence(corrected=False, px2_per_m2=1.0)


# ---- P⁻, P⁺, C -------------------------------------------------------------------------------------------------------


def test_covariance_is_before_the_update_and_posterior_after():
    """`covariance` is the a-priori P⁻ of Eq. 4, `posterior` its update P⁺ = (P⁻⁻¹ + J)⁻¹, and P⁻ = A P⁺ Aᵀ + Q."""
    process = ConstantVelocity(0.1)
    result = evaluate(PAIR, POINTS, NORMALS, process=process)
    again = process.A @ result.posterior @ process.A.T + process.Q
    spread = np.sqrt(np.diagonal(result.covariance, axis1=1, axis2=2))
    units = spread[:, :, None] * spread[:, None, :]
    np.testing.assert_allclose(again / units, result.covariance / units, rtol=0, atol=1e-9)
    information = np.linalg.inv(result.posterior) - np.linalg.inv(result.covariance)
    frame = np.linalg.inv(result.single_frame_covariance)
    size = np.abs(frame).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(information[:, :3, :3] / size, frame / size, rtol=0, atol=1e-6)


def test_single_frame_covariance_knows_no_process():
    """C = (ΣHᵀR⁻¹H)⁻¹ is one frame's triangulation: the process does not enter, and P⁺ < C."""
    walk, faster = (evaluate(PAIR, POINTS, NORMALS, process=RandomWalk(step)) for step in (1e-3, 1e-1))
    np.testing.assert_array_equal(walk.single_frame_covariance, faster.single_frame_covariance)
    assert (walk.sigma_m < faster.sigma_m).all()
    assert (np.linalg.eigvalsh(walk.single_frame_covariance - walk.posterior) > 0).all()


def test_a_random_walk_has_the_closed_form_of_c():
    """For A = I and Q = qI, P⁻ has C's eigenvectors and the eigenvalues q/2 + √(q²/4 + q·c)."""
    q, result = 1e-6, evaluate(PAIR, POINTS, NORMALS, process=RandomWalk(1e-3))
    c, axes = np.linalg.eigh(result.single_frame_covariance)
    expected = (axes * (q / 2 + np.sqrt(q**2 / 4 + q * c))[:, None, :]) @ axes.mT
    np.testing.assert_allclose(result.covariance, expected, rtol=1e-8, atol=1e-15)


def test_sigma_is_of_the_position_alone():
    """With velocity in the state, σ∞ is taken from the 3 × 3 position block; positions come first."""
    result = evaluate(PAIR, POINTS, NORMALS, process=ConstantVelocity(0.1))
    assert result.covariance.shape == (3, 6, 6)
    position = np.sqrt(np.linalg.eigvalsh(result.covariance[:, :3, :3])[:, -1])
    np.testing.assert_allclose(result.sigma_m, position, rtol=SAME_TO_ROUNDING)
    assert (result.sigma_m < np.sqrt(np.linalg.eigvalsh(result.covariance)[:, -1])).all()


# ---- names and randomness --------------------------------------------------------------------------------------------

UNITS = ("_m", "_deg", "_s", "_ms", "_nm", "_px", "_px2", "_px2_per_m2", "_e", "_dn", "_m2_s3", "_m2_s5")
UNITS += ("_w_per_m2_sr", "_modules", "_e_per_s", "_dn_per_e", "_um", "_w_per_sr", "_m_per_s", "_deg_per_s")
UNITS += ("_dioptre", "_dioptre_per_s")
WITHOUT_UNIT = {
    "zoom": "a ratio",
    "max_zoom": "a ratio",
    "f_number": "a ratio",
    "resolution": "pixels (width, height), as every camera library calls it",
    "corrected": "a switch",
    "ccd_noise": "a ratio",
    "px2_per_m2": "is its own unit",
    "normal": "a unit vector",
    "up": "a unit vector",
    "id": "a number to count by",
    "bits": "a count",
    "quantum_efficiency": "a ratio",
    "prnu_share": "a ratio",
    "share": "a ratio",
    "radial_distortion": "factors of slopes",
    "aperture_blades": "a count",
    "zoom_range": "ratios",
    "zoom_factor_per_s": "a ratio in each second",
    "zoom_step": "a ratio",
}
NUMBERS = re.compile(r"\b(float|int|Floats)\b")


@pytest.mark.parametrize(
    "owner",
    [PTZCamera, pss.Rectangle, pss.Sphere, pss.Box, pss.RandomWalk, pss.ConstantVelocity, pss.ConstantAcceleration]
    + [
        pss.noise.DistanceIncidence,
        pss.noise.Resolution,
        IdentityNoise,
        AutoExposure,
        ImageSensor,
        Marker,
        MarkerPrint,
        Panel,
        Light,
        Room,
        PTZLimits,
    ],
    ids=lambda owner: owner.__name__,
)
def test_numbers_end_in_their_unit(owner):
    """Units are part of the name (`focus_distance_m`, `tilt_deg`), but for what has none."""
    for field in dataclasses.fields(owner):
        if NUMBERS.search(str(field.type)) and not field.name.endswith("_albedo"):
            assert field.name.endswith(UNITS) or field.name in WITHOUT_UNIT, f"{owner.__name__}.{field.name}"


def test_angles_are_degrees_in_names_and_radians_inside():
    """Angles: degrees at the door, and then the name says so; no public name of pss carries radians."""
    names = [field.name for owner in (PTZCamera, Rectangle) for field in dataclasses.fields(owner)]
    assert {"pan_deg", "tilt_deg", "widest_fov_deg", "facing_deg", "elevation_deg"} <= set(names)
    for owner in (PTZCamera, Rectangle, Sphere, pss.Box):
        parameters = [
            name for _, f in inspect.getmembers(owner, inspect.isfunction) for name in inspect.signature(f).parameters
        ]
        assert not [name for name in [*parameters, *dir(owner)] if name.endswith("_rad")]
    quarter = PTZCamera((0, 0, 0), 90, 0)
    np.testing.assert_allclose(quarter.rotation[2], [1, 0, 0], atol=SAME_TO_ROUNDING)


def test_the_metric_draws_no_random_numbers():
    """The same inputs, the same numbers (`test_architecture` holds that every generator of pss has a seed)."""
    first, second = (evaluate(PAIR, POINTS, NORMALS) for _ in range(2))
    np.testing.assert_array_equal(first.covariance, second.covariance)


def test_random_streams_depend_on_seed_view_name_and_trial_and_on_nothing_else():
    """Randomness: SeedSequence(run seed, view hash, stream name, trial); order, workers and resume change nothing."""
    keys = [
        (seed, view, name, trial) for seed in (0, 1) for view in "ab" for name in ("noise", "walk") for trial in (0, 1)
    ]
    forwards = {key: random_stream(*key).random(3) for key in keys}
    backwards = {key: random_stream(*key).random(3) for key in reversed(keys)}
    for key in keys:
        np.testing.assert_array_equal(forwards[key], backwards[key])
    assert len({tuple(numbers) for numbers in forwards.values()}) == len(keys)


# ---- the page itself -------------------------------------------------------------------------------------------------


def test_the_page_of_conventions_names_tests_that_exist():
    """Every row of docs/conventions.md names the test that enforces it, as `tests/file.py::test`."""
    page = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    named = re.findall(r"`tests/([\w/]+\.py)::(\w+)`", page)
    for file, name in named:
        module = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
        assert name in [node.name for node in module.body if isinstance(node, ast.FunctionDef)], f"{file}::{name}"
    rows = [line for line in page.splitlines() if line.startswith("| ") and not set(line) <= set("|- :")]
    without = [row for row in rows if "`tests/" not in row and "enforced by" not in row]
    assert not without, without
    # And what this file tests is on the page.
    here = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    tests = {node.name for node in here.body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}
    tests.remove("test_the_page_of_conventions_names_tests_that_exist")
    assert not tests - {name for file, name in named if Path(file).name == Path(__file__).name}
