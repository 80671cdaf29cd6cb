"""Many configurations in one call, points that move differently, visibility by parts, and input that is wrong."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pss.metric.evaluate
import pss.processes.steady_state
from pss import (
    ConstantAcceleration,
    ConstantVelocity,
    FieldOfView,
    GeometryError,
    LinearProcess,
    NonlinearProcess,
    Occlusion,
    PerPoint,
    PSSError,
    PTZCamera,
    RandomWalk,
    RangeError,
    Rectangle,
    SelfOcclusion,
    ShapeError,
    Sphere,
    evaluate,
    evaluate_many,
    noise_model,
)
from pss.noise import IdentityNoise, NoiseModel, PixelCovariance

# The same sums in another order, or in blocks of another size.
SAME_TO_ROUNDING = 1e-9

BALL, BOARD = Sphere("ball", (0.25, 0.1, 1.25), 0.45), Rectangle("board", (0.0, -1.4, 1.3), 2.4, 1.8)
PLACES = [(-2.8, 0.2), (-2.8, 1.6), (-1.7, 2.8), (0.0, 2.8), (1.7, 2.8), (2.8, 1.6), (2.8, 0.2)]
CAMERAS = [
    PTZCamera((x, y, 2.8), 0, 0, zoom=2, focus_distance_m=3.8, name=str(i)).aimed_at((0, -0.7, 1.3))
    for i, (x, y) in enumerate(PLACES)
]
FACES = [((0.0, -2.0), 0.0), ((1.8, 0.9), -60.0)]


def scene_points():
    on_board, on_ball = BOARD.grid(5, 4), BALL.spiral(15)
    points = np.concatenate([on_board[0] + 5e-4 * on_board[1], on_ball[0] + 5e-4 * on_ball[1]])
    return points, np.concatenate([on_board[1], on_ball[1]])


# ---- many configurations -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pairs_at_once", [16384, 50, 7], ids=lambda n: f"{n} pairs at once")
def test_many_configurations_are_what_each_is_alone(monkeypatch, pairs_at_once):
    """Of any size, empty too, sharing cameras or not, in blocks of any size."""
    monkeypatch.setattr(pss.metric.evaluate, "PAIRS_AT_ONCE", pairs_at_once)
    monkeypatch.setattr(pss.processes.steady_state, "MATRICES_AT_ONCE", pairs_at_once)
    monkeypatch.setattr(pss.metric.evaluate, "SHORTEST_RUN", min(pairs_at_once, 128))
    rng = np.random.default_rng(0)
    chosen = [sorted(rng.choice(7, size, replace=False)) for size in (0, 1, 2, 3, 7, 4, 2)]
    configurations = [[CAMERAS[i] for i in one] for one in chosen]
    configurations.append([dataclasses.replace(CAMERAS[0], pan_deg=100.0), CAMERAS[3]])
    points, normals = scene_points()
    many = evaluate_many(configurations, points, normals, noise="corrected", occluder=[BALL, BOARD])
    assert len(many) == len(configurations)
    assert len(many.cameras) == 8
    for k, (together, cameras) in enumerate(zip(many, configurations, strict=True)):
        alone = evaluate(cameras, points, normals, noise="corrected", occluder=[BALL, BOARD])
        np.testing.assert_array_equal(together.visible, alone.visible)
        np.testing.assert_array_equal(together.observable, alone.observable)
        np.testing.assert_allclose(together.sigma_m, alone.sigma_m, rtol=SAME_TO_ROUNDING)
        np.testing.assert_allclose(together.covariance, alone.covariance, rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose(many.single_frame_sigma_m[k], alone.single_frame_sigma_m, rtol=SAME_TO_ROUNDING)
        assert many.pss[k] == pytest.approx(alone.pss, rel=SAME_TO_ROUNDING)
        assert many.pss_single_frame[k] == pytest.approx(alone.pss_single_frame, rel=SAME_TO_ROUNDING)


def test_cameras_that_differ_by_name_alone_stay_two():
    points, normals = scene_points()
    twins = [CAMERAS[0], dataclasses.replace(CAMERAS[0], name="twin")]
    assert evaluate(twins, points, normals).visible.shape == (2, len(points))
    once, twice = (evaluate([*cs, CAMERAS[3]], points, normals) for cs in (twins[:1], twins))
    assert twice.pss > once.pss


def test_the_arrays_of_one_camera_and_point_are_those_that_were_summed():
    """J is the sum of the cameras' own, and these are HᵀR⁻¹H."""
    points, normals = scene_points()
    model = noise_model("corrected")
    result = evaluate(CAMERAS, points, normals, noise=model, occluder=[BALL, BOARD])
    np.testing.assert_allclose(result.camera_information.sum(axis=0), result.information, rtol=1e-9, atol=1e-9)
    for c in (0, 3):
        H, R = CAMERAS[c].jacobian(points), model.covariance(CAMERAS[c], points, normals)
        np.testing.assert_allclose(result.noise_px2[c], R, rtol=1e-12)
        np.testing.assert_allclose(result.jacobian[c], H, rtol=1e-12, atol=1e-9)
        expected = np.swapaxes(H, 1, 2) @ np.linalg.solve(R, H) * result.visible[c][:, None, None]
        np.testing.assert_allclose(result.camera_information[c], expected, rtol=1e-9, atol=1e-9)


