"""The metric against a slow loop that follows the paper to the letter, and against what must not change it."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.linalg

from pss import (
    METRICS,
    ConstantAcceleration,
    ConstantVelocity,
    PSSError,
    PTZCamera,
    RandomWalk,
    RangeError,
    Rectangle,
    RiccatiError,
    ShapeError,
    Sphere,
    evaluate,
    noise_model,
)
from pss.noise import IdentityNoise, NoiseModel
from pss.processes.steady_state import SMALLEST_INFORMATION_RATIO

# SciPy's QZ algorithm on covariances of 1e-6 m² beside pixel variances of 10 keeps about nine digits of them.
AGREES_WITH_SCIPY = 1e-7
# Relative; sums over a handful of cameras, in another order or another frame of the world.
SAME_TO_ROUNDING = 1e-9

BALL = Sphere("ball", (0.25, 0.1, 1.25), 0.45)
BOARD = Rectangle("board", (0.0, -1.4, 1.3), 2.4, 1.8)
OCCLUDERS = (BALL, BOARD)
PLACES = [(-2.8, 0.2), (-2.8, 1.6), (-1.7, 2.8), (0.0, 2.8), (1.7, 2.8), (2.8, 1.6), (2.8, 0.2)]
CAMERAS = [PTZCamera((x, y, 2.8), 0, 0, zoom=2, focus_distance_m=3.8).aimed_at((0, -0.7, 1.3)) for x, y in PLACES]
PROCESSES = {"random walk": RandomWalk(), "constant velocity": ConstantVelocity(0.05)}


def scene_points() -> tuple[np.ndarray, np.ndarray]:
    """Points of the paper's static scene: a board and the ball that hides a part of it; some are unobservable."""
    on_board, on_ball = BOARD.grid(6, 4), BALL.spiral(20)
    points = np.concatenate([on_board[0] + 5e-4 * on_board[1], on_ball[0] + 5e-4 * on_ball[1]])
    return points, np.concatenate([on_board[1], on_ball[1]])


def turned(angle: float, shift: np.ndarray, camera: PTZCamera) -> PTZCamera:
    """The camera in a world that is turned about z (counter-clockwise from above), then shifted."""
    position = about_z(angle) @ np.array(camera.position_m) + shift
    return dataclasses.replace(camera, position_m=tuple(position), pan_deg=camera.pan_deg - math.degrees(angle))


def about_z(angle: float) -> np.ndarray:
    return np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])


# ---- the paper to the letter -----------------------------------------------------------------------------------------


def by_the_paper(cameras, points, normals, occluders, process, ccd_noise=6e-4):
    """Sections 3.2 and 3.3 and Eqs. 11–15, camera by camera and point by point; only `project` is the project's own."""
    h_step, sigmas, seen_by = 1e-6, [], []
    for point, normal in zip(points, normals, strict=True):
        jacobians, covariances = [], []
        for camera in cameras:
            ray = point - np.array(camera.position_m)
            D = np.linalg.norm(ray)
            cos_alpha, cos_theta = -ray @ normal / D, ray @ camera.rotation[2] / D
            if cos_theta <= 0 or cos_alpha <= 0:
                continue
            (u, v), depth = camera.project(point)
            w, h = camera.resolution
            if not (-0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5):
                continue
            if any(shape.blocks(np.array(camera.position_m), point + 1e-4 * normal) for shape in occluders):
                continue
            H = np.column_stack(
                [
                    (camera.project(point + e)[0] - camera.project(point - e)[0]) / (2 * h_step)
                    for e in h_step * np.eye(3)
                ]
            )
            a, f, d, ps = (
                camera.aperture_diameter_m,
                camera.focal_length_m,
                camera.focus_distance_m,
                camera.pixel_pitch_m,
            )
            cc = a / ps * f / (d - f) * abs(depth - d) / depth  # Eq. 14, D read as depth
            R = np.diag([D**2 * cos_alpha] * 2)  # Eq. 11
            R = R + np.diag([(ccd_noise * w * cos_theta) ** 2, (ccd_noise * h * cos_theta) ** 2])  # Eqs. 12, 13
            R = R + np.diag([cc**2, cc**2])  # Eq. 15
            jacobians.append(np.hstack([H, np.zeros((2, process.states - 3))]))
            covariances.append(R)
        seen_by.append(len(jacobians))
        if len(jacobians) < 2:
            sigmas.append(None)
            continue
        H_hat, R_hat = np.vstack(jacobians), scipy.linalg.block_diag(*covariances)  # Eq. 5
        P = scipy.linalg.solve_discrete_are(process.A.T, H_hat.T, process.Q, R_hat)  # Eq. 4
        sigmas.append(math.sqrt(np.linalg.eigvalsh(P[:3, :3])[-1]))  # Eq. 9, of the position
    pss = sum(1 / sigma for sigma in sigmas if sigma is not None) / len(sigmas)  # Eq. 10
    return np.array([np.nan if sigma is None else sigma for sigma in sigmas]), pss, seen_by


