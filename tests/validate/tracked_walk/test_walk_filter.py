"""The filter of the walk against χ², a general minimiser and pss's own recursion, with cameras that are steered."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.optimize
import scipy.stats

from pss import (
    ConstantAcceleration,
    ConstantVelocity,
    LinearProcess,
    PTZCamera,
    RandomWalk,
    RangeError,
    ShapeError,
    steady_state_covariance,
)
from pss.riccati.solve import posterior_covariance
from pss.surrogates import Cylinder, on_cylinder
from validate.schedule.state import Avatar, Plan
from validate.schedule.steering import steer
from validate.schedule.strategies import STRATEGIES
from validate.schedule.walk import passing
from validate.tracked_walk.filter import track_walk
from validate.tracked_walk.marker_filters import WalkFiltering
from validate.tracked_walk.riccati import riccati_along

# Probability outside the χ² bands of a test, shared by the bands; the seeds are fixed, so that a pass stays a pass.
OUTSIDE_BANDS = 0.01
# The error of the told covariance that must be rejected.
WRONG_BY = 1.2
# The filter's matrices are of condition 1e5 or so, and two routes to one covariance differ by that many roundings.
SAME_COVARIANCE = 1e-9
# Linearised at an estimate that is off by a few millimetres at some metres: 1e-3 of H, and P goes with its square.
LINEARISED_ELSEWHERE = 1e-2
STEADY = 1e-6
# Two relinearisations leave far less than the noise: this part of a standard deviation.
SAME_MINIMUM = 1e-3
# Trials side by side take other paths through BLAS.
SAME_TO_ROUNDING_M = 1e-9
FRAME_S, FRAMES = 0.1, 21
R_PX2 = np.array([[0.04, 0.01], [0.01, 0.02]])
SLOW = ConstantVelocity(0.05, FRAME_S)
CORNERS = [(-2.9, -4.9, 2.9), (2.9, -4.9, 2.9), (-2.9, 4.9, 2.9), (2.9, 4.9, 2.9)]
BODY = on_cylinder(Cylinder("body", (0, 0, 0), 0.25, 1.8), 6, caps=False)
SCENE = passing(reach_m=1.2, steps=FRAMES)
TWO_MARKERS = LinearProcess(np.tile(np.eye(3), (2, 1, 1)), 1e-6 * np.tile(np.eye(3), (2, 1, 1)))
# No pixel is refused, so that the errors are normal and their squares χ².
UNGATED = WalkFiltering(gate_probability=1 - 1e-12, start_speed_sigma_m_per_s=0.3)


@pytest.fixture(scope="module")
def cameras():
    """Settings of four cameras that follow the avatars and change in every frame."""
    plan = Plan({"H1": Avatar(BODY), "H2": Avatar(BODY)})
    still = [PTZCamera(place, 0, 0).aimed_at((0, 0, 1)) for place in CORNERS]
    run = steer(SCENE, still, STRATEGIES["follow"], plan).cameras
    assert all(a != b for two in pairwise(run) for a, b in zip(*two, strict=True))
    return run


def walking():
    """m, points on H1, (K, N, 3)."""
    return SCENE.positions_m["H1"][:, None] + BODY.points_m


def standing():
    return np.tile(walking()[FRAMES // 2], (FRAMES, 1, 1))


def detections(cameras, truth, trials=1, rng=None):
    """px, every camera's view of every point, (K, C, T, N, 2), with noise of `R_PX2` if `rng` draws it."""
    exact = [[c.project(points)[0] for c in of_frame] for of_frame, points in zip(cameras, truth, strict=True)]
    pixels = np.repeat(np.array(exact)[:, :, None], trials, axis=2)
    return pixels if rng is None else pixels + rng.standard_normal(pixels.shape) @ np.linalg.cholesky(R_PX2).T


def reported(pixels, factor=1.0):
    return np.broadcast_to(factor * R_PX2, (*pixels.shape, 2))


