"""Other modalities: Jacobians against finite differences, fusion against its closed forms."""

import math

import numpy as np
import pytest

from pss import (
    Bearing,
    ConstantVelocity,
    DepthCamera,
    FunctionSensor,
    GeometryError,
    LinearProcess,
    PositionFix,
    PTZCamera,
    RandomWalk,
    RangeBeacon,
    RangeError,
    ShapeError,
    Sphere,
    evaluate,
)

# Central differences over 1e-6 m, of functions that are smooth over a metre.
SAME_DERIVATIVE = 1e-6
SAME_TO_ROUNDING = 1e-9

CAMERA = PTZCamera((0, -3, 1), 5, -3, focus_distance_m=3, radial_distortion=(-0.1, 0.02))
SENSORS = [
    RangeBeacon((2.0, 1.0, 2.5), 0.01),
    Bearing((-2.0, -2.0, 2.0), 1e-3),
    DepthCamera(CAMERA, 0.2, 0.002),
    PositionFix((0.1, 0.2, 0.3)),
    FunctionSensor(lambda x: x[:, :2] ** 2, 0.01 * np.eye(2), name="squares"),
    FunctionSensor(
        lambda x: np.sin(x).sum(axis=1)[:, None], [[0.01]], of_position=lambda x: np.cos(x)[:, None], name="sines"
    ),
]
POINTS = np.random.default_rng(4).uniform((-1, -1, 0.5), (1, 1, 1.8), (40, 3))
UP = np.tile([0.0, 0.0, 1.0], (40, 1))


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)
def test_the_jacobian_is_the_derivative_of_the_measurement(sensor):
    step = 1e-6
    sides = [(sensor.measure(POINTS + e) - sensor.measure(POINTS - e)) / (2 * step) for e in step * np.eye(3)]
    numeric = np.stack(sides, axis=-1)
    assert sensor.jacobian(POINTS).shape == numeric.shape == (*sensor.measure(POINTS).shape, 3)
    scale = np.abs(numeric).max()
    np.testing.assert_allclose(sensor.jacobian(POINTS), numeric, rtol=SAME_DERIVATIVE, atol=SAME_DERIVATIVE * scale)
    covariance = np.broadcast_to(sensor.covariance(POINTS), (40, numeric.shape[1], numeric.shape[1]))
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_bearing_uses_the_cameras_axes():
    """Azimuth 0 along +y, positive to +x, as pan; elevation above the horizon, as tilt."""
    bearing = Bearing((0, 0, 0), 1e-3)
    for target in [(1.0, 2.0, 0.5), (-1.0, -0.3, -0.7)]:
        aimed = PTZCamera((0, 0, 0), 0, 0).aimed_at(target)
        np.testing.assert_allclose(np.degrees(bearing.measure(np.array([target]))[0]), [aimed.pan_deg, aimed.tilt_deg])


def test_a_bearing_is_a_small_angle_across_the_line_of_sight():
    """Its information is (I − u uᵀ)/(σ d)², whatever the elevation."""
    bearing = Bearing((0.0, 0.0, 0.0), 2e-3)
    H, R = bearing.jacobian(POINTS), bearing.covariance(POINTS)
    information = np.swapaxes(H, 1, 2) @ np.linalg.inv(R) @ H
    d = np.linalg.norm(POINTS, axis=1)
    u = POINTS / d[:, None]
    expected = (np.eye(3) - u[:, :, None] * u[:, None]) / (2e-3 * d[:, None, None]) ** 2
    np.testing.assert_allclose(information, expected, rtol=1e-9, atol=1e-9 * expected.max())


def test_a_position_fix_alone_is_a_scalar_filter_on_each_axis():
    """p = q/2 + √(q²/4 + q r) for each axis, σ∞ the largest."""
    result = evaluate([], POINTS[:1], UP[:1], sensors=[PositionFix((0.01, 0.02, 0.03))], process=RandomWalk(5e-3))
    q, r = 25e-6, np.array([1e-4, 4e-4, 9e-4])
    expected = q / 2 + np.sqrt(q**2 / 4 + q * r)
    np.testing.assert_allclose(np.diag(result.covariance[0]), expected, rtol=SAME_TO_ROUNDING)
    assert result.sigma_m[0] == pytest.approx(math.sqrt(expected[2]))
    assert result.visible.shape == (0, 1)
    assert result.observable.all()


def test_sensors_and_cameras_add_their_information():
    """J of the batch is the sum, by the inverse of the stacked least squares."""
    cameras = [PTZCamera((x, -2.5, 1.4), 0, 0, focus_distance_m=2.5).aimed_at((0, 0, 1)) for x in (-1.5, 1.5)]
    normals = np.tile([0.0, -1.0, 0.0], (40, 1))
    alone = evaluate(cameras, POINTS, normals, noise="identity")
    both = evaluate(cameras, POINTS, normals, noise="identity", sensors=SENSORS[:2])
    seen = alone.observable
    expected = alone.information.copy()
    for sensor in SENSORS[:2]:
        H, R = sensor.jacobian(POINTS), sensor.covariance(POINTS)
        expected += np.swapaxes(H, 1, 2) @ np.linalg.solve(R, H)
    np.testing.assert_allclose(both.information, expected, rtol=1e-9, atol=1e-6)
    assert (both.sigma_m[seen] <= alone.sigma_m[seen]).all()
    assert both.pss > alone.pss