def test_off_diagonal_noise_is_weighted_by_its_inverse():
    """An elongated blur at 30° in the image."""

    class Streak:
        name = "streak"

        def covariance(self, views):
            turn = np.array([[math.cos(0.5), -math.sin(0.5)], [math.sin(0.5), math.cos(0.5)]])
            return PixelCovariance.from_matrix(turn @ np.diag([9.0, 0.25]) @ turn.T)

    points, normals = scene_points()
    model = NoiseModel("streak", (Streak(),))
    curved = [dataclasses.replace(c, radial_distortion=(-0.1, 0.02)) for c in CAMERAS]
    for cameras in (CAMERAS, curved):
        result = evaluate(cameras, points, normals, noise=model)
        R = model.covariance(CAMERAS[0], points[:1], normals[:1])[0]
        expected = sum(
            np.swapaxes(H, 1, 2) @ np.linalg.inv(R) @ H * seen[:, None, None]
            for H, seen in zip([c.jacobian(points) for c in cameras], result.visible, strict=True)
        )
        np.testing.assert_allclose(result.information, expected, rtol=1e-9, atol=1e-6)


# ---- points that move differently ----------------------------------------------------------------------------------


def test_each_point_moves_by_its_own_model():
    """A static wall, a walker, a runner: each point's σ∞ is that of an evaluation in which all move like it."""
    points, normals = scene_points()
    models = [RandomWalk(), ConstantVelocity(0.05), ConstantAcceleration(0.3)]
    index = np.arange(len(points)) % 3
    mixed = evaluate(CAMERAS, points, normals, process=PerPoint(models, index))
    listed = evaluate(CAMERAS, points, normals, process=[models[i] for i in index])
    np.testing.assert_array_equal(mixed.sigma_m, listed.sigma_m)
    for number, model in enumerate(models):
        alone = evaluate(CAMERAS, points, normals, process=model)
        own = (index == number) & alone.observable
        np.testing.assert_allclose(mixed.sigma_m[own], alone.sigma_m[own], rtol=SAME_TO_ROUNDING)
        n = model.states
        np.testing.assert_allclose(mixed.covariance[own][:, :n, :n], alone.covariance[own], rtol=1e-7, atol=1e-14)
        np.testing.assert_allclose(mixed.posterior[own][:, :n, :n], alone.posterior[own], rtol=1e-7, atol=1e-14)
        assert np.isnan(mixed.covariance[own][:, n:]).all()
    np.testing.assert_allclose(mixed.rms_m, np.sqrt(np.trace(mixed.covariance[:, :3, :3], axis1=1, axis2=2)))