@pytest.mark.parametrize("process", PROCESSES.values(), ids=PROCESSES)
@pytest.mark.parametrize("chosen", [[0, 3, 5, 6], [0, 4], list(range(7))], ids=str)
def test_evaluate_is_what_the_paper_says(process, chosen):
    cameras, (points, normals) = [CAMERAS[i] for i in chosen], scene_points()
    sigma, pss, seen_by = by_the_paper(cameras, points, normals, OCCLUDERS, process)
    result = evaluate(cameras, points, normals, process=process, occluder=OCCLUDERS)
    np.testing.assert_array_equal(result.visible.sum(axis=0), seen_by)
    np.testing.assert_array_equal(result.observable, np.isfinite(sigma))
    np.testing.assert_allclose(result.sigma_m, sigma, rtol=AGREES_WITH_SCIPY)
    assert result.pss == pytest.approx(pss, rel=AGREES_WITH_SCIPY)
    assert 0 < result.observable.sum() < len(points)  # the scene has both kinds


def test_one_point_by_hand():
    """Two cameras with R = I, 2 m from the point on the axes, f_px = 200: by each, 100 px/m across and nothing along.

    J = diag(10⁴, 10⁴, 2·10⁴), so c = 10⁻⁴ and 0.5·10⁻⁴ m²; with q = 10⁻⁴, p = q/2 + √(q²/4 + q·c).
    """
    south = PTZCamera((0, -2, 1), 0, 0, resolution=(400, 300), focus_distance_m=2)
    west = PTZCamera((-2, 0, 1), 90, 0, resolution=(400, 300), focus_distance_m=2)
    normal = np.array([[-1.0, -1.0, 0.0]]) / math.sqrt(2)
    result = evaluate([south, west], [[0, 0, 1]], normal, noise="identity", process=RandomWalk(step_std_m=1e-2))
    golden = (1 + math.sqrt(5)) / 2
    np.testing.assert_allclose(
        result.covariance[0], 1e-4 * np.diag([golden, golden, (1 + math.sqrt(3)) / 2]), rtol=1e-12, atol=1e-18
    )
    np.testing.assert_allclose(result.single_frame_covariance[0], 1e-4 * np.diag([1, 1, 0.5]), rtol=1e-12, atol=1e-18)
    assert result.sigma_m[0] == pytest.approx(1e-2 * math.sqrt(golden))
    assert result.rms_m[0] == pytest.approx(1e-2 * math.sqrt(2 * golden + (1 + math.sqrt(3)) / 2))
    assert result.single_frame_sigma_m[0] == pytest.approx(1e-2)
    assert result.single_frame_rms_m[0] == pytest.approx(1e-2 * math.sqrt(2.5))
    assert result.pss == pytest.approx(100 / math.sqrt(golden))
    assert result.pss_single_frame == pytest.approx(100)
    # P⁺ = (P⁻¹ + J)⁻¹: p·c/(p + c)
    np.testing.assert_allclose(np.diag(result.posterior[0])[0], 1e-4 * golden / (golden + 1), rtol=1e-12)


def test_single_frame_covariance_is_the_inverse_of_the_summed_information():
    """C = (Σ HᵀR⁻¹H)⁻¹ over the cameras that see the point, and what least squares makes of noise drawn from R."""
    points, normals = scene_points()
    result = evaluate(CAMERAS, points, normals, noise="corrected", occluder=OCCLUDERS)
    model = noise_model("corrected")
    for i in np.flatnonzero(result.observable):
        cameras = [camera for camera, seen in zip(CAMERAS, result.visible[:, i], strict=True) if seen]
        H = np.vstack([camera.jacobian(points[i]) for camera in cameras])
        R = scipy.linalg.block_diag(*[model.covariance(c, points[[i]], normals[[i]])[0] for c in cameras])
        gain = np.linalg.solve(H.T @ np.linalg.solve(R, H), H.T @ np.linalg.inv(R))
        np.testing.assert_allclose(
            result.single_frame_covariance[i], gain @ R @ gain.T, rtol=SAME_TO_ROUNDING, atol=1e-18
        )


def test_the_update_makes_the_prior_smaller_and_a_walk_takes_it_back():
    """P⁻ = P⁺ + Q for a random walk; P⁺ ≤ C, and P⁺ ≤ P⁻."""
    points, normals = scene_points()
    result = evaluate(CAMERAS, points, normals, occluder=OCCLUDERS)
    seen = result.observable
    prior, posterior, frame = result.covariance[seen], result.posterior[seen], result.single_frame_covariance[seen]
    np.testing.assert_allclose(prior, posterior + 1e-6 * np.eye(3), rtol=SAME_TO_ROUNDING, atol=1e-15)
    assert (np.linalg.eigvalsh(frame - posterior) > 0).all()