def test_one_camera_and_a_range_observe_a_point_that_neither_does():
    """The paper's acoustic tracker: the range fills in what the camera's ray leaves open."""
    camera = PTZCamera((0, -3, 1), 0, 0, zoom=8, focus_distance_m=3)
    beacon = RangeBeacon((0, -3, 1.0), 0.005)
    point, normal = np.array([[0.1, 0.2, 1.1]]), np.array([[0.0, -1.0, 0.0]])
    together = evaluate([camera], point, normal, noise="identity", sensors=[beacon])
    assert together.observable.all()
    assert not evaluate([camera], point, normal).observable.any()
    assert not evaluate([], point, normal, sensors=[beacon]).observable.any()
    # Along the ray the range alone tells: its σ is the single frame's √λmax.
    assert together.single_frame_sigma_m[0] == pytest.approx(0.005, rel=0.05)


def test_three_beacons_observe_and_two_do_not():
    places = [(3.0, 0.0, 2.5), (-3.0, 0.5, 2.5), (0.0, 3.0, 0.5)]
    beacons = [RangeBeacon(place, 0.01) for place in places]
    assert evaluate([], POINTS, UP, sensors=beacons).observable.all()
    assert not evaluate([], POINTS, UP, sensors=beacons[:2]).observable.any()


def test_reach_and_shapes_limit_what_is_measured():
    ball = Sphere("ball", (0.0, 0.0, 1.0), 0.3)
    behind, before = np.array([[0.0, 1.0, 1.0]]), np.array([[0.0, -1.0, 1.0]])
    for sensor, soft in (
        (RangeBeacon((0, -2.5, 1), 0.01), RangeBeacon((0, -2.5, 1), 0.01, blocked_by_shapes=False)),
        (Bearing((0, -2.5, 1), 0.01), Bearing((0, -2.5, 1), 0.01, blocked_by_shapes=False)),
    ):
        assert not sensor.reaches(behind, -before, [ball]).any()
        assert soft.reaches(behind, -before, [ball]).all()
        assert sensor.reaches(before, -before, [ball]).all()
    assert not RangeBeacon((0, -2.5, 1), 0.01, furthest_m=1.0).reaches(before, -before, []).any()
    depth = DepthCamera(PTZCamera((0, -2.5, 1), 0, 0), 0.1, 0.001, furthest_m=1.0)
    assert not depth.reaches(before, np.array([[0.0, -1.0, 0.0]]), []).any()


def test_a_sensor_of_the_whole_state_joins_a_constant_velocity_filter():
    """A velocity sensor beside a position fix: against the general Riccati solution of the stacked system."""

    class Speed:
        name = "speed"

        def measure(self, points_m):
            return np.zeros((len(points_m), 3))

        def jacobian(self, points_m):
            return np.broadcast_to(np.hstack([np.zeros((3, 3)), np.eye(3)]), (len(points_m), 3, 6))

        def covariance(self, points_m):
            return np.broadcast_to(0.04 * np.eye(3), (len(points_m), 3, 3))

        def reaches(self, points_m, normals, occluder):
            return np.ones(len(points_m), dtype=bool)

    from pss import steady_state_covariance

    process = ConstantVelocity(0.3)
    result = evaluate([], POINTS[:3], UP[:3], sensors=[PositionFix(0.02), Speed()], process=process)
    H = np.eye(6)
    R = np.diag([4e-4] * 3 + [0.04] * 3)
    expected = steady_state_covariance(process.A, process.Q, H, R, method="scipy")
    np.testing.assert_allclose(result.covariance[0], expected, rtol=1e-7, atol=1e-12)
    assert result.sigma_m[0] == pytest.approx(math.sqrt(expected[0, 0]), rel=1e-7)
    without = evaluate([], POINTS[:3], UP[:3], sensors=[PositionFix(0.02)], process=process)
    assert (result.sigma_m < without.sigma_m).all()
    with pytest.raises(ShapeError, match="measures the whole state; allowed: one process"):
        evaluate([], POINTS[:2], UP[:2], sensors=[Speed()], process=[process, ConstantVelocity(0.1)])


def test_a_process_of_ones_own_goes_through():
    process = LinearProcess(np.eye(3), np.diag([1e-6, 4e-6, 9e-6]))
    result = evaluate([], POINTS[:1], UP[:1], sensors=[PositionFix(0.01)], process=process)
    q = np.array([1e-6, 4e-6, 9e-6])
    np.testing.assert_allclose(
        np.diag(result.covariance[0]), q / 2 + np.sqrt(q**2 / 4 + q * 1e-4), rtol=SAME_TO_ROUNDING
    )


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: RangeBeacon((0, 0, 0), 0.0), RangeError, "sigma_m = 0.0; allowed: above 0"),
        (lambda: Bearing((0, 0, 0), -1.0), RangeError, "sigma_rad = -1.0"),
        (lambda: PositionFix((0.1, 0.0, 0.1)), RangeError, "sigma_m = 0.0"),
        (lambda: PositionFix((1.0, 1.0)), ShapeError, r"\(2,\); allowed: a number, or \(3,\)"),
        (lambda: RangeBeacon((0, 0, 1), 0.1).measure(np.array([[0, 0, 1.0]])), GeometryError, "range's own place"),
        (lambda: Bearing((0, 0, 1), 0.1).jacobian(np.array([[0, 0, 2.0]])), GeometryError, "straight above or below"),
        (
            lambda: evaluate([], POINTS, UP, sensors=[FunctionSensor(lambda x: x[:3], np.eye(3))]),
            ShapeError,
            r"gives shape \(3, 3\); allowed: \(40, m\)",
        ),
        (
            lambda: evaluate([], POINTS, UP, sensors=[FunctionSensor(lambda x: x, -np.eye(3))]),
            RangeError,
            "allowed: positive definite",
        ),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, error, message):
    with pytest.raises(error, match=message):
        make()
