"""The camera by second routes: OpenCV's projection, complex steps, a lens drawn by hand, and plain angles."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pss import GeometryError, PSSError, PTZCamera, RangeError, ShapeError

# Two routes of some ten operations each in double precision, at pixels below 1e5.
SAME_PIXEL_PX = 1e-8
# Relative; a result of a few roundings.
SAME_TO_ROUNDING = 1e-12
# Angles go through degrees and back: pixels near the sensor's edge are off by some eps times the focal length.
EDGE_PX = 1e-9
# Central differences of step h err by about h² f'''/6 + eps f/h; with h = 1e-5 m that is 1e-6 of the derivative.
DIFFERENCE_STEP_M = 1e-5
DIFFERENCE_RELATIVE = 1e-5

settings_of_cameras = {
    "position_m": st.tuples(*[st.floats(-5, 5)] * 3),
    "pan_deg": st.floats(-400, 400),
    "tilt_deg": st.floats(-90, 90),
    "zoom": st.floats(1, 8),
    "focus_distance_m": st.floats(0.5, 50),
    "f_number": st.floats(0.8, 22),
    "resolution": st.tuples(st.integers(2, 4000), st.integers(2, 3000)),
}
cameras = st.builds(PTZCamera, **settings_of_cameras)


def points_in_front(camera: PTZCamera, seed: int, count: int = 20) -> np.ndarray:
    """Points up to 60° off the axis, 0.2 to 20 m deep, in the world."""
    rng = np.random.default_rng(seed)
    depth = 10 ** rng.uniform(np.log10(0.2), np.log10(20), (count, 1))
    local = np.hstack([depth * rng.uniform(-1.2, 1.2, (count, 2)), depth])
    return local @ camera.rotation + np.array(camera.position_m)


# ---- projection ------------------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(camera=cameras, seed=st.integers(0, 1000))
def test_projection_and_jacobian_are_those_of_opencv(camera, seed):
    """OpenCV gets K, R and t only; its derivative by t, turned by R, is the derivative by the point."""
    points = points_in_front(camera, seed)
    rotation_vector, _ = cv2.Rodrigues(camera.rotation)
    expected, derivatives = cv2.projectPoints(
        points.reshape(-1, 1, 3), rotation_vector, camera.translation_m, camera.intrinsic_matrix, None
    )
    pixels, depth = camera.project(points)
    by_translation = derivatives.reshape(len(points), 2, -1)[..., 3:6]
    # Points that lie near in units of the image distance have large pixels: compare in units of the focal length.
    np.testing.assert_allclose(pixels, expected[:, 0], rtol=0, atol=SAME_PIXEL_PX)
    np.testing.assert_allclose(
        camera.jacobian(points) * depth[:, None, None] / camera.focal_px,
        by_translation @ camera.rotation * depth[:, None, None] / camera.focal_px,
        rtol=0,
        atol=1e-9,  # Rodrigues' vector loses some digits near half a turn
    )
    assert (depth > 0).all()


@settings(max_examples=60, deadline=None)
@given(camera=cameras, seed=st.integers(0, 1000))
def test_projection_matrix_and_its_complex_step_derivative(camera, seed):
    """A complex step has no cancellation: Im(f(x + ih))/h is the derivative to rounding."""
    points, step = points_in_front(camera, seed), 1e-30
    pixels, depth = camera.project(points)
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ camera.projection_matrix.T
    np.testing.assert_allclose(homogeneous[:, 2], depth, rtol=SAME_TO_ROUNDING, atol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(homogeneous[:, :2] / homogeneous[:, 2:], pixels, rtol=0, atol=SAME_PIXEL_PX)
    jacobian = camera.jacobian(points)
    for axis in range(3):
        moved = np.column_stack([points, np.ones(len(points))]).astype(complex)
        moved[:, axis] += 1j * step
        image = moved @ camera.projection_matrix.T
        derivative = (image[:, :2] / image[:, 2:]).imag / step
        np.testing.assert_allclose(
            jacobian[..., axis] * depth[:, None], derivative * depth[:, None], rtol=0, atol=SAME_PIXEL_PX
        )


def test_jacobian_is_the_slope_of_project_itself():
    camera = PTZCamera((1.0, -2.0, 2.5), 33, -21, zoom=3)
    points = points_in_front(camera, 4)
    for axis, step in enumerate(DIFFERENCE_STEP_M * np.eye(3)):
        slope = (camera.project(points + step)[0] - camera.project(points - step)[0]) / (2 * DIFFERENCE_STEP_M)
        scale = np.abs(camera.jacobian(points)).max(axis=(1, 2))[:, None]
        np.testing.assert_allclose(
            camera.jacobian(points)[..., axis] / scale, slope / scale, rtol=0, atol=DIFFERENCE_RELATIVE
        )


def test_projection_by_hand():
    """A camera at the origin that looks along +y: 1 m ahead, 0.1 m to the right (+x) and 0.2 m up (+z)."""
    camera = PTZCamera((0, 0, 0), 0, 0, zoom=1, resolution=(640, 480))
    pixel, depth = camera.project((0.1, 1.0, 0.2))
    assert camera.focal_px == pytest.approx(320, rel=SAME_TO_ROUNDING)
    np.testing.assert_allclose(pixel, [319.5 + 32, 239.5 - 64], rtol=SAME_TO_ROUNDING)
    assert depth == pytest.approx(1, rel=SAME_TO_ROUNDING)
    # ∂u/∂x = f/z, ∂u/∂y = −f x/z², ∂v/∂z = −f/z, ∂v/∂y = f·0.2/z²
    np.testing.assert_allclose(camera.jacobian((0.1, 1.0, 0.2)), [[320, -32, 0], [0, 64, -320]], rtol=0, atol=1e-9)


@pytest.mark.parametrize("batch", [(), (1,), (7,), (2, 3), (0,), (2, 0)])
def test_leading_axes_are_kept(batch):
    camera = PTZCamera((0, 0, 1), 20, 5)
    points = np.broadcast_to([1.0, 3.0, 1.5], (*batch, 3))
    pixels, depth = camera.project(points)
    assert pixels.shape == (*batch, 2)
    assert depth.shape == camera.circle_of_confusion_px(points).shape == camera.in_frustum(points).shape == batch
    assert camera.jacobian(points).shape == (*batch, 2, 3)
    assert camera.range_m(points).shape == camera.cos_off_axis(points).shape == batch
    assert camera.cos_incidence(points, np.broadcast_to([0.0, -1, 0], points.shape)).shape == batch


def test_behind_and_beside_the_camera():
    camera = PTZCamera((0, 0, 0), 0, 0)
    assert camera.project((0, -2, 0))[1] == pytest.approx(-2)
    assert not camera.in_frustum((0, -2, 0))
    assert not camera.in_frustum((1, 0, 0))
    for ask in (camera.project, camera.jacobian, camera.circle_of_confusion_px):
        with pytest.raises(GeometryError, match="depth 0"):
            ask([[0, 1, 0], [1, 0, 0]])
    for ask in (camera.cos_off_axis, lambda point: camera.cos_incidence(point, (0, 0, 1))):
        with pytest.raises(GeometryError, match="depth 0"):
            ask((0, 0, 0))


# ---- field of view ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("zoom", [1, 1.5, 2, 4, 8])
@pytest.mark.parametrize("focus_distance_m", [0.5, 4, 100])
def test_half_the_field_of_view_is_the_edge_of_the_sensor(zoom, focus_distance_m):
    """Horizontal field of view = 90°/zoom at any focus: half of it lands half a pixel beyond the outer centres."""
    half = math.radians(90 / zoom / 2)
    camera = PTZCamera((0, 0, 1), 0, 0, zoom=zoom, focus_distance_m=focus_distance_m, resolution=(1280, 960))
    for side, edge in ((1, 1279.5), (-1, -0.5)):
        pixel, _ = camera.project((side * 3 * math.sin(half), 3 * math.cos(half), 1))
        np.testing.assert_allclose(pixel, [edge, 479.5], rtol=0, atol=EDGE_PX)
    for height, edge in ((0.75, -0.5), (-0.75, 959.5)):
        pixel, _ = camera.project((0, 1, 1 + height * math.tan(half)))
        np.testing.assert_allclose(pixel, [639.5, edge], rtol=0, atol=EDGE_PX)


@settings(max_examples=60, deadline=None)
@given(camera=cameras, seed=st.integers(0, 1000))
def test_the_frustum_is_the_area_of_the_sensor(camera, seed):
    points = points_in_front(camera, seed, 200)
    (u, v), (width, height) = camera.project(points)[0].T, camera.resolution
    beyond = np.max([-0.5 - u, u - (width - 0.5), -0.5 - v, v - (height - 0.5)], axis=0)
    clear = np.abs(beyond) > SAME_PIXEL_PX
    np.testing.assert_array_equal(camera.in_frustum(points)[clear], beyond[clear] < 0)


# ---- aim -------------------------------------------------------------------------------------------------------------


@settings(max_examples=100, deadline=None)
@given(camera=cameras, target=st.tuples(*[st.floats(-20, 20)] * 3))
def test_aimed_at_puts_the_target_in_the_middle(camera, target):
    away = np.array(target) - np.array(camera.position_m)
    assume(np.linalg.norm(away) > 1e-3)
    assume(math.hypot(away[0], away[1]) > 0.01 * np.linalg.norm(away))  # not within half a degree of up or down
    aimed = camera.aimed_at(target)
    pixel, depth = aimed.project(target)
    np.testing.assert_allclose((pixel - camera.principal_point_px) / camera.focal_px, 0, rtol=0, atol=1e-10)
    assert depth == pytest.approx(np.linalg.norm(away), rel=1e-9)
    assert dataclasses.replace(aimed, pan_deg=camera.pan_deg, tilt_deg=camera.tilt_deg) == camera


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("pan_deg", [0.0, 35.0, -120.0])
def test_straight_up_and_down_are_the_limits_of_steep_tilts(sign, pan_deg):
    """Projection and Jacobian go over into each other; down, the image's top points along the pan."""
    position = np.array([1.0, -2.0, 1.5])
    points = position + [[0.2, 0.1, sign], [-0.3, 0.4, 2 * sign], [0.0, 0.0, 3 * sign]]
    steep, upright = (
        PTZCamera(tuple(position), pan_deg, sign * tilt, radial_distortion=(-0.1, 0.0)) for tilt in (89.999, 90.0)
    )
    moved_px = 1.5 * math.radians(0.001) * steep.focal_px
    np.testing.assert_allclose(upright.project(points)[0], steep.project(points)[0], atol=moved_px)
    assert np.isfinite(upright.jacobian(points)).all()
    np.testing.assert_allclose(upright.jacobian(points), steep.jacobian(points), atol=2e-4 * steep.focal_px)
    np.testing.assert_allclose(upright.rotation @ upright.rotation.T, np.eye(3), atol=1e-15)
    along = np.array([math.sin(math.radians(pan_deg)), math.cos(math.radians(pan_deg)), 0])
    np.testing.assert_allclose(upright.rotation[1], sign * along, atol=1e-15)