# ---- what must not change it -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle_deg", [90, 137, -61])
def test_turning_and_shifting_the_world_changes_nothing(angle_deg):
    """No occluders but a ball, which can be turned; covariances turn along with the world."""
    (points, normals), shift, angle = scene_points(), np.array([1.3, -0.7, 0.4]), math.radians(angle_deg)
    rotation = about_z(angle)
    ball = Sphere("ball", tuple(rotation @ BALL.centre_m + shift), BALL.radius_m)
    before = evaluate(CAMERAS, points, normals, occluder=[BALL])
    cameras = [turned(angle, shift, camera) for camera in CAMERAS]
    after = evaluate(cameras, points @ rotation.T + shift, normals @ rotation.T, occluder=[ball])
    np.testing.assert_array_equal(after.visible, before.visible)
    np.testing.assert_allclose(after.sigma_m, before.sigma_m, rtol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(after.covariance, rotation @ before.covariance @ rotation.T, rtol=1e-6, atol=1e-15)
    assert after.pss == pytest.approx(before.pss, rel=SAME_TO_ROUNDING)


def test_the_order_of_cameras_and_points_does_not_matter():
    (points, normals), rng = scene_points(), np.random.default_rng(2)
    before = evaluate(CAMERAS, points, normals, occluder=OCCLUDERS)
    of_points, of_cameras = rng.permutation(len(points)), rng.permutation(len(CAMERAS))
    after = evaluate([CAMERAS[i] for i in of_cameras], points[of_points], normals[of_points], occluder=OCCLUDERS[::-1])
    np.testing.assert_array_equal(after.visible, before.visible[np.ix_(of_cameras, of_points)])
    np.testing.assert_allclose(after.sigma_m, before.sigma_m[of_points], rtol=SAME_TO_ROUNDING)
    assert after.pss == pytest.approx(before.pss, rel=SAME_TO_ROUNDING)


@pytest.mark.parametrize("noise", ["as-printed", "corrected", "identity"])
@pytest.mark.parametrize("process", PROCESSES.values(), ids=PROCESSES)
def test_more_cameras_never_hurt(noise, process):
    """Each camera adds information: every point's P∞ shrinks (as matrices), and no point is lost."""
    points, normals = scene_points()
    before = None
    for count in range(2, len(CAMERAS) + 1):
        after = evaluate(CAMERAS[:count], points, normals, noise=noise, process=process, occluder=OCCLUDERS)
        if before is not None:
            assert (after.observable >= before.observable).all()
            both = before.observable
            gained = before.covariance[both] - after.covariance[both]
            size = np.linalg.norm(before.covariance[both], axis=(1, 2))
            assert (np.linalg.eigvalsh(gained)[:, 0] > -SAME_TO_ROUNDING * size).all()
            assert after.pss >= before.pss
            assert after.pss_single_frame >= before.pss_single_frame
        before = after


def test_cameras_that_see_nothing_change_nothing():
    points, normals = scene_points()
    blind = PTZCamera((0, 2.8, 2.8), 0, 60)
    with_it, without = (evaluate(cs, points, normals, occluder=OCCLUDERS) for cs in ([blind, *CAMERAS], CAMERAS))
    np.testing.assert_array_equal(with_it.covariance, without.covariance)
    assert not with_it.visible[0].any()


# ---- observability ---------------------------------------------------------------------------------------------------


def test_unobservable_points_count_zero_and_are_nan():
    """Eq. 10 divides by all points: half of them unobservable, half the PSS."""
    points, normals = scene_points()
    result = evaluate(CAMERAS, points, normals, occluder=OCCLUDERS)
    kept = result.observable
    alone = evaluate(CAMERAS, points[kept], normals[kept], occluder=OCCLUDERS)
    assert result.pss == pytest.approx(alone.pss * kept.mean(), rel=SAME_TO_ROUNDING)
    assert result.pss_single_frame == pytest.approx(alone.pss_single_frame * kept.mean(), rel=SAME_TO_ROUNDING)
    for values in (result.sigma_m, result.rms_m, result.posterior_rms_m, result.single_frame_sigma_m):
        np.testing.assert_array_equal(np.isnan(values), ~kept)
    for values in (result.covariance, result.posterior, result.single_frame_covariance, result.single_frame_rms_m):
        np.testing.assert_array_equal(np.isnan(values.reshape(len(points), -1)).all(axis=1), ~kept)


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_cameras_observe_nothing(count):
    points, normals = scene_points()
    result = evaluate(CAMERAS[:count], points, normals)
    assert result.visible.shape == (count, len(points))
    assert not result.observable.any()
    assert result.pss == result.pss_single_frame == 0
    assert METRICS["worst-sigma"].score(result) == math.inf


@pytest.mark.parametrize(
    "process",
    [RandomWalk(), RandomWalk(1e-9), ConstantVelocity(0.3), ConstantAcceleration(0.3), ConstantAcceleration(1e-9)],
    ids=lambda process: type(process).__name__,
)
def test_rays_ever_closer_to_parallel_end_as_unobservable_and_never_as_an_error(process):
    """Two cameras in line with the point but for an offset: the information ratio falls as its square."""
    offsets = np.concatenate([[0.0], 10.0 ** np.arange(-12, -1, 0.1)])
    front = PTZCamera((0, -3, 1), 0, 0, focus_distance_m=3)
    observable, sigma = [], []
    for offset in offsets:
        behind = PTZCamera((offset, -5, 1), 0, 0, focus_distance_m=3).aimed_at((0, 0, 1))
        result = evaluate([front, behind], [[0, 0, 1]], [[0, -1, 0]], process=process)
        assert result.visible.all()
        assert np.isfinite(result.covariance).all() == result.observable[0] == np.isfinite(result.posterior).all()
        assert np.isfinite(result.single_frame_covariance).all() == result.observable[0]
        observable.append(result.observable[0])
        sigma.append(result.sigma_m[0])
    first = int(np.argmax(observable))
    assert not any(observable[:first])
    assert all(observable[first:])
    # Once it is measurable, less parallax is never better.
    assert (np.diff(np.array(sigma)[first:]) < 0).all()
    assert offsets[first] ** 2 < 1e4 * SMALLEST_INFORMATION_RATIO


def test_a_process_without_a_steady_state_is_an_error_and_not_a_scene_of_unobservable_points():
    @dataclasses.dataclass
    class Still:
        A = np.eye(3)
        Q = np.zeros((3, 3))
        states = 3

    points, normals = scene_points()
    with pytest.raises(RiccatiError, match="not excited"):
        evaluate(CAMERAS, points, normals, process=Still())


# ---- the table of metrics --------------------------------------------------------------------------------------------


def test_metrics_agree_with_the_evaluation():
    points, normals = scene_points()
    result = evaluate(CAMERAS, points, normals, occluder=OCCLUDERS)
    scores = {name: metric.score(result) for name, metric in METRICS.items()}
    assert scores["pss"] == result.pss
    assert scores["pss-single-frame"] == result.pss_single_frame
    assert scores["worst-sigma"] == np.nanmax(result.sigma_m)
    assert scores["visible-share"] == (result.visible.sum(axis=0) >= 2).mean()
    own = [name for name, metric in METRICS.items() if metric.status == "paper" and not metric.higher_is_better]
    assert own == ["worst-sigma"]
    assert all(name == metric.name for name, metric in METRICS.items())


# ---- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "normals", "error", "message"),
    [
        (np.zeros((2, 3)), np.zeros((3, 3)), ShapeError, r"\(2, 3\) and normals \(3, 3\); allowed are two alike"),
        (np.zeros((2, 2)), np.zeros((2, 2)), ShapeError, r"points_m has shape \(2, 2\); allowed is \(\.\.\., 3\)"),
        (np.zeros(3), np.array([0, 0, 1.0]), ShapeError, r"points_m \(3,\).*allowed are two alike, \(N, 3\)"),
        (np.zeros((0, 3)), np.zeros((0, 3)), ShapeError, r"points_m has shape \(0, 3\).*at least one point"),
        ([[0, np.nan, 0]], [[0, 0, 1]], RangeError, "points_m holds nan; allowed are finite"),
        ([[0, 0, 0]], [[0, np.inf, 1]], RangeError, "normals holds inf; allowed are finite"),
        ([[0, 0, 0]], [[0, 0, 2]], RangeError, r"a normal has length 2; allowed is 1 ±"),
        ([[0, 0, 0]], [[0, 0, 0]], RangeError, r"a normal has length 0; allowed is 1 ±"),
    ],
)
def test_wrong_points_and_normals_are_refused(points, normals, error, message):
    with pytest.raises(error, match=message) as caught:
        evaluate(CAMERAS, points, normals)
    assert isinstance(caught.value, PSSError)
    assert isinstance(caught.value, ValueError)


def test_an_unknown_noise_model_and_one_that_is_no_covariance_are_refused():
    points, normals = scene_points()
    with pytest.raises(RangeError, match="'printed'; allowed: as-printed"):
        evaluate(CAMERAS, points, normals, noise="printed")
    with pytest.raises(RangeError, match="R has the eigenvalue -1; allowed: positive definite"):
        evaluate(CAMERAS, points, normals, noise=NoiseModel("wrong", (IdentityNoise(variance_px2=-1.0),)))