def tracked(cameras, pixels, settings=None, process=SLOW):
    return track_walk(cameras, pixels, reported(pixels), process, settings)


def information(cameras, truth):
    """1/m², the sum over all views, (K, N, 3, 3)."""
    of_frames = []
    for of_frame, points in zip(cameras, truth, strict=True):
        H = [camera.jacobian(points) for camera in of_frame]
        of_frames.append(sum(h.mT @ np.linalg.inv(R_PX2) @ h for h in H))
    return np.array(of_frames)


def relative(found, expected):
    """Largest difference of covariances (..., 3, 3), each in units of its trace; nan must be where nan is."""
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    return np.nanmax(np.abs(found - expected) / np.trace(expected, axis1=-2, axis2=-1)[..., None, None])


def rms_m(errors):
    return np.sqrt((errors**2).sum(axis=-1).mean())


# ---- is the filter what it says? -------------------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [1.0, WRONG_BY, 1 / WRONG_BY])
def test_errors_of_a_truth_that_follows_the_process_are_as_large_as_believed(cameras, factor):
    """800 markers with motions of their own: sums of e'P⁻¹e in frames far apart are χ²; 20 % off in R they are not."""
    rng, markers = np.random.default_rng(1), 800
    root = np.linalg.cholesky(SLOW.Q)
    state = np.concatenate(
        [
            SCENE.positions_m["H1"][FRAMES // 2] + rng.uniform(-0.3, 0.3, (markers, 3)),
            UNGATED.start_speed_sigma_m_per_s * rng.standard_normal((markers, 3)),
        ],
        axis=1,
    )
    truth = []
    for _ in range(FRAMES):
        truth.append(state[:, :3])
        state = state @ SLOW.A.T + rng.standard_normal((markers, 6)) @ root.T
    truth = np.array(truth)
    pixels = detections(cameras, truth, rng=rng)
    tracks = track_walk(cameras, pixels, reported(pixels, factor), SLOW, UNGATED)
    assert tracks.used.all()
    sums = {
        name: np.einsum("kni,knij,knj->k", errors, np.linalg.inv(covariance[:, 0]), errors)
        for name, errors, covariance in (
            ("prior", (tracks.prior_m[:, 0] - truth)[1:], tracks.prior_covariance_m2[1:]),
            ("posterior", tracks.posterior_m[:, 0] - truth, tracks.posterior_covariance_m2),
        )
    }
    chosen = [*sums["prior"][[0, 9, -1]], *sums["posterior"][[0, 10, -1]]]
    low, high = scipy.stats.chi2.interval(1 - OUTSIDE_BANDS / len(chosen), 3 * markers)
    if factor == 1:
        assert low < min(chosen) < max(chosen) < high
    else:  # the posterior hangs on R, the prior mostly on Q
        assert all(not low < value < high for value in chosen[3:])


def test_an_update_finds_the_minimum_that_a_general_minimiser_finds(cameras):
    """The frame after the start, 0.12 m on, where one linearisation is off by several standard deviations."""
    truth, rng = walking(), np.random.default_rng(2)
    pixels = detections(cameras, truth, rng=rng)
    tracks = tracked(cameras, pixels)
    A, Q, speed = SLOW.A, SLOW.Q, WalkFiltering().start_speed_sigma_m_per_s
    weigh = np.linalg.inv(np.linalg.cholesky(R_PX2))
    for point in range(len(BODY.points_m)):
        P = np.diag(np.repeat([0.0, speed**2], 3))
        P[:3, :3] = tracks.posterior_covariance_m2[0, 0, point]
        prior = A @ np.concatenate([tracks.posterior_m[0, 0, point], np.zeros(3)])
        whiten = np.linalg.inv(np.linalg.cholesky(A @ P @ A.T + Q))

        def misfit(step, whiten=whiten, prior=prior, point=point):
            place = prior[:3] + step[:3]
            seen = [weigh @ (pixels[1, c, 0, point] - camera.project(place)[0]) for c, camera in enumerate(cameras[1])]
            return np.concatenate([whiten @ step, *seen])

        best = scipy.optimize.least_squares(misfit, np.zeros(6), x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
        off_m = tracks.posterior_m[1, 0, point] - prior[:3] - best.x[:3]
        spread = tracks.posterior_covariance_m2[1, 0, point]
        assert np.sqrt(off_m @ np.linalg.solve(spread, off_m)) < SAME_MINIMUM


def test_the_covariance_is_the_recursions_that_the_metric_predicts(cameras):
    """At the very points if a marker that stands is seen without noise, and close to it if linearised at estimates."""
    for truth, rng, tolerance in (
        (standing(), None, SAME_COVARIANCE),
        (walking(), np.random.default_rng(3), LINEARISED_ELSEWHERE),
    ):
        tracks = tracked(cameras, detections(cameras, truth, trials=2, rng=rng))
        prior, posterior = riccati_along(information(cameras, truth), SLOW)
        for trial in range(2):
            assert relative(tracks.prior_covariance_m2[:, trial], prior) < tolerance
            assert relative(tracks.posterior_covariance_m2[:, trial], posterior) < tolerance


def test_with_cameras_that_rest_it_ends_in_the_steady_state(cameras):
    frames = 100  # a few times constants of the slow velocity, which is known to centimetres a second
    resting, truth = [cameras[5]] * frames, np.tile(standing()[:1], (frames, 1, 1))
    H = np.zeros((truth.shape[1], 8, 6))
    H[:, :, :3] = np.concatenate([camera.jacobian(truth[0]) for camera in cameras[5]], axis=1)
    R = np.kron(np.eye(4), R_PX2)
    prior = steady_state_covariance(SLOW.A, SLOW.Q, H, R)
    posterior = posterior_covariance(prior, H.mT @ np.linalg.inv(R) @ H)
    tracks = tracked(resting, detections(resting, truth))
    found = (tracks.prior_covariance_m2[-1, 0], tracks.posterior_covariance_m2[-1, 0])
    along = [of_frames[-1] for of_frames in riccati_along(information(resting, truth), SLOW)]
    for of_filter, of_recursion, expected in zip(found, along, (prior, posterior), strict=True):
        assert relative(of_filter, expected[:, :3, :3]) < STEADY
        assert relative(of_recursion, expected[:, :3, :3]) < STEADY


def test_the_recursion_waits_for_two_views_and_coasts_out_of_sight(cameras):
    truth = standing()
    known = information(cameras, truth)
    single = cameras[0][0].jacobian(truth[0])
    known[:3] = single.mT @ np.linalg.inv(R_PX2) @ single
    known[6:] = 0
    prior, posterior = riccati_along(known, SLOW, 0.3)
    assert np.isnan(posterior[:3]).all()
    assert np.isnan(prior[:4]).all()
    np.testing.assert_allclose(posterior[3], np.linalg.inv(known[3]), rtol=SAME_COVARIANCE)
    np.testing.assert_allclose(prior[4], posterior[3] + (0.3**2 * FRAME_S**2 + SLOW.Q[0, 0]) * np.eye(3), rtol=1e-12)
    np.testing.assert_allclose(posterior[6:], prior[6:], rtol=SAME_COVARIANCE)
    assert (np.diff(np.trace(posterior[6:], axis1=-2, axis2=-1), axis=0) > 0).all()


# ---- what goes wrong in a walk ---------------------------------------------------------------------------------------


def test_anothers_pixel_is_thrown_out_and_does_no_harm(cameras):
    """One view that is wrong for longer than it takes to be lost, and three that are right."""
    pixels = detections(cameras, walking(), trials=2, rng=np.random.default_rng(4))
    wrong, without = pixels.copy(), pixels.copy()
    wrong[10:, 1, 0, 2] = pixels[10:, 1, 0, 5]
    without[10:, 1, 0, 2] = np.nan
    found, expected = tracked(cameras, wrong), tracked(cameras, without)
    assert found.gated[10:, 1, 0, 2].all()
    assert not found.used[10:, 1, 0, 2].any()
    assert not found.losses.any()
    np.testing.assert_array_equal(found.posterior_m, expected.posterior_m)
    np.testing.assert_array_equal(found.posterior_covariance_m2, expected.posterior_covariance_m2)
    # Each of 1,000 detections fails the gate once in a thousand; the seed has few that do.
    assert expected.gated.sum() < 5


def test_the_gate_refuses_as_many_as_it_says(cameras):
    """Of a filter that is right, the share 1 − probability; a marker's views fail together, so the band is wide."""
    truth, rng = np.tile(standing()[:, :1], (1, 400, 1)), np.random.default_rng(5)
    pixels = detections(cameras, truth, rng=rng)[:3]
    settings = WalkFiltering(gate_probability=0.9, start_speed_sigma_m_per_s=1e-3)
    still = ConstantVelocity(1e-9, FRAME_S)
    gated = tracked(cameras[:3], pixels, settings, still).gated[1]  # one frame after the start
    assert gated.mean() == pytest.approx(0.1, abs=0.03)


def test_a_hidden_marker_is_lost_coasts_and_is_found_by_its_gate(cameras):
    truth = walking()
    pixels = detections(cameras, truth, rng=np.random.default_rng(6))
    pixels[8:15, :, :, 1] = np.nan
    tracks = tracked(cameras, pixels, WalkFiltering(lost_after_frames=5))
    np.testing.assert_array_equal(np.flatnonzero(tracks.lost[:, 0, 1]), [12, 13, 14])
    expected = [[0, 1, 0, 0, 0, 0]]
    np.testing.assert_array_equal(tracks.losses, expected)
    np.testing.assert_array_equal(tracks.reacquired, expected)
    size = np.trace(tracks.posterior_covariance_m2[:, 0, 1], axis1=-2, axis2=-1)
    assert (np.diff(size[7:15]) > 0).all()
    np.testing.assert_array_equal(tracks.posterior_m[8:15, 0, 1], tracks.prior_m[8:15, 0, 1])
    # It went on along its line: a start anew would have no velocity, and a prior 0.12 m off a frame later.
    assert rms_m(tracks.prior_m[8:17, 0, 1] - truth[8:17, 1]) < 0.1
    assert rms_m(tracks.prior_m[16, 0, 1] - truth[16, 1]) < 0.01


def test_a_marker_that_jumps_is_lost_and_starts_anew(cameras):
    truth = walking()
    truth[10:, 3] += [0, 1, 0]
    tracks = tracked(
        cameras, detections(cameras, truth, rng=np.random.default_rng(7)), WalkFiltering(lost_after_frames=4)
    )
    assert tracks.gated[10:13, :, 0, 3].all()
    assert not tracks.used[10:13, :, 0, 3].any()
    # The fourth frame without an update: lost and, by views that agree, found.
    assert tracks.used[13, :, 0, 3].all()
    assert not tracks.gated[13, :, 0, 3].any()
    np.testing.assert_array_equal(tracks.losses, [[0, 0, 0, 1, 0, 0]])
    np.testing.assert_array_equal(tracks.reacquired, tracks.losses)
    assert not tracks.lost[13:].any()
    assert rms_m(tracks.posterior_m[13:, 0, 3] - truth[13:, 3]) < 0.005


def test_a_track_that_keeps_the_view_in_line_with_its_error_is_lost_and_starts_anew(cameras):
    """The marker jumps towards one of its two cameras, whose pixel stays as it was; the other's is rejected."""
    truth, centre = standing(), np.array(CORNERS[0])
    towards = (centre - truth[10:, 0]) / np.linalg.norm(centre - truth[10:, 0], axis=-1, keepdims=True)
    truth[10:, 0] += 0.8 * towards
    pixels = detections(cameras, truth, rng=np.random.default_rng(11))
    pixels[:, [1, 2]] = np.nan
    tracks = tracked(cameras, pixels, WalkFiltering(lost_after_frames=3))
    np.testing.assert_array_equal(tracks.used[10:12, [0, 3], 0, 0], [[True, False]] * 2)
    np.testing.assert_array_equal(tracks.gated[10:12, [0, 3], 0, 0], [[False, True]] * 2)
    assert tracks.used[12:, [0, 3], 0, 0].all()
    assert (tracks.losses[0, 0], tracks.reacquired[0, 0]) == (1, 1)
    assert rms_m(tracks.posterior_m[12:, 0, 0] - truth[12:, 0]) < 0.005


def test_views_that_do_not_agree_start_nothing(cameras):
    pixels = detections(cameras, walking(), rng=np.random.default_rng(8))
    pixels[:, 2:, :, 0] = np.nan
    pixels[:, 1, :, 0] += [0, 100]
    tracks = tracked(cameras, pixels)
    assert np.isnan(tracks.posterior_m[:, 0, 0]).all()
    assert tracks.gated[:, :2, 0, 0].all()
    assert np.isfinite(tracks.posterior_m[:, 0, 1:]).all()
    assert not tracks.losses.any()


def test_one_view_starts_nothing_but_goes_on_with_a_track(cameras):
    """As if all cameras but one, and then all of them, turned to the other avatar."""
    truth = walking()
    pixels = detections(cameras, truth, rng=np.random.default_rng(9))
    pixels[:, 1:, :, 0] = np.nan
    pixels[:, :, :, 1] = np.nan
    pixels[6:, 1:, :, 2] = np.nan
    tracks = tracked(cameras, pixels)
    for array in (tracks.prior_m, tracks.posterior_m, tracks.prior_covariance_m2, tracks.posterior_covariance_m2):
        assert np.isnan(array[:, :, :2]).all()
        assert np.isfinite(array[1:, :, 2:]).all()
    assert not tracks.gated[:, :, :, :2].any()
    assert not tracks.losses.any()
    np.testing.assert_array_equal(tracks.used[6:, :, 0, 2].sum(axis=1), 1)
    before, after = (
        np.trace(P[6:, 0, 2], axis1=-2, axis2=-1) for P in (tracks.prior_covariance_m2, tracks.posterior_covariance_m2)
    )
    assert (after < before).all()
    assert after[-1] > 10 * np.trace(tracks.posterior_covariance_m2[5, 0, 2])


def test_no_detection_at_all_is_nan_everywhere(cameras):
    pixels = np.full((FRAMES, 4, 2, 3, 2), np.nan)
    tracks = track_walk(cameras, pixels, np.full((*pixels.shape, 2), np.nan), SLOW)
    assert np.isnan(tracks.prior_m).all()
    assert np.isnan(tracks.posterior_covariance_m2).all()
    for counted in (tracks.used, tracks.gated, tracks.lost, tracks.losses, tracks.reacquired):
        assert not counted.any()


def test_trials_together_and_apart_are_the_same(cameras):
    """With markers that come and go, so that tracks are lost and start in one trial and not in another."""
    rng = np.random.default_rng(10)
    pixels = detections(cameras, walking(), trials=3, rng=rng)
    pixels[rng.random(pixels.shape[:-1]) < 0.7] = np.nan
    settings = WalkFiltering(lost_after_frames=2)
    together = tracked(cameras, pixels, settings)
    assert together.losses.any()
    assert together.reacquired.any()
    for trial in range(3):
        apart = tracked(cameras, pixels[:, :, [trial]], settings)
        np.testing.assert_allclose(apart.posterior_m[:, 0], together.posterior_m[:, trial], atol=SAME_TO_ROUNDING_M)
        np.testing.assert_array_equal(apart.used[:, :, 0], together.used[:, :, trial])
        np.testing.assert_array_equal(apart.losses[0], together.losses[trial])


def test_a_random_walk_has_no_velocity_and_the_floor_widens_every_detection(cameras):
    truth = standing()
    pixels = detections(cameras, truth)
    tracks = track_walk(cameras, pixels, reported(pixels), RandomWalk(1e-3), WalkFiltering(measurement_floor_px=0.5))
    wider = np.linalg.inv(R_PX2 + 0.25 * np.eye(2))
    H = [camera.jacobian(truth[0]) for camera in cameras[0]]
    first = np.linalg.inv(sum(h.mT @ wider @ h for h in H))
    np.testing.assert_allclose(tracks.posterior_covariance_m2[0, 0], first, rtol=SAME_COVARIANCE)
    np.testing.assert_allclose(tracks.prior_covariance_m2[1, 0], first + 1e-6 * np.eye(3), rtol=SAME_COVARIANCE)


def test_each_marker_may_have_a_process_of_its_own(cameras):
    pixels = detections(cameras, walking()[:, :2], rng=np.random.default_rng(12))
    fast = ConstantVelocity(5.0, FRAME_S)
    mixed = LinearProcess(np.stack([SLOW.A, fast.A]), np.stack([SLOW.Q, fast.Q]))
    both, known = tracked(cameras, pixels, process=mixed), information(cameras, walking()[:, :2])
    along = riccati_along(known, mixed)[1]
    for point, process in enumerate((SLOW, fast)):
        alone = tracked(cameras, pixels[:, :, :, [point]], process=process)
        np.testing.assert_allclose(both.posterior_m[:, :, point], alone.posterior_m[:, :, 0], atol=SAME_TO_ROUNDING_M)
        expected = riccati_along(known[:, [point]], process)[1]
        np.testing.assert_allclose(along[:, [point]], expected, rtol=SAME_COVARIANCE)


# ---- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"gate_probability": 1.0}, "gate_probability = 1.0"),
        ({"lost_after_frames": 0}, "lost_after_frames = 0"),
        ({"start_speed_sigma_m_per_s": 0.0}, "m/s"),
        ({"measurement_floor_px": -1.0}, "0 or more pixels"),
    ],
)
def test_wrong_settings_are_named(values, says):
    with pytest.raises(RangeError, match=says):
        WalkFiltering(**values)