def test_a_turning_walker_has_a_transition_of_its_own_at_each_point():
    """x' = x + R(turn) v dt with each point's own velocity: as the general solution of its own linearised system."""
    points, normals = scene_points()
    dt, rate = 1 / 30, 2.0

    def transition(x):
        speed = np.linalg.norm(x[:, 3:5], axis=1, keepdims=True)
        turn = rate * dt * speed
        vx, vy = x[:, 3:4], x[:, 4:5]
        v = np.concatenate([vx * np.cos(turn) - vy * np.sin(turn), vx * np.sin(turn) + vy * np.cos(turn), x[:, 5:]], 1)
        return np.concatenate([x[:, :3] + dt * v, v], axis=1)

    Q = ConstantVelocity(0.1, dt).Q
    velocities = np.random.default_rng(0).uniform(-2, 2, (len(points), 3))
    states = np.concatenate([points, velocities], axis=1)
    process = NonlinearProcess(transition, Q, time_step_s=dt).linearised(states)
    result = evaluate(CAMERAS, points, normals, process=process)
    for i in (0, 7, 30):
        one = evaluate(CAMERAS, points[[i]], normals[[i]], process=LinearProcess(process.A[i], Q, time_step_s=dt))
        np.testing.assert_allclose(result.sigma_m[i], one.sigma_m[0], rtol=1e-7)
    straight = evaluate(CAMERAS, points, normals, process=ConstantVelocity(0.1, dt))
    assert np.nanmax(np.abs(result.sigma_m / straight.sigma_m - 1)) > 1e-3


def test_the_whole_state_is_an_option_of_equation_9():
    points, normals = scene_points()
    result = evaluate(CAMERAS, points, normals, process=ConstantVelocity(0.3))
    seen = result.observable
    expected = np.sqrt(np.linalg.eigvalsh(result.covariance[seen])[:, -1])
    np.testing.assert_allclose(result.whole_state_sigma[seen], expected)
    assert (result.whole_state_sigma[seen] > result.sigma_m[seen]).all()


# ---- visibility by parts -------------------------------------------------------------------------------------------


def test_visibility_tests_can_be_left_out_tightened_and_joined():
    points, normals = scene_points()
    options = {"occluder": [BALL, BOARD]}
    whole = evaluate(CAMERAS, points, normals, **options).visible
    for tests, more in (
        ((FieldOfView(), SelfOcclusion()), True),
        ((FieldOfView(), Occlusion()), True),
        ((FieldOfView(margin_px=250), SelfOcclusion(), Occlusion()), False),
        ((FieldOfView(), SelfOcclusion(largest_incidence_deg=40), Occlusion()), False),
    ):
        other = evaluate(CAMERAS, points, normals, visibility=tests, **options).visible
        assert ((other >= whole) if more else (other <= whole)).all()
        assert (other != whole).any()
    views = evaluate(CAMERAS, points, normals, **options).views
    tight = evaluate(CAMERAS, points, normals, visibility=(SelfOcclusion(40.0),)).visible
    np.testing.assert_array_equal(tight, (views.cos_incidence > math.cos(math.radians(40))) & (views.depth_m > 0))

    class Near:
        name = "near"

        def passed(self, views, candidates, occluder):
            return views.range_m < 3.0

    near = evaluate(
        CAMERAS, points, normals, visibility=(*pss.metric.evaluate.VISIBILITY_TESTS, Near()), **options
    ).visible
    np.testing.assert_array_equal(near, whole & (views.range_m < 3.0))


# ---- input that is wrong -------------------------------------------------------------------------------------------

POINT, NORMAL = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 1.0, 0.0]])