def test_a_camera_aimed_straight_below_has_pan_0_whatever_rounding_leaves():
    camera = PTZCamera((0.1 + 0.2, -1.7, 2.8), 40, -10)
    for x in (0.3, 0.1 + 0.2, 0.3 - 1e-16):
        aimed = camera.aimed_at((x, -1.7, 0.4))
        assert (aimed.pan_deg, aimed.tilt_deg) == (0, -90)
        pixel, depth = aimed.project((x, -1.7, 0.4))
        np.testing.assert_allclose(pixel, aimed.principal_point_px, atol=1e-9)
        assert depth == pytest.approx(2.4)
    assert camera.aimed_at((0.1 + 0.2, -1.7, 5.0)).tilt_deg == 90


def test_aims_without_a_direction_are_refused():
    camera = PTZCamera((1, 2, 3), 0, 0)
    with pytest.raises(GeometryError, match="own position"):
        camera.aimed_at((1, 2, 3))
    with pytest.raises(ShapeError, match=r"target_m has shape \(2,\)"):
        camera.aimed_at((1, 2))


@settings(max_examples=50, deadline=None)
@given(camera=cameras)
def test_the_rotation_is_one_and_keeps_the_horizon_level(camera):
    right, down, forward = camera.rotation
    np.testing.assert_allclose(camera.rotation @ camera.rotation.T, np.eye(3), rtol=0, atol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(np.cross(right, down), forward, rtol=0, atol=SAME_TO_ROUNDING)
    assert right[2] == 0
    assert down[2] < 0


# ---- thin lens -------------------------------------------------------------------------------------------------------


def test_circle_of_confusion_by_hand():
    """f_px = 500, pitch 10 µm: v = 5 mm; d = 2 m: f = 1/200.5 m; N = 2: a = 1/401 m; z = 4 m: 500/(401·2)·2/4 px."""
    camera = PTZCamera(
        (0, 0, 0), 0, 0, resolution=(1000, 800), pixel_pitch_m=1e-5, focus_distance_m=2, f_number=2, zoom=1
    )
    assert camera.image_distance_m == pytest.approx(5e-3, rel=SAME_TO_ROUNDING)
    assert camera.focal_length_m == pytest.approx(1 / 200.5, rel=SAME_TO_ROUNDING)
    assert camera.aperture_diameter_m == pytest.approx(1 / 401, rel=SAME_TO_ROUNDING)
    np.testing.assert_allclose(
        camera.circle_of_confusion_px([[0, 4, 0], [0, 2, 0], [0, 1, 0], [1, 4, -1]]),
        [125 / 401, 0, 250 / 401, 125 / 401],
        rtol=SAME_TO_ROUNDING,
        atol=1e-15,
    )


@settings(max_examples=80, deadline=None)
@given(camera=cameras, seed=st.integers(0, 1000))
def test_circle_of_confusion_by_two_other_routes(camera, seed):
    """Eq. 14 against its short form, and against the cone of light that the lens sends to the sharp image v'."""
    points = points_in_front(camera, seed)
    depth = camera.project(points)[1]
    a, d = camera.aperture_diameter_m, camera.focus_distance_m
    short = a * camera.focal_px / d * np.abs(depth - d) / depth
    # In terms of vergence, 1/v' = 1/f − 1/z; the cone from a to a point has the width a·|v' − v|/v' at the sensor.
    sharp_vergence = 1 / camera.focal_length_m - 1 / depth
    cone = a * np.abs(1 - camera.image_distance_m * sharp_vergence) / camera.pixel_pitch_m
    scale = a * camera.focal_px / d
    blur = camera.circle_of_confusion_px(points)
    np.testing.assert_allclose(blur / scale, short / scale, rtol=1e-10, atol=1e-10)
    # 1 − v/v' cancels near focus, and the more so the further the focus: v/d is 1e-4 at 50 m.
    np.testing.assert_allclose(blur / scale, cone / scale, rtol=1e-8, atol=1e-8)


def test_focus_changes_the_lens_and_not_the_field_of_view():
    near, far = (PTZCamera((0, 0, 0), 0, 0, focus_distance_m=d) for d in (0.5, 50))
    assert near.focal_px == far.focal_px
    assert near.image_distance_m == far.image_distance_m
    assert near.focal_length_m < far.focal_length_m < near.image_distance_m


# ---- angles ----------------------------------------------------------------------------------------------------------


def test_range_depth_and_angles_by_hand():
    """A 3-4-5 triangle: 4 m deep, 3 m to the side."""
    camera = PTZCamera((0, 0, 0), 0, 0)
    assert camera.range_m((3, 4, 0)) == pytest.approx(5)
    assert camera.project((3, 4, 0))[1] == pytest.approx(4)
    assert camera.cos_off_axis((3, 4, 0)) == pytest.approx(0.8)
    assert camera.cos_incidence((3, 4, 0), (0, -1, 0)) == pytest.approx(0.8)
    assert camera.cos_incidence((3, 4, 0), (0, 1, 0)) == pytest.approx(-0.8)
    assert camera.cos_incidence((3, 4, 0), (-0.6, -0.8, 0)) == pytest.approx(1)


# ---- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("zoom", 0.99, "1 to 8"),
        ("zoom", 8.01, "1 to 8"),
        ("zoom", math.nan, "1 to 8"),
        ("tilt_deg", 90.01, "±90°"),
        ("tilt_deg", math.nan, "±90°"),
        ("pan_deg", math.inf, "finite degrees"),
        ("focus_distance_m", 0.0, "beyond the image distance of 0.002976 m"),
        ("focus_distance_m", 0.002, "beyond the image distance of 0.002976 m"),
        ("focus_distance_m", math.inf, "beyond the image distance"),
        ("f_number", 0.0, "above 0"),
        ("f_number", math.inf, "above 0"),
        ("pixel_pitch_m", 4.65, "above 0 and below 1e-3 metres"),
        ("pixel_pitch_m", 0.0, "above 0 and below 1e-3 metres"),
        ("resolution", (0, 960), "at least 1 × 1"),
        ("widest_fov_deg", 180.0, "between 0 and 180"),
        ("position_m", (0.0, math.nan, 0.0), "finite metres"),
    ],
)
def test_a_value_out_of_range_is_named_with_what_is_allowed(field, value, allowed):
    arguments = {"position_m": (0, 0, 0), "pan_deg": 0, "tilt_deg": 0} | {field: value}
    with pytest.raises(RangeError, match=field) as caught:
        PTZCamera(**arguments)
    assert repr(value) in str(caught.value)
    assert allowed in str(caught.value)
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, PSSError)