@pytest.mark.parametrize(
    ("pixels", "covariance", "process", "error", "says"),
    [
        ((2, 4, 1, 1, 3), (2, 4, 1, 1, 2, 2), SLOW, ShapeError, r"\(2, C, T, N, 2\)"),
        ((3, 4, 1, 1, 2), (3, 4, 1, 1, 2, 2), SLOW, ShapeError, r"\(2, C, T, N, 2\)"),
        ((2, 4, 1, 1, 2), (2, 4, 1, 1, 2), SLOW, ShapeError, r"\(2, 4, 1, 1, 2, 2\)"),
        ((2, 3, 1, 1, 2), (2, 3, 1, 1, 2, 2), SLOW, ShapeError, "frame 0 has 4 cameras"),
        ((2, 4, 1, 1, 2), (2, 4, 1, 1, 2, 2), SLOW, RangeError, "positive definite"),
        ((2, 4, 1, 1, 2), (2, 4, 1, 1, 2, 2), ConstantAcceleration(1.0), RangeError, "9 states"),
        ((2, 4, 1, 3, 2), (2, 4, 1, 3, 2, 2), TWO_MARKERS, ShapeError, r"A \(2, 3, 3\)"),
    ],
)
def test_arrays_that_do_not_fit_are_named(cameras, pixels, covariance, process, error, says):
    with pytest.raises(error, match=says):
        track_walk(cameras[:2], np.zeros(pixels), np.zeros(covariance), process)


def test_wrong_information_is_named():
    for wrong, error, says in (
        (np.zeros((2, 3, 3)), ShapeError, r"\(K, N, 3, 3\)"),
        (np.full((1, 1, 3, 3), np.nan), RangeError, "nan"),
        (-np.ones((1, 1, 1, 1)) * np.eye(3), RangeError, "eigenvalue"),
    ):
        with pytest.raises(error, match=says):
            riccati_along(wrong, SLOW)