def test_a_camera_at_the_point_or_beyond_it_does_not_see_it():
    """The documented answer: not visible, whatever noise and process; no warning, no error, no nan in what is known."""
    at = PTZCamera((0, 0, 1), 0, 0)
    past = PTZCamera((0, -1, 1), 180, 0)
    level = PTZCamera((1, 0, 1), 0, 0)  # the point is in the plane of its lens
    with np.errstate(all="raise"):
        for name in ("as-printed", "corrected", "identity"):
            result = evaluate([at, past, level, CAMERAS[2], CAMERAS[4]], POINT, NORMAL, noise=name)
            np.testing.assert_array_equal(result.visible[:, 0], [False, False, False, True, True])
            assert np.isfinite(result.sigma_m).all()
            np.testing.assert_allclose(result.camera_information.sum(axis=0), result.information, rtol=1e-9, atol=1e-9)
            assert result.noise_px2.shape == (5, 1, 2, 2)
    with pytest.raises(GeometryError, match="depth 0"):
        at.project(POINT)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"points_m": [[0, 0, np.nan]]}, RangeError, "nan.*allowed: finite|nan; allowed are finite"),
        ({"normals": [[0, np.inf, 0]]}, RangeError, "inf"),
        ({"normals": [[0, 1.1, 0]]}, RangeError, "length 1.1; allowed is 1"),
        ({"normals": [[0, 1, 0]] * 2}, ShapeError, r"\(2, 3\)"),
        ({"points_m": [0, 0, 1]}, ShapeError, r"\(3,\)"),
        ({"points_m": np.zeros((1, 4))}, ShapeError, r"\(1, 4\); allowed is"),
        ({"process": [RandomWalk()] * 2}, ShapeError, "2 points; allowed: 1|N = 2|for 2"),
        ({"process": LinearProcess(np.tile(np.eye(3), (4, 1, 1)), np.eye(3))}, ShapeError, "4 points"),
        ({"noise": "perfect"}, RangeError, "'perfect'; allowed: as-printed"),
        (
            {"noise": NoiseModel("bad", (IdentityNoise(-2.0),))},
            RangeError,
            "eigenvalue -2; allowed: positive definite",
        ),
        ({"noise": NoiseModel("bad", (IdentityNoise(np.nan),))}, RangeError, "R has nan; allowed: positive definite"),
        ({"points_m": []}, ShapeError, r"\(0,\)"),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(change, error, message):
    arguments = {"points_m": POINT, "normals": NORMAL} | change
    with pytest.raises(error, match=message):
        evaluate(CAMERAS, **arguments)


@pytest.mark.parametrize("Q", [np.diag([1.0, 1.0, -1.0]), np.array([[1, 2, 0], [0, 1, 0], [0, 0, 1.0]])])
def test_a_process_noise_that_is_none_is_refused(Q):
    with pytest.raises(RangeError, match="allowed"):
        LinearProcess(np.eye(3), Q)


NUMBER = st.floats(-4, 4, allow_nan=False)
ANYTHING = st.one_of(NUMBER, st.sampled_from([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e-300]))


DIRECTION = st.floats(-math.pi, math.pi).map(lambda angle: (math.cos(angle), math.sin(angle), 0.0))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(ANYTHING, ANYTHING, ANYTHING), min_size=1, max_size=4),
    st.one_of(DIRECTION, st.tuples(ANYTHING, ANYTHING, ANYTHING)),
)
def test_any_points_and_normals_give_an_answer_or_the_projects_own_error(points, normal):
    """Never another exception; and what comes out is finite where it is said to be known, and nan elsewhere."""
    try:
        result = evaluate(CAMERAS, points, [normal] * len(points))
    except PSSError:
        values = np.array([*points, normal])
        # Ordinary points with a normal of length 1 are not refused.
        assert not (
            np.isfinite(values).all() and np.abs(values).max() < 1e100 and math.hypot(*normal) == pytest.approx(1)
        )
        return
    np.testing.assert_array_equal(np.isfinite(result.sigma_m), result.observable)
    np.testing.assert_array_equal(np.isfinite(result.covariance).all(axis=(1, 2)), result.observable)
    assert np.isfinite(result.pss)
    assert result.pss >= 0


@settings(max_examples=60, deadline=None)
@given(st.tuples(NUMBER, NUMBER, NUMBER), st.floats(-180, 180), st.floats(-80, 80), st.floats(1, 8), st.floats(0.5, 9))
def test_any_camera_gives_a_symmetric_positive_covariance(position, pan, tilt, zoom, focus):
    """With two cameras that see the points, a third of any place and setting never makes a point worse."""
    points, normals = scene_points()
    third = PTZCamera(position, pan, tilt, zoom=zoom, focus_distance_m=focus)
    before, after = evaluate(CAMERAS[:2], points, normals), evaluate([*CAMERAS[:2], third], points, normals)
    both = before.observable
    assert (after.observable >= both).all()
    assert (after.sigma_m[both] <= before.sigma_m[both] * (1 + SAME_TO_ROUNDING)).all()
    P = after.covariance[after.observable]
    np.testing.assert_array_equal(P, np.swapaxes(P, 1, 2))
    assert (np.linalg.eigvalsh(P) > 0).all()