@pytest.mark.parametrize(("field", "value"), [("position_m", (0, 0)), ("resolution", (1280, 960, 3))])
def test_a_wrong_number_of_numbers_is_refused(field, value):
    arguments = {"position_m": (0, 0, 0), "pan_deg": 0, "tilt_deg": 0} | {field: value}
    with pytest.raises(ShapeError, match=f"{field} has {len(value)} numbers; allowed is"):
        PTZCamera(**arguments)


def test_points_of_the_wrong_kind_are_refused():
    camera = PTZCamera((0, 0, 0), 0, 0)
    with pytest.raises(ShapeError, match=r"points_m has shape \(4, 2\); allowed is \(\.\.\., 3\)"):
        camera.project(np.zeros((4, 2)))
    with pytest.raises(ShapeError, match=r"shape \(\)"):
        camera.project(1.0)
    with pytest.raises(RangeError, match="points_m holds nan"):
        camera.project((0, np.nan, 1))


def test_a_camera_is_a_value():
    camera = PTZCamera([0, 0, 1], 0, 0, name="a")
    assert camera == PTZCamera((0.0, 0.0, 1.0), 0, 0, name="b")
    assert hash(camera) == hash(dataclasses.replace(camera))
    with pytest.raises(dataclasses.FrozenInstanceError):
        camera.zoom = 2
